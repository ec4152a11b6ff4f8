"""The parts of a light-field microscope, and where they stand."""

import math
from collections.abc import Callable, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from lumigraph.core.calibration import Calibration
from lumigraph.core.grid import Grid
from lumigraph.core.lattice import Lattice
from lumigraph.design import microscope as closed_forms
from lumigraph.design.layout import LensletLayout, MicroscopeLayout
from lumigraph.elements.mismatch import Mismatch
from lumigraph.elements.objective import Model, Objective
from lumigraph.errors import GeometryError
from lumigraph.instruments.angular import refuse_angles, refuse_gaps
from lumigraph.instruments.instrument import Instrument
from lumigraph.instruments.lenslets import Lenslets
from lumigraph.instruments.microscope_objective import MicroscopeObjective
from lumigraph.instruments.parts import Pixels
from lumigraph.instruments.quantities import Displacement, Length, Positive, Wavelength
from lumigraph.sensor import Sensor

if TYPE_CHECKING:
    from lumigraph.operators.microscope.cell import Lenslet
    from lumigraph.operators.microscope.fourier_microscope import Mosaic


class DescribedMicroscope(Instrument):
    """Description of a microscope and positions of its parts; see `LightFieldMicroscope`."""

    wavelength: Wavelength
    objective: MicroscopeObjective
    lenslets: Lenslets
    pixels: Pixels = Field(alias="sensor")
    configuration: Literal["1.0", "2.0", "fourier"] = "1.0"
    bandwidth: Length | None = None
    relay_magnification: Positive = 1.0
    lenslet_offset: Displacement | None = None
    sensor_distance: Length | None = None
    fourier_lens: Length | None = None

    @model_validator(mode="after")
    def _is_possible(self) -> Self:
        if self.lenslets.layout != "square" or self.lenslets.magnification is not None:
            raise GeometryError(
                "lenslets of a light-field microscope need layout 'square' and no magnification. "
                "Use lenslet_offset and sensor_distance for configuration '2.0'."
            )
        wanted = {"2.0": "lenslet_offset", "fourier": "fourier_lens"}
        for configuration, key in wanted.items():
            given = getattr(self, key) is not None
            if given != (self.configuration == configuration):
                verb = "needs" if self.configuration == configuration else "has no use for"
                raise GeometryError(f"configuration {self.configuration!r} {verb} {key}. Change one of them.")
        if self.lenslets.conic is not None or self.lenslets.abbe is not None:
            raise GeometryError(
                "lenslets.conic and lenslets.abbe are of cameras, not of microscopes, whose lenslets are "
                "parabolic. Leave them out."
            )
        refuse_angles(self.pixels.angular_response, "microscopes")
        if self.configuration == "fourier":
            refuse_gaps(self.pixels.fill_factor, "Fourier microscopes")
        if self.lenslets.single and self.configuration != "fourier":
            raise GeometryError(
                f"single lenslets differ in configuration 'fourier', not {self.configuration!r}. "
                "Leave lenslets.single out."
            )
        if any(one.decentre_y or one.decentre_x for one in self.lenslets.single.values()):
            raise GeometryError(
                "decentre_y and decentre_x are of lenslets behind a main lens. Move the whole lenslet by "
                "offset_y and offset_x."
            )
        if self.objective.model == "rays" and self.configuration != "1.0":
            raise GeometryError(
                f"objective.model 'rays' needs configuration '1.0', not {self.configuration!r}. Use 'scalar'."
            )
        if self.bandwidth is not None and self.bandwidth >= self.wavelength:
            raise GeometryError(
                f"bandwidth {self.bandwidth * 1e9:.4g} nm is not below the wavelength "
                f"{self.wavelength * 1e9:.4g} nm. Give the band's full width."
            )
        return self

    @property
    def magnification(self) -> float:
        """Magnification M from the object to the native image."""
        return self.objective.actual_magnification

    @property
    def lenslet_distance(self) -> float:
        """Distance b from lenslets to the plane imaged on the sensor [m]."""
        return self.sensor_distance or self.lenslets.focal_length[0]

    @property
    def path_difference(self) -> float:
        """Path difference by both edges of a lenslet to a pitch from its middle, p²/b, or 10 λ [m]."""
        return max(10 * self.wavelength, self.lenslets.pitch**2 / self.lenslet_distance)

    def layout(self) -> MicroscopeLayout:
        """Layout for a ray diagram."""
        row = LensletLayout(self.lenslet_distance, self.lenslets.pitch, 0.0, self.lenslets.focal_length)
        aperture, tube = self.objective.numerical_aperture, self.objective.tube_focal_length
        offset = self.lenslet_offset or 0.0
        return MicroscopeLayout(self.magnification, aperture, row, offset, tube, self.fourier_lens)

    @property
    def lenslet_size(self) -> float:
        """Pitch of the lenslets in object space, d/M [m]."""
        return self.lenslets.pitch / self.magnification

    @property
    def micro_image_pitch(self) -> float:
        """Distance between micro-images on the sensor [m]."""
        return self.lenslets.pitch * self.relay_magnification

    @property
    def pupil_diameter(self) -> float:
        """Diameter of the pupil's image on the lenslets of a Fourier microscope, 2 f_F NA/M [m].

        Otherwise that of the exit pupil per unit of distance from the native image, 2 NA/M.
        """
        return 2 * self.objective.numerical_aperture / self.magnification * (self.fourier_lens or 1.0)

    @property
    def objectives(self) -> tuple[Objective, ...]:
        """The objective at each wavelength that is summed: three over a band."""
        part, band = self.objective, self.bandwidth or 0.0
        steps = (-band / 3, 0.0, band / 3) if band else (0.0,)
        model: Model = part.model or ("vector" if part.numerical_aperture >= 0.8 else "scalar")
        mismatch = None
        if part.sample_index is not None:
            mismatch = Mismatch(part.sample_index, part.focus_depth or 0.0)
        return tuple(
            Objective(
                self.wavelength + step, part.numerical_aperture, part.immersion_index, model,
                part.axial_share, tuple(part.aberrations.items()), mismatch,
                (self.lenslet_offset or 0.0) / self.magnification**2,
            )
            for step in steps
        )  # fmt: skip

    @property
    def lenslet(self) -> "Lenslet":
        """One lenslet and what stands behind it."""
        from lumigraph.operators.microscope.cell import Lenslet

        part = self.lenslets
        return Lenslet(
            part.pitch, part.focal_length[0], self.lenslet_distance, self.magnification,
            part.pitch * part.fill_factor, part.shape == "round",
        )  # fmt: skip

    @property
    def lattice(self) -> Lattice:
        """Lattice of the lenslets [m]."""
        return self.lenslets.lattice()

    @property
    def sensor(self) -> Sensor:
        """The pixels; without a shape given, as many as all micro-images need."""
        given = self.pixels
        size = self.relay_magnification / given.pixel_pitch
        shape = given.shape or tuple(2 * math.ceil(reach * size - 0.5) + 1 for reach in self._reach)
        return given.sensor((shape[0], shape[1]))

    @property
    def _reach(self) -> tuple[float, float]:
        """Farthest that micro-images, a pitch wide, extend from the axis (y, x) [m]."""
        if not self.lenslets.single:
            return self.lenslets.reach
        y, x = np.abs(self.lenslets.each()[0]).max(0) + self.lenslets.pitch / 2
        return max(float(y), self.lenslets.reach[0]), max(float(x), self.lenslets.reach[1])

    @property
    def in_pupil(self) -> bool:
        """True if lenslets stand in the pupil, so that each micro-image is a view."""
        return self.configuration == "fourier"

    @property
    def in_focus(self) -> np.ndarray:
        """Depths (k,) at which the lenslets of a Fourier microscope are in focus, to first order [m]."""
        mosaic, medium = self._mosaic(), self.objectives[0].medium
        return medium * mosaic.defocus * (mosaic.fourier_lens / mosaic.magnification) ** 2

    @cached_property
    def calibration(self) -> Calibration:
        """Calibration of the raw image [px], by geometry; only micro-images inside the sensor."""
        sensor, pitch = self.sensor, self.sensor.pixel_pitch
        # Raw images are turned by 180°, and the lattice about the axis; behind a pupil they are not.
        sign = 1 if self.in_pupil else -1
        scale = sign * self.relay_magnification / pitch
        lattice, aside = self.lattice.scaled(scale), self.lenslets.aside(scale)
        lattice = lattice.moved(sensor.shape[0] // 2, sensor.shape[1] // 2)
        indices = sign * self.lenslets.indices()[::sign]
        centers = lattice.position(indices) + (0.0 if aside is None else aside.of(indices))
        inside = ((centers >= -0.5) & (centers <= [n - 0.5 for n in sensor.shape])).all(axis=1)
        return Calibration(
            lattice, sensor.shape, indices[inside], centers[inside], 0.0,
            pixel_pitch=pitch, lenslet_distance=self.lenslet_distance, aside=aside,
        )  # fmt: skip

    @property
    def object_grid(self) -> Grid:
        """The focused plane that the lenslets see, five samples per lenslet along each axis; of a Fourier
        microscope the field of a lenslet, as fine as its pixels.
        """
        if self.configuration == "fourier":
            mosaic = self._mosaic()
            pitch = mosaic.pixel_pitch / mosaic.total_magnification
            return Grid((mosaic.field, mosaic.field), (pitch, pitch))
        ny, nx = (5 * n for n in self.lenslets.count)
        return _about_axis(ny, nx, self.lenslet_size / 5)

    @property
    def scene_grid(self) -> Grid:
        """Grid as fine as the objective resolves, up to three times finer than `object_grid`."""
        grid = self.object_grid
        if self.configuration == "fourier":
            return grid
        finest = self.wavelength / (4 * self.objective.numerical_aperture)
        finer = min(3, math.ceil(grid.pitch[0] / finest))
        ny, nx = (n * finer for n in grid.shape)
        return _about_axis(ny, nx, grid.pitch[0] / finer)

    def sampling_distances(self, depths: Sequence[float]) -> tuple[float, ...]:
        """Distance between the samples that the lenslets take of each depth [m]: finer is not measured.

        See `design.microscope.sampling_distance`.
        """
        return self._each(closed_forms.sampling_distance, depths)

    def low_pass_distances(self, depths: Sequence[float]) -> tuple[float, ...]:
        """Widths of a low-pass that keeps lenslet-shaped artefacts out of each depth [m].

        Over the object's pitch these are the widths of `deconvolution.filters.LowPass`. See
        `design.microscope.low_pass_distance`.
        """
        return self._each(closed_forms.low_pass_distance, depths)

    def depth_per_alpha(self, separation: float) -> float:
        """Depth from the focused plane over α' - 1, of views with a separation [m]; positive farther.

        See `design.microscope.depth_per_alpha`.

        Raises
        ------
        GeometryError
            Configuration "2.0" or "fourier", whose raw images are not decoded into views.
        """
        if self.configuration != "1.0":
            raise GeometryError(
                f"refocus factors are of configuration '1.0', not {self.configuration!r}. "
                "Use deconvolve for depths."
            )
        aperture = (self.objective.numerical_aperture, self.objective.immersion_index)
        return closed_forms.depth_per_alpha(self.magnification, aperture, (separation, self.lenslet_distance))

    def refocus_factor(self, dz: float, separation: float) -> float:
        """α' that focuses views of a separation [m] at a depth `dz` [m] from the focused plane."""
        return 1 + dz / self.depth_per_alpha(separation)

    def _each(self, closed_form: Callable[..., float], depths: Sequence[float]) -> tuple[float, ...]:
        aperture = (self.objective.numerical_aperture, self.objective.immersion_index)
        return tuple(closed_form(self.wavelength, aperture, self.lenslet_size, dz) for dz in depths)

    def _mosaic(self) -> "Mosaic":
        from lumigraph.operators.microscope.fourier_microscope import Mosaic

        assert self.fourier_lens is not None  # checked above
        part, pitch = self.lenslets, self.pixels.pixel_pitch / self.relay_magnification
        centers, focal_lengths = part.each()
        return Mosaic(
            centers, part.pitch * part.fill_factor, focal_lengths, self.lenslet_distance,
            self.fourier_lens, self.magnification, pitch, self.sensor.shape, part.spacing,
        )  # fmt: skip


def _about_axis(ny: int, nx: int, pitch: float) -> Grid:
    """Samples that lie evenly about the axis, none of them on it where their number is even."""
    return Grid((ny, nx), (pitch, pitch), (0.0 if ny % 2 else pitch / 2, 0.0 if nx % 2 else pitch / 2))
