"""Base of all cameras: distances, grids and trains."""

import math
import warnings
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from os import PathLike
from typing import TYPE_CHECKING, Self

from pydantic import Field

from lumigraph.core import checks
from lumigraph.core.calibration import Calibration
from lumigraph.core.grid import Grid
from lumigraph.core.lattice import Lattice
from lumigraph.core.linear import Linear, Sum
from lumigraph.core.progress import Progress, part
from lumigraph.design import plenoptic1, resolution, thin_lens
from lumigraph.design.layout import Layout, LensletLayout
from lumigraph.elements import LensletArray, ThinLens, Train, ZernikePlate
from lumigraph.elements.field_plate import FieldPlate
from lumigraph.errors import GeometryError, ParaxialWarning
from lumigraph.instruments import parameters
from lumigraph.instruments.glass import GlassRequest, LensGlass, first_order, glass
from lumigraph.instruments.glass_layout import glass_layout
from lumigraph.instruments.glass_optics import ExitPupil, Traced, behind_glass, glass_warnings, traced
from lumigraph.instruments.grids import Sampling
from lumigraph.instruments.instrument import Instrument
from lumigraph.instruments.making import Making
from lumigraph.instruments.parameters import MagnificationRange, Parameter
from lumigraph.instruments.parts import MainLens, Pixels
from lumigraph.instruments.quantities import Length, Wavelength
from lumigraph.operators import CameraOptics
from lumigraph.propagation import Propagate
from lumigraph.sensor import Sensor

