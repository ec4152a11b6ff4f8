"""Band-limited pictures from one sampling to another: a banded matrix for each axis."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from lumigraph.core.arrays import Array
from lumigraph.core.banded import Banded, banded
from lumigraph.core.grid import Grid
from lumigraph.core.linear import Linear, Shape
from lumigraph.operators.band import HALF_WIDTH, integral, kernel

Part = tuple[slice, slice]
"""Rows and columns of a plane."""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Resampling(Linear):
    """Two matrices: one for the rows of a picture (y, x), one for its columns."""

    y: Banded
    x: Banded

    title: ClassVar[str] = "A picture on other samples"

    @property
    def shape(self) -> tuple[Shape, Shape]:
        """Rows of both matrices, and columns of both."""
        return (self.y.rows, self.x.rows), (self.y.columns, self.x.columns)

    def _forward(self, intensity: Array) -> Array:
        if self.y.rows * self.x.columns > self.y.columns * self.x.rows:  # what leaves less to do comes first
            return self.y.down(self.x.right(intensity))
        return self.x.right(self.y.down(intensity))

    def _adjoint(self, raw: Array) -> Array:
        if self.y.rows * self.x.columns > self.y.columns * self.x.rows:
            return self.x.left(self.y.up(raw))
        return self.y.up(self.x.left(raw))

    def of_part(self, part: Part, planes: np.ndarray) -> tuple[Part, np.ndarray]:
        """Lit part and values of planes that are dark but for a part (k, rows, columns)."""
        seen = (matrix.seeing(own) for matrix, own in zip((self.y, self.x), part, strict=True))
        (rows, down), (columns, across) = seen
        return (rows, columns), _along(down, _along(across, planes).swapaxes(1, 2)).swapaxes(1, 2)

    @property
    def memory_bytes(self) -> float:
        """Memory of the matrices and of a picture on the way [bytes]."""
        held = self.y.nbytes + self.x.nbytes
        between = min(self.y.rows * self.x.columns, self.y.columns * self.x.rows)
        return held + 4.0 * (between + self.y.rows * self.x.rows)


def represented(
    source: Grid, points: Grid, half_width: float = HALF_WIDTH, *, upright: bool = False
) -> Resampling:
    """Samples of an object as band-limited light on points; what they sum up to is kept.

    The points are turned by 180° but for those that are `upright`. The closer they stand to what the band
    asks for, the longer the kernel must be.
    """

    def matrix(axis: int) -> Banded:
        pitch = points.pitch[axis]
        at = ((points.y, points.x)[axis] if upright else _descending(points, axis)) / pitch
        samples = (source.y, source.x)[axis] / pitch
        scale = source.pitch[axis] / pitch
        return banded(at, samples, lambda d: kernel(d, half_width) * scale, half_width)

    return _on_both_axes(matrix, source, points)


def averaged(plane: Grid, pixels: Grid, fill: float = 1.0) -> Resampling:
    """Means over the areas of pixels of a band-limited plane, the pixels turned by 180°.

    What falls beside a pixel's active square, `fill` times as wide as the pixel, counts as nothing.
    """

    def matrix(axis: int) -> Banded:
        pitch, width = plane.pitch[axis], pixels.pitch[axis] / plane.pitch[axis]

        def mean(d: np.ndarray) -> np.ndarray:
            half = fill * width / 2
            return (integral(d + half) - integral(d - half)) / width

        at = -(pixels.y, pixels.x)[axis] / pitch
        return banded(at, (plane.y, plane.x)[axis] / pitch, mean, HALF_WIDTH + width / 2)

    return _on_both_axes(matrix, plane, pixels)


def _along(matrix: Banded, planes: np.ndarray) -> np.ndarray:
    """Planes (k, rows, n) to (k, rows, matrix rows)."""
    k, rows, n = planes.shape
    return matrix.right(planes.reshape(k * rows, n)).reshape(k, rows, matrix.rows)


def _on_both_axes(matrix: Callable[[int], Banded], *grids: Grid) -> Resampling:
    """The matrices of both axes; one for both where they are sampled alike."""
    y = matrix(0)
    alike = all(len({*pair}) == 1 for grid in grids for pair in (grid.shape, grid.pitch, grid.center))
    return Resampling(y, y if alike else matrix(1))


def _descending(grid: Grid, axis: int) -> np.ndarray:
    """Positions along an axis of a plane turned by 180°: from the largest down."""
    n, pitch, center = grid.shape[axis], grid.pitch[axis], grid.center[axis]
    return center - (np.arange(n) - n // 2) * pitch
