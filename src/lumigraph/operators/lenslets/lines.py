r"""Lenslets of any shape, one after the other: light around each, line after line, to what it brings.

At places s from its middle a lenslet brings

.. math:: E(s) = \frac{1}{i \lambda b} e^{i \pi s^2 / (\lambda b)} \int G(w) \, T(w) \,
          e^{i \pi w^2 / (\lambda b)} \, e^{-2 \pi i s w / (\lambda b)} \, d^2w

whose integral has a band along x: half the lenslet's width over λb. Discrete prolate sequences hold it in few
numbers, which lie in matrices that all lenslets of one focal length share, wherever samples are.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby

import numpy as np

from lumigraph.operators.lenslets.line_parts import ON_LINES, Key, LineParts, Pieces

DARK = 0.15
"""Part of the accuracy that lenslets may have that are left out, whose light is faint."""

TOGETHER = 48
"""Lenslets, or a row's, whose light is worked on at a time: products of few columns are slow."""


@dataclass(frozen=True, slots=True)
class LensletPatch:
    """A lenslet: its place [m], its kind, and the first samples of the light around it."""

    y: float
    x: float
    kind: int
    top: int
    left: int


@dataclass(frozen=True, slots=True)
class LineSamples:
    """Samples around a lenslet, and the matrix to these with the columns that are theirs."""

    there: slice
    key: Key
    inside: slice

    def of(self, pieces: Pieces) -> np.ndarray:
        """The matrix (k, samples)."""
        return pieces(self.key)[:, self.inside]


