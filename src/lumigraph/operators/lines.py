r"""Lenslets of any shape, one after the other: light around each, line after line, to what it brings.

At places s from its middle a lenslet brings

.. math:: E(s) = \frac{1}{i \lambda b} e^{i \pi s^2 / (\lambda b)} \int G(w) \, T(w) \,
          e^{i \pi w^2 / (\lambda b)} \, e^{-2 \pi i s w / (\lambda b)} \, d^2w

whose integral has a band along x: half the lenslet's width over λb. Discrete prolate sequences hold it in few
numbers, which lie in matrices that all lenslets of one focal length share, wherever samples are.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import groupby

import numpy as np
import scipy.linalg

from lumigraph.operators.cell_response import STEP, Lenslets, focal_lengths, held, legendre, nodes
from lumigraph.operators.exact import lenslets_of
from lumigraph.operators.lenslet_light import AROUND
from lumigraph.operators.optics import Optics

FAINT = 1e-7
"""Part of the light in a sequence's window below which the sequence is left out."""

ASIDE = 0.5, 0.3
"""Pitches that light is followed farther than beside other lenslets: at 5e-3, and more for each tenth.

Behind three kinds with p²/(λb) of 5 and 33, images then are 2.6e-3 and 2.0e-3 from those that are followed to
8 and 5 pitches at 5e-3, 1.9e-4 and 1.8e-4 at 5e-4.
"""

MORE = 24
"""Sequences beyond those of the band that are looked at."""

DARK = 0.15
"""Part of the accuracy that lenslets may have that are left out, whose light is faint."""

TOGETHER = 48
"""Lenslets, or a row's, whose light is worked on at a time: products of few columns are slow."""

Row = tuple[float, list[tuple[float, float, float]]]
"""y of lenslets [m], and their places (y, x) and focal lengths [m]."""

Lit = tuple[float, float, float, np.ndarray]
"""Place (y, x) and focal length of a lenslet [m], and the light (y, x) around it."""


