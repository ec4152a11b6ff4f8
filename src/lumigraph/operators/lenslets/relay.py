"""Light that is known in the lenslet plane, through the lenslets to the image: cell by cell, nothing is kept.

For what has no use for the matrices of all points of a cell: single points wherever they are, planes of
coherent light, the pupil's own light. As in `cell_response`, each lenslet is a quadrature with exact borders,
and exactly those lenslets count that exist.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Protocol, cast

import numpy as np

from lumigraph.operators.lenslets.cell_response import CellLenslets
from lumigraph.operators.lenslets.exact_lenslets import ExactLenslets, lenslets_of
from lumigraph.operators.lenslets.individual_lenslets import IndividualLenslets
from lumigraph.operators.lenslets.line_parts import Key
from lumigraph.operators.lenslets.lines import LineRelay
from lumigraph.operators.lenslets.square_changes import CellNeighbourhood, CellNumbers
from lumigraph.operators.sampling.camera import CameraOptics
from lumigraph.operators.sampling.cell_axis import INFINITE, MIDDLE, STEP, Box, CellAxis, Limits
from lumigraph.operators.sampling.optics import Optics

TOGETHER = 4
"""Cells along an axis whose points take exact lenslets' terms to be the same."""

_KEPT = 8
"""Relays at a time, of those that are sampled alike; more might fill the memory."""


class Relay(Protocol):
    """From amplitudes in the lenslet plane to amplitudes on the image, for any block of its cells."""

    optics: Optics

    def places(self, rows: range, columns: range) -> tuple[np.ndarray, np.ndarray]:
        """Where amplitudes are needed along y and along x [m], without the phase exp(iπw²/(λL))."""
        ...

    def field(self, light: np.ndarray, rows: range, columns: range) -> np.ndarray:
        """Amplitude (y, x) on the samples of the cells, of light (y, x) at those places."""
        ...


def relay(optics: Optics) -> Relay:
    """Of a camera's lenslets, in the frame that turns with them."""
    if optics.array.scatter is not None:
        return IndividualLenslets(optics)
    return SeparableRelay(optics) if optics.straight else LineRelay(optics)


@dataclass(slots=True)
class RelaySet:
    """Of depths and accuracies, computed once; those whose cells and windows are alike share their matrices.

    Parameters
    ----------
    blurred
        Distance of the plane whose points are blurred most [m]: all are sampled as it asks for. None where
        each is sampled as it asks for itself.
    """

    blurred: float | None = None
    _known: dict[tuple[float, float], Relay] = field(default_factory=dict)

    def of(self, camera: CameraOptics, dz: float, accuracy: float) -> Relay:
        """Of one camera's plane at a depth [m]."""
        if (key := (dz, accuracy)) not in self._known:
            optics = Optics.of(camera, camera.object_distance + dz, accuracy, self.blurred)
            if len(self._known) >= _KEPT and self.blurred is not None:
                self._known.pop(next(iter(self._known)))
            alike = next((one for one in self._known.values() if _alike(one.optics, optics)), None)
            self._known[key] = relay(optics) if alike is None else replace(cast(Any, alike), optics=optics)
        return self._known[key]


def _alike(one: Optics, other: Optics) -> bool:
    same = one.cells == other.cells and one.axes == other.axes
    return same and one.fineness == other.fineness and (one.straight or one.beside == other.beside)


@dataclass(slots=True)
class _Cells:
    """Cells of the image along one axis, and the light around them."""

    optics: Optics
    which: int
    axis: CellAxis = field(init=False)

    def __post_init__(self) -> None:
        self.axis = self.optics.axes[self.which]  # once: how far light goes is asked of the main lens

    def center(self, cell: int) -> float:
        """Of a cell of the image [m]; 0 is the outermost of the ring."""
        cells = self.optics.cells
        return cells.edge[self.which] + (cell - cells.ring[self.which] + 0.5) * cells.size[self.which]

    def limits(self, cell: int) -> Limits:
        """Of the lenslets' centres from the cell's; infinite where light is not followed that far."""
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
        """Of the cell of this number, among those samples."""
        start = number * self.axis.points // STEP
        return slice(start, start + len(self.axis.window))


