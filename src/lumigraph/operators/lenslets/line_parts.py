"""Matrices that lenslets of any shape are made of: from the light around one to few numbers, and to samples.

Those of cameras that hardly differ are of the same shape and mean the same, number by number.
"""

import math
from collections.abc import Callable, Hashable, Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy.linalg

from lumigraph.operators.lenslets.cell_response import (
    CellLenslets,
    focal_lengths,
    legendre,
    nodes,
    times_real,
)
from lumigraph.operators.lenslets.exact_lenslets import lenslets_of
from lumigraph.operators.lenslets.lenslet_light import AROUND
from lumigraph.operators.sampling.cell_axis import STEP, held
from lumigraph.operators.sampling.optics import Optics

FAINT = 1e-7, 1e-10
"""Part of light in a sequence's window below which the sequence is left out, in single and double precision.

With 1e-7 derivatives by the wavelength behind three kinds are 2.6e-4 from differences of images of cameras
that have sequences of their own, with 1e-9 1.0e-5, with 1e-11 1.3e-6.
"""

ASIDE = 0.5, 0.3
"""Pitches that light is followed farther than beside other lenslets: at 5e-3, and more for each tenth.

Behind three kinds with p²/(λb) of 5 and 33, images then are 2.6e-3 and 2.0e-3 from those that are followed to
8 and 5 pitches at 5e-3, 1.9e-4 and 1.8e-4 at 5e-4.
"""

MORE = 24
"""Sequences beyond those of the band that are looked at."""

Key = tuple[Hashable, ...]
"""Names a matrix that lenslets are made of."""

Pieces = Callable[[Key], np.ndarray]

ON_LINES: Key = ("on lines",)


