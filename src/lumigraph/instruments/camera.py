"""What all cameras have in common: distances, grids and trains."""

import math
from collections.abc import Sequence
from functools import cached_property

from pydantic import Field

from lumigraph.core import checks
from lumigraph.core.grid import Grid
from lumigraph.core.lattice import Lattice
from lumigraph.design import plenoptic1, resolution, thin_lens
from lumigraph.elements import ThinLens, Train, ZernikePlate
from lumigraph.errors import GeometryError
from lumigraph.instruments.grids import Sampling
from lumigraph.instruments.instrument import Instrument
from lumigraph.instruments.parts import MainLens, Pixels
from lumigraph.instruments.quantities import Length, Wavelength
from lumigraph.instruments.trade_offs import Range
from lumigraph.propagation import Propagate
from lumigraph.sensor import Sensor


class Camera(Instrument):
    """A camera focused at `object_distance`; see its children."""

    wavelength: Wavelength
    object_distance: Length
    main_lens: MainLens
    pixels: Pixels = Field(alias="sensor")

    @property
    def image_distance(self) -> float:
        """Main lens to its image, z2 [m]."""
        return thin_lens.image_distance(self.main_lens.focal_length, self.object_distance)

    @property
    def magnification(self) -> float:
        """Size of the main-lens image over the object's, z2 / z1; above 0, though the image is inverted."""
        return thin_lens.magnification(self.object_distance, self.image_distance)

    @property
    def separation(self) -> float:
        """Main lens to lenslets, L, or to the sensor where there are none [m]."""
        return self.image_distance

    @property
    def lenslet_distance(self) -> float | None:
        """Lenslets to sensor, b [m]; None without lenslets."""
        return None

    @property
    def lattice(self) -> Lattice | None:
        """Where the lenslets stand [m], in physical coordinates; None without lenslets."""
        return None

    @property
    def pupil_diameter(self) -> float:
        """Of the main lens' stop, D [m]."""
        raise NotImplementedError

    @property
    def f_number(self) -> float:
        """Of the main lens at its image, z2 / D."""
        return resolution.f_number(self.image_distance, self.pupil_diameter)

    @cached_property
    def sampling(self) -> Sampling:
        """How finely the planes must be sampled, and are."""
        raise NotImplementedError

    @property
    def sensor(self) -> Sensor:
        """The pixels; without a shape given, as many as all micro-images need."""
        return self.pixels.sensor(self.pixels.shape or self._covering_shape())

    def _covering_shape(self) -> tuple[int, int]:
        raise NotImplementedError

    @property
    def object_grid(self) -> Grid:
        """Samples of the focused plane that the sensor sees."""
        return self.sampling.object_grid

    @property
    def pupil_grid(self) -> Grid:
        """Samples of the main lens."""
        return self.sampling.pupil_grid

    @property
    def lenslet_grid(self) -> Grid | None:
        """Samples of the lenslet plane; None without lenslets."""
        return self.sampling.lenslet_grid

    @property
    def image_grid(self) -> Grid:
        """Samples of the sensor plane."""
        return self.sampling.image_grid

    def train(self, object_distance: float | None = None) -> Train:
        """Elements from a field at the object to the sensor.

        Parameters
        ----------
        object_distance
            Where the field stands, from the main lens [m]; None for the focused plane.
        """
        distance = self.object_distance if object_distance is None else object_distance
        return Train((Propagate(distance, method="fresnel", grid=self.pupil_grid), self.image_train()))

    def image_train(self) -> Train:
        """Elements from the field just before the main lens to the sensor."""
        raise NotImplementedError

    def relay_train(self) -> Train | None:
        """Elements from the field just before the lenslets to the sensor; None without lenslets."""
        return None

    def lens_train(self) -> Train:
        """The main lens: its phase, its stop and its aberrations."""
        focal_length, diameter = self.main_lens.focal_length, self.pupil_diameter
        if not self.main_lens.aberrations:
            return Train((ThinLens(focal_length, diameter),))
        waves = self.main_lens.aberrations
        # The plate is also the stop: two grey edges would be darker than one.
        plate = ZernikePlate({j: 2 * math.pi * rms for j, rms in waves.items()}, diameter)
        return Train((plate, ThinLens(focal_length)))

    def magnifications(self) -> Range:
        """Of the main lens, by the distance of the object."""
        focal_length, own = self.main_lens.focal_length, self.magnification
        return Range(
            "z2/z1, of the main lens", own, (own / 5, own * 5),
            lambda m: self.replace(object_distance=focal_length * (1 + 1 / m)),
        )  # fmt: skip

    def defocused(self, dz: float) -> float:
        """Object distance of a depth `dz` from the focused plane [m]; positive is farther.

        Raises
        ------
        GeometryError
            The object would be inside the focal length.
        """
        dz = checks.finite("dz", dz)
        distance, focal_length = self.object_distance + dz, self.main_lens.focal_length
        if not math.isfinite(distance) or distance <= focal_length:
            raise GeometryError(
                f"an object at depth {dz * 1e3:.6g} mm is {distance * 1e3:.6g} mm from the main lens, inside "
                f"its focal length of {focal_length * 1e3:.6g} mm. Use a depth above "
                f"{(focal_length - self.object_distance) * 1e3:.6g} mm."
            )
        return distance

    def _depths(self, depths: Sequence[float] | None) -> list[float]:
        """Depths [m], none of them inside the focal length; None is the focused plane."""
        planes = [0.0] if depths is None else [checks.finite("a depth", dz) for dz in depths]
        if not planes:
            raise GeometryError("depths is empty. Give at least one depth, or None for the focused plane.")
        for dz in planes:
            self.defocused(dz)
        return planes

    def alpha(self, dz: float) -> float:
        """Refocus factor α' = F/F' that brings an object at depth `dz` into focus."""
        self.defocused(dz)
        return plenoptic1.refocus_factor(self.main_lens.focal_length, self.object_distance, dz)

    def _check_beyond_focus(self) -> None:
        if self.object_distance <= self.main_lens.focal_length:
            raise GeometryError(
                f"object_distance {self.object_distance * 1e3:.6g} mm is inside the main lens' focal length "
                f"of {self.main_lens.focal_length * 1e3:.6g} mm: there is no real image. "
                "Move the object farther away or use a shorter focal length."
            )
        if self.image_distance > 1e3 * self.main_lens.focal_length:
            raise GeometryError(
                f"object_distance {self.object_distance * 1e3:.9g} mm is so close to the focal plane that "
                f"the image lies {self.image_distance:.4g} m away. Move the object farther away."
            )