@dataclass(eq=False)
class Lines:
    """A relay of lenslets of any shape."""

    optics: Optics
    _matrices: dict[float, np.ndarray] = field(default_factory=dict)
    _carriers: dict[tuple[int, float], np.ndarray] = field(default_factory=dict)

    def places(self, rows: range, columns: range) -> tuple[np.ndarray, np.ndarray]:
        """As `Relay.places`."""
        around = self._around(rows, columns)
        y, x = (
            self._origin[which] + self._steps[which] * np.arange(numbers.start, numbers.stop)
            for which, numbers in enumerate(self._numbers(around))
        )
        return y, x

    def field(self, light: np.ndarray, rows: range, columns: range) -> np.ndarray:
        """As `Relay.field`."""
        (y0, dy), (x0, dx) = self._first(0, rows.start), self._first(1, columns.start)
        (ky, kx), lit = self.optics.cells.samples, self._lit(light, self._around(rows, columns))
        total = np.zeros((len(rows) * ky, len(columns) * kx), np.complex64)
        for y, behind in self._few(lit):
            mine, spread = self._carried(0, (y - y0) / dy, total.shape[0])
            row, ends = np.zeros((len(spread), total.shape[1]), np.complex64), []
            for x, few in behind:
                there, carrier = self._carried(1, (x - x0) / dx, total.shape[1])
                row[:, there] += few @ carrier
                ends += [there.start, there.stop]
            there = slice(min(ends), max(ends))
            total[mine, there] += spread.T @ row[:, there]
        return total

    def _lit(self, light: np.ndarray, around: list[Row]) -> list[Lit]:
        """Lenslets and the light (y, x) around each of them, without those that are dark."""
        light, found = light.astype(np.complex64), []
        (first_y, first_x), (beyond_y, beyond_x) = self._numbers(around), self._beyond
        for y, members in around:
            top = self._number(0, y) - beyond_y - first_y.start
            for _, x, focal_length in members:
                left = self._number(1, x) - beyond_x - first_x.start
                seen = light[top : top + 2 * beyond_y + 1, left : left + 2 * beyond_x + 1]
                found.append((y, x, focal_length, seen))
        bright = np.array([np.linalg.norm(seen) for *_, seen in found], np.float64)
        bright = (bright / max(bright.max(initial=0), np.finfo(np.float64).tiny)) ** 4
        order = np.argsort(bright)
        budget = (DARK * self.optics.fineness.accuracy) ** 2 * bright.sum()
        lit = sorted(order[np.cumsum(bright[order]) > budget].tolist())
        return [found[k] for k in lit]

    def _few(self, lit: list[Lit]) -> Iterator[tuple[float, list[tuple[float, np.ndarray]]]]:
        """Rows of lenslets, y, and x and the few numbers (along y, along x) of the light of each."""
        rows, some = [list(row) for _, row in groupby(lit, lambda one: one[0])], []
        for number, row in enumerate(rows, 1):
            some += row
            if len(some) >= TOGETHER or number == len(rows):
                yield from self._of_rows(some)
                some = []

    def _of_rows(self, lit: list[Lit]) -> Iterator[tuple[float, list[tuple[float, np.ndarray]]]]:
        found: dict[tuple[float, float], np.ndarray] = {}
        for focal_length in self._kinds:
            members = [one for one in lit if one[2] == focal_length]
            if members:
                few = self._behind(focal_length, np.stack([one[3] for one in members], axis=-1))
                found.update({one[:2]: few[..., k] for k, one in enumerate(members)})
        for y, row in groupby(lit, lambda one: one[0]):
            yield y, [(one[1], found[one[:2]]) for one in row]

    def _behind(self, focal_length: float, light: np.ndarray) -> np.ndarray:
        """Few numbers (along y, along x, n) of light (y, x, n) around lenslets."""
        (chords, like), (_, width, n) = self._chords, light.shape
        seen = (self._on_lines @ light.reshape(len(light), -1)).reshape(-1, width, n)
        across = self._matrix(focal_length)
        few = np.empty((len(seen), across.shape[1], n), np.complex64)
        for chord in range(len(chords)):
            mine = np.flatnonzero(like == chord)
            few[mine] = across[chord] @ seen[mine]
        return (self._down[focal_length] @ few.reshape(len(few), -1)).reshape(-1, *few.shape[1:])

    @cached_property
    def _lenslets(self) -> Lenslets:
        """As light is followed from them: to places around a lenslet, not around a cell of several."""
        found, pitch = lenslets_of(self.optics), self.optics.array.lattice.pitch
        y, x = (replace(axis, size=min(axis.size, pitch)) for axis in found.axes)
        found.axes = y, x
        return found

    @cached_property
    def _squared(self) -> float:
        return math.prod(self._lenslets.optics)

    @cached_property
    def _half(self) -> tuple[float, float]:
        """Height and width of a lenslet, halved [m]."""
        lines, _, chords = self._lenslets.lines
        return float(np.abs(lines).max()), float(chords.max())

    @property
    def _origin(self) -> tuple[float, float]:
        return self.optics.array.lattice.origin

    @cached_property
    def _steps(self) -> tuple[float, float]:
        """Between the samples of light along y and x [m]: all lenslets stand on some."""
        (_, step), (row, aside) = self.optics.array.lattice.basis
        y, x = (
            gap / math.ceil(gap / (STEP * axis.size / axis.points) - 1e-9)
            for gap, axis in zip((abs(row), abs(aside) or abs(step)), self.optics.axes, strict=True)
        )
        return y, x

    @cached_property
    def _beyond(self) -> tuple[int, int]:
        """Samples of light on each side of a lenslet's middle, along y and x."""
        periods = AROUND[0] + AROUND[1] * max(0.0, math.log10(1e-3 / self.optics.fineness.accuracy))
        y, x = (
            math.ceil((half + periods / axis.band / 2) / step)
            for half, axis, step in zip(self._half, self.optics.axes, self._steps, strict=True)
        )
        return y, x

    def _window(self, which: int) -> np.ndarray:
        """Places of the samples around a lenslet [m]."""
        beyond = self._beyond[which]
        return np.arange(-beyond, beyond + 1) * self._steps[which]

    def _number(self, which: int, place: float) -> int:
        return round((place - self._origin[which]) / self._steps[which])

    def _numbers(self, around: list[Row]) -> tuple[range, range]:
        """Of the samples of light around lenslets, along y and x."""
        found, members = [], [one for _, row in around for one in row]
        for which, beyond in enumerate(self._beyond):
            numbers = [self._number(which, one[which]) for one in members]
            found.append(range(min(numbers) - beyond, max(numbers) + beyond + 1) if numbers else range(0))
        return found[0], found[1]

    def _reach(self, which: int) -> float:
        """How far from a lenslet's middle its light is followed on the samples [m]."""
        more = ASIDE[0] + ASIDE[1] * max(0.0, math.log10(5e-3 / self.optics.fineness.accuracy))
        return self._half[which] + self.optics.beside + more * self.optics.array.lattice.pitch

    def _first(self, which: int, cell: int) -> tuple[float, float]:
        """Place of a cell's first sample, and the samples' pitch [m]."""
        cells = self.optics.cells
        pitch = cells.size[which] / cells.samples[which]
        return cells.edge[which] + (cell - cells.ring[which]) * cells.size[which] + pitch / 2, pitch

    def _around(self, rows: range, columns: range) -> list[Row]:
        """Rows of lenslets that light some cells: their y, and the lenslets."""
        array, low, high = self.optics.array, [], []
        for which, mine in enumerate((rows, columns)):
            reach, far = self._reach(which), math.inf if array.extent is None else array.extent[which] / 2
            slack = 1e-9 * array.lattice.pitch
            low.append(max(self._first(which, mine.start)[0] - reach, -far) - slack)
            high.append(min(self._first(which, mine.stop)[0] + reach, far) + slack)
        if low[0] > high[0] or low[1] > high[1]:
            return []
        pairs = array.lattice.indices((low[0], high[0]), (low[1], high[1]))
        kinds, places = array.lattice.kind(pairs[:, 0], pairs[:, 1]), array.lattice.position(pairs)
        focal = np.asarray(focal_lengths(array))
        members = np.column_stack([places, focal[kinds % len(focal)]])
        return [
            (float(mine[0, 0]), [tuple(one) for one in mine.tolist()])
            for mine in (members[pairs[:, 0] == row] for row in np.unique(pairs[:, 0]))
        ]

    def _sequences(self, which: int) -> tuple[np.ndarray, np.ndarray, float]:
        """Prolate sequences (k, samples) along an axis, their parts of light in the window, and their band.

        D. Slepian, Bell Syst. Tech. J. 57, 1371 (1978).
        """
        return self._both_sequences[which]

    @cached_property
    def _both_sequences(self) -> list[tuple[np.ndarray, np.ndarray, float]]:
        found = []
        for which, half in enumerate(self._half):
            band = half / self._squared * self._first(which, 0)[1]
            found.append((*prolate(self._count(which), band), band))
        return found

    def _count(self, which: int) -> int:
        """Samples along an axis around a lenslet."""
        return math.ceil(2 * self._reach(which) / self._first(which, 0)[1])

    def _carried(self, which: int, place: float, samples: int) -> tuple[slice, np.ndarray]:
        """Samples around a lenslet at a place [samples], of so many, and amplitude (k, those) there."""
        first = math.ceil(place - self._reach(which) / self._first(which, 0)[1])
        offset = round(first - place, 6)
        if (key := (which, offset)) not in self._carriers:
            self._carriers[key] = self._across(which, offset).astype(np.complex64)
        carrier, low = self._carriers[key], max(0, first)
        high = max(low, min(samples, first + carrier.shape[1]))
        return slice(low, high), carrier[:, low - first : high - first]

    def _across(self, which: int, offset: float) -> np.ndarray:
        """Amplitude (k, samples) of the few numbers, between the samples that they are of, too."""
        sequences, ratios, band = self._sequences(which)
        pitch = self._first(which, 0)[1]
        number = np.arange(sequences.shape[1])
        at = (number + offset) * pitch
        moved = at / pitch + self._reach(which) / pitch
        held_there = 2 * band * np.sinc(2 * band * (moved[:, None] - number)) @ (sequences.T / ratios)
        turn = np.exp(1j * np.pi * np.square(at) / self._squared) / math.sqrt(self._squared)
        return held_there.T * (turn * self._fade(which, at))

    def _fade(self, which: int, at: np.ndarray) -> np.ndarray:
        """Weight of samples from a lenslet's middle [m]: 1, and 0 where its light is no longer followed."""
        pitch = self.optics.array.lattice.pitch
        left = np.clip((np.abs(at) - self._reach(which) + pitch) / pitch, 0, 1)
        return np.cos(np.pi / 2 * left) ** 2

    @cached_property
    def _chords(self) -> tuple[np.ndarray, np.ndarray]:
        """Halves of those that differ [m], and the number of each line's."""
        return np.unique(self._lenslets.lines[2].round(12), return_inverse=True)

    @cached_property
    def _on_lines(self) -> np.ndarray:
        """From light along y (window) to the lines across a lenslet: (lines, window)."""
        coefficients, light = held(self._window(0), self.optics.axes[0].band)
        return (light(self._lenslets.lines[0]) @ coefficients).astype(np.complex64)

    @cached_property
    def _down(self) -> dict[float, np.ndarray]:
        """From the lines to few numbers along y, by focal length: (k, lines)."""
        lines, weight, _ = self._lenslets.lines
        seen = self._seen(0, lines) * weight
        return {kind: (seen * self._bend(kind, lines)).astype(np.complex64) for kind in self._kinds}

    @property
    def _kinds(self) -> list[float]:
        return sorted(set(focal_lengths(self.optics.array)))

    def _bend(self, focal_length: float, at: np.ndarray) -> np.ndarray:
        """What a lenslet and the way behind it do to light at places from its middle [m]."""
        wavelength = self._lenslets.optics[0]
        return np.exp(1j * np.pi * at**2 * (1 / self._squared - 1 / (wavelength * focal_length)))

    def _seen(self, which: int, light: np.ndarray) -> np.ndarray:
        """Few numbers (k, places) of what light at places from a lenslet's middle [m] brings."""
        sequences, pitch = self._sequences(which)[0], self._first(which, 0)[1]
        at = (np.arange(sequences.shape[1]) * pitch - self._reach(which))[:, None]
        turn = np.exp(-2j * np.pi / self._squared * at * light)
        return sequences @ (turn * self._lenslets.accepted(at - light))

    def _matrix(self, focal_length: float) -> np.ndarray:
        """From light (window) on a line to few numbers along x, by the line's chord: (chords, k, window)."""
        if not self._matrices:
            self._matrices.update(self._computed())
        return self._matrices[focal_length]

    def _computed(self) -> dict[float, np.ndarray]:
        """Of all focal lengths: they share what goes from a line's nodes to the samples.

        Polynomials give it for all chords, by what it is for the longest.
        """
        lenslets, kinds = self._lenslets, self._kinds
        steepest, longest = min(map(abs, kinds)), self._half[1]

        def count(chord: float) -> int:
            return nodes(chord, steepest, lenslets.axes[1], lenslets.optics)

        x, weight = legendre(-longest, longest, most := count(longest))
        degrees = (np.arange(most) + 0.5) / longest
        polynomials = np.polynomial.legendre.legvander(x / longest, most - 1)
        seen = self._seen(1, x) * weight @ (polynomials * degrees)
        coefficients, light = held(self._window(1), self.optics.axes[1].band)
        found: dict[float, list[np.ndarray]] = {kind: [] for kind in kinds}
        for chord in self._chords[0].tolist():
            x, weight = legendre(-chord, chord, count(chord))
            polynomials = np.polynomial.legendre.legvander(x / longest, most - 1)
            there, around = seen @ polynomials.T * weight, light(x) @ coefficients
            for kind, mine in found.items():
                mine.append(((there * self._bend(kind, x)) @ around).astype(np.complex64))
        return {kind: np.array(mine) for kind, mine in found.items()}


def prolate(count: int, band: float) -> tuple[np.ndarray, np.ndarray]:
    """Sequences (k, count) of a band [1/sample], and the parts of their light in the window, not faint."""
    most = min(count, math.ceil(2 * count * band) + MORE)
    number = np.arange(count)
    middle = ((count - 1) / 2 - number) ** 2 * math.cos(2 * math.pi * band)  # Slepian's matrix
    beside = number[1:] * (count - number[1:]) / 2
    _, vectors = scipy.linalg.eigh_tridiagonal(
        middle, beside, select="i", select_range=(count - most, count - 1)
    )
    inside = scipy.linalg.matmul_toeplitz(2 * band * np.sinc(2 * band * number), vectors)
    strength = np.einsum("ik,ik->k", vectors, inside)
    kept = strength > FAINT
    return vectors[:, kept].T, strength[kept]
