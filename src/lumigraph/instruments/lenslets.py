"""The lenslet array, as the table of a camera file."""

import math
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, Field, field_validator, model_validator

from lumigraph.core.lattice import Lattice
from lumigraph.core.lattice_offsets import LatticeOffsets
from lumigraph.elements.scatter import SingleLenslet
from lumigraph.elements.surface import GlassSurface, index_at
from lumigraph.errors import FormatError, GeometryError
from lumigraph.instruments.part import CameraTable
from lumigraph.instruments.quantities import (
    Angle,
    Counts,
    Displacement,
    Fraction,
    Length,
    Number,
    Offset,
    OneOrThree,
    Positive,
)

MOST_LENSLETS = 2**20
"""Largest array: 1024 x 1024."""
MOST_CHANGE = 0.5
"""Largest change of a single lenslet's focal length."""
MOST_INDEX = 4.0
"""Largest index of lenslets: germanium's."""
MOST_CONIC = 100.0
"""Largest conic constant of their surfaces, of either sign."""


class OneLenslet(CameraTable):
    """Deviations of one lenslet, table ``[lenslets.single.N]``.

    Parameters
    ----------
    focal_change
        Relative change of its focal length: 0.03 is 3 % longer than the array's.
    offset_y, offset_x
        Offset of the lenslet, aperture and all, from its place on the lattice.
    decentre_y, decentre_x
        Offset of its vertex from the middle of its aperture, before a main lens.
    """

    focal_change: Number = 0.0
    offset_y: Displacement = 0.0
    offset_x: Displacement = 0.0
    decentre_y: Displacement = 0.0
    decentre_x: Displacement = 0.0

    @property
    def vertex(self) -> tuple[float, float]:
        """Offset (y, x) of the vertex from the place on the lattice [m]."""
        return self.offset_y + self.decentre_y, self.offset_x + self.decentre_x

    @property
    def offset(self) -> tuple[float, float]:
        """Offset of the aperture (y, x) [m]."""
        return self.offset_y, self.offset_x

    @property
    def decentre(self) -> tuple[float, float]:
        """Offset of the vertex from the middle of the aperture (y, x) [m]."""
        return self.decentre_y, self.decentre_x

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
"""Deviations of single lenslets, by number."""


