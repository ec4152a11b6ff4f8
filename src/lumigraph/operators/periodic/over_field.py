"""Exact operators over the field: what differs from cell to cell is interpolated between nine places.

Chief rays stand oblique to lenslets beside the axis, so that a cell's response changes slowly over the array.
Each of 3 × 3 places has a periodic operator, as if all cells were there, and their raw images are weighed by
Lagrange's parabolas at each pixel's own place.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from lumigraph.core import arrays
from lumigraph.core.arrays import Array
from lumigraph.core.linear import Linear, Shape, Sum
from lumigraph.operators.lenslets.paraxial_error import NODE, half_field, weights
from lumigraph.operators.sampling import cells as _cells
from lumigraph.operators.sampling.camera import CameraOptics
from lumigraph.operators.sampling.cell_axis import Pair


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class WeightedMap(Linear):
    """A map whose raw images are multiplied by a weight for each pixel.

    Parameters
    ----------
    of
        The map.
    factors
        Two arrays that broadcast to (ny, nx), whose product is the weight.
    """

    of: Linear
    factors: tuple[np.ndarray, np.ndarray]

    title: ClassVar[str] = "Operator of a place in the field"

    @property
    def shape(self) -> tuple[Shape, Shape]:
        """Of the map."""
        return self.of.shape

    def _weighed(self, raw: Array) -> Array:
        for factor in self.factors:
            raw = raw * arrays.held(factor, raw)
        return raw

    def _forward(self, intensity: Array) -> Array:
        return self._weighed(self.of._forward(intensity))

    def _adjoint(self, raw: Array) -> Array:
        return self.of._adjoint(self._weighed(raw))

    @property
    def memory_bytes(self) -> float:
        """Of the map and the weights [bytes]."""
        return self.of.memory_bytes + sum(factor.nbytes for factor in self.factors)

    @property
    def error(self) -> float:
        """Of the map."""
        return self.of.error


def over_field(camera: CameraOptics, at: Callable[[Pair], Linear]) -> Sum:
    """The operator of all places, of operators at single ones (y, x) [m] of the straight array."""
    half = half_field(camera)
    down, across = _places(camera)
    by_row, by_column = (weights(part / half) for part in (down, across))
    nodes: Sequence[float] = (-NODE * half, 0.0, NODE * half)
    maps: list[Linear] = []
    for y, row in zip(nodes, by_row, strict=True):
        for x, column in zip(nodes, by_column, strict=True):
            of = at((y, x))
            factors = row.astype(np.float32), column.astype(np.float32)
            maps.append(WeightedMap(of, factors, object_grid=of.object_grid, depths=of.depths))
    return Sum(tuple(maps), (1.0,) * len(maps), object_grid=maps[0].object_grid, depths=maps[0].depths)


def _places(camera: CameraOptics) -> tuple[np.ndarray, np.ndarray]:
    """Where pixels look at the straight array (ny, nx), or along its axes [m]; they are turned by 180°."""
    grid, scale = camera.sensor.grid, -1 / (1 + _cells.lenslet_distance(camera) / camera.separation)
    y, x = grid.y[:, None] * scale, grid.x[None, :] * scale
    rotation = 0.0 if camera.lattice is None else camera.lattice.rotation
    if not rotation:
        return y, x
    sin, cos = math.sin(rotation), math.cos(rotation)
    return y * cos - x * sin, y * sin + x * cos
