r"""Light of one lenslet at a time: how all that do not have two axes apart bring a point's light to a cell.

Light behind a lenslet has few degrees of freedom, on both sides: band-limited light within its edge, and

.. math:: E(s) = \frac{1}{i \lambda b} e^{i \pi s^2 / (\lambda b)} \int G(w) \, T(w) \,
          e^{i \pi w^2 / (\lambda b)} \, e^{-2 \pi i s w / (\lambda b)} \, d^2w

over a cell, whose first phase no intensity shows. Between the two stands a small matrix for each place of a
lenslet and each focal length, by Gauss-Legendre quadrature line by line. Which lenslets exist is but a choice
of those that are added up.
"""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from lumigraph.core.threads import each
from lumigraph.operators.lenslets.cell_response import (
    CellLenslets,
    focal_lengths,
    legendre,
    nodes,
    times_real,
)
from lumigraph.operators.lenslets.point_images import LensletPlaneWave, through
from lumigraph.operators.sampling.cell_axis import STEP, CellAxis

Pair = tuple[float, float]

Row = tuple[float, Sequence[Pair]]
"""Lenslets that stand in a row: their y from a cell's centre [m], and their x and focal length."""

FAINTEST = 0.3
"""Part of the accuracy that a lenslet's few numbers may leave out of its light's amplitude, and they again of
what they bring to a cell."""

FEWER = 32
"""Numbers that light may go through on its way from a lenslet to a cell, at first, and four times as many."""

AROUND = 6.0, 5.0
"""How far beyond a lenslet's edge light is sampled [periods of the band]: to 1e-3, and more for each tenth.

Between its samples light is known the worse the nearer the end of a window: with six periods, points 1.2
times as close as the band asks for put samples behind hexagons off by 1.5e-4.
"""


