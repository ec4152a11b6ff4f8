"""Classes of cells with the same blocks: inside, and along each row and column of the array's border."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import NamedTuple

from lumigraph.operators.sampling import cells as _cells
from lumigraph.operators.sampling.cell_axis import INFINITE, Limits
from lumigraph.operators.sampling.optics import Optics

Turn = tuple[bool, bool, bool]
"""Mirrored across the diagonal, up and down, left and right."""


class BorderState(NamedTuple):
    """Limits of the lenslets that exist, along y and along x from a cell's centre, and the cell's kind."""

    y: Limits
    x: Limits
    kind: int = 0


INSIDE = BorderState(INFINITE, INFINITE)
"""Far from all borders, of the first kind."""


@dataclass(frozen=True, slots=True)
class BorderBand:
    """Rows or columns of cells with the same lenslets around them.

    Parameters
    ----------
    cells
        The first and the one after the last, from the outermost ring around the array.
    limits
        Of the lenslets' centres, from a cell's centre [m]; infinite where the border is far.
    ring
        Whether it is of a ring.
    """

    cells: tuple[int, int]
    limits: Limits
    ring: bool = False

    @property
    def border(self) -> float:
        """Distance of the nearest border from a cell's centre [m]."""
        return min(map(abs, self.limits))


@dataclass(frozen=True, slots=True)
class BorderClass:
    """Cells of the image with the same blocks: those of one kind, in rows of one parity.

    Parameters
    ----------
    y, x
        What is missing along y and along x.
    rows, columns
        Of the image, counted from the outermost ring around the array.
    parity
        Of the rows: 1 where they stand half a cell towards larger x.
    kind
        Of the cells.
    """

    y: BorderBand
    x: BorderBand
    rows: range
    columns: range
    parity: int = 0
    kind: int = 0

    @property
    def state(self) -> BorderState:
        """Lenslets that exist around the cells."""
        return BorderState(self.y.limits, self.x.limits, self.kind)


def bands(optics: Optics, axis: int, parity: int = 0) -> list[BorderBand]:
    """Bands along y (0) or x (1, of rows of a parity); the first is all of the array, without a border."""
    cells, extent = optics.cells, optics.array.extent
    size, n, pitch = cells.size[axis], cells.count[axis], optics.array.lattice.pitch
    first = cells.ring[axis]
    result = [BorderBand((first, first + n), INFINITE)]
    if extent is None:
        return result
    far = optics.fineness.border(_cells.fresnel_number(optics.camera), optics.blur)
    far = size / 2 + far * pitch * (1 + 1e-9) + optics.spill
    for row in range(cells.image[axis]):
        middle = cells.edge[axis] + (row - first + 0.5 + axis * parity / 2) * size
        low, high = -extent[axis] / 2 - middle, extent[axis] / 2 - middle
        ring = not first <= row < first + n
        limits = _near(low, far), _near(high, far)
        if limits == INFINITE and not ring:
            continue
        result.append(BorderBand((row, row + 1), limits, ring))
    return result


def _near(border: float, far: float) -> float:
    """A border at a distance from a cell's centre; infinite where it is far."""
    return round(border, 12) if abs(border) < far else math.copysign(math.inf, border)


def flipped(limits: Limits) -> Limits:
    """Limits as seen in a mirror."""
    return -limits[1], -limits[0]


def inside(optics: Optics) -> list[BorderClass]:
    """All cells of the array, as if it had no border."""
    y = bands(optics, 0)[0]
    return _of(optics, [(y, parity, bands(optics, 1, parity)[0]) for parity in optics.cells.parities])


def places(optics: Optics) -> list[BorderClass]:
    """Places where blocks are added: along the borders and, where both are close, in the corners."""
    along_y, parities = bands(optics, 0), optics.cells.parities
    along_x = [bands(optics, 1, parity) for parity in parities]
    edges = [(y, parity, along_x[parity][0]) for y in along_y[1:] for parity in parities]
    edges += [(along_y[0], parity, x) for parity in parities for x in along_x[parity][1:]]
    corners = [
        (y, parity, x)
        for y in along_y[1:]
        for parity in parities
        for x in along_x[parity][1:]
        if _in_corner(optics, y, x)
    ]
    return _of(optics, edges + corners)


def _in_corner(optics: Optics, y: BorderBand, x: BorderBand) -> bool:
    """True if light missing on two sides is not the sum of the light missing on each."""
    far = optics.fineness.corner(_cells.fresnel_number(optics.camera), _cells.edges(optics.array))
    # What is missing is a product of both behind square lenslets, and round about the corner behind others.
    away = y.border + x.border if optics.straight else math.hypot(y.border, x.border)
    return (y.ring and x.ring) or away < far * optics.array.lattice.pitch + optics.spill


def _of(optics: Optics, wanted: Sequence[tuple[BorderBand, int, BorderBand]]) -> list[BorderClass]:
    """Places that hold cells, kind by kind."""
    found, cells = [], optics.cells
    for y, parity, x in wanted:
        for kind in range(cells.kinds):
            rows, columns = cells.rows(*y.cells, parity), cells.columns(*x.cells, parity, kind)
            if rows and columns:
                found.append(BorderClass(y, x, rows, columns, parity, kind))
    return found


def terms(place: BorderClass) -> dict[BorderState, int]:
    """Blocks added at a place: a signed sum of those with the lenslets of a state."""
    y, x, kind = place.y, place.x, place.kind
    if INFINITE in (y.limits, x.limits):  # along a border
        without = {} if y.ring or x.ring else {BorderState(INFINITE, INFINITE, kind): -1}
        return {place.state: 1, **without}
    result = {place.state: 1}
    if not x.ring:
        result[BorderState(y.limits, INFINITE, kind)] = -1
    if not y.ring:
        result[BorderState(INFINITE, x.limits, kind)] = -1
    if not (x.ring or y.ring):
        result[BorderState(INFINITE, INFINITE, kind)] = 1
    return result


def alike(
    wanted: Sequence[BorderClass], even: tuple[bool, bool], square: bool
) -> list[tuple[BorderClass, BorderClass, Turn]]:
    """Each place, the first that it mirrors, and how: across the diagonal, up and down, left and right."""
    up, left = ((False, True) if mirrored else (False,) for mirrored in even)
    first, result = {}, []
    for place in wanted:
        for turn in product((False, True) if square else (False,), up, left):
            if (key := _turned_key(place, *turn)) in first:
                break
        else:
            turn = (False, False, False)
            first[key := _turned_key(place, *turn)] = place
        result.append((place, first[key], turn))
    return result


def _turned_key(place: BorderClass, across: bool, up: bool, left: bool) -> tuple:
    """Key of the blocks of the mirrored place."""
    y, x = (
        (flipped(band.limits) if flip else band.limits, band.ring)
        for band, flip in zip((place.y, place.x), (up, left), strict=True)
    )
    return (x, y, place.kind) if across else (y, x, place.kind)
