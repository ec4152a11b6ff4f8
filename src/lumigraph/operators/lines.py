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

ASIDE = 0.5
"""Pitches that light is followed farther than to so many lenslets beside it.

Without, images behind three kinds were off by 2.0e-3 at 1e-3, with it by 1.2e-3.
"""

MORE = 24
"""Sequences beyond those of the band that are looked at."""

Lenslet = tuple[float, float, float]
"""Place (y, x) and focal length [m]."""


@dataclass(eq=False)
class Lines:
    """A relay of lenslets of any shape."""

    optics: Optics
    _matrices: dict[float, np.ndarray] = field(default_factory=dict)
    _carriers: dict[tuple[int, float], np.ndarray] = field(default_factory=dict)

    def places(self, rows: range, columns: range) -> tuple[np.ndarray, np.ndarray]:
        """As `Relay.places`: along y, the lines of all rows of lenslets."""
        around = self._around(rows, columns)
        y = np.array([y for y, _ in around])
        numbers = self._numbers(around)
        x = self._origin + self._step * np.arange(numbers.start, numbers.stop)
        return (y[:, None] + self._lenslets.lines[0]).ravel(), x

    def field(self, light: np.ndarray, rows: range, columns: range) -> np.ndarray:
        """As `Relay.field`."""
        around = self._around(rows, columns)
        (y0, dy), (x0, dx) = self._first(0, rows.start), self._first(1, columns.start)
        (ky, kx), first = self.optics.cells.samples, self._numbers(around).start
        total = np.zeros((len(rows) * ky, len(columns) * kx), np.complex64)
        light = light.astype(np.complex64).reshape(len(around), -1, light.shape[1])
        for (y, members), lines in zip(around, light, strict=True):
            behind = np.zeros((light.shape[1], total.shape[1]), np.complex64)
            for x, few in self._few(lines, members, first):
                mine, carrier = self._carried(1, (x - x0) / dx, total.shape[1])
                behind[:, mine] += few @ carrier
            mine, spread = self._carried(0, (y - y0) / dy, total.shape[0])
            total[mine] += spread.T @ behind
        return total

    def _few(
        self, lines: np.ndarray, members: list[Lenslet], first: int
    ) -> Iterator[tuple[float, np.ndarray]]:
        """Places of the lenslets of a row, and the few numbers (lines, k) of their light."""
        width = 2 * self._beyond + 1
        for focal_length, alike in groupby(sorted(members, key=lambda one: one[2]), lambda one: one[2]):
            places = [x for _, x, _ in alike]
            starts = [self._number(x) - self._beyond - first for x in places]
            seen = np.stack([lines[:, k : k + width] for k in starts], axis=-1)
            few = np.matmul(self._matrix(focal_length), seen)
            yield from ((x, few[:, :, k]) for k, x in enumerate(places))

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
    def _origin(self) -> float:
        return self.optics.array.lattice.origin[1]

    @cached_property
    def _step(self) -> float:
        """Between the samples of light along x [m]: all lenslets stand on some."""
        (_, step), (_, aside) = self.optics.array.lattice.basis
        gap, axis = abs(aside) or abs(step), self.optics.axes[1]
        return gap / math.ceil(gap / (STEP * axis.size / axis.points) - 1e-9)

    @cached_property
    def _beyond(self) -> int:
        """Samples of light on each side of a lenslet's middle."""
        axis = self.optics.axes[1]
        periods = AROUND[0] + AROUND[1] * max(0.0, math.log10(1e-3 / self.optics.fineness.accuracy))
        return math.ceil((self._half[1] + periods / axis.band / 2) / self._step)

    def _number(self, x: float) -> int:
        return round((x - self._origin) / self._step)

    def _numbers(self, around: list[tuple[float, list[Lenslet]]]) -> range:
        """Of the samples of light around lenslets."""
        numbers = [self._number(x) for _, members in around for _, x, _ in members]
        if not numbers:
            return range(0)
        return range(min(numbers) - self._beyond, max(numbers) + self._beyond + 1)

    def _reach(self, which: int) -> float:
        """How far from a lenslet's middle its light is followed on the samples [m]."""
        farther = self.optics.axes[which].neighbourhood + ASIDE * self.optics.array.lattice.pitch
        return self._half[which] + farther

    def _first(self, which: int, cell: int) -> tuple[float, float]:
        """Place of a cell's first sample, and the samples' pitch [m]."""
        cells = self.optics.cells
        pitch = cells.size[which] / cells.samples[which]
        return cells.edge[which] + (cell - cells.ring[which]) * cells.size[which] + pitch / 2, pitch

    def _around(self, rows: range, columns: range) -> list[tuple[float, list[Lenslet]]]:
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

    @cached_property
    def _sequences(self) -> tuple[np.ndarray, np.ndarray, float]:
        """Prolate sequences (k, samples) along x, their parts of light in the window, and their band.

        D. Slepian, Bell Syst. Tech. J. 57, 1371 (1978).
        """
        count, pitch = self._count(1), self._first(1, 0)[1]
        band = self._half[1] / self._squared * pitch
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
        return vectors[:, kept].T, strength[kept], band

    def _count(self, which: int) -> int:
        """Samples along an axis around a lenslet."""
        return math.ceil(2 * self._reach(which) / self._first(which, 0)[1])

    def _carried(self, which: int, place: float, samples: int) -> tuple[slice, np.ndarray]:
        """Samples around a lenslet at a place [samples], of so many, and amplitude (n, those) there.

        Along x of the few numbers, along y of the lines.
        """
        first = math.ceil(place - self._reach(which) / self._first(which, 0)[1])
        offset = round(first - place, 6)
        if (key := (which, offset)) not in self._carriers:
            self._carriers[key] = (self._across if which else self._down)(offset).astype(np.complex64)
        carrier, low = self._carriers[key], max(0, first)
        high = max(low, min(samples, first + carrier.shape[1]))
        return slice(low, high), carrier[:, low - first : high - first]

    def _down(self, offset: float) -> np.ndarray:
        """Amplitude (lines, samples) along y of light on the lines."""
        lines, weight, _ = self._lenslets.lines
        at = (np.arange(self._count(0)) + offset) * self._first(0, 0)[1]
        return (self._lenslets.spread(at, lines) * weight).T * self._fade(0, at)

    def _across(self, offset: float) -> np.ndarray:
        """Amplitude (k, samples) along x of the few numbers, between the samples that they are of, too."""
        sequences, ratios, band = self._sequences
        pitch = self._first(1, 0)[1]
        number, at = np.arange(sequences.shape[1]), (np.arange(sequences.shape[1]) + offset) * pitch
        moved = at / pitch + self._reach(1) / pitch
        held_there = 2 * band * np.sinc(2 * band * (moved[:, None] - number)) @ (sequences.T / ratios)
        turn = np.exp(1j * np.pi * np.square(at) / self._squared) / math.sqrt(self._squared)
        return held_there.T * (turn * self._fade(1, at))

    def _fade(self, which: int, at: np.ndarray) -> np.ndarray:
        """Weight of samples from a lenslet's middle [m]: 1, and 0 where its light is no longer followed."""
        pitch = self.optics.array.lattice.pitch
        left = np.clip((np.abs(at) - self._reach(which) + pitch) / pitch, 0, 1)
        return np.cos(np.pi / 2 * left) ** 2

    def _matrix(self, focal_length: float) -> np.ndarray:
        """From light (window) on each line to few numbers: (lines, k, window)."""
        if not self._matrices:
            self._matrices.update(self._computed())
        return self._matrices[focal_length]

    def _computed(self) -> dict[float, np.ndarray]:
        """Of all focal lengths: they share what goes from a line's nodes to the samples."""
        lenslets, (wavelength, _) = self._lenslets, self._lenslets.optics
        kinds = sorted(set(focal_lengths(self.optics.array)))
        steepest = min(map(abs, kinds))
        lines, _, chords = lenslets.lines
        chords, like = np.unique(chords.round(12), return_inverse=True)
        sequences, pitch = self._sequences[0], self._first(1, 0)[1]
        at = np.arange(sequences.shape[1]) * pitch - self._reach(1)
        window = np.arange(-self._beyond, self._beyond + 1) * self._step
        coefficients, light = held(window, self.optics.axes[1].band)
        found: dict[float, list[np.ndarray]] = {kind: [] for kind in kinds}
        for chord in chords.tolist():
            x, weight = legendre(-chord, chord, nodes(chord, steepest, lenslets.axes[1], lenslets.optics))
            turn = np.exp(-2j * np.pi / self._squared * at[:, None] * x)
            if lenslets.pixels is not None:
                turn *= lenslets.accepted(at[:, None] - x)
            seen, around = sequences @ turn, light(x) @ coefficients
            for kind, mine in found.items():
                bend = np.pi * x**2 * (1 / self._squared - 1 / (wavelength * kind))
                mine.append(((seen * (weight * np.exp(1j * bend))) @ around).astype(np.complex64))
        bends = {kind: np.exp(-1j * np.pi * lines**2 / (wavelength * kind)) for kind in kinds}
        return {
            kind: np.array(mine)[like] * bends[kind].astype(np.complex64)[:, None, None]
            for kind, mine in found.items()
        }