class LensletLight:
    """Amplitudes on a cell's samples behind single lenslets.

    Parameters
    ----------
    lenslets
        Of the array.
    light
        Of a point.
    widest
        Distances from the point's image at which a lenslet is lit [m].
    accuracy
        That is asked for.
    """

    def __init__(
        self, lenslets: CellLenslets, light: LensletPlaneWave, widest: float, accuracy: float
    ) -> None:
        self.lenslets, self.axes, self.squared = lenslets, lenslets.axes, math.prod(lenslets.optics)
        self.window = windows(lenslets, accuracy)
        self.bases = [axis.basis() for axis in self.window]
        self.faintest = FAINTEST * accuracy
        halves = zip(self.axes, _half(lenslets), strict=True)
        bent = lenslets.pixels is not None
        self.modes = [_modes(a, h, self.squared, self.faintest, bent=bent) for a, h in halves]
        self._known: dict[tuple[float, float, float], tuple[np.ndarray, ...]] = {}
        self._nodes: dict[tuple[int, float, int, float], _Behind] = {}
        self._carriers: dict[tuple[int, float], np.ndarray] = {}
        self.light, self.widest = light, widest

    @cached_property
    def kept(self) -> np.ndarray:
        """Orthonormal (numbers along y times along x, q): what of the light around a lenslet it sees."""
        (_, down), (_, across) = self.bases
        lines, weight, chords = self.lenslets.lines
        along_x = np.array([_gram(across, chord) for chord in chords])
        along_y = down(lines)
        products = np.einsum("l,la,lb->lab", weight, along_y, along_y).reshape(len(lines), -1)
        n, m = along_y.shape[1], along_x.shape[1]
        gram = (products.T @ along_x.reshape(len(lines), -1)).reshape(n, n, m, m)
        strength, vectors = np.linalg.eigh(gram.transpose(0, 2, 1, 3).reshape(n * m, n * m))
        return vectors[:, strength > self.faintest**2 * strength[-1]].astype(np.float32)

    @cached_property
    def around(self) -> np.ndarray:
        """Whether points light a lenslet (rows, columns), as the table has them: within a circle."""
        at = [
            ((np.arange(-n, n + axis.points) + 0.5) / axis.points - 0.5) * axis.size
            for n, axis in zip(self._counts, self.axes, strict=True)
        ]
        return np.hypot(at[0][:, None], at[1]) <= self.widest + min(axis.size for axis in self.axes) / 2

    @property
    def _counts(self) -> list[int]:
        """Points along y and x as far as lenslets are lit."""
        return [math.ceil(self.widest * axis.points / axis.size) for axis in self.axes]

    @cached_property
    def table(self) -> tuple[np.ndarray, tuple[int, int]]:
        """Light (rows, columns, q) in a lenslet, by the point's number from there, and the first number."""
        y, x = self.window
        counts = self._counts
        down, across = (coefficients.astype(np.complex64) for coefficients, _ in self.bases)
        numbers = [np.arange(-n, n + axis.points) for n, axis in zip(counts, (y, x), strict=True)]
        behind = through(self.light, across, x, numbers[1])
        kept = self.kept
        table = np.empty((len(numbers[0]), len(numbers[1]), kept.shape[1]), np.complex64)

        def fill(number: int) -> None:
            top, row = -y.margin - number - self.light.first[0], table[number + counts[0]]
            part = behind[top : top + STEP * down.shape[1] : STEP].reshape(down.shape[1], -1)
            part = (down @ part).reshape(len(down), len(row), -1).transpose(1, 0, 2)
            row[:] = times_real(part.reshape(len(row), -1), kept)

        for _ in each(fill, numbers[0].tolist()):
            pass
        return table, (-counts[0], -counts[1])

    def prepare(self, rows: Iterable[Row], workers: int) -> None:
        """Compute what the lenslets of some rows share, once, not in each thread that needs it."""
        _ = self.table
        wanted = {(y, x, f) for y, members in rows for x, f in members} - self._known.keys()
        for _ in each(lambda key: self.matrices(*key), sorted(wanted), workers):
            pass

    def lit(self, numbers: np.ndarray, y: float, x: float) -> tuple[np.ndarray, np.ndarray]:
        """Which of the points (n, 2) light a lenslet at (y, x) from the cell, and their light (m, q)."""
        table, first = self.table
        rows, columns = (
            numbers[:, k] - round(at * axis.points / axis.size) - first[k]
            for k, (at, axis) in enumerate(zip((y, x), self.axes, strict=True))
        )
        near = np.flatnonzero(
            (rows >= 0) & (rows < table.shape[0]) & (columns >= 0) & (columns < table.shape[1])
        )
        which = near[self.around[rows[near], columns[near]]]
        return which, table[rows[which], columns[which]]

    def amplitudes(self, numbers: np.ndarray, rows: Sequence[Row]) -> np.ndarray:
        """(n, samples) of points (n, 2), summed over the lenslets of some rows."""
        total = np.zeros((len(numbers), *(axis.samples for axis in self.axes)), np.complex64)
        for row in rows:
            if (seen := self.across(numbers, row)) is not None:
                total += self.carried(0, row[0]) @ seen
        return total.reshape(len(numbers), -1)

    def across(self, numbers: np.ndarray, row: Row) -> np.ndarray | None:
        """Amplitudes (n, modes along y, samples along x) behind a row; None where all of it is dark."""
        y, members = row
        n, m = (modes.shape[1] for modes in self.modes)
        behind = [(x, f, *self.lit(numbers, y, x)) for x, f in members]
        behind = [one for one in behind if len(one[2])]
        if not behind:
            return None
        few = np.zeros((len(numbers), n, len(behind), m), np.complex64)
        for k, (x, focal_length, which, lit) in enumerate(behind):
            for matrix in self.matrices(y, x, focal_length):
                lit = lit @ matrix
            few[which, :, k] = lit.reshape(-1, n, m)
        carried = np.hstack([self.carried(1, x) for x, *_ in behind])
        return few.reshape(len(numbers), n, -1) @ carried.T

    def carried(self, which: int, place: float) -> np.ndarray:
        """Amplitudes (samples, modes) along y (0) or x (1) of the few numbers of a lenslet at a place."""
        if (key := (which, place)) not in self._carriers:
            turn = np.exp(-2j * np.pi / self.squared * place * self.axes[which].image)
            self._carriers[key] = (turn[:, None] * self.modes[which]).astype(np.complex64)
        return self._carriers[key]

    def matrices(self, y: float, x: float, focal_length: float) -> tuple[np.ndarray, ...]:
        """From light in a lenslet at (y, x) to the few numbers on a cell: (q, numbers), or by way of fewer.

        The farther a lenslet is from the cell, the less of what it sees comes there.
        """
        if (key := (y, x, focal_length)) not in self._known:
            matrix = self._quadrature(y, x, focal_length)
            self._known[key] = _by_way(matrix, self.faintest * self._own)
        return self._known[key]

    @cached_property
    def _own(self) -> float:
        """How much a lenslet before the middle of a cell brings there of its light, at the least."""
        matrix = self._quadrature(0.0, 0.0, focal_lengths(self.lenslets.array)[0])
        return float(np.linalg.norm(matrix)) / math.sqrt(min(matrix.shape))

    def _quadrature(self, y: float, x: float, focal_length: float) -> np.ndarray:
        wavelength = self.lenslets.optics[0]
        pitch, (lines, weight, chords) = self.lenslets.array.lattice.pitch, self.lenslets.lines
        bend = -1 / (wavelength * focal_length) + 1 / self.squared

        def turn(at: np.ndarray, place: float) -> np.ndarray:
            return np.exp(1j * np.pi * (bend * at**2 + (2 * at * place + place**2) / self.squared))

        behind = self._behind(0, lines, y)
        seen = behind.seen * (turn(lines, y) * weight * self.axes[0].fade(y + lines, pitch))
        along_y = (seen[:, None, :] * behind.light.T).reshape(-1, len(lines))
        chords, like = np.unique(chords.round(12), return_inverse=True)
        along_x = []
        for chord in chords.tolist():
            at, share = legendre(
                -chord, chord, nodes(chord, focal_length, self.axes[1], self.lenslets.optics)
            )
            behind = self._behind(1, at, x)
            seen = behind.seen * (turn(at, x) * share * self.axes[1].fade(x + at, pitch))
            along_x.append((seen @ behind.light).ravel())
        both = along_y.astype(np.complex64) @ np.array(along_x, np.complex64)[like]
        (n, a), (m, b) = (
            (len(seen.T), base[0].shape[0]) for seen, base in zip(self.modes, self.bases, strict=True)
        )
        both = both.reshape(n, a, m, b).transpose(0, 2, 1, 3).reshape(n * m, a * b)
        return np.ascontiguousarray(times_real(both, self.kept).T)

    def _behind(self, which: int, at: np.ndarray, place: float) -> "_Behind":
        """Nodes of a lenslet at a place, counted from its middle."""
        pixels = self.lenslets.pixels is not None
        key = which, float(at[-1]), len(at), place if pixels else 0.0
        if key not in self._nodes:
            image = self.axes[which].image[:, None]
            turn = np.exp(-2j * np.pi / self.squared * image * at)
            if pixels:
                turn *= self.lenslets.accepted(image - (place + at))
            seen = self.modes[which].conj().T @ turn / math.sqrt(self.squared)
            found = _Behind(seen, self.bases[which][1](at))
            if pixels:
                return found
            self._nodes[key] = found
        return self._nodes[key]


