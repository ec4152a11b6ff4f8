"""`CameraOptics`: what an operator reads of a camera, as plain values."""

from dataclasses import dataclass
from typing import Literal, Protocol

from lumigraph.core.lattice import Lattice
from lumigraph.elements import LensletArray, ObjectSpace, Train
from lumigraph.elements.surface import GlassSurface
from lumigraph.elements.tilt import TiltAndBow
from lumigraph.sensor import Sensor

Model = Literal["paraxial", "exact", "auto"]
"""How light goes through lenses and to the sensor."""


@dataclass(frozen=True, slots=True)
class CameraOptics:
    """A main lens, lenslets or none, and pixels.

    Parameters
    ----------
    wavelength
        In vacuum [m].
    object_distance, separation
        Focused plane to main lens, z1; main lens to lenslets, L, or to the sensor where there are none [m].
    pupil_diameter
        Of the main lens, D [m].
    lens
        The main lens: phase, stop and aberrations.
    sensor
        Pixels.
    object_pitch
        Of the camera's own samples of the focused plane [m].
    array
        The lenslets; None without them.
    lenslet_distance
        Lenslets to sensor, b [m]; None without lenslets.
    model
        "paraxial", parabolic phases and Fresnel's distances; "exact", lenses free of spherical aberration, or
        lenslets of glass, and Rayleigh and Sommerfeld's; "auto", exact where the paraxial one misses the
        accuracy that is asked for.
    lean
        Of array and sensor; None where they are square to the axis.
    objects
        Of a lens of glass, by the thin lens in its exit pupil, whose values all others are then; None for a
        thin lens.
    surface
        Of lenslets of glass, which "exact" follows; None of ideal ones.
    """

    wavelength: float
    object_distance: float
    separation: float
    pupil_diameter: float
    lens: Train
    sensor: Sensor
    object_pitch: float
    array: LensletArray | None = None
    lenslet_distance: float | None = None
    model: Model = "paraxial"
    lean: TiltAndBow | None = None
    objects: ObjectSpace | None = None
    surface: GlassSurface | None = None

    def optics(self) -> "CameraOptics":
        """Itself: an operator takes an instrument, or the values that it reads of one."""
        return self

    @property
    def lattice(self) -> Lattice | None:
        """Lattice on which the lenslets stand [m]; None without them."""
        return None if self.array is None else self.array.lattice


class HasOptics(Protocol):
    """An instrument with a main lens, or its values themselves."""

    def optics(self) -> CameraOptics:
        """Values of the instrument that an operator reads."""
        ...