class Lenslets(CameraTable):
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
        Magnification of a camera 2.0, m = b/a of the first focal length: above 0 Keplerian, between -1
        and 0 Galilean.
    shape
        Shape of a lenslet: "square" or "hex", the lattice's cell, or "round"; left out, the cell.
    fill_factor
        Width of a lenslet over the pitch; the rest is opaque.
    rotation
        From +x towards +y [rad], or text such as "2 mrad".
    offset
        Offset of the lenslets from the axis (y, x), less than half a pitch.
    index
        Refractive index of the lenslets, which tilts and surfaces need: at the camera's wavelength, or n_d
        beside an Abbe number.
    conic
        Constant K of the curved side of plano-convex lenslets, 0 of spheres, whose rays model "exact" then
        follows; left out, lenslets are free of spherical aberration.
    thickness
        Thickness of the glass, vertex to flat side, if the curved one faces the main lens; left out, it faces
        the sensor. Of distances to the sensor, glass counts as thickness over index.
    abbe
        Abbe number V_d, by which the focal length changes with the wavelength; left out, it does not.
    single
        Lenslets that differ from the others, in the pupil of a Fourier microscope or, square ones of one
        kind, behind a main lens: `OneLenslet` by number, from 1 on row by row as `indices` has them.
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
    conic: Number | None = None
    thickness: Length | None = None
    abbe: Positive | None = None
    single: Singles = Field(default_factory=dict)

    @field_validator("index")
    @classmethod
    def _is_an_index(cls, index: float | None) -> float | None:
        if index is not None and not 1 < index <= MOST_INDEX:
            raise GeometryError(f"index is {index:g} but must be above 1 and at most {MOST_INDEX:g}.")
        return index

    @field_validator("conic")
    @classmethod
    def _is_a_conic(cls, conic: float | None) -> float | None:
        if conic is not None and not abs(conic) <= MOST_CONIC:
            raise GeometryError(f"conic is {conic:g} but must be from -{MOST_CONIC:g} to {MOST_CONIC:g}.")
        return conic

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
        for name, shift, slack in zip("yx", self.turned(*self.offset), self._slack, strict=True):
            if abs(shift) >= slack:
                raise GeometryError(
                    f"offset along {name} is {shift * 1e6:.6g} µm but must stay below {slack * 1e6:.6g} µm. "
                    "Give what is left after whole lenslets, or change count."
                )
        return self

    @model_validator(mode="after")
    def _glass_is_known(self) -> "Lenslets":
        for name in ("conic", "abbe"):
            if getattr(self, name) is not None and self.index is None:
                raise GeometryError(f"{name} needs the glass' index. Add it, such as index = 1.46.")
        if self.thickness is not None and self.conic is None:
            raise GeometryError("thickness is of lenslets with a surface. Add conic, such as conic = 0.")
        return self

    @model_validator(mode="after")
    def _singles_have_room(self) -> "Lenslets":
        if not self.single:
            return self
        count = len(self.indices())
        if (last := max(self.single)) > count:
            raise GeometryError(f"single has lenslet {last}, but there are {count}. Count them from 1.")
        width = self.pitch * self.fill_factor
        if self.layout == "square" and (room := self.spacing) < width * (1 - 1e-9):
            raise GeometryError(
                f"two lenslets stand {room * 1e6:.6g} µm from each other but are {width * 1e6:.6g} µm wide. "
                "Change their offsets, or use a smaller fill_factor."
            )
        return self

    def index_at(self, wavelength: float) -> float:
        """Refractive index at a wavelength [m]; 1 where it is not known.

        Raises
        ------
        GeometryError
            An Abbe number by which no glass is left at the wavelength.
        """
        if self.index is None or self.abbe is None:
            return self.index or 1.0
        found = index_at(wavelength, self.index, self.abbe)
        if not 1 < found <= MOST_INDEX:
            raise GeometryError(
                f"by abbe = {self.abbe:g} the index at {wavelength * 1e9:.4g} nm is {found:.4g}, but it must "
                f"be above 1 and at most {MOST_INDEX:g}. Use a larger Abbe number, or leave it out."
            )
        return found

    def surface(self, wavelength: float) -> GlassSurface | None:
        """Curved surface at a wavelength [m]; None for ideal lenslets.

        Raises
        ------
        GeometryError
            One that glass does not have, or that light does not pass.
        """
        if self.conic is None:
            return None
        surface = GlassSurface(self.index_at(wavelength), self.conic, self.thickness)
        for focal_length in self.focal_length:
            surface.check(self.fill_factor * self.pitch / 2, focal_length)
        return surface

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
        """Lattice of the lenslets [m]."""
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
        """True for centres (k, 2) of the lattice at which the array has lenslets (k,)."""
        across, along = self.turned(*centers.T)
        height, width = self.extent
        return (np.abs(across) <= height / 2) & (np.abs(along) <= width / 2)

    def __hash__(self) -> int:
        """Hash of what all lenslets share: the values of single ones stand in a dict, which has no hash."""
        return hash((self.pitch, self.focal_length, self.count, self.layout, self.rotation, self.offset))

    def each(self) -> tuple[np.ndarray, np.ndarray]:
        """Centres (k, 2) as (y, x) and focal lengths (k,) [m] of the lenslets of one kind, as `indices`."""
        centers = self.lattice().position(self.indices())
        focal_lengths = np.full(len(centers), self.focal_length[0])
        for number, own in self.single.items():
            centers[number - 1] += own.offset_y, own.offset_x
            focal_lengths[number - 1] *= 1 + own.focal_change
        return centers, focal_lengths

    def own(self) -> tuple[SingleLenslet, ...]:
        """Deviations of single lenslets, in the frame that turns with the array."""
        indices, found = self.indices(), []
        for number, one in self.single.items():
            i, j = indices[number - 1].tolist()
            aside, decentre = self.turned(*one.offset), self.turned(*one.decentre)
            found.append(SingleLenslet((i, j), one.focal_change, aside if any(aside) else None, decentre))
        return tuple(found)

    def aside(self, scale: float) -> LatticeOffsets | None:
        """Offsets of micro-images from the lattice, of lenslets whose vertex is off it, times a scale [px/m].

        Where the raw image is turned the scale is negative, and indices are the other way round.
        """
        ways = {number: one.vertex for number, one in self.single.items() if any(one.vertex)}
        if not ways:
            return None
        indices = self.indices()[np.array(list(ways)) - 1]
        return LatticeOffsets(int(math.copysign(1, scale)) * indices, scale * np.array(list(ways.values())))

    def amid(self, count: Sequence[int]) -> dict[str, Any]:
        """Changes for `Instrument.replace` that keep the middle of the array, `count` lenslets.

        Of an array in which some differ it has one more along an axis where its middle would move.
        """
        if not self.single:
            return {"count": tuple(count)}
        kept = tuple(n - (n - some) // 2 * 2 for n, some in zip(self.count, count, strict=True))
        fewer = self.model_copy(update={"count": kept, "single": {}}).indices().tolist()
        index = self.indices().tolist()
        single = {
            fewer.index(index[number - 1]) + 1: one
            for number, one in self.single.items()
            if index[number - 1] in fewer
        }
        return {"count": kept, "single": single}

    @property
    def spacing(self) -> float:
        """Largest width of lenslets at which no two overlap, at most the pitch [m]."""
        if not self.single:
            return self.pitch
        along = np.stack(self.turned(*self.each()[0].T), -1)
        apart = np.abs(along[:, None] - along).max(-1)
        np.fill_diagonal(apart, np.inf)
        return float(min(apart.min(), self.pitch))

    def turned(self, y: Any, x: Any) -> tuple[Any, Any]:
        """Coordinates (y, x) in the frame that turns with the array."""
        sin, cos = math.sin(self.rotation), math.cos(self.rotation)
        return y * cos - x * sin, y * sin + x * cos