@dataclass(frozen=True, slots=True, eq=False)
class _Behind:
    """Nodes of a quadrature along a lenslet.

    Parameters
    ----------
    seen
        Few numbers (modes, nodes) of what they bring to a cell.
    light
        Their values (nodes, m) of band-limited light.
    """

    seen: np.ndarray
    light: np.ndarray


def _by_way(matrix: np.ndarray, least: float) -> tuple[np.ndarray, ...]:
    """A matrix (q, n) in two factors that leave out singular values below some, or itself where it has many.

    The part of it that few numbers see is found by a product with so many columns by chance.
    """
    rng = np.random.default_rng(0)
    for count in (FEWER, 4 * FEWER):
        if 2 * count > min(matrix.shape):
            break
        seen = matrix @ rng.standard_normal((matrix.shape[1], count), np.float32)
        basis = np.linalg.qr(seen)[0]
        across = basis.conj().T @ matrix
        if np.linalg.norm(matrix - basis @ across) < least:
            turn, strength, rest = np.linalg.svd(across, full_matrices=False)
            kept = strength > least
            return basis @ (turn[:, kept] * strength[kept]), rest[kept]
    return (matrix,)


def windows(lenslets: CellLenslets, accuracy: float) -> tuple[CellAxis, CellAxis]:
    """Of the light around a single lenslet, in a cell's coordinates."""
    periods = AROUND[0] + AROUND[1] * max(0.0, math.log10(1e-3 / accuracy))
    beyond = periods / lenslets.axes[0].band / 2
    y, x = (
        replace(axis, neighbourhood=max(0.0, half - axis.size / 2) + beyond)
        for axis, half in zip(lenslets.axes, _half(lenslets), strict=True)
    )
    return y, x


def _half(lenslets: CellLenslets) -> Pair:
    """Height and width of a lenslet, halved [m]."""
    lines, _, chords = lenslets.lines
    return float(np.abs(lines).max()), float(chords.max())


def _gram(light: Callable[[np.ndarray], np.ndarray], chord: float) -> np.ndarray:
    at, weight = legendre(-chord, chord, 96)
    return (light(at).T * weight) @ light(at)


def _modes(axis: CellAxis, half: float, squared: float, faintest: float, *, bent: bool) -> np.ndarray:
    """Orthonormal (samples, modes): all that a lenslet brings to a cell, but for where the lenslet is.

    Where pixels respond to angles, what it brings is `bent`: times parabolas over the cell, too.
    """
    at = np.linspace(-half, half, 4 * math.ceil(2 * half * axis.size / squared) + 40)
    turn = np.exp(-2j * np.pi / squared * axis.image[:, None] * at)
    if bent:
        across = 2 * axis.image[:, None] / axis.size
        turn = np.hstack([turn, turn * across, turn * across**2])
    vectors, strength, _ = np.linalg.svd(turn, full_matrices=False)
    return vectors[:, strength > faintest * strength[0]]
