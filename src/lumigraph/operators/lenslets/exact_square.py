r"""Square lenslets beyond the paraxial: matrices of each cell, sums of terms, as they follow from a camera.

A matrix is a sum over lenslets l and their nodes w, of light u there,

.. math:: M = \sum_l \sum_w g_w \, B_l(s, w) \, e^{i \varphi_l(s, w)} \, u_l(w)

with weights g. Seen in cells, nodes and light stay where they are from one camera to another close by, while
phases φ and what is beside them, B, change by what is smooth over a cell and a lenslet: by their values at
few places of both. Where lenslets become wider, the light at their edges comes in.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple, cast

import numpy as np

from lumigraph.operators.lenslets.array_libraries import NUMPY, Array, ArrayLibrary, Numbers
from lumigraph.operators.lenslets.cell_response import LensletNodes
from lumigraph.operators.lenslets.exact_lenslets import ExactLenslets, between, interpolated, lenslets_of
from lumigraph.operators.lenslets.square import Key, Ways
from lumigraph.operators.sampling.cell_axis import INFINITE, STEP, Box, CellAxis, Limits
from lumigraph.operators.sampling.optics import Optics

TOGETHER = 4
"""Cells along an axis whose points take exact lenslets' terms to be the same."""

FEWEST = 8
"""Places along a cell, and along a lenslet, that changes follow from at least."""

TAIL = 3e-3
"""Coefficient of the last polynomial that such places hold, of what matrices are at most.

Behind lenslets of f/10 changes by the wavelength are 4e-6 off with 5e-2, 1e-7 with 6e-4; of f/4, 2e-3 with
5e-2, 8e-7 with 4e-3.
"""


class CellNumbers(NamedTuple):
    """Numbers that the matrices of a cell follow from, as far as cameras close by differ by them.

    Parameters
    ----------
    phase
        (lenslets, places along the cell, places along a lenslet) [rad].
    beside
        (lenslets, terms, places along the cell, places along a lenslet), for nodes of the camera's own cell.
    half
        (1,), of a lenslet's side, in a cell as large as the camera's own [m].
    """

    phase: np.ndarray
    beside: np.ndarray
    half: np.ndarray


