"""Points in space with colours."""

from dataclasses import dataclass

from lumigraph.core import checks
from lumigraph.core.arrays import Array, to_numpy
from lumigraph.core.short_repr import brief, table
from lumigraph.errors import GeometryError


@dataclass(frozen=True, slots=True, eq=False)
class PointCloud:
    """Measured points of surfaces.

    The frame is that of pictures: x to the right, y down, z away from the camera (right-handed).

    Parameters
    ----------
    points
        Positions (n, 3) as (z, y, x), in metres or another unit of length.
    colours
        (n, 3) red, green, blue: uint8, or floats from 0 to 1; None for none.
    confidence
        (n,), higher is better; None where unknown.

    Raises
    ------
    GeometryError
        Shapes that do not belong together, or positions that are not finite.
    """

    points: Array
    colours: Array | None = None
    confidence: Array | None = None

    __repr__ = brief
    _repr_html_ = table

    def __post_init__(self) -> None:
        checks.array("points", self.points)
        shape = tuple(self.points.shape)
        if len(shape) != 2 or shape[1] != 3:
            raise GeometryError(f"points have shape {shape} but must be (n, 3) as (z, y, x).")
        checks.finite_array("points", self.points, GeometryError)
        if self.colours is not None:
            _check_shape("colours", self.colours, shape)
            self._check_colours(to_numpy(self.colours))
        if self.confidence is not None:
            _check_shape("confidence", self.confidence, shape[:1])

    def __len__(self) -> int:
        return int(self.points.shape[0])

    @staticmethod
    def _check_colours(colours: Array) -> None:
        if colours.dtype.kind == "f":
            checks.finite_array("colours", colours, GeometryError)
            if colours.size and not (colours.min() >= 0 and colours.max() <= 1):
                raise GeometryError(
                    f"colours reach from {colours.min():g} to {colours.max():g} but floats must be 0 to 1. "
                    "Divide by the white, or give uint8."
                )
        elif colours.dtype.name != "uint8":
            raise GeometryError(f"colours are {colours.dtype} but must be uint8, or floats from 0 to 1.")


def _check_shape(name: str, array: Array, shape: tuple[int, ...]) -> None:
    checks.array(name, array)
    if tuple(array.shape) != shape:
        raise GeometryError(f"{name} have shape {tuple(array.shape)} but must have {shape}, as the points.")
