r"""Lenslets of any shape, one after the other: light around each, line after line, to what it brings.

At places s from its middle a lenslet brings

.. math:: E(s) = \frac{1}{i \lambda b} e^{i \pi s^2 / (\lambda b)} \int G(w) \, T(w) \,
          e^{i \pi w^2 / (\lambda b)} \, e^{-2 \pi i s w / (\lambda b)} \, d^2w

whose integral has a band along x: half the lenslet's width over λb. Discrete prolate sequences hold it in few
numbers, which lie in matrices that all lenslets of one focal length share, wherever samples are.
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby

import numpy as np

from lumigraph.operators.lenslets.array_libraries import NUMPY, Array, ArrayLibrary, Numbers
from lumigraph.operators.lenslets.individual import bright_ones
from lumigraph.operators.lenslets.line_matrices import ON_LINES, Key, LineMatrices
from lumigraph.operators.lenslets.square import Ways

TOGETHER = 48
"""Lenslets whose light is worked on at a time: products of few columns are slow."""


@dataclass(frozen=True, slots=True)
class Lenslet:
    """One lenslet: its place [m], its kind, and the first samples of the light around it."""

    y: float
    x: float
    kind: int
    top: int
    left: int


class AnyShape(LineMatrices):
    """Lenslets of any shape and of several focal lengths: light in their plane to light on the image."""

    def places(self, rows: range, columns: range) -> tuple[np.ndarray, np.ndarray]:
        """Places of light along y and x that the samples of some cells need [m]."""
        y, x = (
            self._origin[which] + self._steps[which] * np.arange(numbers.start, numbers.stop)
            for which, numbers in enumerate(self._numbers(rows, columns))
        )
        return y, x

    def field(self, light: np.ndarray, rows: range, columns: range) -> np.ndarray:
        """Amplitude (y, x) on the samples of the cells, of light (y, x) at those places."""
        cells, light = (rows, columns), light.astype(self.precision)
        return self.amplitude(NUMPY, self.prepared(self.keys(cells)), light, cells, self.lit(light, cells))

    def keys(self, cells: Ways) -> list[Key]:
        """Names of the arrays that light behind some cells is computed with."""
        around = self._around(*cells)
        kinds = [(what, kind) for kind in sorted({one.kind for one in around}) for what in ("along", "down")]
        carried = [self._start(which, at, cells[which])[1] for which, at in
                   dict.fromkeys(pair for one in around for pair in ((0, one.y), (1, one.x)))]  # fmt: skip
        return [ON_LINES, *kinds, *dict.fromkeys(carried)]

    def grouped(self, keys: Iterable[Key]) -> list[list[Key]]:
        """Arrays that are followed back together: all."""
        return [list(keys)]

    def numbers(self, keys: Iterable[Key]) -> dict[Key, np.ndarray]:
        """Matrices of the camera, as far as cameras close by differ by them."""
        return {key: self.number(key) for key in keys}

    def prepare(self, xp: ArrayLibrary, numbers: Numbers, keys: Iterable[Key]) -> dict[Key, Array]:
        """The same: a camera's matrices are what light behind its lenslets is computed with."""
        return {key: numbers[key] for key in keys}

    def prepared(self, keys: Iterable[Key]) -> dict[Key, Array]:
        """Matrices of the camera itself, computed once."""
        return self.numbers(keys)

    def lit(self, light: np.ndarray, cells: Ways) -> list[list[Lenslet]]:
        """Lenslets, without those that are dark: some rows at a time."""
        around, (tall, wide) = self._around(*cells), self._windows
        bright = np.array([np.linalg.norm(light[o.top :, o.left :][:tall, :wide]) for o in around], float)
        kept = [around[k] for k in bright_ones(bright, self.optics.fineness.accuracy)]
        groups: list[list[Lenslet]] = [[]]
        for _, row in groupby(kept, lambda one: one.y):
            if len(groups[-1]) >= TOGETHER:
                groups.append([])
            groups[-1] += row
        return groups

    def amplitude(
        self, xp: ArrayLibrary, prepared: Numbers, light: Array, cells: Ways, lit: list[list[Lenslet]]
    ) -> Array:
        """Amplitude (..., y, x) on the samples of cells, of light (..., y, x) in the lenslet plane."""
        rows, columns = (len(mine) * n for mine, n in zip(cells, self.optics.cells.samples, strict=True))
        total = xp.asarray(np.zeros((*light.shape[:-2], rows, columns), self.precision))
        for some in lit:
            for y, few in self._rows(xp, prepared, light, some):
                start, key = self._start(0, y, cells[0])
                matrix = prepared[key]
                seen = xp.part(matrix, max(0, -start), min(max(0, rows - start), matrix.shape[1]), 1)
                row = seen.swapaxes(-1, -2) @ self._beside(xp, prepared, few, cells[1])
                total = total + xp.overlap_add(row[None], [max(0, start)], rows, -2)
        return total

    def _rows(
        self, xp: ArrayLibrary, prepared: Numbers, light: Array, some: Sequence[Lenslet]
    ) -> Iterator[tuple[float, list[tuple[list[Lenslet], Array]]]]:
        """Rows of lenslets: their y, and their members of each kind with few numbers (n, ..., ky, kx)."""
        seen: dict[int, list[tuple[float, list[Lenslet], Array]]] = {}
        for y, row in groupby(some, lambda one: one.y):
            members = list(row)
            on_lines = prepared[ON_LINES] @ xp.part(light, top := members[0].top, top + self._windows[0], -2)
            for kind in sorted({one.kind for one in members}):
                mine = [one for one in members if one.kind == kind]
                windows = xp.windows(on_lines, [one.left for one in mine], self._windows[1], -1)
                seen.setdefault(kind, []).append((y, mine, windows))
        found: dict[float, list[tuple[list[Lenslet], Array]]] = {}
        for kind, parts in seen.items():
            few, first = self._few(xp, prepared, kind, [windows for *_, windows in parts]), 0
            for y, mine, _ in parts:
                found.setdefault(y, []).append((mine, xp.part(few, first, first + len(mine), 0)))
                first += len(mine)
        yield from found.items()

    def _few(self, xp: ArrayLibrary, prepared: Numbers, kind: int, windows: Sequence[Array]) -> Array:
        """Few numbers (n, ..., ky, kx), of light (n, ..., lines, window) on lines of one kind's lenslets."""
        lines = xp.moveaxis(xp.concatenate(windows, 0), 0, -1)
        along = prepared["along", kind] @ lines
        *batch, count, k, n = along.shape
        few = prepared["down", kind] @ along.reshape((*batch, count, k * n))
        return xp.moveaxis(few.reshape((*batch, few.shape[-2], k, n)), -1, 0)

    def _beside(
        self, xp: ArrayLibrary, prepared: Numbers, few: list[tuple[list[Lenslet], Array]], columns: range
    ) -> Array:
        """Amplitude (..., ky, samples along x) of the few numbers of a row's lenslets."""
        parts = []
        width = len(columns) * self.optics.cells.samples[1]
        for members, numbers in few:
            placed = [self._start(1, one.x, columns) for one in members]
            first = 0
            for key, same in groupby(placed, lambda one: one[1]):
                mine = [start for start, _ in same]
                low, high = max(0, -max(mine)), max(0, width - min(mine))
                matrix = xp.part(prepared[key], low, min(high, prepared[key].shape[1]), 1)
                behind = xp.part(numbers, first, first + len(mine), 0) @ matrix
                parts.append(xp.overlap_add(behind, [start + low for start in mine], width, -1))
                first += len(mine)
        return sum(parts[1:], parts[0])

    def _start(self, which: int, at: float, cells: range) -> tuple[int, Key]:
        """First of a lenslet's samples along an axis, counted from those of some cells; and its matrix."""
        start, pitch = self._first(which, cells.start)
        place = (at - start) / pitch
        first = math.ceil(place - self._reach(which) / pitch)
        return first, ("carried", which, round(first - place, 6))

    def _around(self, rows: range, columns: range) -> list[Lenslet]:
        """Lenslets that light some cells, and where the light around them begins."""
        first, members = self._numbers(rows, columns), self._members(rows, columns)
        starts = [
            np.rint((members[:, k] - self._origin[k]) / self._steps[k]) - self._beyond[k] - first[k].start
            for k in (0, 1)
        ]
        tops, lefts = (start.astype(int).tolist() for start in starts)
        return [
            Lenslet(y, x, int(kind), top, left)
            for (y, x, kind), top, left in zip(members.tolist(), tops, lefts, strict=True)
        ]
