"""Parts of a camera, as the tables of a camera file: frozen, strict, no unknown keys.

Values are SI floats or text with a unit in Python; in a file, lengths carry their unit.
"""

import math
from typing import Annotated, Any

from pydantic import BeforeValidator, Field, field_validator, model_validator

from lumigraph.errors import FormatError, GeometryError
from lumigraph.instruments.angular import Angles
from lumigraph.instruments.mask import Mask
from lumigraph.instruments.over_field import OverField, given
from lumigraph.instruments.part import CameraTable
from lumigraph.instruments.quantities import (
    Aberrations,
    Bits,
    Counts,
    File,
    Fraction,
    Length,
    NotNegative,
    Positive,
    Seed,
    Time,
)
from lumigraph.sensor import Sensor

MOST_PIXELS = 2**28
"""Largest sensor: 268 million pixels, 1 GiB in single precision."""


class MainLens(CameraTable):
    """The lens that forms the image: a thin lens with a round stop.

    Parameters
    ----------
    focal_length
        [m] or text such as "60 mm".
    diameter
        Diameter of the stop; left out, it is matched to the lenslets.
    aberrations
        Zernike terms: Noll index to waves rms, of all fields.
    over_field
        Terms that change over the field besides: `OverField`, its table, or the path of a CSV file.
    prescription
        Path of a ZMX file or of Optiland's JSON, in place of terms, which follow from its rays.
    mask
        Phase mask, coded aperture or diffuser in the stop: `Mask` or its table.

    Examples
    --------
    >>> MainLens(focal_length="60 mm").focal_length
    0.06
    """

    focal_length: Length
    diameter: Length | None = None
    aberrations: Aberrations = Field(default_factory=dict)
    over_field: Annotated[OverField | None, BeforeValidator(given)] = None
    prescription: File | None = None
    mask: Mask | None = None

    @model_validator(mode="before")
    @classmethod
    def _has_a_focal_length(cls, table: Any) -> Any:
        if isinstance(table, dict) and "prescription" in table and "focal_length" not in table:
            raise FormatError(
                "focal_length is missing beside prescription. Write the lens' own at the camera's "
                'wavelength, such as "50 mm": where another one is written, the error names the right one.'
            )
        return table

    @model_validator(mode="after")
    def _has_one_source(self) -> "MainLens":
        if self.over_field is not None and self.prescription is not None:
            raise FormatError("over_field and prescription both give terms over the field. Leave one out.")
        if self.mask is not None and self.varies:
            raise FormatError("mask stands in a lens that changes over the field. Leave one of them out.")
        return self

    @property
    def varies(self) -> bool:
        """True if the lens changes over the field."""
        return self.over_field is not None or self.prescription is not None


class Pixels(CameraTable):
    """The sensor's pixels, table ``[sensor]``.

    Parameters
    ----------
    pixel_pitch
        [m] or text such as "5 um".
    shape
        Rows and columns; left out, all micro-images fit.
    full_well
        Electrons of a full pixel.
    read_noise
        Electrons rms.
    bits
        Number of bits of the readout.
    quantum_efficiency, dark_current, exposure_time, black_level, prnu, dsnu, pattern_seed
        As for `Sensor`; left out, an ideal one. The time is text such as "10 ms", or [s].
    fill_factor
        Width of a pixel's active square over the pitch.
    angular_response
        Response by the angle from the chief ray: `Angles`, behind lenslets of cameras only.
    """

    pixel_pitch: Length
    shape: Counts | None = None
    full_well: Positive = 10000.0
    read_noise: NotNegative = 5.0
    bits: Bits = 12
    quantum_efficiency: Fraction = 1.0
    dark_current: NotNegative = 0.0
    exposure_time: Time = 0.0
    black_level: NotNegative = 0.0
    prnu: NotNegative = 0.0
    dsnu: NotNegative = 0.0
    pattern_seed: Seed = 0
    fill_factor: Fraction = 1.0
    angular_response: Angles | None = None

    @field_validator("shape")
    @classmethod
    def _few_enough(cls, shape: tuple[int, int] | None) -> tuple[int, int] | None:
        if shape is not None:
            check_pixels(shape)
        return shape

    @model_validator(mode="after")
    def _level_below_the_highest(self) -> "Pixels":
        self.sensor((1, 1))  # it knows what black levels its bits leave
        return self

    def sensor(self, shape: tuple[int, int]) -> Sensor:
        """These pixels, so many of them."""
        check_pixels(shape)
        given: dict[str, Any] = {
            name: getattr(self, name) for name in type(self).model_fields if name != "shape"
        }
        angles = self.angular_response
        given["angular_response"] = None if angles is None else angles.response()
        return Sensor(shape, **given)


def check_pixels(shape: tuple[int, int], cause: str = "") -> None:
    """Refuse a sensor that no computer would simulate; `cause` names the keys that it follows from."""
    if math.prod(shape) > MOST_PIXELS:
        raise GeometryError(
            f"{shape[0]} x {shape[1]} = {math.prod(shape):.3g} pixels are more than the {MOST_PIXELS:.3g} "
            f"that can be simulated. {cause or 'Use fewer or larger pixels.'}"
        )