@dataclass(eq=False)
class LineParts:
    """Of a camera; sampled as those of another that hardly differs, if there is one."""

    optics: Optics
    precision: type[np.complexfloating] = np.complex64
    like: "LineParts | None" = None
    _pieces: dict[Key, np.ndarray] = field(default_factory=dict)
    _values: dict[tuple[int, float], np.ndarray] = field(default_factory=dict)

    def piece(self, key: Key) -> np.ndarray:
        """A matrix: `ON_LINES`, "along" or "down" of a kind, "carried" along an axis from an offset."""
        if key not in self._pieces:
            what, *of = key
            if self.like is not None and self._shared(what, *of):
                self._pieces[key] = self.like.piece(key)
            elif what == "along":
                self._pieces.update((("along", kind), made) for kind, made in self._along())
            else:
                made = {"on lines": self._on_lines, "down": self._down, "carried": self._across}
                self._pieces[key] = made[str(what)](*of).astype(self.precision)
        return self._pieces[key]

    def _shared(self, what: Hashable, *of: Any) -> bool:
        """Whether a matrix is the other's, with all it follows from: cameras may differ in one kind alone."""
        assert self.like is not None
        if what == "on lines":
            return self._wide == self.like._wide
        if what in ("along", "down") and self._focal[of[0]] != self.like._focal[of[0]]:
            return False
        one, other = (
            (array.lattice, array.fill_factor, parts.optics.cells, *lenslets.optics)
            for parts in (self, self.like)
            for array, lenslets in [(parts.optics.array, parts._lenslets)]
        )
        return one == other and self._lenslets.pixels == self.like._lenslets.pixels

    @cached_property
    def _lenslets(self) -> CellLenslets:
        """As light is followed from them: to places around a lenslet, not around a cell of several."""
        found, pitch = lenslets_of(self.optics), self.optics.array.lattice.pitch
        y, x = (replace(axis, size=min(axis.size, pitch)) for axis in found.axes)
        found.axes = y, x
        return found

    @cached_property
    def _squared(self) -> float:
        return math.prod(self._lenslets.optics)

    @cached_property
    def _lines(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """As `CellLenslets.lines`; as many as the other's."""
        if self.like is None:
            return self._lenslets.lines
        larger = self._aperture / self.like._aperture
        y, weight, chord = (larger * part for part in self.like._lines)
        return y, weight, chord

    @property
    def _aperture(self) -> float:
        """Width of a lenslet [m]."""
        return self.optics.array.fill_factor * self.optics.array.lattice.pitch

    @cached_property
    def _half(self) -> tuple[float, float]:
        """Height and width of a lenslet, halved [m]."""
        lines, _, chords = self._lines
        return float(np.abs(lines).max()), float(chords.max())

    @property
    def _origin(self) -> tuple[float, float]:
        return self.optics.array.lattice.origin

    @cached_property
    def _steps(self) -> tuple[float, float]:
        """Between the samples of light along y and x [m]: all lenslets stand on some."""
        y, x = (gap / count for gap, count in zip(self._gaps, self._between, strict=True))
        return y, x

    @property
    def _gaps(self) -> tuple[float, float]:
        """Of lenslets, between those of neighbouring rows too [m]."""
        (_, step), (row, aside) = self.optics.array.lattice.basis
        return abs(row), abs(aside) or abs(step)

    @cached_property
    def _between(self) -> tuple[int, int]:
        """Samples of light to a gap."""
        if self.like is not None:
            return self.like._between
        y, x = (
            math.ceil(gap / (STEP * axis.size / axis.points) - 1e-9)
            for gap, axis in zip(self._gaps, self.optics.axes, strict=True)
        )
        return y, x

    @cached_property
    def _beyond(self) -> tuple[int, int]:
        """Samples of light on each side of a lenslet's middle, along y and x."""
        if self.like is not None:
            return self.like._beyond
        periods = AROUND[0] + AROUND[1] * max(0.0, math.log10(1e-3 / self.optics.fineness.accuracy))
        y, x = (
            math.ceil((half + periods / axis.band / 2) / step)
            for half, axis, step in zip(self._half, self.optics.axes, self._steps, strict=True)
        )
        return y, x

    @property
    def _windows(self) -> tuple[int, int]:
        """Samples of light around a lenslet."""
        y, x = (2 * beyond + 1 for beyond in self._beyond)
        return y, x

    def _window(self, which: int) -> np.ndarray:
        """Places of the samples around a lenslet [m]."""
        beyond = self._beyond[which]
        return np.arange(-beyond, beyond + 1) * self._steps[which]

    def _reach(self, which: int) -> float:
        """How far from a lenslet's middle its light is followed on the samples [m]."""
        return self._followed[which] * self.optics.array.lattice.pitch

    @cached_property
    def _followed(self) -> tuple[float, float]:
        """The same along y and along x [pitches]; whatever the fill factor."""
        if self.like is not None:
            return self.like._followed
        array, optics = self.optics.array, self.optics
        more = ASIDE[0] + ASIDE[1] * max(0.0, math.log10(5e-3 / optics.fineness.accuracy))
        y, x = (
            (half / array.fill_factor + optics.beside) / array.lattice.pitch + more for half in self._half
        )
        return y, x

    def _first(self, which: int, cell: int) -> tuple[float, float]:
        """Place of a cell's first sample, and the samples' pitch [m]."""
        cells = self.optics.cells
        pitch = cells.size[which] / cells.samples[which]
        return cells.edge[which] + (cell - cells.ring[which]) * cells.size[which] + pitch / 2, pitch

    def _numbers(self, rows: range, columns: range) -> tuple[range, range]:
        """Of the samples of light around the lenslets that light some cells, along y and x."""
        if self.like is not None:
            return self.like._numbers(rows, columns)
        found, members = [], self._members(rows, columns)
        for which, beyond in enumerate(self._beyond):
            numbers = np.rint((members[:, which] - self._origin[which]) / self._steps[which]).astype(int)
            ends = (numbers.min() - beyond, numbers.max() + beyond + 1) if len(numbers) else (0, 0)
            found.append(range(int(ends[0]), int(ends[1])))
        return found[0], found[1]

    def _members(self, rows: range, columns: range) -> np.ndarray:
        """Places and kinds (n, 3) of the lenslets that light some cells, row after row."""
        array, low, high = self.optics.array, [], []
        for which, mine in enumerate((rows, columns)):
            reach, far = self._reach(which), math.inf if array.extent is None else array.extent[which] / 2
            slack = 1e-9 * array.lattice.pitch
            low.append(max(self._first(which, mine.start)[0] - reach, -far) - slack)
            high.append(min(self._first(which, mine.stop)[0] + reach, far) + slack)
        if low[0] > high[0] or low[1] > high[1]:
            return np.zeros((0, 3))
        pairs = array.lattice.indices((low[0], high[0]), (low[1], high[1]))
        kinds = array.lattice.kind(pairs[:, 0], pairs[:, 1]) % len(focal_lengths(array))
        return np.column_stack([array.lattice.position(pairs), kinds])[np.argsort(pairs[:, 0], kind="stable")]

    def _sequences(self, which: int) -> tuple[np.ndarray, np.ndarray, float]:
        """Prolate sequences (k, samples) along an axis, their parts of light in the window, and their band.

        D. Slepian, Bell Syst. Tech. J. 57, 1371 (1978).
        """
        return self._both_sequences[which]

    @cached_property
    def _both_sequences(self) -> list[tuple[np.ndarray, np.ndarray, float]]:
        if self.like is not None:  # any that hold the light do, but they must be the same
            return self.like._both_sequences
        found, faint = [], FAINT[self.precision is np.complex128]
        for which, half in enumerate(self._half):
            band = half / self._squared * self._first(which, 0)[1]
            found.append((*prolate(self._count(which), band, faint), band))
        return found

    def _count(self, which: int) -> int:
        """Samples along an axis around a lenslet."""
        if self.like is not None:
            return self.like._count(which)
        return math.ceil(2 * self._reach(which) / self._first(which, 0)[1])

    def _across(self, which: int, offset: float) -> np.ndarray:
        """Amplitude (k, samples) of the few numbers, between the samples that they are of, too."""
        at = (np.arange(self._count(which)) + offset) * self._first(which, 0)[1]
        turn = np.exp(1j * np.pi * np.square(at) / self._squared) / math.sqrt(self._squared)
        return self._held(which, offset) * (turn * self._fade(which, at))

    def _held(self, which: int, offset: float) -> np.ndarray:
        """Values (k, samples) of the sequences at an offset [samples]."""
        if self.like is not None:
            return self.like._held(which, offset)
        if (key := (which, offset)) not in self._values:
            sequences, ratios, band = self._sequences(which)
            number = np.arange(sequences.shape[1])
            moved = number + offset + self._reach(which) / self._first(which, 0)[1]
            spread = 2 * band * np.sinc(2 * band * (moved[:, None] - number))
            self._values[key] = (spread @ (sequences.T / ratios)).T
        return self._values[key]

    def _fade(self, which: int, at: np.ndarray) -> np.ndarray:
        """Weight of samples from a lenslet's middle [m]: 1, and 0 where its light is no longer followed."""
        pitch = self.optics.array.lattice.pitch
        left = np.clip((np.abs(at) - self._reach(which) + pitch) / pitch, 0, 1)
        return np.cos(np.pi / 2 * left) ** 2

    @cached_property
    def like_lines(self) -> list[np.ndarray]:
        """Numbers of the lines of each chord."""
        if self.like is not None:
            return self.like.like_lines
        chords, like = np.unique(self._lines[2].round(12), return_inverse=True)
        return [np.flatnonzero(like == chord) for chord in range(len(chords))]

    def _on_lines(self) -> np.ndarray:
        """From light along y (window) to the lines across a lenslet: (lines, window)."""
        return self._held_at(0, self._lines[0])

    def _held_at(self, which: int, at: np.ndarray) -> np.ndarray:
        """From light around a lenslet to places along an axis: (places, window)."""
        coefficients, light = held(self._window(which), self._band(which))
        return light(at) @ coefficients

    def _band(self, which: int) -> float:
        """Of the light [1/m]; on the samples, that of the other: any that holds it does."""
        if self.like is not None:
            return self.like._band(which) * self.like._steps[which] / self._steps[which]
        return self.optics.axes[which].band

    @property
    def _wide(self) -> tuple[float, ...]:
        """Height and width of a lenslet, halved [samples], however rounded."""
        return tuple(round(half / step, 12) for half, step in zip(self._half, self._steps, strict=True))

    @cached_property
    def _on_chords(self) -> list[np.ndarray]:
        """From light (window) to the nodes of a line, of each chord: (nodes, window)."""
        if self.like is not None and self._wide == self.like._wide:
            return self.like._on_chords
        return [self._held_at(1, self._half[1] * mine.at) for mine in self._nodes[1:]]

    def _down(self, kind: int) -> np.ndarray:
        """From the lines to few numbers along y, by the kind: (k, lines)."""
        return self._seen_of_lines * self._bend(self._focal[kind], self._lines[0])

    @cached_property
    def _seen_of_lines(self) -> np.ndarray:
        """What all kinds share of that."""
        lines, weight, _ = self._lines
        return self._seen(0, lines) * weight

    @property
    def _focal(self) -> tuple[float, ...]:
        """Of each kind."""
        return focal_lengths(self.optics.array)

    def _bend(self, focal_length: float, at: np.ndarray) -> np.ndarray:
        """What a lenslet and the way behind it do to light at places from its middle [m]."""
        wavelength = self._lenslets.optics[0]
        return np.exp(1j * np.pi * at**2 * (1 / self._squared - 1 / (wavelength * focal_length)))

    def _seen(self, which: int, light: np.ndarray) -> np.ndarray:
        """Few numbers (k, places) of what light at places from a lenslet's middle [m] brings."""
        sequences, pitch = self._sequences(which)[0], self._first(which, 0)[1]
        at = (np.arange(sequences.shape[1]) * pitch - self._reach(which))[:, None]
        turn = np.exp(-2j * np.pi / self._squared * at * light)
        if self._lenslets.pixels is not None:
            turn *= self._lenslets.accepted(at - light)
        return times_real(turn.T, sequences.T).T

    def _along(self) -> Iterator[tuple[int, np.ndarray]]:
        """From light (window) on a line to few numbers along x: (chords, k, window) of kinds not shared.

        They share what goes from a line's nodes to the samples: polynomials give it for all chords, by what
        it is for the longest.
        """
        longest, whole = self._half[1], self._nodes[0]
        degrees = (np.arange(len(whole.at)) + 0.5) / longest
        seen = self._seen(1, longest * whole.at) * (longest * whole.weight)
        seen = times_real(seen, whole.polynomials * degrees)
        chords = self._nodes[1:]
        there = [times_real(seen, mine.polynomials.T) * (longest * mine.weight) for mine in chords]
        for kind, focal_length in enumerate(self._focal):
            if self.like is None or not self._shared("along", kind):
                bends = [self._bend(focal_length, longest * mine.at) for mine in chords]
                parts = zip(there, bends, self._on_chords, strict=True)
                found = [times_real(one * bend, light) for one, bend, light in parts]
                yield kind, np.array(found, self.precision)

    @cached_property
    def _nodes(self) -> list["_Nodes"]:
        """Of the longest chord, and of each that differs."""
        if self.like is not None:
            return self.like._nodes
        lenslets, longest = self._lenslets, self._half[1]
        steepest = min(map(abs, self._focal))

        def count(chord: float) -> int:
            return nodes(chord, steepest, lenslets.axes[1], lenslets.optics)

        chords = [float(self._lines[2][mine[0]]) for mine in self.like_lines]
        most = count(longest)
        return [_Nodes.of(chord / longest, count(chord), most) for chord in (longest, *chords)]


@dataclass(frozen=True, slots=True, eq=False)
class _Nodes:
    """Of a quadrature along a chord: places and weights, of half the longest, and polynomials there."""

    at: np.ndarray
    weight: np.ndarray
    polynomials: np.ndarray

    @classmethod
    def of(cls, chord: float, count: int, degrees: int) -> "_Nodes":
        """So many, and polynomials of so many degrees."""
        x, weight = legendre(-chord, chord, count)
        return cls(x, weight, np.polynomial.legendre.legvander(x, degrees - 1))


def prolate(count: int, band: float, faint: float) -> tuple[np.ndarray, np.ndarray]:
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
    kept = strength > faint
    return vectors[:, kept].T, strength[kept]
