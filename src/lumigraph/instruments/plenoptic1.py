"""The plenoptic camera 1.0."""

from collections.abc import Sequence
from typing import ClassVar

from pydantic import model_validator

from lumigraph.core.calibration import Calibration
from lumigraph.core.lightfield import LightField
from lumigraph.design import plenoptic1, thin_lens
from lumigraph.errors import GeometryError
from lumigraph.instruments import camera_pupil
from lumigraph.instruments.lenslet_camera import LensletCamera
from lumigraph.instruments.parameters import Parameter, lenslets
from lumigraph.operators.microscope.pupil import PupilImages
from lumigraph.simulation import plane_views

_MOST_KNOWN = 33
"""Lenslets along each side of the camera that known planes are simulated with."""


class PlenopticCamera(LensletCamera):
    """Plenoptic camera 1.0: lenslets at the main-lens image, F = z2, and the sensor at b = f_µ behind them.

    Each lenslet is one place, each pixel under it one direction.

    Parameters
    ----------
    wavelength, object_distance
        [m] or text with a unit.
    main_lens
        `MainLens`; without a diameter it is matched, D = p F / b.
    lenslets
        `Lenslets`, of one focal length and without magnification.
    sensor
        `Pixels`; without a shape all micro-images fit.
    matching
        "views" or "full", which are the same here.
    model
        "paraxial": parabolic lenses and Fresnel's distances; "exact": lenses free of spherical aberration, or
        lenslets of glass, and Rayleigh and Sommerfeld's integral, for square lenslets of one focal length;
        "auto": exact where the paraxial one misses the requested accuracy.
    built
        `Built`: distances as built, where they are not the description's.
    tolerances
        Tolerances of values, as `lumigraph.studies.tolerance` takes them, such as "±0.05 mm" of "separation".

    Raises
    ------
    FormatError
        A wrong or missing key, a wrong unit.
    GeometryError
        The object is inside the focal length, a magnification or three focal lengths are given, or values
        that no camera can have.

    Examples
    --------
    >>> camera = PlenopticCamera(
    ...     wavelength="633 nm", object_distance="240 mm", main_lens={"focal_length": "120 mm"},
    ...     lenslets={"pitch": "150 um", "focal_length": "10 mm", "count": (101, 101)},
    ...     sensor={"pixel_pitch": "5 um"},
    ... )
    >>> round(camera.pupil_diameter * 1e3, 6), round(camera.micro_image_pitch * 1e6, 6)
    (3.6, 156.25)
    """

    KIND: ClassVar[str] = "plenoptic"

    @model_validator(mode="after")
    def _is_possible(self) -> "PlenopticCamera":
        self._check_beyond_focus()
        if self.lenslets.magnification is not None:
            raise GeometryError(
                f"lenslets.magnification is {self.lenslets.magnification:g}, but the lenslets of a plenoptic "
                "camera 1.0 image infinity. Leave it out, or use kind 'focused-plenoptic'."
            )
        if len(self.lenslets.focal_length) != 1:
            raise GeometryError(
                "lenslets.focal_length has 3 lengths, but the sensor of a plenoptic camera 1.0 stands in one "
                "focal plane. Give one, or use kind 'focused-plenoptic'."
            )
        self._check_glass()
        return self

    @property
    def _described_lenslet_distance(self) -> float:
        return self.lenslets.focal_length[0]

    def alpha(self, dz: float) -> float:
        """Refocus factor α' = L/F' that brings an object at depth `dz` into focus."""
        if not self.built:
            return super().alpha(dz)
        image = thin_lens.image_distance(self.main_lens.focal_length, self.defocused(dz))
        return self.pupil_distance / self.exit_pupil.to(image)

    def refocus_factor(self, dz: float, separation: float) -> float:
        """α' that focuses its views at a depth `dz` [m] from the focused plane, whatever their separation."""
        return self.alpha(dz)

    def plane_views(self, alpha: float) -> LightField:
        """Views of a textured plane at a refocus factor, by wave optics and a part of the lenslets."""
        fewer = self.lenslets.amid([min(n, _MOST_KNOWN) for n in self.lenslets.count])
        small = self.replace(lenslets=fewer, sensor={"shape": None})
        focal_length, behind = self.main_lens.focal_length, self.exit_pupil.behind
        if behind:
            image = behind + self.pupil_distance / alpha
            dz = thin_lens.object_distance(focal_length, image) - self.object_distance
        else:
            focused = thin_lens.object_distance(focal_length, self.separation)
            dz = focused - self.object_distance + plenoptic1.defocus(focal_length, focused, alpha)
        return plane_views(small, small.calibration, dz)

    def pupil_images(
        self,
        terms: Sequence[int],
        *,
        dz: float = 0.0,
        accuracy: float = 1e-2,
        pixels: Calibration | None = None,
    ) -> PupilImages:
        """Images of points in a plane as functions of Zernike terms of the main lens, with derivatives.

        Points stand at (y, x, 0) in that plane, and shine as samples as large as a lenslet there. Lenslets go
        on beyond the array, whose outermost two receive some light that does not exist.

        Parameters
        ----------
        terms
            Noll indices; their coefficients, in waves rms, add to the description's aberrations.
        dz
            Depth of the plane from the focused one [m], positive farther.
        accuracy
            Relative rms error of points' images, 1e-5 to 0.1.
        pixels
            Calibration of a real camera; None for the description's own pixels.

        Raises
        ------
        GeometryError
            Lenslets that are not square, alike and in rows and columns along the sensor's; a main lens that
            changes over the field; the exact model; a term that is no Noll index.
        """
        return camera_pupil.pupil_images(self, terms, dz, accuracy, pixels)

    def _own_parameters(self) -> tuple[Parameter, ...]:
        return lenslets(self.lenslets, layouts=True)
