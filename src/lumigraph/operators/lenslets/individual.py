r"""Square lenslets that differ from each other, one by one.

At places (v, u) in halves of its width, lenslet n turns the phase of light by

.. math:: \varphi_n(v, u) = \sum_{jk} c_{n,jk} P_j(v) P_k(u)

of Legendre polynomials of degree 4 at most: focus and vertex, tilt and form. These are few numbers c for each
lenslet; the matrices to it and from it are shared by all that stand on the lattice.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import cached_property
from itertools import groupby
from typing import Any

import numpy as np

from lumigraph.elements import LensletArray, form
from lumigraph.elements.scatter import Scatter
from lumigraph.errors import GeometryError
from lumigraph.operators.lenslets.array_libraries import NUMPY, Array, ArrayLibrary, Numbers
from lumigraph.operators.lenslets.cell_response import focal_lengths, legendre
from lumigraph.operators.lenslets.square import Key, SquareLenslets, Ways
from lumigraph.operators.sampling import cells as _cells
from lumigraph.operators.sampling.camera import CameraOptics, Model

Lenslet = tuple[int, int]
"""Row and column of a lenslet's cell."""

Rows = list[tuple[int, list[int]]]
"""Rows of lenslets that are lit, and the columns of each."""

DEGREES = form.ORDER + 1
"""Polynomials along an axis of a lenslet."""

DARK = 0.15
"""Part of the accuracy that lenslets may have that are left out, whose light is faint."""


def require_square(array: LensletArray, model: Model) -> None:
    """Refuse lenslets that differ by chance and are not simulated one by one.

    Raises
    ------
    GeometryError
        Others than squares of one focal length, or the exact model.
    """
    if array.shape != "square" or isinstance(array.focal_length, tuple) or model == "exact":
        raise GeometryError(
            "lenslets that differ from each other are simulated for square ones of one focal length and "
            f'model = "paraxial". Use those, or {_cells.ALIKE}.'
        )


def one_by_one(cameras: Sequence[CameraOptics]) -> list[CameraOptics]:
    """Cameras to be compared: where lenslets of some differ, those of all are taken one by one.

    Raises
    ------
    GeometryError
        Of `require_square`; other lenslets are missing, or all are drawn anew.
    """
    arrays = [camera.array for camera in cameras if camera.array is not None]
    own = next((array.scatter for array in arrays if array.scatter is not None), None)
    if own is None:
        return list(cameras)
    found = []
    for camera, array in zip(cameras, arrays, strict=True):
        require_square(array, camera.model)
        scatter = array.scatter or Scatter(seed=own.seed)
        if (scatter.seed, scatter.missing) != (own.seed, own.missing):
            raise GeometryError(
                f"cameras have seeds {own.seed} and {scatter.seed}, and {own.missing:g} and "
                f"{scatter.missing:g} of their lenslets missing, but derivatives are of the same lenslets: "
                "other ones are no small change. Give built.seed and built.missing alike, or search without "
                "derivatives."
            )
        found.append((camera, array, scatter))
    moved = [one.index for *_, scatter in found for one in scatter.own if one.aside is not None]
    named = {one.index: one.index in moved for *_, scatter in found for one in scatter.own}
    kept = [array.scatter is scatter and _names(scatter, named) for _, array, scatter in found]
    return [
        camera if same else replace(camera, array=replace(array, scatter=scatter.naming(named)))
        for same, (camera, array, scatter) in zip(kept, found, strict=True)
    ]


def _names(scatter: Scatter, lenslets: dict[tuple[int, int], bool]) -> bool:
    """True if a scatter names these lenslets in order, with the places of the marked ones."""
    own = [(one.index, one.aside is not None) for one in scatter.own]
    return own == sorted(lenslets.items())


def bright_ones(bright: np.ndarray, accuracy: float) -> list[int]:
    """Numbers of the lenslets, of the rms amplitudes around them, that are not left out."""
    squared = (bright / max(bright.max(initial=0), np.finfo(np.float64).tiny)) ** 4
    order = np.argsort(squared)
    budget = (DARK * accuracy) ** 2 * squared.sum()
    return sorted(order[np.cumsum(squared[order]) > budget].tolist())