@dataclass(slots=True)
class SeparableRelay:
    """Square lenslets, whose two axes are apart, or a sum of terms whose are; in single precision or not.

    Those of a camera that hardly differs from another are `like` its: they have numbers that can be compared.
    """

    optics: Optics
    precision: type[np.complexfloating] = np.complex64
    like: "SeparableRelay | None" = None
    _known: dict[tuple[int, Limits, float, Box], np.ndarray] = field(default_factory=dict)
    _numbers: dict[Key, CellNumbers] = field(default_factory=dict)
    _seats: dict[Key, CellNeighbourhood] = field(default_factory=dict)
    _lenslets: CellLenslets = field(init=False)
    _sides: tuple[_Cells, _Cells] = field(init=False)
    _both: bool = field(init=False)

    def __post_init__(self) -> None:
        self._lenslets = lenslets_of(self.optics)
        self._sides = _Cells(self.optics, 0), _Cells(self.optics, 1)
        (y, x), cells, lattice = self.optics.axes, self.optics.cells, self.optics.array.lattice
        pairs = (y, x), cells.edge, lattice.pitches, lattice.origin
        self._both = not self._exact and all(one == other for one, other in pairs)

    def places(self, rows: range, columns: range) -> tuple[np.ndarray, np.ndarray]:
        """As `Relay.places`."""
        return self._sides[0].places(rows), self._sides[1].places(columns)

    def field(self, light: np.ndarray, rows: range, columns: range) -> np.ndarray:
        """As `Relay.field`."""
        box = self._box(rows, columns) if self._exact else MIDDLE
        down = self.along(0, light[None], rows, box)
        return self.along(1, down.transpose(0, 2, 1), columns, box).sum(0).T

    def along(self, which: int, light: np.ndarray, cells: range, box: Box) -> np.ndarray:
        """Amplitudes (terms, samples, n) along one axis of light (1 or terms, places, n)."""
        mine = self._sides[which]
        parts = [self.matrix(which, cell, box) @ light[:, mine.window(k)] for k, cell in enumerate(cells)]
        return np.concatenate(parts, axis=1)

    def window(self, which: int, number: int) -> slice:
        """Of the cell of this number along an axis, among the places of some."""
        return self._sides[which].window(number)

    def keys(self, rows: range, columns: range) -> set[Key]:
        """Of all matrices that bring light to some cells."""
        return {key for which in (0, 1) for key in self.of_cells(which, (rows, columns))}

    def of_cells(self, which: int, cells: tuple[range, range]) -> list[Key]:
        """Of the matrices along an axis; cells beside each other have those of all around them."""
        if not self._exact:
            return [(which, cell) for cell in cells[which]]
        rows, columns = (
            range(c.start // TOGETHER * TOGETHER, -(-c.stop // TOGETHER) * TOGETHER) for c in cells
        )
        return [(which, cell, rows, columns) for cell in cells[which]]

    def piece(self, key: Key) -> np.ndarray:
        """Matrix (terms, samples, window), by axis, cell and those around it; or some `CellNumbers` of it."""
        if key[0] in CellNumbers._fields:
            name, *seat = key
            return getattr(self._numbers_of(tuple(seat)), str(name))
        which, cell, box = self._where(key)
        return self.matrix(which, cell, box)

    def matrix(self, which: int, cell: int, box: Box = MIDDLE) -> np.ndarray:
        """Amplitudes (terms, samples, window) of one cell along one axis."""
        mine = self._sides[which]
        middle, limits = mine.center(cell), mine.limits(cell)
        key = 0 if self._both else which, limits, 0.0 if box is MIDDLE else middle, box
        if key not in self._known:
            found = self._lenslets.along(which, middle, limits, key[2], box)
            self._known[key] = found.astype(self.precision)
        return self._known[key]

    def compared(self, keys: Iterable[Key]) -> set[Key]:
        """Of the numbers that matrices follow from."""
        return {(name, *self._seat(key)) for key in keys for name in CellNumbers._fields}

    def changed(self, change: Mapping[Key, np.ndarray], keys: Iterable[Key]) -> dict[Key, np.ndarray]:
        """Change of matrices with the numbers that they follow from."""
        found = {}
        for key in keys:
            seat = self._seat(key)
            by = CellNumbers(*(change[name, *seat] for name in CellNumbers._fields))
            found[key] = self._around(seat).changed(by, self._there(key))
        return found

    def back(self, slopes: Mapping[Key, np.ndarray]) -> dict[Key, np.ndarray]:
        """Slopes by the numbers, of those by matrices."""
        each: dict[Key, dict[int, np.ndarray]] = {}
        for key, by in slopes.items():
            mine = each.setdefault(self._seat(key), {})
            for k in self._there(key):
                mine[k] = mine[k] + by if k in mine else by
        back = ((seat, self._around(seat).back(mine)) for seat, mine in each.items())
        return {(name, *seat): part for seat, found in back for name, part in found._asdict().items()}

    def _numbers_of(self, seat: Key) -> CellNumbers:
        if seat not in self._numbers:
            like = (self.like or self)._around(seat)
            self._numbers[seat] = replace(self._at(seat), count=like.count).numbers(like)
        return self._numbers[seat]

    def _seat(self, key: Key) -> Key:
        """Of matrices that follow from the same numbers: those of all cells, where lenslets are paraxial."""
        return key if self._exact else (0 if self._both else key[0], 0)

    def _around(self, seat: Key) -> CellNeighbourhood:
        """As finely as it changes."""
        if seat not in self._seats:
            self._seats[seat] = self._at(seat).resolved()
        return self._seats[seat]

    def _at(self, seat: Key) -> CellNeighbourhood:
        which, cell, box = self._where(seat)
        center = self._sides[which].center(cell)
        middles = self._lenslets.middles(which, center)
        return CellNeighbourhood(
            self._lenslets, which, np.array(middles), center if self._exact else 0.0, box
        )

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
        if not wide:
            return which, cell, MIDDLE
        box, lenslets = self._box(*wide), cast(ExactLenslets, self._lenslets)
        if self.like is not None:
            lenslets.align(box, cast(ExactLenslets, self.like._lenslets), self.like._box(*wide))
        return which, cell, box

    def _box(self, rows: range, columns: range) -> Box:
        """Where cells' centres are."""
        ends = [
            (mine.center(cells[0]), mine.center(cells[-1]))
            for mine, cells in zip(self._sides, (rows, columns), strict=True)
        ]
        (top, bottom), (left, right) = ends
        return ((top + bottom) / 2, (left + right) / 2), ((bottom - top) / 2, (right - left) / 2)

    @property
    def _exact(self) -> bool:
        return self.optics.camera.model == "exact"
