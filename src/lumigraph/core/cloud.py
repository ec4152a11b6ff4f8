"""Points in space with colours, and the triangles between them."""

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
    faces
        Triangles (m, 3) of a mesh: numbers of their points, counter-clockwise as the camera sees them; None
        for points alone.

    Raises
    ------
    GeometryError
        Shapes that do not belong together, positions that are not finite, or faces without their points.
    """

    points: Array
    colours: Array | None = None
    confidence: Array | None = None
    faces: Array | None = None

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
        if self.faces is not None:
            self._check_faces(self.faces)

    def __len__(self) -> int:
        return int(self.points.shape[0])

    def _check_faces(self, given: Array) -> None:
        checks.array("faces", given)
        faces = to_numpy(given)
        if faces.ndim != 2 or faces.shape[1] != 3 or faces.dtype.kind not in "iu":
            raise GeometryError(
                f"faces are {faces.dtype} of shape {faces.shape} but must be integers (m, 3)."
            )
        if faces.size and not (faces.min() >= 0 and faces.max() < len(self)):
            raise GeometryError(
                f"faces name points {faces.min()} to {faces.max()} but there are {len(self)}, from 0 on."
            )

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