class IndividualLenslets(SquareLenslets):
    """Square lenslets, each with its own phase."""

    def __post_init__(self) -> None:
        require_square(self.optics.array, self.optics.camera.model)

    def lit(self, light: np.ndarray, cells: Ways) -> Rows:
        """Lenslets that are there and not dark; those beside the lattice make rows of their own."""
        around = self._around(0, cells[0]), self._around(1, cells[1])
        there = np.argwhere(self._scatter.of(*self._numbers(*around))[3]).tolist()
        windows, steps = [len(window) for window in self._windows], (self._step(0), self._step(1))
        squared = np.abs(light) ** 2
        for axis, (size, step, mine) in enumerate(zip(windows, steps, around, strict=True)):
            summed = np.cumsum(np.insert(squared, 0, 0.0, axis), axis)
            first = np.arange(len(mine)) * step
            squared = summed.take(first + size, axis) - summed.take(first, axis)
        bright = np.sqrt(np.array([squared[k, n] for k, n in there]))
        ones = [(around[0][k], around[1][n]) for k, n in there]
        kept = (ones[k] for k in bright_ones(bright, self.optics.fineness.accuracy))
        alike = groupby(sorted(kept, key=self._row), self._row)
        return [(row, [x for _, x in some]) for (row, _), some in alike]

    def keys(self, cells: Ways) -> list[Key]:
        """Names of the arrays that light behind some cells is computed with."""
        around = self._around(0, cells[0]), self._around(1, cells[1])
        moved = [one for one in self._moved if one[0] in around[0] and one[1] in around[1]]
        ways = [
            (what, which, *one) for one in ((), *moved) for what in ("light", "spread") for which in (0, 1)
        ]
        return [*ways, *(("phases", row) for row in around[0])]

    def numbers(self, keys: Iterable[Key]) -> dict[Key, np.ndarray]:
        """Numbers of the camera that some arrays follow from."""
        wanted: dict[Key, None] = {}
        for what, *of in keys:
            if what == "spread":
                wanted |= {("strength", of[0]): None, ("nodes", *of): None, ("weights", *of): None}
                wanted |= {("accepted", *of): None} if self._pixels is not None else {}
            else:
                wanted[what, *of] = None
        return {key: self.number(key) for key in wanted}

    def prepare(self, xp: ArrayLibrary, numbers: Numbers, keys: Iterable[Key]) -> dict[Key, Array]:
        """Matrices to and from lenslets' nodes, and terms of their phases."""
        found = {}
        for key in keys:
            what, *of = key
            if what == "spread":
                found[key] = self._spread(xp, numbers, *of)
            else:
                found[key] = numbers[key] + 0j if what == "light" else numbers[key]
        return found

    def prepared(self, keys: Iterable[Key]) -> dict[Key, Array]:
        """Arrays of the camera itself, computed once; phases in double precision."""
        keys = list(keys)
        if missing := [key for key in keys if key not in self._prepared]:
            for key, one in self.prepare(NUMPY, self.numbers(missing), missing).items():
                self._prepared[key] = one if key[0] == "phases" else one.astype(self.precision)
        return {key: self._prepared[key] for key in keys}

    def amplitude(self, xp: ArrayLibrary, prepared: Numbers, light: Array, cells: Ways, lit: Rows) -> Array:
        """Amplitude (..., y, x) on the samples of cells, of light (..., y, x) in the lenslet plane."""
        rows, columns = (len(mine) * n for mine, n in zip(cells, self.optics.cells.samples, strict=True))
        total = xp.asarray(np.zeros((*light.shape[:-2], rows, columns), self.precision))
        for row in lit:
            start, beside = self._row_behind(xp, prepared, light, cells, row)
            total = total + xp.overlap_add(beside[None], [start], rows, -2)
        return total

    def _row_behind(
        self, xp: ArrayLibrary, prepared: Numbers, light: Array, cells: Ways, row: tuple[int, list[int]]
    ) -> tuple[int, Array]:
        """First sample along y, and amplitudes (..., samples y, samples x) behind a row of lenslets."""
        number, columns = row
        own = (number, columns[0]) if (number, columns[0]) in self._moved else ()
        first = (number - self._around(0, cells[0]).start) * self._step(0)
        down, across = (prepared["light", which, *own] for which in (0, 1))
        left = down @ xp.part(light, first, first + len(self._windows[0]), -2)
        start = self._around(1, cells[1]).start
        starts = [(column - start) * self._step(1) for column in columns]
        on_nodes = xp.windows(left, starts, len(self._windows[1]), -1) @ across.swapaxes(-1, -2)
        bend = self._bend(xp, prepared["phases", number], columns)
        bend = bend.reshape((len(columns), *[1] * (len(light.shape) - 2), *bend.shape[1:]))
        behind = (on_nodes * bend) @ prepared["spread", 1, *own].swapaxes(-1, -2)
        samples = self._sides[1].samples
        starts = [(column - self._reach[1] - cells[1].start) * samples for column in columns]
        beside = xp.overlap_add(behind, starts, len(cells[1]) * samples, -1)
        first = (number - self._reach[0] - cells[0].start) * self._sides[0].samples
        low, high = max(0, -first), max(0, len(cells[0]) * self._sides[0].samples - first)
        spread = prepared["spread", 0, *own]
        return max(0, first), xp.part(spread, low, min(high, spread.shape[0]), 0) @ beside

    def _bend(self, xp: ArrayLibrary, terms: Array, columns: Sequence[int]) -> Array:
        """Factors (lenslets, v, u) of light on lenslets' nodes, by terms (columns, degrees, degrees)."""
        low = min(columns) + self._reach[1]
        mine = xp.part(terms, low, max(columns) + self._reach[1] + 1, 0)
        if len(columns) < mine.shape[0]:
            mine = xp.stack([mine[column + self._reach[1] - low] for column in columns])
        down, across = self._polynomials
        return xp.exp(1j * (xp.asarray(down) @ mine @ xp.asarray(across.T)))

    @cached_property
    def _polynomials(self) -> tuple[np.ndarray, np.ndarray]:
        """Legendre polynomials on the nodes (nodes, degrees), along y and along x."""
        y, x = (form.along(legendre(-1, 1, count)[0]) for count in self._counts)
        return y, x

    def _row(self, one: Lenslet) -> Lenslet:
        """Name of what shares its matrices along y: lenslets of a row, or one beside the lattice."""
        return one[0], one[1] if one in self._moved else -self._reach[1] - 1

    @cached_property
    def _counts(self) -> tuple[int, int]:
        """Nodes along y and along x: more where lenslets are stronger, tilted or have a form."""
        if self.like is not None:
            return self.like._counts
        scatter, found = self._scatter, []
        strongest = focal_lengths(self.optics.array)[0] * (1 - 4 * scatter.focal_length)
        for which, size in enumerate(self.optics.cells.size):
            half = self.optics.array.fill_factor * size / 2
            turn = scatter.turn + scatter.decentre / abs(strongest)
            steepest = 4 * turn + form.STEEPEST * scatter.form / half
            more = math.ceil(4 * half * steepest / self.optics.camera.wavelength)
            found.append(self._nodes(which, strongest) + more)
        return found[0], found[1]

    @cached_property
    def _moved(self) -> dict[Lenslet, tuple[float, float]]:
        """Offsets (y, x) from the lattice, by cell, of lenslets that have matrices of their own [m]."""
        cells, lattice, found = self.optics.cells, self.optics.array.lattice, {}
        for own in self._scatter.own:
            if own.aside is not None:
                middle = np.array(lattice.origin) + own.index[0] * np.array(lattice.basis[1])
                middle += own.index[1] * np.array(lattice.basis[0])
                row, column = np.rint((middle - cells.edge) / cells.size - 0.5).astype(int) + cells.ring
                found[int(row), int(column)] = own.aside
        return found

    def _aside(self, *one: int) -> tuple[float, float]:
        return self._moved[one[0], one[1]] if one else (0.0, 0.0)

    def _given(self, key: Key) -> tuple[Any, ...]:
        if key[0] != "phases":
            return super()._given(key)
        array, scatter = self.optics.array, self._scatter
        row = int(self._numbers(range(key[1], key[1] + 1), range(1))[0][0, 0])
        of = array.focal_length, array.fill_factor, array.lattice
        chance = (
            scatter.focal_length,
            scatter.decentre,
            scatter.missing,
            scatter.seed,
            scatter.turn,
            scatter.form,
        )
        return self.optics.camera.wavelength, self.optics.cells.size, of, chance, self._own.get(row, ())

    @cached_property
    def _own(self) -> dict[int, tuple[Any, ...]]:
        """Given values of single lenslets, by their row on the lattice."""
        found: dict[int, tuple[Any, ...]] = {}
        for one in self._scatter.own:
            found[one.index[0]] = (*found.get(one.index[0], ()), one)
        return found

    def _made(self, key: Key) -> np.ndarray:
        return self._phases(key[1]) if key[0] == "phases" else super()._made(key)

    def _phases(self, row: int) -> np.ndarray:
        """Terms (columns, degrees, degrees) of the phases of a row of lenslets [rad]."""
        columns = range(-self._reach[1], self.optics.cells.image[1] + self._reach[1])
        i, j = self._numbers(range(row, row + 1), columns)
        high, wide = (self.optics.array.fill_factor * size / 2 for size in self.optics.cells.size)
        (focal_length,) = focal_lengths(self.optics.array)
        (factor, *vertex, _), terms = self._scatter.of(i, j), np.zeros((*j.shape, DEGREES, DEGREES))
        dy, dx = np.subtract(vertex, self._scatter.aside(i, j))
        if self._scatter.warps:
            warp = self._scatter.warp(i, j)
            terms += form.matrices(warp.terms)
            terms[..., 1, 0] += warp.down * high
            terms[..., 0, 1] += warp.across * wide
        length = 2 * focal_length * factor  # a path of -((y - dy)² + (x - dx)²) over it
        terms[..., 2, 0] -= 2 / 3 * high**2 / length
        terms[..., 0, 2] -= 2 / 3 * wide**2 / length
        terms[..., 1, 0] += 2 * high * dy / length
        terms[..., 0, 1] += 2 * wide * dx / length
        terms[..., 0, 0] -= ((high**2 + wide**2) / 3 + dy**2 + dx**2) / length
        return 2 * np.pi / self.optics.camera.wavelength * terms[0]

    def _numbers(self, rows: range, columns: range) -> tuple[np.ndarray, np.ndarray]:
        """Indices on the lattice of lenslets (i, j) in cells (rows, columns)."""
        lattice, found = self.optics.array.lattice, []
        for which, mine in enumerate((rows, columns)):
            step, at = lattice.basis[1 - which][which], self._middles(which, mine)
            found.append(np.rint((at - lattice.origin[which]) / step).astype(np.int64))
        i, j = np.meshgrid(*found, indexing="ij")
        return i, j

    @property
    def _scatter(self) -> Scatter:
        scatter = self.optics.array.scatter
        assert scatter is not None  # as `relay` and `one_by_one` have it
        return scatter
