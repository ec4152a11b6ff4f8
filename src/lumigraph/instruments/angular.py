"""Angular response of pixels, as a table of a camera file."""

from pydantic import model_validator

from lumigraph.errors import GeometryError
from lumigraph.instruments.part import CameraTable
from lumigraph.instruments.quantities import Angle, Fraction, NotNegative
from lumigraph.sensor.angular import AngularResponse


class Angles(CameraTable):
    """Table ``[sensor.angular_response]``; see `lumigraph.sensor.angular.AngularResponse`.

    Angles count from the chief ray: on-chip microlenses are taken to be offset for the main lens of the
    camera, so that each pixel responds most to light from its middle.

    Parameters
    ----------
    power
        n of cos^n along each axis.
    angles, values
        Response at angles such as ["0 deg", "20 deg"], from 0 on.
    """

    power: NotNegative = 0.0
    angles: tuple[Angle, ...] = ()
    values: tuple[Fraction, ...] = ()

    @model_validator(mode="before")
    @classmethod
    def _takes_lists(cls, table: object) -> object:
        """A file has lists where a part has tuples."""
        if not isinstance(table, dict):
            return table
        return {key: tuple(value) if isinstance(value, list) else value for key, value in table.items()}

    @model_validator(mode="after")
    def _is_a_response(self) -> "Angles":
        self.response()  # it knows what tables are none
        return self

    def response(self) -> AngularResponse:
        """Angular response for the sensor."""
        return AngularResponse(self.power, self.angles, self.values)


def refuse_angles(response: Angles | None, whose: str) -> None:
    """Refuse pixels that respond to angles where these are not followed.

    Raises
    ------
    GeometryError
        They do.
    """
    if response is not None:
        raise GeometryError(
            f"sensor.angular_response is followed behind the lenslets of plenoptic cameras, not in {whose}. "
            "Leave it out."
        )


def refuse_gaps(fill_factor: float, whose: str) -> None:
    """Refuse pixels that are dark in part where they are averaged whole.

    Raises
    ------
    GeometryError
        They are.
    """
    if fill_factor < 1:
        raise GeometryError(
            f"sensor.fill_factor is {fill_factor:g} but pixels of {whose} are active all over. Leave it out."
        )