@dataclass(frozen=True, slots=True, eq=False)
class CellSurroundings:
    """A cell along an axis, and lenslets that send light to it.

    Parameters
    ----------
    lenslets, which
        What they do to light, and the axis.
    middles
        Of the lenslets, from the cell's centre [m].
    place, box
        As of `Lenslets.along`.
    count
        Places along the cell and along each lenslet that changes follow from.
    """

    lenslets: ExactLenslets
    which: int
    middles: np.ndarray
    place: float
    box: Box
    count: int = FEWEST

    def resolved(self) -> "CellSurroundings":
        """The same with as many places as tell what the matrices are."""
        to, beside = interpolated(self.count)[1], self.numbers(self).beside
        found = np.abs(to @ beside @ to.T)
        tail = max(found[..., -1, :].max(), found[..., -1].max())
        if tail <= TAIL * np.abs(beside).max() or self.count >= self.lenslets.axes[self.which].samples:
            return self
        return replace(self, count=self.count * 4 // 3).resolved()

    def numbers(self, like: "CellSurroundings") -> CellNumbers:
        """Numbers at places of the cell of another camera that hardly differs."""
        (nodes, _), size = interpolated(self.count), self.lenslets.axes[self.which].size
        larger, half = size / like.lenslets.axes[self.which].size, self.lenslets.half(self.which)
        off = larger * like.lenslets.half(self.which) * nodes
        places = size / 2 * nodes[:, None], larger * like.middles[:, None, None] + off, off
        phase, beside = self.lenslets.kernel(self.which, places, self.place, self.box)
        beside = np.broadcast_to(larger * beside, (len(beside), *phase.shape)).swapaxes(0, 1).astype(complex)
        return CellNumbers(phase, beside, np.array([half / larger]))

    def matrix(self, xp: ArrayLibrary, by: Any, own: CellNumbers, there: Iterable[int]) -> Array:
        """Matrix (terms, samples, window) of lenslets that are there, by a camera's numbers."""
        down, across = (xp.asarray(one + 0j) for one in self._smooth)
        found = 0.0
        for k in there:
            one, turn, beside = self._light(k)
            turn, beside, plain = xp.asarray(turn), xp.asarray(beside), xp.asarray(one.weight)
            phase = (by.phase[k] - xp.asarray(own.phase[k])) + 0j
            more = by.beside[k] - xp.asarray(own.beside[k])
            turn = turn * xp.exp(1j * (down @ phase @ across.T))
            wider = xp.asarray(np.concatenate([np.zeros(len(one.weight) - 2), one.edge]))
            weight = plain + (by.half - xp.asarray(own.half)) * wider
            found = found + ((beside + down @ more @ across.T) * (turn * weight)) @ xp.asarray(one.light + 0j)
        return found @ xp.asarray(self.lenslets.coefficients[self.which] + 0j)

    def _light(self, k: int) -> tuple[LensletNodes, np.ndarray, np.ndarray]:
        """Nodes of a lenslet, what light turns by there, and B (terms, samples, nodes)."""
        axis, middle = self.lenslets.axes[self.which], float(self.middles[k])
        one = self.lenslets.on_nodes(self.which, middle)
        places = axis.image[:, None], middle + one.off, one.off
        phase, beside = self.lenslets.kernel(self.which, places, self.place, self.box)
        return one, np.exp(1j * phase), beside

    @property
    def _smooth(self) -> tuple[np.ndarray, np.ndarray]:
        """Matrices from numbers to the samples of the cell and to the nodes of a lenslet."""
        axis, one = self.lenslets.axes[self.which], self.lenslets.on_nodes(self.which, float(self.middles[0]))
        down = between(2 / axis.size * axis.image, self.count)
        return down, between(one.off / self.lenslets.half(self.which), self.count)


@dataclass(slots=True)
class _Side:
    """Cells of the image along one axis, and the light around them."""

    optics: Optics
    which: int
    axis: CellAxis = field(init=False)

    def __post_init__(self) -> None:
        self.axis = self.optics.axes[self.which]  # once: how far light goes is asked of the main lens

    def center(self, cell: int) -> float:
        """Centre of a cell of the image [m]; 0 is the outermost of the ring."""
        cells = self.optics.cells
        return cells.edge[self.which] + (cell - cells.ring[self.which] + 0.5) * cells.size[self.which]

    def limits(self, cell: int) -> Limits:
        """Limits of the lenslets' centres from the cell's; infinite where light is not followed that far."""
        extent, axis = self.optics.array.extent, self.axis
        if extent is None:
            return INFINITE
        reach, middle = axis.size / 2 + axis.neighbourhood, self.center(cell)
        low, high = (round(side * extent[self.which] / 2 - middle, 12) for side in (-1, 1))
        return low if low > -reach else INFINITE[0], high if high < reach else INFINITE[1]

    def places(self, cells: range) -> np.ndarray:
        """Samples of light that hold the windows of all cells."""
        first, axis = self.axis.window, self.axis
        count = len(first) + (len(cells) - 1) * axis.points // STEP
        return self.center(cells[0]) + first[0] + np.arange(count) * (first[1] - first[0])

    def window(self, number: int) -> slice:
        """Window of the cell of this number, among those samples."""
        start = number * self.axis.points // STEP
        return slice(start, start + len(self.axis.window))


@dataclass(eq=False)
class ExactSquareLenslets:
    """Square lenslets beyond the paraxial: light in their plane to light on the image, a sum of terms.

    Those of a camera that hardly differs from another are `like` its: they have numbers that can be compared.
    """

    optics: Optics
    precision: type[np.complexfloating] = np.complex64
    like: "ExactSquareLenslets | None" = None
    _prepared: dict[Key, np.ndarray] = field(default_factory=dict)
    _known: dict[Key, CellNumbers] = field(default_factory=dict)
    _seats: dict[Key, CellSurroundings] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._lenslets = cast(ExactLenslets, lenslets_of(self.optics))
        self._sides = _Side(self.optics, 0), _Side(self.optics, 1)

    def places(self, rows: range, columns: range) -> tuple[np.ndarray, np.ndarray]:
        """Places of light along y and x that the samples of some cells need [m]."""
        return self._sides[0].places(rows), self._sides[1].places(columns)

    def field(self, light: np.ndarray, rows: range, columns: range) -> np.ndarray:
        """Amplitude (y, x) on the samples of the cells, of light (y, x) at those places."""
        cells, light = (rows, columns), light.astype(self.precision)
        matrices = {
            (which, number): self._matrix(which, cell, self._box(rows, columns))
            for which, mine in enumerate(cells)
            for number, cell in enumerate(mine)
        }
        return self._through(NUMPY, lambda which, number: matrices[which, number], light, cells)

    def lit(self, light: np.ndarray, cells: Ways) -> Any:
        """Choice of lenslets that are not dark: all of these."""
        return None

    def keys(self, cells: Ways) -> list[Key]:
        """Names of the matrices of some cells; those beside each other have the terms of all around them."""
        return [key for which in (0, 1) for key in self._keys_along(which, cells)]

    def grouped(self, keys: Iterable[Key]) -> list[list[Key]]:
        """Matrices that are followed back together: each alone."""
        return [[key] for key in keys]

    def numbers(self, keys: Iterable[Key]) -> dict[Key, np.ndarray]:
        """Numbers of the camera that some matrices follow from."""
        return {(name, *key): self.number((name, *key)) for key in keys for name in CellNumbers._fields}

    def number(self, key: Key) -> np.ndarray:
        """One of them."""
        name, *seat = key
        own = tuple(seat)
        if own not in self._known:
            like = (self.like or self)._around(own)
            self._known[own] = replace(self._at(own), count=like.count).numbers(like)
        return getattr(self._known[own], name)

    def prepare(self, xp: ArrayLibrary, numbers: Numbers, keys: Iterable[Key]) -> dict[Key, Array]:
        """Matrices (terms, samples, window) of cells, of a camera's numbers."""
        found = {}
        for key in keys:
            by = CellNumbers(*(numbers[name, *key] for name in CellNumbers._fields))
            own = CellNumbers(*(self.number((name, *key)) for name in CellNumbers._fields))
            found[key] = self._around(key).matrix(xp, by, own, self._there(key))
        return found

    def prepared(self, keys: Iterable[Key]) -> dict[Key, np.ndarray]:
        """Matrices of the camera itself, computed once."""
        found = {}
        for key in keys:
            if key not in self._prepared:
                which, cell, box = self._where(key)
                self._prepared[key] = self._matrix(which, cell, box)
            found[key] = self._prepared[key]
        return found

    def amplitude(self, xp: ArrayLibrary, prepared: Numbers, light: Array, cells: Ways, lit: Any) -> Array:
        """Amplitude (..., y, x) on the samples of cells, of light (..., y, x) in the lenslet plane."""
        keys = [self._keys_along(which, cells) for which in (0, 1)]
        return self._through(xp, lambda which, number: prepared[keys[which][number]], light, cells)

    def _through(self, xp: ArrayLibrary, matrix: Any, light: Array, cells: Ways) -> Array:
        """Amplitudes by a product along y, then along x, summed over terms."""
        down = self._along(xp, matrix, 0, light[..., None, :, :], cells)
        across = self._along(xp, matrix, 1, down.swapaxes(-1, -2), cells)
        return xp.sum(across, -3).swapaxes(-1, -2)

    def _along(self, xp: ArrayLibrary, matrix: Any, which: int, light: Array, cells: Ways) -> Array:
        """Amplitudes (..., terms, samples, n) along one axis of light (..., 1 or terms, places, n)."""
        side = self._sides[which]
        parts = [
            matrix(which, number) @ xp.part(light, (window := side.window(number)).start, window.stop, -2)
            for number in range(len(cells[which]))
        ]
        return xp.concatenate(parts, -2)

    def _keys_along(self, which: int, cells: Ways) -> list[Key]:
        rows, columns = (
            range(c.start // TOGETHER * TOGETHER, -(-c.stop // TOGETHER) * TOGETHER) for c in cells
        )
        return [(which, cell, rows, columns) for cell in cells[which]]

    def _matrix(self, which: int, cell: int, box: Box) -> np.ndarray:
        """Amplitudes (terms, samples, window) of one cell along one axis."""
        key = "matrix", which, cell, box
        if key not in self._prepared:
            mine = self._sides[which]
            middle = mine.center(cell)
            found = self._lenslets.along(which, middle, mine.limits(cell), middle, box)
            self._prepared[key] = found.astype(self.precision)
        return self._prepared[key]

    def _around(self, seat: Key) -> CellSurroundings:
        """A cell and its lenslets, as finely as their matrix changes."""
        if seat not in self._seats:
            self._seats[seat] = self._at(seat).resolved()
        return self._seats[seat]

    def _at(self, seat: Key) -> CellSurroundings:
        which, cell, box = self._where(seat)
        center = self._sides[which].center(cell)
        middles = self._lenslets.middles(which, center)
        return CellSurroundings(self._lenslets, which, np.array(middles), center, box)

    def _there(self, key: Key) -> list[int]:
        """Numbers of lenslets that send light to a cell, of those around it."""
        which, cell, _ = self._where(key)
        mine, middles = self._sides[which], self._lenslets.middles
        first = middles(which, mine.center(cell))[0]
        there = middles(which, mine.center(cell), mine.limits(cell))
        return [round((middle - first) / mine.axis.size) for middle in there]

    def _where(self, key: Key) -> tuple[int, int, Box]:
        """Axis, cell, and where cells around it are: terms there are as those of the other camera."""
        which, cell, *wide = cast(tuple[Any, ...], key)
        box = self._box(*wide)
        if self.like is not None:
            self._lenslets.align(box, self.like._lenslets, self.like._box(*wide))
        return which, cell, box

    def _box(self, rows: range, columns: range) -> Box:
        """Middle and half extent of the cells' centres, along y and x [m]."""
        ends = [
            (mine.center(cells[0]), mine.center(cells[-1]))
            for mine, cells in zip(self._sides, (rows, columns), strict=True)
        ]
        (top, bottom), (left, right) = ends
        return ((top + bottom) / 2, (left + right) / 2), ((bottom - top) / 2, (right - left) / 2)
