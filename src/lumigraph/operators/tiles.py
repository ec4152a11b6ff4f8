"""Planes of objects and images on the cells of a lenslet array, and how they come there."""

import math
from collections.abc import Iterator, Sequence

from lumigraph.core import arrays
from lumigraph.core.arrays import Array
from lumigraph.core.grid import Grid
from lumigraph.core.linear import Linear
from lumigraph.operators.cells import HALF_WIDTH, Cells, Offset
from lumigraph.operators.optics import Optics
from lumigraph.operators.resampling import averaged, represented
from lumigraph.operators.turning import Crop, Turn, turn_margin


def spread(optics: Optics, grid: Grid, points: Offset, ring: Offset) -> Linear:
    """Map from an object's samples to so many points of each cell, in a ring around the turned array."""
    cells, scale = optics.cells, -optics.distance / optics.camera.separation
    if not optics.rotation:
        return represented(grid, cells.grid(points, scale, ring), HALF_WIDTH)
    wide = _widened(cells.grid(points, 1.0, ring), optics)
    turn = Turn(cells.grid(points, 1.0, wide), optics.rotation)
    onto = represented(grid, cells.grid(points, scale, wide), HALF_WIDTH)
    return _cropped(turn.grid, wide, ring, points) @ turn @ onto


def readout(optics: Optics) -> Linear:
    """Means over the pixels of the image's samples, turned back."""
    cells, sensor = optics.cells, optics.camera.sensor
    if not optics.rotation:
        return averaged(
            cells.grid(cells.samples, optics.image_scale, cells.ring), sensor.grid, sensor.fill_factor
        )
    wide = _widened(cells.grid(cells.samples, 1.0, cells.ring), optics)
    turn = Turn(cells.grid(cells.samples, 1.0, wide), -optics.rotation)
    mean = averaged(cells.grid(cells.samples, optics.image_scale, wide), sensor.grid, sensor.fill_factor)
    return mean @ turn @ _cropped(turn.grid, wide, cells.ring, cells.samples).T


def _cropped(plane: Grid, wide: Offset, ring: Offset, per_cell: Offset) -> Crop:
    """Map from cells in a wide ring to those in a narrower one."""
    y, x = ((w - r) * n for w, r, n in zip(wide, ring, per_cell, strict=True))
    return Crop(plane.shape, (y, x))


def _widened(grid: Grid, optics: Optics) -> tuple[int, int]:
    """Cells around the array that hold the grid's plane when it is turned."""
    size, cells = grid.size, optics.cells
    extra = turn_margin((size[0], size[1]), optics.rotation)
    wide = []
    for k in (0, 1):
        ring = (grid.size[k] / cells.size[k] - cells.count[k]) / 2
        wide.append(math.ceil(ring + extra[k] / cells.size[k]))
    return wide[0], wide[1]


def by_cell(plane: Array, cells: Cells, per_cell: tuple[int, int], margin: int = 0) -> Array:
    """(rows ky, columns kx) to (rows, columns, ky kx); there are `margin` more rows beyond the image's."""
    step = cells.step(per_cell)
    if not step:
        tiles = arrays.tiled(plane, per_cell)
        return arrays.namespace(plane).reshape(tiles, (*tiles.shape[:2], math.prod(per_cell)))
    xp, (rows, columns) = arrays.namespace(plane), _inside(plane.shape, per_cell)
    found = xp.zeros((rows, columns, math.prod(per_cell)), dtype=plane.dtype, device=arrays.device(plane))
    lines = xp.reshape(plane, (rows, per_cell[0], plane.shape[1]))
    for mine, across in _staggered(cells, columns * per_cell[1], step, margin):
        tiles = xp.reshape(lines[mine, :, across], (-1, per_cell[0], columns, per_cell[1]))
        tiles = xp.permute_dims(tiles, (0, 2, 1, 3))
        found[mine, :, :] = xp.reshape(tiles, (*tiles.shape[:2], math.prod(per_cell)))
    return found


def as_plane(image: Array, cells: Cells, per_cell: tuple[int, int], margin: int = 0) -> Array:
    """(rows, columns, ky kx) to (rows ky, columns kx): the transpose of `by_cell`."""
    xp, (rows, columns, _), step = arrays.namespace(image), image.shape, cells.step(per_cell)
    if not step:
        return arrays.untiled(xp.reshape(image, (rows, columns, *per_cell)))
    width = columns * per_cell[1]
    lines = xp.zeros((rows, per_cell[0], width + step), dtype=image.dtype, device=arrays.device(image))
    for mine, across in _staggered(cells, width, step, margin):
        tiles = xp.reshape(image[mine, :, :], (-1, columns, *per_cell))
        lines[mine, :, across] = xp.reshape(xp.permute_dims(tiles, (0, 2, 1, 3)), (-1, per_cell[0], width))
    return xp.reshape(lines, (rows * per_cell[0], width + step))


def _inside(shape: Sequence[int], per_cell: tuple[int, int]) -> tuple[int, int]:
    """Whole cells in a plane of so many samples."""
    return shape[0] // per_cell[0], shape[1] // per_cell[1]


def _staggered(cells: Cells, width: int, step: int, margin: int) -> Iterator[tuple[slice, slice]]:
    """Rows of a parity, and the samples of a line that lie in their cells."""
    for parity in cells.parities:
        across = slice(parity * step, parity * step + width)
        yield slice((cells.ring[0] + margin + parity) % 2, None, 2), across
