"""Light of a wide object from beyond the cells whose points have images of their own.

A main lens sends 0.2 λL/(Dr) of a point's light farther than r: of a scene that goes on beside the array
some percent come from there. Cells count as one each, as in `glare`.
"""

import math
from dataclasses import dataclass

from lumigraph.core import arrays, memory
from lumigraph.core.arrays import Array
from lumigraph.core.grid import Grid
from lumigraph.core.linear import Linear
from lumigraph.errors import SamplingError
from lumigraph.operators.cells import Cells, Offset
from lumigraph.operators.glare import Glare
from lumigraph.operators.optics import Optics
from lumigraph.operators.sizes import glare_bytes
from lumigraph.operators.tiles import as_plane, by_cell, spread

POINTS = (2, 2)
"""To a cell: the least that staggered rows have in common."""


@dataclass(frozen=True, slots=True, eq=False)
class Beyond:
    """Matrix from an object's samples to the image's cells.

    Parameters
    ----------
    spread
        Of the samples onto `POINTS` of each cell.
    glare
        Of more cells than those whose points have images of their own.
    more
        Cells (y, x) that it has more on each side.
    """

    spread: Linear
    glare: Glare
    more: Offset

    @property
    def nbytes(self) -> int:
        """Memory that it takes [bytes]."""
        return self.glare.spectra.nbytes + self.glare.pictures.nbytes

    def forward(self, plane: Array) -> Array:
        """Object (y, x) to the image's (rows, columns, samples)."""
        xp, cells = arrays.namespace(plane), self.glare.cells
        light = xp.mean(by_cell(self.spread.forward(plane), cells, POINTS, self.glare.margin[0]), axis=2)
        return self.glare.forward(self._outside(light) * math.prod(cells.points))

    def adjoint(self, image: Array) -> Array:
        """Transpose of `forward`."""
        xp = arrays.namespace(image)
        share = math.prod(self.glare.cells.points) / math.prod(POINTS)
        light = xp.expand_dims(self._outside(self.glare.adjoint(image)) * share, axis=2)
        points = xp.concat([light] * math.prod(POINTS), axis=2)
        return self.spread.adjoint(as_plane(points, self.glare.cells, POINTS, self.glare.margin[0]))

    def _outside(self, light: Array) -> Array:
        """Light of cells (rows, columns) without those whose points have images of their own."""
        xp, (y, x), (ny, nx) = arrays.namespace(light), self.more, light.shape
        inner = xp.zeros_like(light)
        inner[y : ny - y, x : nx - x] = light[y : ny - y, x : nx - x]
        return light - inner


def beyond(optics: Optics, grid: Grid, glare: Glare) -> Beyond | None:
    """Light of an object's samples beyond the cells with separate images of points; None if there is none."""
    cells, scale = optics.cells, optics.camera.separation / optics.distance
    sin, cos = abs(math.sin(optics.rotation)), abs(math.cos(optics.rotation))
    height, width = (
        scale * (size / 2 + abs(center)) for size, center in zip(grid.size, grid.center, strict=True)
    )
    y, x = (
        max(0, math.ceil(_outer(cells, k, reach) - glare.margin[k] - cells.ring[k] - 1e-6))
        for k, reach in enumerate((height * cos + width * sin, width * cos + height * sin))
    )
    if not (y or x):
        return None
    memory.require(
        glare_bytes(optics, (y, x)),
        "light from beside the array",
        "Give an object that is less wide.",
        SamplingError,
    )
    wide = glare.widened((y, x))
    ring = (cells.ring[0] + wide.margin[0], cells.ring[1] + wide.margin[1])
    return Beyond(spread(optics, grid, POINTS, ring), wide, (y, x))


def _outer(cells: Cells, axis: int, reach: float) -> float:
    """Cells outside the array, at its side that has more of them, of a plane that reaches so far [m]."""
    low, size = cells.edge[axis], cells.size[axis]
    high = low + cells.count[axis] * size
    return max(reach - high, low + reach) / size