class LineRelay(LineParts):
    """A relay of lenslets of any shape."""

    def places(self, rows: range, columns: range) -> tuple[np.ndarray, np.ndarray]:
        """As `Relay.places`."""
        y, x = (
            self._origin[which] + self._steps[which] * np.arange(numbers.start, numbers.stop)
            for which, numbers in enumerate(self._numbers(rows, columns))
        )
        return y, x

    def field(self, light: np.ndarray, rows: range, columns: range) -> np.ndarray:
        """As `Relay.field`."""
        light, own, total = light.astype(self.precision), self.piece, self.dark(rows, columns)
        for some in self.lit(light, rows, columns):
            few = {}
            for kind, mine in of_kinds(some):
                along = self.along(own, kind, self.on_lines(own, light, mine))
                few.update(zip(mine, self.down(own, kind, along), strict=True))
            self.add(total, (own, own), few, (rows, columns))
        return total

    def dark(self, rows: range, columns: range) -> np.ndarray:
        """Nothing on the samples (y, x) of some cells."""
        ky, kx = self.optics.cells.samples
        return np.zeros((len(rows) * ky, len(columns) * kx), self.precision)

    def keys(self, rows: range, columns: range) -> set[Key]:
        """Of all matrices that bring light to some cells."""
        around = self._around(rows, columns)
        found: set[Key] = {(what, one.kind) for one in around for what in ("along", "down")}
        found |= {self.cut(0, one.y, rows).key for one in around}
        return found | {self.cut(1, one.x, columns).key for one in around} | {ON_LINES}

    def lit(self, light: np.ndarray, rows: range, columns: range) -> Iterator[list[LensletPatch]]:
        """Lenslets, without those that are dark: some rows at a time."""
        around, (tall, wide) = self._around(rows, columns), self._windows
        bright = np.array(
            [np.linalg.norm(light[o.top :, o.left :][:tall, :wide]) for o in around], np.float64
        )
        lit = [around[k] for k in bright_ones(bright, self.optics.fineness.accuracy)]
        rest: list[LensletPatch] = []
        for _, row in groupby(lit, lambda one: one.y):
            rest += row
            if len(rest) >= TOGETHER:
                yield rest
                rest = []
        if rest:
            yield rest

    def around(self, light: np.ndarray, some: Sequence[LensletPatch]) -> np.ndarray:
        """Light (y, x, n) around each of n lenslets; a change of what is added to it is one of the light."""
        tall, wide = self._windows
        return np.stack([light[one.top :, one.left :][:tall, :wide] for one in some], axis=-1)

    def on_lines(self, pieces: Pieces, light: np.ndarray, some: Sequence[LensletPatch]) -> np.ndarray:
        """Light (lines, window, n) on the lines across n lenslets, of light (y, x) on all samples."""
        tall, wide = self._windows
        seen = self.around(light, some).reshape(tall, -1)
        return (pieces(ON_LINES) @ seen).reshape(-1, wide, len(some))

    def along(self, pieces: Pieces, kind: int, seen: np.ndarray) -> np.ndarray:
        """Few numbers along x (lines, k, n) of light on the lines across lenslets of a kind."""
        across = pieces(("along", kind))
        found = np.empty((len(seen), across.shape[1], seen.shape[2]), self.precision)
        for chord, mine in enumerate(self.like_lines):
            found[mine] = across[chord] @ seen[mine]
        return found

    def down(self, pieces: Pieces, kind: int, along: np.ndarray) -> np.ndarray:
        """Few numbers (n, k along y, k along x) of those along x."""
        few = (pieces(("down", kind)) @ along.reshape(len(along), -1)).reshape(-1, *along.shape[1:])
        return few.transpose(2, 0, 1)

    def add(
        self,
        total: np.ndarray,
        ways: tuple[Pieces, Pieces],
        few: dict[LensletPatch, np.ndarray],
        cells: tuple[range, range],
    ) -> None:
        """Amplitude on the samples (y, x) of cells, of lenslets' few numbers, by matrices along y and x."""
        for y, row in by_row(few):
            mine = self.cut(0, y, cells[0])
            total[mine.there] += mine.of(ways[0]).T @ self.behind(ways[1], row, cells[1])

    def behind(
        self, pieces: Pieces, row: Sequence[tuple[LensletPatch, np.ndarray]], columns: range
    ) -> np.ndarray:
        """Amplitude (k, samples along x) of the few numbers of a row's lenslets."""
        width = len(columns) * self.optics.cells.samples[1]
        total = np.zeros((len(row[0][1]), width), self.precision)
        for one, few in row:
            mine = self.cut(1, one.x, columns)
            total[:, mine.there] += few @ mine.of(pieces)
        return total

    def cut(self, which: int, at: float, cells: range) -> LineSamples:
        """Along an axis, around a lenslet at a place [m], of the samples of some cells."""
        start, pitch = self._first(which, cells.start)
        place, count = (at - start) / pitch, len(cells) * self.optics.cells.samples[which]
        first = math.ceil(place - self._reach(which) / pitch)
        low, high = max(0, first), min(count, first + self._count(which))
        there = slice(low, max(low, high))
        key = "carried", which, round(first - place, 6)
        return LineSamples(there, key, slice(there.start - first, there.stop - first))

    def _around(self, rows: range, columns: range) -> list[LensletPatch]:
        """The same, and where the light around them begins."""
        first, members = self._numbers(rows, columns), self._members(rows, columns)
        starts = [
            np.rint((members[:, k] - self._origin[k]) / self._steps[k]) - self._beyond[k] - first[k].start
            for k in (0, 1)
        ]
        tops, lefts = (start.astype(int).tolist() for start in starts)
        return [
            LensletPatch(y, x, int(kind), top, left)
            for (y, x, kind), top, left in zip(members.tolist(), tops, lefts, strict=True)
        ]


def bright_ones(bright: np.ndarray, accuracy: float) -> list[int]:
    """Numbers of the lenslets, of the rms amplitudes around them, that are not left out."""
    squared = (bright / max(bright.max(initial=0), np.finfo(np.float64).tiny)) ** 4
    order = np.argsort(squared)
    budget = (DARK * accuracy) ** 2 * squared.sum()
    return sorted(order[np.cumsum(squared[order]) > budget].tolist())


def of_kinds(some: Sequence[LensletPatch]) -> Iterator[tuple[int, list[LensletPatch]]]:
    """Lenslets by their kind."""
    for kind in sorted({one.kind for one in some}):
        yield kind, [one for one in some if one.kind == kind]


def by_row(
    few: dict[LensletPatch, np.ndarray],
) -> Iterator[tuple[float, list[tuple[LensletPatch, np.ndarray]]]]:
    """Rows of lenslets: their y, and each with what belongs to it."""
    for y, row in groupby(sorted(few, key=lambda one: one.y), lambda one: one.y):
        yield y, [(one, few[one]) for one in row]
