"""`Joint`: several raw images of one object."""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from lumigraph.core import arrays
from lumigraph.core.arrays import Array
from lumigraph.core.grid import Grid
from lumigraph.core.linear import Linear, Shape
from lumigraph.errors import GeometryError


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Joint(Linear):
    """Several raw images of one object: those of each map, pixel after pixel, in one row.

    Parameters
    ----------
    maps
        One for each raw image, of one object; raw images may have any shapes.

    Raises
    ------
    GeometryError
        No maps, or maps of objects of other shapes, other grids or other depths.
    """

    maps: tuple[Linear, ...]

    title: ClassVar[str] = "Several raw images of one object"

    def __post_init__(self) -> None:
        if not self.maps:
            raise GeometryError("there are no maps. Give one for each raw image.")
        for number, one in enumerate(self.maps):
            _check_same_object(self.maps[0], one, number)

    @property
    def shape(self) -> tuple[Shape, Shape]:
        """Pixels of all raw images together, and of the object."""
        return (sum(math.prod(one.shape[0]) for one in self.maps),), self.maps[0].shape[1]

    def parted(self, raw: Array) -> list[Array]:
        """The raw images (ny, nx) of a row of pixels."""
        xp, shapes, start, parts = arrays.namespace(raw), [one.shape[0] for one in self.maps], 0, []
        for shape in shapes:
            stop = start + math.prod(shape)
            parts.append(xp.reshape(raw[start:stop], shape))
            start = stop
        return parts

    def _forward(self, intensity: Array) -> Array:
        xp = arrays.namespace(intensity)
        return xp.concat([xp.reshape(one._forward(intensity), (-1,)) for one in self.maps])

    def _adjoint(self, raw: Array) -> Array:
        parts = zip(self.maps, self.parted(raw), strict=True)
        total: Array = 0.0
        for one, part in parts:  # one object at a time: it may be a volume
            total = total + one._adjoint(part)
        return total

    @property
    def memory_bytes(self) -> float:
        """Memory of all maps together, at most [bytes]."""
        return sum(one.memory_bytes for one in self.maps)

    @property
    def error(self) -> float:
        """Largest error of the maps, an upper bound."""
        return max(one.error for one in self.maps)


def _check_same_object(first: Linear, other: Linear, number: int) -> None:
    """Refuse two maps of objects that differ in shape, place or depths, where these are known."""
    if first.shape[1] != other.shape[1]:
        raise GeometryError(
            f"operator 0 takes objects of shape {first.shape[1]} but operator {number} of {other.shape[1]}. "
            "Give operators of one object, such as those of lumigraph.joint_operator."
        )
    mine, theirs = first.object_grid, other.object_grid
    if mine is not None and theirs is not None and not _alike(mine, theirs):
        raise GeometryError(
            f"the object of operator 0 stands on {mine} but that of operator {number} on {theirs}. "
            "Bring them onto one grid: lumigraph.joint_operator does."
        )
    if first.depths is not None and other.depths is not None and len(first.depths):
        reach = max(map(abs, first.depths)) or 1.0
        if not np.allclose(first.depths, other.depths, rtol=0, atol=1e-9 * reach):
            raise GeometryError(
                f"operator 0 takes planes at {first.depths} m but operator {number} at {other.depths} m. "
                "Give one set of depths."
            )


def _alike(one: Grid, other: Grid) -> bool:
    """True if the samples of both grids coincide to a millionth of the pitch."""
    return all(
        abs(a - b) <= 1e-6 * p
        for mine, theirs in ((one.pitch, other.pitch), (one.center, other.center))
        for a, b, p in zip(mine, theirs, one.pitch, strict=True)
    )
