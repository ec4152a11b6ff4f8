"""Deviations of a camera's parts from its description, as built: table ``[built]``."""

import math

from pydantic import model_validator

from lumigraph.elements.scatter import Scatter
from lumigraph.elements.tilt import TiltAndBow
from lumigraph.errors import GeometryError
from lumigraph.instruments.part import CameraTable
from lumigraph.instruments.quantities import Angle, Displacement, Length, NotNegative, Seed, Tilt


class Built(CameraTable):
    """A camera as built: distances other than described, lenslets that differ, tilted planes.

    The object stays at `object_distance`, in focus or not.

    Parameters
    ----------
    separation
        Main lens to lenslets, L.
    lenslet_distance
        Lenslets to sensor, b.
    array_tilt, sensor_tilt
        By how much lenslets, and pixels, stand farther from the main lens along y and along x: two angles,
        about the axis, in physical coordinates; a raw image shows them turned by 180°.
    array_bow
        Distance by which lenslets at the array's corners are behind the middle; it grows with the square
        of the distance from the axis.
    focal_length_scatter
        Standard deviation of single lenslets' focal lengths, as a part of them.
    decentre_scatter
        Standard deviation of their vertices from the middle of their apertures, along each axis.
    missing
        Part of the lenslets that are opaque.
    tilt_scatter
        Standard deviation of the angles by which their surfaces are tilted about their vertices, along each
        axis. A sphere that is tilted by θ turns light by (n - 1) θ; n is the `index` of the lenslets.
    form_scatter
        Rms form error of the path through lenslets, without focus and tilt.
    seed
        Seed of the random differences.

    Examples
    --------
    >>> Built(separation="135.7 mm").separation
    0.1357
    """

    separation: Length | None = None
    lenslet_distance: Length | None = None
    array_tilt: Tilt = (0.0, 0.0)
    array_bow: Displacement = 0.0
    sensor_tilt: Tilt = (0.0, 0.0)
    focal_length_scatter: NotNegative = 0.0
    decentre_scatter: Displacement = 0.0
    missing: NotNegative = 0.0
    tilt_scatter: Angle = 0.0
    form_scatter: Displacement = 0.0
    seed: Seed = 0

    def scatter(self, index: float | None = None) -> Scatter | None:
        """Scatter of single lenslets of a refractive index; None if all are alike.

        Raises
        ------
        GeometryError
            A negative scatter, more than lenslets have, or tilts of lenslets whose index is not known.
        """
        if self.tilt_scatter and index is None:
            raise GeometryError(
                "tilted lenslets turn light by (n - 1) times their tilt, but their index n is not known. Add "
                "it under [lenslets], such as index = 1.46 of fused silica."
            )
        turn = self.tilt_scatter * ((index or 1.0) - 1)
        found = Scatter(
            self.focal_length_scatter, self.decentre_scatter, self.missing, self.seed, turn, self.form_scatter
        )
        return None if found == Scatter(seed=self.seed) else found

    def lean(self, corner: float) -> TiltAndBow | None:
        """Tilt and bow of array and sensor, whose corners are `corner` from the axis [m]; None without any.

        Raises
        ------
        GeometryError
            A tilt beyond 0.1 rad.
        """
        array, sensor = (
            (math.tan(y), math.tan(x)) for y, x in (self.array_tilt, self.sensor_tilt)
        )  # fmt: skip
        found = TiltAndBow(array, self.array_bow / corner**2, sensor)
        return None if found == TiltAndBow() else found

    @model_validator(mode="after")
    def _is_possible(self) -> "Built":
        _ = self.scatter(index=2.0), self.lean(1.0)  # they refuse what cannot be
        return self

    def __bool__(self) -> bool:
        return self != Built()
