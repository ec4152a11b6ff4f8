"""Band-limited pictures from one sampling to another: a banded matrix for each axis."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from lumigraph.core import arrays
from lumigraph.core.arrays import Array
from lumigraph.core.grid import Grid
from lumigraph.operators.band import HALF_WIDTH, integral, kernel

_ROWS = 64
"""Of a block."""


@dataclass(frozen=True, slots=True, eq=False)
class Banded:
    """Matrix (rows, columns) of blocks of rows that see few columns each.

    Parameters
    ----------
    columns
        Their number.
    blocks
        (first column, matrix), row after row.
    """

    columns: int
    blocks: tuple[tuple[int, np.ndarray], ...]

    def forward(self, plane: Array) -> Array:
        """``matrix @ plane``: (columns, n) to (rows, n)."""
        xp, row = arrays.namespace(plane), 0
        rows = sum(m.shape[0] for _, m in self.blocks)
        result = xp.empty((rows, plane.shape[1]), dtype=plane.dtype, device=plane.device)
        for first, m in self.blocks:
            result[row : row + m.shape[0], :] = arrays.like(m, plane) @ plane[first : first + m.shape[1], :]
            row += m.shape[0]
        return result

    def adjoint(self, plane: Array) -> Array:
        """``matrix.T @ plane``: (rows, n) to (columns, n)."""
        xp = arrays.namespace(plane)
        result = xp.zeros((self.columns, plane.shape[1]), dtype=plane.dtype, device=plane.device)
        row = 0
        for first, m in self.blocks:
            part = xp.matrix_transpose(arrays.like(m, plane)) @ plane[row : row + m.shape[0], :]
            result[first : first + m.shape[1], :] += part
            row += m.shape[0]
        return result

    def across(self, plane: Array) -> Array:
        """``plane @ matrix.T``: (n, columns) to (n, rows)."""
        xp, row = arrays.namespace(plane), 0
        rows = sum(m.shape[0] for _, m in self.blocks)
        result = xp.empty((plane.shape[0], rows), dtype=plane.dtype, device=plane.device)
        for first, m in self.blocks:
            turned = xp.matrix_transpose(arrays.like(m, plane))
            result[:, row : row + m.shape[0]] = plane[:, first : first + m.shape[1]] @ turned
            row += m.shape[0]
        return result

    def across_adjoint(self, plane: Array) -> Array:
        """``plane @ matrix``: (n, rows) to (n, columns)."""
        xp, row = arrays.namespace(plane), 0
        result = xp.zeros((plane.shape[0], self.columns), dtype=plane.dtype, device=plane.device)
        for first, m in self.blocks:
            part = plane[:, row : row + m.shape[0]] @ arrays.like(m, plane)
            result[:, first : first + m.shape[1]] += part
            row += m.shape[0]
        return result


@dataclass(frozen=True, slots=True, eq=False)
class Resampling:
    """Two matrices: one for the rows of a picture (y, x), one for its columns."""

    y: Banded
    x: Banded

    def forward(self, plane: Array) -> Array:
        """(y, x) to (rows of `y`, rows of `x`)."""
        return self.x.across(self.y.forward(plane))

    def adjoint(self, plane: Array) -> Array:
        """The transpose of `forward`."""
        return self.y.adjoint(self.x.across_adjoint(plane))


def represented(source: Grid, points: Grid) -> Resampling:
    """Samples of an object as band-limited light on points turned by 180°; what they sum up to is kept."""
    matrices = []
    for axis in (0, 1):
        pitch = points.pitch[axis]
        at = _descending(points, axis) / pitch
        samples = (source.y, source.x)[axis] / pitch
        scale = source.pitch[axis] / pitch
        matrices.append(banded(at, samples, lambda d, s=scale: kernel(d) * s, HALF_WIDTH))
    return Resampling(matrices[0], matrices[1])


def averaged(plane: Grid, pixels: Grid) -> Resampling:
    """Means over the areas of pixels of a band-limited plane, the pixels turned by 180°."""
    matrices = []
    for axis in (0, 1):
        pitch, width = plane.pitch[axis], pixels.pitch[axis] / plane.pitch[axis]

        def mean(d: np.ndarray, width: float = width) -> np.ndarray:
            return (integral(d + width / 2) - integral(d - width / 2)) / width

        at = -(pixels.y, pixels.x)[axis] / pitch
        matrices.append(banded(at, (plane.y, plane.x)[axis] / pitch, mean, HALF_WIDTH + width / 2))
    return Resampling(matrices[0], matrices[1])


def banded(
    rows: np.ndarray, columns: np.ndarray, entries: Callable[[np.ndarray], np.ndarray], reach: float
) -> Banded:
    """Matrix ``entries(row - column)`` of sorted positions; farther apart than `reach` it is zero."""
    blocks = []
    for start in range(0, len(rows), _ROWS):
        mine = rows[start : start + _ROWS]
        first = int(np.searchsorted(columns, mine.min() - reach, "left"))
        last = int(np.searchsorted(columns, mine.max() + reach, "right"))
        offsets = mine[:, None] - columns[first:last]
        blocks.append((first, np.asarray(entries(offsets)).reshape(len(mine), last - first)))
    return Banded(len(columns), tuple(blocks))


def _descending(grid: Grid, axis: int) -> np.ndarray:
    """Positions along an axis of a plane turned by 180°: from the largest down."""
    n, pitch, center = grid.shape[axis], grid.pitch[axis], grid.center[axis]
    return center - (np.arange(n) - n // 2) * pitch
