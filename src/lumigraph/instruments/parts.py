"""Parts of a camera, as the tables of a camera file: frozen, strict, no unknown keys.

Values are SI floats or text with a unit in Python; in a file, lengths carry their unit.
"""

import math
from collections.abc import Mapping
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, Field, field_validator, model_validator

from lumigraph.core.lattice import Lattice
from lumigraph.errors import FormatError, GeometryError
from lumigraph.instruments.angular import Angles
from lumigraph.instruments.over_field import OverField, given
from lumigraph.instruments.part import Part
from lumigraph.instruments.quantities import (
    Aberrations,
    Angle,
    Bits,
    Counts,
    Displacement,
    File,
    Fraction,
    Length,
    NotNegative,
    Number,
    Offset,
    OneOrThree,
    Positive,
    Seed,
    Time,
)
from lumigraph.sensor import Sensor

MOST_PIXELS = 2**28
"""Largest sensor: 268 million pixels, 1 GiB in single precision."""
MOST_LENSLETS = 2**20
"""Largest array: 1024 x 1024."""
MOST_CHANGE = 0.5
"""Of a single lenslet's focal length."""
MOST_INDEX = 4.0
"""Of lenslets: germanium's."""


class MainLens(Part):
    """The lens that forms the image: a thin lens with a round stop.

    Parameters
    ----------
    focal_length
        [m] or text such as "60 mm".
    diameter
        Of the stop; left out, it is matched to the lenslets.
    aberrations
        Zernike terms: Noll index to waves rms, of all fields.
    over_field
        Terms that change over the field besides: `OverField`, its table, or the path of a CSV file.
    prescription
        In its place, the path of a ZMX file or of Optiland's JSON: its rays tell the terms.

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
        return self

    @property
    def varies(self) -> bool:
        """Whether it changes over the field."""
        return self.over_field is not None or self.prescription is not None


class OneLenslet(Part):
    """What a lenslet has of its own, table ``[lenslets.single.N]``.

    Parameters
    ----------
    focal_change
        By what part its focal length is longer than the array's: 0.03 is 3 % longer.
    offset_y, offset_x
        Of it, aperture and all, from its place on the lattice.
    """

    focal_change: Number = 0.0
    offset_y: Displacement = 0.0
    offset_x: Displacement = 0.0

    @field_validator("focal_change")
    @classmethod
    def _is_a_part(cls, change: float) -> float:
        if not abs(change) <= MOST_CHANGE:
            raise GeometryError(f"{change:g} is beyond ±{MOST_CHANGE:g}. Give a part, such as 0.03 for 3 %.")
        return change


def _singles(value: Any) -> Any:
    """Numbers of lenslets, which a file has as text."""
    if not isinstance(value, Mapping):
        raise FormatError(f"{value!r} is not a table. Write [lenslets.single.1] above what lenslet 1 has.")
    for key in value:
        if not str(key).isdecimal() or int(key) < 1:
            raise FormatError(f"{key!r} is no number of a lenslet. Count them from 1, row by row.")
    return {int(key): one for key, one in value.items()}


Singles = Annotated[dict[int, OneLenslet], BeforeValidator(_singles)]
"""What single lenslets have, by number."""


class Lenslets(Part):
    """The lenslet array.

    Parameters
    ----------
    pitch
        Between neighbouring lenslets.
    focal_length
        One, or three for a multi-focus array in a "hex" layout; kept as a tuple.
    count
        Rows and columns (ny, nx). An odd number has a lenslet on the axis, an even one straddles it. The
        rows of a "hex" array hold nx and nx - 1 in turn, or nx each if ny is even.
    layout
        "square" or "hex".
    magnification
        Of a focused plenoptic camera, m = b/a of the first focal length: above 0 Keplerian, between -1
        and 0 Galilean.
    shape
        Of a lenslet: "square" or "hex", the lattice's cell, or "round"; left out, the cell.
    fill_factor
        Width of a lenslet over the pitch; the rest is opaque.
    rotation
        From +x towards +y [rad], or text such as "2 mrad".
    offset
        Of the lenslets from the axis (y, x), less than half a pitch.
    index
        Refractive index of the lenslets; what tilts them needs it, nothing else.
    single
        Lenslets that differ from the others, in the pupil of a Fourier microscope: `OneLenslet` by number,
        from 1 on row by row as `indices` has them.
    """

    pitch: Length
    focal_length: OneOrThree
    count: Counts
    layout: Literal["square", "hex"] = "square"
    magnification: Number | None = None
    shape: Literal["square", "hex", "round"] | None = None
    fill_factor: Fraction = 1.0
    rotation: Angle = 0.0
    offset: Offset = (0.0, 0.0)
    index: Number | None = None
    single: Singles = Field(default_factory=dict)

    @field_validator("index")
    @classmethod
    def _is_an_index(cls, index: float | None) -> float | None:
        if index is not None and not 1 < index <= MOST_INDEX:
            raise GeometryError(f"index is {index:g} but must be above 1 and at most {MOST_INDEX:g}.")
        return index

    @field_validator("count")
    @classmethod
    def _few_enough(cls, count: tuple[int, int]) -> tuple[int, int]:
        if math.prod(count) > MOST_LENSLETS:
            raise GeometryError(
                f"{count[0]} x {count[1]} lenslets are more than {MOST_LENSLETS}, the most that can be "
                "simulated. Use fewer."
            )
        return count

    @model_validator(mode="after")
    def _fits_its_layout(self) -> "Lenslets":
        if len(self.focal_length) == 3 and self.layout != "hex":
            raise GeometryError(
                "three focal lengths need layout 'hex', in which neighbours never have the same, not "
                f"{self.layout!r}. Give one focal length or change the layout."
            )
        if self.shape not in (None, "round", self.layout):
            raise GeometryError(
                f"shape {self.shape!r} does not tile layout {self.layout!r}. "
                f"Use {self.layout!r} or 'round', or leave it out."
            )
        for name, shift, slack in zip("yx", self._turned(*self.offset), self._slack, strict=True):
            if abs(shift) >= slack:
                raise GeometryError(
                    f"offset along {name} is {shift * 1e6:.6g} µm but must stay below {slack * 1e6:.6g} µm. "
                    "Give what is left after whole lenslets, or change count."
                )
        return self

    @model_validator(mode="after")
    def _singles_have_room(self) -> "Lenslets":
        if not self.single:
            return self
        count = len(self.indices())
        if (last := max(self.single)) > count:
            raise GeometryError(f"single has lenslet {last}, but there are {count}. Count them from 1.")
        width = self.pitch * self.fill_factor
        if (room := self.spacing) < width * (1 - 1e-9):
            raise GeometryError(
                f"two lenslets stand {room * 1e6:.6g} µm from each other but are {width * 1e6:.6g} µm wide. "
                "Change their offsets, or use a smaller fill_factor."
            )
        return self

    @property
    def row_pitch(self) -> float:
        """Distance between rows [m]."""
        return self.pitch * (math.sqrt(3) / 2 if self.layout == "hex" else 1.0)

    @property
    def extent(self) -> tuple[float, float]:
        """Height and width of the rectangle, turned with the array, that holds its lenslets' centres [m]."""
        ny, nx = self.count
        # Every second hexagonal row is shifted by half a pitch: the border lies between the rows' ends.
        inset = 0.5 if self.layout == "hex" and ny % 2 else 0.0
        return ny * self.row_pitch, (nx - inset) * self.pitch

    @property
    def _slack(self) -> tuple[float, float]:
        """Shift (y, x) that brings no lenslet over the border of `extent` [m]."""
        return self.row_pitch / 2, self.pitch / (4 if self.layout == "hex" else 2)

    @property
    def reach(self) -> tuple[float, float]:
        """Farthest the outermost lenslets extend from the axis (y, x) [m], turned and moved as they are."""
        sin, cos = abs(math.sin(self.rotation)), abs(math.cos(self.rotation))
        height, width = self.extent
        if self.layout == "hex":  # its cells are pointed along y, and the border lies inside the last cells
            height, width = height + 0.3 * self.pitch, width + 0.5 * self.pitch
        return (
            (height * cos + width * sin) / 2 + abs(self.offset[0]),
            (width * cos + height * sin) / 2 + abs(self.offset[1]),
        )

    def lattice(self) -> Lattice:
        """Where the lenslets stand [m]."""
        if self.layout == "hex":
            lattice = Lattice.hex(self.pitch, self.rotation, kinds=len(self.focal_length))
        else:
            lattice = Lattice.square(self.pitch, self.rotation)
        half_steps = [0.0 if n % 2 else 0.5 for n in self.count]
        dy, dx = lattice.position(np.asarray(half_steps))
        return lattice.moved(float(dy) + self.offset[0], float(dx) + self.offset[1])

    def indices(self) -> np.ndarray:
        """Index pairs (k, 2) as (i, j) of the lenslets that exist, row by row."""
        lattice, (reach_y, reach_x) = self.lattice(), self.reach
        pairs = lattice.indices((-reach_y, reach_y), (-reach_x, reach_x))
        return pairs[self.holds(lattice.position(pairs))]

    def holds(self, centers: np.ndarray) -> np.ndarray:
        """Whether the array has lenslets at centres (k, 2) of the lattice: (k,)."""
        across, along = self._turned(*centers.T)
        height, width = self.extent
        return (np.abs(across) <= height / 2) & (np.abs(along) <= width / 2)

    def __hash__(self) -> int:
        """Of what all lenslets have: numbers by which some differ stand in a dict, which has no hash."""
        return hash((self.pitch, self.focal_length, self.count, self.layout, self.rotation, self.offset))

    def each(self) -> tuple[np.ndarray, np.ndarray]:
        """Centres (k, 2) as (y, x) and focal lengths (k,) [m] of the lenslets of one kind, as `indices`."""
        centers = self.lattice().position(self.indices())
        focal_lengths = np.full(len(centers), self.focal_length[0])
        for number, own in self.single.items():
            centers[number - 1] += own.offset_y, own.offset_x
            focal_lengths[number - 1] *= 1 + own.focal_change
        return centers, focal_lengths

    @property
    def spacing(self) -> float:
        """How wide lenslets may be before two overlap, at most the pitch [m]."""
        if not self.single:
            return self.pitch
        along = np.stack(self._turned(*self.each()[0].T), -1)
        apart = np.abs(along[:, None] - along).max(-1)
        np.fill_diagonal(apart, np.inf)
        return float(min(apart.min(), self.pitch))

    def _turned(self, y: Any, x: Any) -> tuple[Any, Any]:
        """Coordinates (y, x) in the frame that turns with the array."""
        sin, cos = math.sin(self.rotation), math.cos(self.rotation)
        return y * cos - x * sin, y * sin + x * cos


class Pixels(Part):
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
        Of the readout.
    quantum_efficiency, dark_current, exposure_time, black_level, prnu, dsnu, pattern_seed
        As for `Sensor`; left out, an ideal one. The time is text such as "10 ms", or [s].
    fill_factor
        Width of a pixel's active square over the pitch.
    angular_response
        By the angle from the chief ray: `Angles`, behind lenslets of cameras only.
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


def check_pixels(shape: tuple[int, int]) -> None:
    """Refuse a sensor that no computer would simulate."""
    if math.prod(shape) > MOST_PIXELS:
        raise GeometryError(
            f"{shape[0]} x {shape[1]} = {math.prod(shape):.3g} pixels are more than the {MOST_PIXELS:.3g} "
            "that can be simulated. Use fewer or larger pixels."
        )
