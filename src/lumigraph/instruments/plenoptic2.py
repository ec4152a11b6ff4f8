"""The focused plenoptic camera 2.0."""

import math
from typing import ClassVar

import numpy as np
from pydantic import model_validator

from lumigraph.core import checks
from lumigraph.design import plenoptic2 as closed_forms
from lumigraph.design import thin_lens
from lumigraph.errors import FormatError, GeometryError
from lumigraph.instruments.lenslet_camera import LensletCamera
from lumigraph.instruments.parameters import MagnificationRange, Parameter, choice, lenslets, number
from lumigraph.instruments.wave_patches import GratingImage


class FocusedPlenopticCamera(LensletCamera):
    """Focused plenoptic camera 2.0: lenslets relay the main-lens image onto the sensor, magnified m = b/a.

    Keplerian for m > 0 (the image lies a before the lenslets), Galilean for m < 0 (it would lie -a behind).

    Parameters
    ----------
    wavelength, object_distance
        [m] or text with a unit.
    main_lens
        `MainLens`; without a diameter it is matched to the lenslets.
    lenslets
        `Lenslets` with their magnification; of three focal lengths it is that of the first.
    sensor
        `Pixels`; without a shape all micro-images fit.
    matching
        Diameter of the main lens, by `design.matching`. "views": f-numbers matched, D = z2 p / b, with which
        1/m lenslets per axis image a point; "full": D = p L / b, micro-images as wide as the lenslets;
        "touching": D = p (L + b) / b, micro-images as wide as their distance.
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
        The object is inside the focal length, a magnification of 0 or at most -1, lenslets before the main
        lens, or values that no camera can have.

    Examples
    --------
    >>> camera = FocusedPlenopticCamera(
    ...     wavelength="633 nm", object_distance="120 mm", main_lens={"focal_length": "60 mm"},
    ...     lenslets={"pitch": "150 um", "focal_length": "5.2 mm", "count": (39, 39), "magnification": 0.5},
    ...     sensor={"pixel_pitch": "1.6667 um"},
    ... )
    >>> round(camera.relay_distance * 1e3, 6), round(camera.lenslet_distance * 1e3, 6)
    (15.6, 7.8)
    >>> round(camera.patch, 2)
    39.82
    """

    KIND: ClassVar[str] = "focused-plenoptic"

    @model_validator(mode="after")
    def _is_possible(self) -> "FocusedPlenopticCamera":
        self._check_beyond_focus()
        m = self.lenslets.magnification
        if m is None:
            raise FormatError(
                "lenslets.magnification is missing. Give m = b/a, such as 0.5 or -0.25 (Galilean)."
            )
        if m == 0 or m <= -1:
            raise GeometryError(
                f"lenslets.magnification is {m:g} but must be above 0 (Keplerian) or between -1 and 0 "
                "(Galilean)."
            )
        if abs(m) < 1e-3 or m > 1e3:
            raise GeometryError(
                f"lenslets.magnification is {m:g}, outside 0.001 to 1000 in size. Use a value near 0.1 to 1; "
                "lenslets that image infinity are kind 'plenoptic'."
            )
        self._check_lenslets_behind_lens()
        self._check_glass()
        if self.built:
            self._check_built()
        return self

    def _check_built(self) -> None:
        """Refuse lenslets that were built where the main lens' image falls on them."""
        if self.relay_distance == 0 or not 1e-3 <= abs(self.lenslet_magnification) <= 1e3:
            raise GeometryError(
                f"built.separation is {self.separation * 1e3:.6g} mm, where the main lens has its image "
                f"(z2 = {self.image_distance * 1e3:.6g} mm): the lenslets have nothing to relay. Use another "
                "distance, or kind 'plenoptic'."
            )

    @property
    def _magnification(self) -> float:
        assert self.lenslets.magnification is not None  # checked above
        return self.lenslets.magnification

    @property
    def lenslet_magnification(self) -> float:
        """Size of the sensor's image over the main lens', m = b/a; negative for a Galilean camera."""
        return self.lenslet_distance / self.relay_distance if self.built else self._magnification

    @property
    def _described_lenslet_distance(self) -> float:
        return closed_forms.lenslet_distance(self.lenslets.focal_length[0], self._magnification)

    @property
    def relay_distance(self) -> float:
        """Main-lens image to lenslets, a = b/m [m]; negative for a Galilean camera."""
        if self.built:
            return self.separation - self.image_distance
        return closed_forms.relay_distance(self.lenslets.focal_length[0], self._magnification)

    @property
    def _described_separation(self) -> float:
        relay = closed_forms.relay_distance(self.lenslets.focal_length[0], self._magnification)
        return self.image_distance + relay

    @property
    def patch(self) -> float:
        """Piece of a micro-image that tiles the picture of the focused plane [px]; negative if Galilean."""
        return self.patch_at(0.0)

    def magnification_at(self, dz: float) -> float:
        """Lenslet magnification m' = b/a' of an object at depth `dz` [m] from the focused plane.

        Raises
        ------
        GeometryError
            The object is inside the focal length, or its image falls on the lenslets.
        """
        return closed_forms.magnification_at(
            self.main_lens.focal_length, self.defocused(dz), self.separation, self.lenslet_distance
        )

    def patch_at(self, dz: float, frequency: float | None = None) -> float:
        """Piece of a micro-image that tiles the picture of an object at depth `dz` [px]; signed.

        Parameters
        ----------
        dz
            Depth from the focused plane [m].
        frequency
            Of a grating in the object [1/m] whose tiles are to meet by waves (`instruments.wave_patches`): of
            Keplerian cameras some 5 % larger than by rays for detail as fine as the lenslets see, 10 to 25 %
            for coarse detail. Left out, the patch of rays.

        Raises
        ------
        GeometryError
            The object is inside the focal length, or its image falls on the lenslets; with a frequency, a
            main lens that is not ideal, or a grating that the camera does not resolve.
        """
        distance = self.defocused(dz)
        image = thin_lens.image_distance(self.main_lens.focal_length, distance)
        rays = self._tile(self.magnification_at(dz), image)
        if frequency is None:
            return rays / self.pixels.pixel_pitch
        in_image = checks.positive("frequency", frequency, "/m") * distance / image
        sharpest = np.argmin(np.abs(np.multiply(self.sharp_patches, self.pixels.pixel_pitch) - rays))
        grating = GratingImage(self, image, in_image, self.lenslets.focal_length[sharpest])
        patch = grating.patch(abs(rays))
        if patch is None:
            raise GeometryError(
                f"frequency is {frequency:.4g} /m but the camera does not resolve that at {dz * 1e3:.4g} mm, "
                "so that no patch joins its tiles. Use a lower one, or none: the patch of rays."
            )
        return math.copysign(patch, rays) / self.pixels.pixel_pitch

    @property
    def sharp_patches(self) -> tuple[float, ...]:
        """Patch [px] at which each focal length of the lenslets is sharp, in their order; signed."""
        sizes = []
        for focal_length in self.lenslets.focal_length:
            m = self.lenslet_distance / focal_length - 1
            image_distance = self.separation - self.lenslet_distance / m
            sizes.append(self._tile(m, image_distance) / self.pixels.pixel_pitch)
        return tuple(sizes)

    def _tile(self, magnification: float, image_distance: float) -> float:
        """Patch of an image so far behind the main lens [m]."""
        image = self.exit_pupil.to(image_distance)
        return closed_forms.patch(self.lenslets.pitch, magnification, image, self.pupil_distance)

    def patches_on_raw(self) -> tuple[float, ...]:
        """Patch [px] at which each kind of lenslets is sharp, in the order of the calibration.

        The raw image is turned by 180°, so that the second and third kind trade places.
        """
        first, *rest = self.sharp_patches
        return (first, *reversed(rest))

    def _own_parameters(self) -> tuple[Parameter, ...]:
        m = self.lenslet_magnification
        ends, kind = ((0.05, 2.0), "log") if m > 0 else ((-0.95, -0.05), "linear")
        return (
            number("lenslets.magnification", "Lenslet magnification m", m, ends, kind=kind),
            choice("matching", "Diameter matched for", self.matching, ("views", "full", "touching")),
            *lenslets(self.lenslets, layouts=len(self.lenslets.focal_length) == 1),
        )

    def magnifications(self) -> MagnificationRange:
        """Magnifications of the lenslets."""
        m = self.lenslet_magnification
        ends = (min(0.05, m), max(1.5, m)) if m > 0 else (min(0.05, -m), max(0.95, -m))
        return MagnificationRange(
            "|m| = b/|a|, of the lenslets", m, ends, lambda m: self.replace(lenslets={"magnification": m})
        )