if TYPE_CHECKING:
    from lumigraph.instruments.point_view import PointImage
    from lumigraph.simulation import Spectrum


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

    @cached_property
    def exit_pupil(self) -> ExitPupil:
        """Exit pupil: of a thin lens the lens itself, of a prescription that of its glass.

        Raises
        ------
        GeometryError
            An exit pupil that is not before the image and the lenslets.
        """
        focal_length, path = self.main_lens.focal_length, self.main_lens.prescription
        if path is None:
            return ExitPupil(0.0, focal_length, self.image_distance)
        behind = first_order(path, self.wavelength).exit_pupil
        found = ExitPupil(behind, focal_length, self.image_distance)
        found.check(path.name, self.separation)
        return found

    @property
    def pupil_distance(self) -> float:
        """Exit pupil to lenslets, L' [m]: L before a thin lens."""
        return self.exit_pupil.to(self.separation)

    @property
    def object_scale(self) -> float:
        """Scale from the lenslet plane to the focused plane, z1/L before a thin lens."""
        if not self.exit_pupil.behind:
            return self.object_distance / self.separation
        return self.exit_pupil.to_image / self.magnification / self.pupil_distance

    @property
    def lattice(self) -> Lattice | None:
        """Lattice of the lenslets [m], in physical coordinates; None without lenslets."""
        return None

    @property
    def pupil_diameter(self) -> float:
        """Diameter D of the main lens' stop [m]."""
        raise NotImplementedError

    @property
    def path_difference(self) -> float:
        """Largest path difference, to ten rings of an Airy disc, 10 λ [m]."""
        return 10 * self.wavelength

    @property
    def f_number(self) -> float:
        """F-number of the main lens at its image, z2 / D."""
        return resolution.f_number(self.image_distance, self.pupil_diameter)

    @cached_property
    def sampling(self) -> Sampling:
        """Required and actual sampling of the planes."""
        raise NotImplementedError

    @property
    def sensor(self) -> Sensor:
        """The pixels; without a shape given, as many as all micro-images need."""
        return self.pixels.sensor(self.pixels.shape or self._covering_shape())

    def _covering_shape(self) -> tuple[int, int]:
        raise NotImplementedError

    @property
    def object_grid(self) -> Grid:
        """Grid of the focused plane within the field of the sensor."""
        return self.sampling.object_grid

    @cached_property
    def point_pitch(self) -> float:
        """Width of the area in the focused plane whose light a point of intensity 1 sends [m].

        It is the pitch of `object_grid`, which the camera's own wavelength sets: `at_wavelength` keeps it.
        """
        return self.sampling.object_pitch

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
        waves = self.main_lens.aberrations
        if (glass := self.glass) is not None:
            more = tuple(waves.items())
            plate = FieldPlate(glass.aberrations, diameter, more, glass.openings)
            return Train((plate, ThinLens(focal_length)))
        if self.main_lens.over_field is not None:
            plate = FieldPlate(self.main_lens.over_field.aberrations, diameter, tuple(waves.items()))
            return Train((plate, ThinLens(focal_length)))
        masks = () if self.main_lens.mask is None else (self.main_lens.mask.element(diameter),)
        if not waves:
            return Train((*masks, ThinLens(focal_length, diameter)))
        # The plate is also the stop: two grey edges would be darker than one.
        plate = ZernikePlate({j: 2 * math.pi * rms for j, rms in waves.items()}, diameter)
        return Train((plate, *masks, ThinLens(focal_length)))

    @cached_property
    def glass(self) -> LensGlass | None:
        """Ray-traced properties of the main lens' prescription at this camera's distances; None without one.

        Raises
        ------
        FormatError
            A file that is not read.
        GeometryError
            A prescription that contradicts the camera, or that is not followed.
        LumigraphError
            Optiland is not installed.
        """
        path = self.main_lens.prescription
        return None if path is None else glass(path, self._wanted)

    def at_wavelength(self, wavelength: float) -> Self:
        """Camera at another wavelength [m]; glass stays focused for its own wavelength."""
        other = self._in_light_of(wavelength)
        if self.main_lens.prescription is not None:
            vars(other).update(exit_pupil=self.exit_pupil, glass=self.glass, traced=self.traced)
        vars(other).update(point_pitch=self.point_pitch)  # or a white point would be coloured
        return other

    def _in_light_of(self, wavelength: float) -> Self:
        """Camera at another wavelength [m]; what follows from it changes, except for the main lens."""
        return self.replace(wavelength=wavelength)

    @cached_property
    def traced(self) -> Traced | None:
        """Chief rays of a prescription; None without one."""
        return None if self.glass is None else traced(self.glass, self.exit_pupil, self.object_distance)

    @property
    def _wanted(self) -> GlassRequest:
        """Requirements on the glass."""
        return GlassRequest(
            self.wavelength, self.object_distance, self.main_lens.focal_length, self.pupil_diameter,
            math.hypot(*self.sampling.object_half) / self.object_distance,
        )  # fmt: skip

    def layout(self) -> Layout:
        """Distances and sizes that a ray diagram shows."""
        width = self.sensor.shape[1] * self.sensor.pixel_pitch
        path = self.main_lens.prescription
        return Layout(
            self.object_distance, self.main_lens.focal_length, self.pupil_diameter, self.image_distance,
            self.separation, width, self._lenslet_layout(),
            None if path is None else glass_layout(path, self._wanted),
        )  # fmt: skip

    def _lenslet_layout(self) -> LensletLayout | None:
        return None

    def parameters(self) -> tuple[Parameter, ...]:
        """Wavelength, distances, diameter, what is the kind's own, and pixels."""
        focal_length, diameter = self.main_lens.focal_length, self.pupil_diameter
        return (
            parameters.wavelength(self.wavelength),
            parameters.length("object_distance", "Object distance z1", self.object_distance, "mm"),
            parameters.length("main_lens.focal_length", "Main lens focal length f", focal_length, "mm"),
            self._stop(parameters.length("main_lens.diameter", "Main lens diameter D", diameter, "mm")),
            *self._own_parameters(), parameters.pixel(self.pixels),
        )  # fmt: skip

    def _stop(self, diameter: Parameter) -> Parameter:
        return diameter

    def _own_parameters(self) -> tuple[Parameter, ...]:
        return ()

    def depth_reach(self) -> float:
        """A third of the distance from the focused plane to the focal length [m]."""
        return 0.3 * (self.object_distance - self.main_lens.focal_length)

    def point_view(self, dz: float = 0.0) -> "PointImage":
        """Image of a point on the axis at a depth `dz` [m] from the focused plane."""
        from lumigraph.instruments import point_view

        self.defocused(dz)
        return point_view.of_camera(self, dz)

    def operator_for(
        self,
        calibration: Calibration | None,
        depths: Sequence[float] | None = None,
        samples_per_lenslet: int | None = None,
        progress: Progress | None = None,
    ) -> Linear:
        """Operator of the described pixels, whatever the calibration of a raw image."""
        return self.operator(depths, samples_per_lenslet, progress=progress)

    def magnifications(self) -> MagnificationRange:
        """Magnifications of the main lens, varied by the object's distance."""
        focal_length, own = self.main_lens.focal_length, self.magnification
        return MagnificationRange(
            "z2/z1, of the main lens", own, (own / 5, own * 5),
            lambda m: self.replace(object_distance=focal_length * (1 + 1 / m)),
        )  # fmt: skip

    def glass_warnings(self) -> tuple[str, ...]:
        """Warnings where a prescription's glass has visible effects that are not simulated."""
        angles = self.pixels.angular_response is not None and self.lattice is not None
        return tuple(glass_warnings(self.glass, self.wavelength, angles=angles))

    def optics(self) -> CameraOptics:
        """Plain values of the camera, which operators read."""
        for text in self.glass_warnings():
            warnings.warn(text, ParaxialWarning, stacklevel=2)
        thin = CameraOptics(
            self.wavelength, self.object_distance, self.separation, self.pupil_diameter, self.lens_train(),
            self.sensor, self.point_pitch, self.lenslet_array(), self.lenslet_distance,
        )  # fmt: skip
        if self.glass is None or self.traced is None:
            return thin
        return behind_glass(thin, self.glass, self.traced, self.exit_pupil)

    def lenslet_array(self) -> LensletArray | None:
        """The lenslets; None without them."""
        return None

    def operator(
        self,
        depths: Sequence[float] | None = None,
        samples_per_lenslet: int | None = None,
        *,
        accuracy: float = 1e-3,
        pixels: Sensor | None = None,
        folder: str | PathLike[str] | None = None,
        progress: Progress | None = None,
        spectrum: "Spectrum | None" = None,
    ) -> Linear:
        """Exact operator of this camera for incoherent planes, for `lumigraph.deconvolve`.

        Parameters
        ----------
        depths
            From the focused plane [m], positive farther, for an object (z, y, x); None for the focused
            plane alone, an object (y, x).
        samples_per_lenslet
            Object samples along a lenslet's pitch, as the main lens shows it; None for as many as hold what
            the main lens resolves, λ z1/(2D). Without lenslets, None: the samples are `object_grid`'s.
        accuracy
            Relative rms error of the raw image, 1e-2 to 1e-5; without lenslets 1e-2 to 1e-4.
        pixels
            Another sensor in the place of the camera's.
        folder
            Keeps what is computed of lenslets; None for the user's cache folder.
        progress
            Called as ``progress(fraction)``.
        spectrum
            Spectrum of one channel, in place of the camera's wavelength.

        Raises
        ------
        GeometryError
            No depths, one inside the focal length, samples below 1 or without lenslets to count them by, or
            pixels that are no `Sensor`.
        SamplingError
            An accuracy out of range, or an operator that does not fit in memory.
        """
        planes = None if depths is None else self._depths(depths)
        optics, making = self.optics(), Making(accuracy, folder, progress)
        grid = self.operator_grid(samples_per_lenslet)
        if pixels is not None:
            checks.instance("pixels", pixels, Sensor)
            optics = replace(optics, sensor=pixels)
        if spectrum is None:
            return self._planes(optics, planes, grid, making)
        if len(spectrum.weights[0]) != 1:
            raise GeometryError("the operator has one channel but the spectrum has three. Take one of them.")
        maps, count = [], len(spectrum.wavelengths)
        for number, wavelength in enumerate(spectrum.wavelengths):
            told = replace(making, progress=part(progress, number, count))
            plain = replace(self.at_wavelength(wavelength).optics(), sensor=optics.sensor)
            maps.append(self._planes(plain, planes, grid, told))
        weights = tuple(weight for (weight,) in spectrum.weights)
        return Sum(tuple(maps), weights, object_grid=maps[0].object_grid, depths=maps[0].depths)

    def operator_on(
        self,
        grid: Grid,
        depths: Sequence[float] | None = None,
        *,
        accuracy: float = 1e-3,
        progress: Progress | None = None,
    ) -> Linear:
        """Operator as of `operator`, for an object on any grid, such as one that was moved."""
        planes = None if depths is None else self._depths(depths)
        return self._planes(self.optics(), planes, grid, Making(accuracy, None, progress))

    def operator_grid(self, samples: int | None = None) -> Grid:
        """Object samples of its `operator`, so many along a lenslet's pitch where there are lenslets."""
        raise NotImplementedError

    def _planes(
        self, optics: CameraOptics, depths: Sequence[float] | None, grid: Grid, making: Making
    ) -> Linear:
        raise NotImplementedError

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

    def _depths(self, depths: Sequence[float]) -> tuple[float, ...]:
        """Depths [m], none of them inside the focal length."""
        planes = tuple(checks.finite("a depth", dz) for dz in depths)
        if not planes:
            raise GeometryError("depths is empty. Give at least one depth, or None for the focused plane.")
        for dz in planes:
            self.defocused(dz)
        return planes

    def alpha(self, dz: float) -> float:
        """Refocus factor α' = F/F' that brings an object at depth `dz` into focus."""
        distance, pupil = self.defocused(dz), self.exit_pupil
        if pupil.behind:
            return pupil.to_image / pupil.to(thin_lens.image_distance(self.main_lens.focal_length, distance))
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
