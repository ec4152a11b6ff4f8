"""A mask in the stop of a main lens: table ``[main_lens.mask]`` of a camera file."""

from typing import Annotated, Any

from pydantic import BeforeValidator, model_validator

from lumigraph.elements import PupilMask
from lumigraph.errors import FormatError
from lumigraph.instruments.part import CameraTable


def _rows(value: Any) -> Any:
    """A table of numbers as tuples."""
    if isinstance(value, list | tuple) and all(isinstance(row, list | tuple) for row in value):
        return tuple(tuple(float(one) if isinstance(one, int) else one for one in row) for row in value)
    return value


Points = Annotated[tuple[tuple[float, ...], ...], BeforeValidator(_rows)]


class Mask(CameraTable):
    """Phase mask, coded aperture or diffuser in the main lens' stop.

    Parameters
    ----------
    phase
        Control points (n, n) of a smooth surface over the square around the stop, row by row [waves].
    open
        Control points (n, n) of the amplitude that is let through, 0 to 1.

    Examples
    --------
    >>> Mask(phase=[[0, 1], [1, 0]]).phase
    ((0.0, 1.0), (1.0, 0.0))
    """

    phase: Points | None = None
    open: Points | None = None

    @model_validator(mode="after")
    def _masks_something(self) -> "Mask":
        if self.phase is None and self.open is None:
            raise FormatError("mask is empty. Give control points of its phase, of open, or leave it out.")
        self.element(1.0)  # it refuses tables that are none
        return self

    def element(self, diameter: float) -> PupilMask:
        """The mask in a stop of a diameter [m]."""
        return PupilMask(diameter, self.phase, self.open)
