"""An operator of an object that stands on another grid than its own: moved, or sampled more finely."""

import math
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from lumigraph.core import arrays
from lumigraph.core.arrays import Array
from lumigraph.core.banded import Banded, banded
from lumigraph.core.grid import Grid
from lumigraph.core.linear import Linear, Shape
from lumigraph.errors import GeometryError
from lumigraph.operators.band import HALF_WIDTH, kernel
from lumigraph.operators.resampling import Resampling

SAME = 1e-6
"""Part of a pitch by which samples may be off and still coincide."""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Regridded(Linear):
    """An operator after a resampling of each plane of the object.

    Parameters
    ----------
    of
        The operator, which knows its grid.
    onto
        From the object's samples to those of the operator.
    placed
        Samples of the object as the operator sees them: moved where the object was.
    """

    of: Linear
    onto: Linear
    placed: Grid

    title: ClassVar[str] = "Operator of an object on another grid"

    @property
    def shape(self) -> tuple[Shape, Shape]:
        """Shapes of the raw image, and of the object."""
        raw, own = self.of.shape
        return raw, (*own[:-2], *self.onto.shape[1])

    def _forward(self, intensity: Array) -> Array:
        return self.of._forward(self._each(self.onto._forward, intensity))

    def _adjoint(self, raw: Array) -> Array:
        return self._each(self.onto._adjoint, self.of._adjoint(raw))

    def _each(self, resample, planes: Array) -> Array:
        if planes.ndim == 2:
            return resample(planes)
        parts = [resample(planes[k, ...]) for k in range(planes.shape[0])]
        return arrays.namespace(planes).stack(parts, axis=0)

    @property
    def memory_bytes(self) -> float:
        """Memory of the operator, and of a plane on the way [bytes]."""
        return self.of.memory_bytes + self.onto.memory_bytes

    @property
    def error(self) -> float:
        """Error of the operator; a resampling adds what the object has above 2/3 of its samples' limit."""
        return self.of.error


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class WideRegridded(Regridded):
    """A `Regridded` operator that can look beyond the picture, as its own can."""

    def widened(self, least: float) -> tuple[Regridded, tuple[slice, slice]]:
        """The same raw image of a larger object, and where (y, x) the operator's own stands in it."""
        wide, inside = self.of.widened(least)  # type: ignore[attr-defined]
        grid, own = self.placed, self.of.object_grid
        assert own is not None  # asked by `on_grid`
        more = [
            math.ceil(max(part.start, n - part.stop) * p / q - SAME)
            for part, n, p, q in zip(inside, wide.shape[1][-2:], own.pitch, grid.pitch, strict=True)
        ]
        ny, nx = grid.shape
        larger = Grid((ny + 2 * more[0], nx + 2 * more[1]), grid.pitch, grid.center)
        inside = slice(more[0], more[0] + ny), slice(more[1], more[1] + nx)
        if (told := self.object_grid) is not None:  # where the object was before it was moved
            told = Grid(larger.shape, told.pitch, told.center)
        return replace(on_grid(wide, larger), object_grid=told), inside


def on_grid(operator: Linear, grid: Grid) -> Regridded:
    """The operator of an object on another grid, whose samples are points of band-limited light.

    What the object has below 2/3 of the highest frequency of the operator's own samples is kept to 1e-5.
    Shifts by whole samples are exact.

    Parameters
    ----------
    operator
        One that knows its grid.
    grid
        At most as coarse.

    Raises
    ------
    GeometryError
        An operator that does not know its grid, or a coarser one.
    """
    own = operator.object_grid
    if own is None:
        raise GeometryError("the operator does not know where its object stands. Give it an object_grid.")
    if any(q > p * (1 + SAME) for p, q in zip(own.pitch, grid.pitch, strict=True)):
        raise GeometryError(
            f"the grid's pitch {grid.pitch} m is coarser than {own.pitch} m, the operator's own. "
            "Use a finer grid."
        )
    kind = WideRegridded if hasattr(operator, "widened") else Regridded
    onto = Resampling(_matrix(own, grid, 0), _matrix(own, grid, 1))
    return kind(operator, onto, grid, object_grid=grid, depths=operator.depths)


def _matrix(own: Grid, grid: Grid, axis: int) -> Banded:
    """Matrix from the grid's samples along an axis to the operator's: points of light (`represented`)."""
    pitch = own.pitch[axis]
    rows, columns = ((g.y, g.x)[axis] / pitch for g in (own, grid))
    scale = grid.pitch[axis] / pitch

    def entries(offset: np.ndarray) -> np.ndarray:
        near = np.abs(offset - np.rint(offset)) < SAME  # a sinc's zeros to the last bit
        return kernel(np.where(near, np.rint(offset), offset)) * scale

    return banded(rows, columns, entries, HALF_WIDTH)
