"""Lengths of a camera's ray diagram, for `lumigraph.plots.layout`."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, slots=True)
class LensletLayout:
    """A row of lenslets behind the main lens.

    Parameters
    ----------
    distance
        To the sensor, b [m].
    pitch, offset
        Between lenslets, and from the axis to the middle one [m].
    focal_lengths
        Of neighbours in turn [m].
    """

    distance: float
    pitch: float
    offset: float
    focal_lengths: tuple[float, ...]

    def center(self, number: int) -> float:
        """Height of a lenslet [m], counted from the middle one."""
        return self.offset + number * self.pitch

    def nearest(self, height: float) -> int:
        """Number of the lenslet that a ray of that height [m] meets."""
        return round((height - self.offset) / self.pitch)

    def focal_length(self, number: int) -> float:
        """Focal length of a lenslet, counted from the middle one [m]."""
        return self.focal_lengths[number % len(self.focal_lengths)]


@dataclass(frozen=True, slots=True, eq=False)
class GlassLayout:
    """The surfaces of a main lens, and rays through them; z counts from the first surface's vertex.

    Parameters
    ----------
    surfaces
        Places (n, 2, points) [m]: z, and heights from edge to edge as far as the rays reach.
    is_glass
        Whether there is glass behind each of them (n,).
    rays
        Places (rays, 2, n + 2) [m], z and height: at the object, at the surfaces and at the image; from two
        fields with as many rays each, the chief ray in their middle.
    stop
        Number of the surface that is the stop.
    planes
        Front and rear principal planes [m].
    """

    surfaces: np.ndarray
    is_glass: tuple[bool, ...]
    rays: np.ndarray
    stop: int
    planes: tuple[float, float]

    @property
    def half_heights(self) -> np.ndarray:
        """Semi-diameters of the surfaces (n,) [m], as far as the rays reach."""
        return self.surfaces[:, 1].max(axis=1)


@dataclass(frozen=True, slots=True)
class Layout:
    """A main lens, a sensor, and lenslets between them or none.

    Parameters
    ----------
    object_distance
        To the main lens, z1 [m].
    focal_length, pupil_diameter
        Of the main lens and of its stop [m].
    image_distance, separation
        From the main lens to its image, z2, and to the lenslets or the sensor, L [m].
    sensor_width
        [m].
    lenslets
        None without them.
    glass
        Of a main lens whose prescription is known.
    """

    object_distance: float
    focal_length: float
    pupil_diameter: float
    image_distance: float
    separation: float
    sensor_width: float
    lenslets: LensletLayout | None = None
    glass: GlassLayout | None = None

    @property
    def length(self) -> float:
        """Main lens to sensor [m]."""
        return self.separation + (0.0 if self.lenslets is None else self.lenslets.distance)


@dataclass(frozen=True, slots=True)
class MicroscopeLayout:
    """An objective with its tube lens, lenslets near their image or in the pupil's, a sensor.

    Parameters
    ----------
    magnification
        To the native image.
    numerical_aperture
        Of the objective.
    lenslets
        Pitch, focal length and distance to the sensor.
    offset
        Native image to lenslets, positive behind it [m].
    tube_lens
        Focal length [m]; None where it is not given.
    fourier_lens
        Focal length of the lens between native image and lenslets [m]; None where there is none.
    """

    magnification: float
    numerical_aperture: float
    lenslets: LensletLayout
    offset: float = 0.0
    tube_lens: float | None = None
    fourier_lens: float | None = None

    @property
    def behind(self) -> Layout:
        """Lenslets and sensor with the light that comes to them: from a pupil that is very far away."""
        cone = 2 * self.numerical_aperture / self.magnification
        return Layout(2 * _FAR, _FAR / 2, cone * _FAR, _FAR, _FAR + self.offset, 0.0, self.lenslets)


_FAR = 1e3
"""Distance from the native image to a pupil whose rays count as parallel to the axis [m]."""
