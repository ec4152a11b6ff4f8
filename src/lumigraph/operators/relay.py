"""Light that is known in the lenslet plane, through the lenslets to the image: cell by cell, nothing is kept.

For what has no use for the matrices of all points of a cell: single points wherever they are, planes of
coherent light, the pupil's own light. As in `cell_response`, each lenslet is a quadrature with exact borders,
and exactly those lenslets count that exist.
"""

from dataclasses import dataclass, field, replace
from typing import Any, Protocol, cast

import numpy as np

from lumigraph.operators.camera import CameraOptics
from lumigraph.operators.cell_response import (
    INFINITE,
    MIDDLE,
    STEP,
    Axis,
    Box,
    Lenslets,
    Limits,
)
from lumigraph.operators.each import Each
from lumigraph.operators.exact import ExactLenslets, lenslets_of
from lumigraph.operators.line_parts import Key
from lumigraph.operators.lines import Lines
from lumigraph.operators.optics import Optics

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
        return Each(optics)
    return Straight(optics) if optics.straight else Lines(optics)


@dataclass(slots=True)
class Relays:
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
    axis: Axis = field(init=False)

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
class Straight:
    """Square lenslets, whose two axes are apart, or a sum of terms whose are; in single precision or not."""

    optics: Optics
    precision: type[np.complexfloating] = np.complex64
    _known: dict[tuple[int, Limits, float, Box], np.ndarray] = field(default_factory=dict)
    _lenslets: Lenslets = field(init=False)
    _sides: tuple[_Cells, _Cells] = field(init=False)
    _both: bool = field(init=False)

    def __post_init__(self) -> None:
        self._lenslets = lenslets_of(self.optics)
        self._sides = _Cells(self.optics, 0), _Cells(self.optics, 1)
        (y, x), cells, lattice = self.optics.axes, self.optics.cells, self.optics.array.lattice
        pairs = (y, x), cells.edge, lattice.pitches, lattice.origin
        self._both = self.optics.camera.model == "paraxial" and all(one == other for one, other in pairs)

    def places(self, rows: range, columns: range) -> tuple[np.ndarray, np.ndarray]:
        """As `Relay.places`."""
        return self._sides[0].places(rows), self._sides[1].places(columns)

    def field(self, light: np.ndarray, rows: range, columns: range) -> np.ndarray:
        """As `Relay.field`."""
        box = self.box(rows, columns) if self.optics.camera.model == "exact" else MIDDLE
        down = self.along(0, light[None], rows, box)
        return self.along(1, down.transpose(0, 2, 1), columns, box).sum(0).T

    def box(self, rows: range, columns: range) -> Box:
        """Where cells' centres are."""
        ends = [
            (mine.center(cells[0]), mine.center(cells[-1]))
            for mine, cells in zip(self._sides, (rows, columns), strict=True)
        ]
        (top, bottom), (left, right) = ends
        return ((top + bottom) / 2, (left + right) / 2), ((bottom - top) / 2, (right - left) / 2)

    def align(self, box: Box, like: "Straight", theirs: Box) -> None:
        """Take terms in a box that are as those of other exact lenslets, which hardly differ, in theirs."""
        cast(ExactLenslets, self._lenslets).align(box, cast(ExactLenslets, like._lenslets), theirs)

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
        return {(which, cell) for which, cells in enumerate((rows, columns)) for cell in cells}

    def piece(self, key: Key) -> np.ndarray:
        """A matrix (samples, window), by the axis and the cell."""
        return self.matrix(*cast(tuple[int, int], key))[0]

    def matrix(self, which: int, cell: int, box: Box = MIDDLE) -> np.ndarray:
        """Amplitudes (terms, samples, window) of one cell along one axis."""
        mine = self._sides[which]
        middle, limits = mine.center(cell), mine.limits(cell)
        key = 0 if self._both else which, limits, 0.0 if box is MIDDLE else middle, box
        if key not in self._known:
            found = self._lenslets.along(which, middle, limits, key[2], box)
            self._known[key] = found.astype(self.precision)
        return self._known[key]
