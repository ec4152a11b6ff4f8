"""Base of plenoptic cameras 1.0 and 2.0."""

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from lumigraph.core import arrays, checks, picture
from lumigraph.core.calibration import Calibration
from lumigraph.core.depth_map import DepthMap
from lumigraph.core.grid import Grid
from lumigraph.core.lattice import Lattice
from lumigraph.core.lightfield import LightField
from lumigraph.core.linear import Linear
from lumigraph.design import plenoptic1, resolution
from lumigraph.design.layout import LensletLayout
from lumigraph.design.matching import Diameters, diameters
from lumigraph.elements import LensletArray, Train
from lumigraph.elements.scatter import Scatter
from lumigraph.elements.tilt import TiltAndBow
from lumigraph.errors import GeometryError
from lumigraph.instruments import grids
from lumigraph.instruments.built import Built
from lumigraph.instruments.lenslets import Lenslets
from lumigraph.instruments.making import Making
from lumigraph.instruments.parameters import Parameter, optional
from lumigraph.instruments.parts import check_pixels
from lumigraph.instruments.tolerances import Tolerances
from lumigraph.instruments.with_parts import CameraGradients
from lumigraph.operators import CameraOptics, Model
from lumigraph.propagation import Propagate

if TYPE_CHECKING:
    from lumigraph.instruments.point_view import PointImage


class LensletCamera(CameraGradients):
    """A main lens, lenslets and a sensor."""

    lenslets: Lenslets
    matching: Literal["views", "full", "touching"] = "views"
    model: Model = "paraxial"
    built: Built = Field(default_factory=Built)
    tolerances: Tolerances = Field(default_factory=dict)

    @model_validator(mode="after")
    def _singles_are_possible(self) -> Self:
        parts = self.lenslets
        if parts.single and (parts.layout != "square" or parts.shape == "round"):
            raise GeometryError(
                f"single lenslets differ from square ones, but these are {parts.shape or parts.layout}. "
                "Leave lenslets.single out, or use layout 'square'."
            )
        width = parts.pitch * parts.fill_factor
        for number, one in parts.single.items():
            name = f"lenslet {number}"
            _check_room(f"{name}'s offset", parts.turned(*one.offset), (parts.pitch - width) / 2, "cell")
            _check_room(f"{name}'s decentre", parts.turned(*one.decentre), width / 2, "aperture")
        return self

    @property
    def described(self) -> Self:
        """The camera as its description has it, whatever was `built`."""
        return self.replace(built=Built()) if self.built else self

    @property
    def separation(self) -> float:
        """Main lens to lenslets, L [m]."""
        return self.built.separation or self._described_separation

    @property
    def _described_separation(self) -> float:
        return self.image_distance

    @property
    def lenslet_distance(self) -> float:
        """Lenslets to sensor, b [m]."""
        return self.built.lenslet_distance or self._described_lenslet_distance

    @property
    def _described_lenslet_distance(self) -> float:
        raise NotImplementedError

    @property
    def path_difference(self) -> float:
        """Path difference by both edges of a lenslet to a pitch from its middle, p²/b, or 10 λ [m]."""
        return max(super().path_difference, self.lenslets.pitch**2 / self.lenslet_distance)

    @cached_property
    def lean(self) -> TiltAndBow | None:
        """Tilt and bow of array and sensor as built; None if they are square to the axis."""
        return self.built.lean(math.hypot(*self.lenslets.reach))

    @model_validator(mode="after")
    def _lenslets_can_differ(self) -> Self:
        _ = self.errors  # it refuses tilts without an index
        return self

    @property
    def scatter(self) -> Scatter | None:
        """Differences of single lenslets, as described and as built; None if all are alike."""
        errors, own = self.errors, self.lenslets.own()
        return replace(errors or Scatter(seed=self.built.seed), own=own) if own else errors

    @property
    def errors(self) -> Scatter | None:
        """Differences of single lenslets as built from those described; None if there are none."""
        return self.built.scatter(self.lenslets.index)

    @property
    def diameters(self) -> Diameters:
        """Main-lens diameters by the words of `design.matching`, before anything was built [m]."""
        length, b = self._described_separation, self._described_lenslet_distance
        return diameters(self.lenslets.pitch, self.image_distance, length, b)

    @property
    def intended_diameter(self) -> float:
        """Main-lens diameter that `matching` asks for, before anything was built [m]."""
        matched, full, touching = self.diameters
        return {"views": matched, "full": full, "touching": touching}[self.matching]

    @property
    def pupil_diameter(self) -> float:
        """Diameter D of the main lens' stop [m]: as given, or as `matching` has it."""
        return self.main_lens.diameter or self.intended_diameter

    @property
    def micro_image_pitch(self) -> float:
        """Distance between neighbouring micro-images on the sensor, p (1 + b/L') [m]."""
        return plenoptic1.micro_image_pitch(self.lenslets.pitch, self.pupil_distance, self.lenslet_distance)

    @property
    def lenslet_size(self) -> float:
        """Size of a lenslet in the focused plane, p z1/L [m]."""
        return self.lenslets.pitch * self.object_scale

    @property
    def micro_image_width(self) -> float:
        """Width of a micro-image by ray optics: the main lens seen through a lenslet, D b / L [m]."""
        wide = self.pupil_diameter * self.exit_pupil.wider
        return wide * self.lenslet_distance / self.pupil_distance

    @property
    def micro_image_fill(self) -> float:
        """Width of the lit part of a micro-image over the pitch, by ray optics; 1 where they touch."""
        return min(1.0, self.micro_image_width / self.micro_image_pitch)

    @property
    def lattice(self) -> Lattice:
        """Lattice of the lenslets [m], in physical coordinates."""
        return self.lenslets.lattice()

    @cached_property
    def calibration(self) -> Calibration:
        """Calibration of the raw image [px], by geometry; only micro-images inside the sensor.

        The raw image is turned by 180°: lenslet (i, j) of the calibration is lenslet (-i, -j) of `lattice`,
        so that the second and third kind of a multi-focus array trade places.
        """
        sensor, pitch = self.sensor, self.sensor.pixel_pitch
        scale = -(1 + self.lenslet_distance / self.pupil_distance) / pitch
        lattice = self.lattice.scaled(scale).moved(sensor.shape[0] // 2, sensor.shape[1] // 2)
        indices = -self.lenslets.indices()[::-1]
        centers = lattice.position(indices)
        if self.lean is not None:
            centers = self._leaning_centers(centers, indices)
        if self.traced is not None:
            centers = self._traced_centers(centers, indices)
        off = float(np.sqrt(np.mean(np.sum((centers - lattice.position(indices)) ** 2, axis=1))))
        if (aside := self.lenslets.aside(scale)) is not None:
            centers = centers + aside.of(indices)
        inside = ((centers >= -0.5) & (centers <= [n - 0.5 for n in sensor.shape])).all(axis=1)
        return Calibration(
            lattice, sensor.shape, indices[inside], centers[inside], off,
            pixel_pitch=pitch, separation=self.pupil_distance, lenslet_distance=self.lenslet_distance,
            aside=aside,
        )  # fmt: skip

    def _traced_centers(self, centers: np.ndarray, indices: np.ndarray) -> np.ndarray:
        """Centres of micro-images (k, 2) [px], shifted by the true inclination of their chief rays."""
        assert self.traced is not None  # asked by `calibration`
        places = self.lattice.position(-indices)
        away = np.hypot(*places.T)
        aside = (
            self.traced.leans(away / self.pupil_distance) * self.lenslet_distance / self.sensor.pixel_pitch
        )
        return centers - places * (aside / np.maximum(away, 1e-12))[:, None]

    def _leaning_centers(self, centers: np.ndarray, indices: np.ndarray) -> np.ndarray:
        """Centres of micro-images (k, 2) [px], of lenslets nearer to the sensor, or farther."""
        assert self.lean is not None  # asked by `calibration`
        y, x = self.lattice.position(-indices).T
        array, scale = self.lean.of_array(y, x), 1 + self.lenslet_distance / self.pupil_distance
        distance = self.lenslet_distance - array + self.lean.of_sensor(y * scale, x * scale)
        middle = np.array([n // 2 for n in self.sensor.shape])
        return middle + (centers - middle) * ((1 + distance / (self.pupil_distance + array)) / scale)[:, None]

    def _count(self) -> tuple[int, int]:
        return self.lenslets.count

    def _lenslet_layout(self) -> LensletLayout:
        pitch, offset = self.lattice.pitches[1], self.lattice.origin[1]
        return LensletLayout(self.lenslet_distance, pitch, offset, self.lenslets.focal_length)

    def _stop(self, diameter: Parameter) -> Parameter:
        return optional(diameter, given=self.main_lens.diameter is not None)

    def point_view(self, dz: float = 0.0) -> "PointImage":
        """Image of a point on the axis at a depth `dz` [m], with as many lenslets as its light reaches."""
        from lumigraph.instruments import point_view

        focal_length, diameter = self.main_lens.focal_length, self.pupil_diameter
        blur = diameter * abs(1 - self.separation * (1 / focal_length - 1 / self.defocused(dz)))
        airy = 2.44 * self.wavelength * self.separation / diameter
        count = point_view.reached(blur + 2 * airy, self.lenslets.pitch, self.lenslets.count)
        small = self.replace(
            lenslets=self.lenslets.amid(count), sensor={"shape": None}, main_lens={"diameter": diameter}
        )
        return point_view.of_camera(small, dz, small.lenslets.count)

    def _planes(
        self, optics: CameraOptics, depths: Sequence[float] | None, grid: Grid, making: Making
    ) -> Linear:
        from lumigraph.operators import periodic_operator

        operator = periodic_operator(
            optics, grid, 0.0 if depths is None else depths,
            accuracy=making.accuracy, folder=making.folder, progress=making.progress,
        )  # fmt: skip
        return replace(operator, resolved_pitch=self._finest * self.object_scale)

    @property
    def _finest(self) -> float:
        """Half the shortest period in the main lens' image [m], λ L/(2D)."""
        return self.wavelength * self.separation / (2 * self.pupil_diameter)

    def _in_light_of(self, wavelength: float) -> Self:
        """Camera at another wavelength [m], with the focal length that lenslets of glass then have."""
        parts, same = self.lenslets, super()._in_light_of(wavelength)
        if parts.abbe is None:
            return same
        weaker = (parts.index_at(self.wavelength) - 1) / (parts.index_at(wavelength) - 1)
        return same.replace(
            lenslets={"focal_length": tuple(f * weaker for f in parts.focal_length)},
            built={"separation": self.separation, "lenslet_distance": self.lenslet_distance},
            main_lens={"diameter": self.pupil_diameter}, sensor={"shape": self.sensor.shape},
        )  # fmt: skip

    def optics(self) -> CameraOptics:
        """Plain values of the camera, which operators read."""
        from lumigraph.operators import is_possible

        surface = self.lenslets.surface(self.wavelength)
        plain = replace(super().optics(), model=self.model, lean=self.lean, surface=surface)
        if self.lean is not None and self.model != "paraxial":
            raise GeometryError(
                f'model is "{self.model}" but array or sensor is tilted: only the paraxial model has that. '
                'Use model = "paraxial", or leave array_tilt, array_bow and sensor_tilt out of [built].'
            )
        if self.model == "exact" and self.main_lens.varies:
            raise GeometryError(
                'model is "exact" but the main lens changes over the field, which only the paraxial model '
                'follows. Use model = "paraxial" or "auto", or leave over_field and prescription out.'
            )
        if self.model == "exact" and self.main_lens.mask is not None:
            raise GeometryError(
                'model is "exact" but the main lens has a mask, which only the paraxial model follows. '
                'Use model = "paraxial", or leave main_lens.mask out.'
            )
        if self.model == "exact" and not is_possible(plain):
            raise GeometryError(
                f'model is "exact" but the lenslets are {self.lenslets.shape or self.lenslets.layout}, of '
                f"{len(self.lenslets.focal_length)} focal lengths; it takes square ones of one. "
                'Use model = "paraxial" or "auto".'
            )
        return plain

    def operator_grid(self, samples: int | None = None) -> Grid:
        """Object samples of its `operator` over the array's field, so many along a lenslet's pitch."""
        scale, pitch = self.object_scale, self.lenslets.pitch
        n = (
            math.ceil(pitch / self._finest)
            if samples is None
            else checks.whole("samples_per_lenslet", samples)
        )
        shape = tuple(max(1, round(2 * reach * n / pitch)) for reach in self.lenslets.reach)
        step = pitch * scale / n
        center = tuple(0.0 if k % 2 else step / 2 for k in shape)
        return Grid((shape[0], shape[1]), (step, step), (center[0], center[1]))

    def _covering_shape(self) -> tuple[int, int]:
        if self.built:  # the sensor was bought for what is described
            return self.described._covering_shape()
        spread = 1 + self.lenslet_distance / self.pupil_distance
        # Micro-images can be wider than their pitch, where the main lens is too large.
        excess = max(0.0, self.micro_image_width - self.micro_image_pitch) / 2
        half = [(reach * spread + excess) / self.pixels.pixel_pitch for reach in self.lenslets.reach]
        shape = 2 * math.ceil(half[0] - 0.5) + 1, 2 * math.ceil(half[1] - 0.5) + 1
        lengths = picture.length(self.lenslets.pitch), picture.length(self.pixels.pixel_pitch)
        check_pixels(shape, "Check lenslets.pitch ({}) and sensor.pixel_pitch ({}).".format(*lengths))
        return shape

    @cached_property
    def sampling(self) -> grids.Sampling:
        """Required and actual sampling of the planes."""
        wavelength, diameter, pitch = self.wavelength, self.pupil_diameter, self.lenslets.pitch
        scale, reach = self.object_scale, self.lenslets.reach
        object_half = (reach[0] * scale, reach[1] * scale)
        rules = self._plane_rules()
        # An odd number of samples per lenslet: the border between lenslets is one between samples.
        samples = math.ceil(pitch / grids.smallest(rules)) // 2 * 2 + 1
        object_rules = grids.object_rules(
            wavelength, self.object_distance, diameter, max(object_half), pitch / samples
        )
        object_samples = math.ceil(pitch * scale / grids.smallest(object_rules))
        image_half = tuple(n * self.sensor.pixel_pitch / 2 for n in self.sensor.shape)
        return grids.Sampling(
            rules=rules,
            pitch=pitch / samples,
            object_rules=object_rules,
            object_pitch=pitch * scale / object_samples,
            object_half=object_half,
            pupil_half=(diameter / 2, diameter / 2),
            lenslet_half=reach,
            image_half=(image_half[0], image_half[1]),
        )

    def _plane_rules(self) -> tuple[grids.Rule, ...]:
        wavelength, diameter, pitch = self.wavelength, self.pupil_diameter, self.lenslets.pitch
        f_number = resolution.f_number(self.lenslet_distance, pitch)
        shortest = min(self.lenslets.focal_length)
        steepest = (max(self.lenslets.reach) + diameter / 2) / self.separation + pitch / (2 * shortest)
        lenslet = grids.Rule("lenslet", wavelength * shortest / (pitch * grids.MARGIN), "λ f_µ / p / 2")
        return (
            *grids.plane_rules(wavelength, self.main_lens.focal_length, diameter, f_number, steepest),
            lenslet,
        )

    def lenslet_array(self) -> LensletArray:
        """The lenslets: their phases and borders."""
        parts = self.lenslets
        return LensletArray(
            self.lattice,
            parts.focal_length,
            shape=parts.shape,
            fill_factor=parts.fill_factor,
            extent=parts.extent,
            scatter=self.scatter,
        )

    def image_train(self) -> Train:
        """Elements from the field just before the main lens to the sensor."""
        to_lenslets = Propagate(self.separation, "band_limited", grid=self.lenslet_grid)
        return Train((self.lens_train(), to_lenslets, self.relay_train()))

    def relay_train(self) -> Train:
        """Elements from the field just before the lenslets to the sensor.

        Raises
        ------
        GeometryError
            Array or sensor is tilted: elements stand in planes square to the axis.
        """
        if self.lean is not None:
            raise GeometryError(
                "the array or the sensor is tilted, but fields go from plane to plane. Simulate in "
                "Incoherent(), Coherent() or PartiallyCoherent() light, or leave array_tilt, array_bow and "
                "sensor_tilt out of [built]."
            )
        # "auto" pads by no more than light spreads over the short way b: a fraction of the window.
        return Train((self.lenslet_array(), Propagate(self.lenslet_distance, "auto", grid=self.image_grid)))

    def _check_glass(self) -> None:
        """Refuse surfaces of lenslets that cannot be, and glass that the sensor stands in."""
        surface, b = self.lenslets.surface(self.wavelength), self.lenslet_distance
        glass = 0.0 if surface is None else (surface.thickness or 0.0) / surface.index
        if glass > b:
            raise GeometryError(
                f"lenslets.thickness over their index is {glass * 1e6:.5g} µm, but the sensor is only "
                f"{b * 1e6:.5g} µm behind the vertex, counted so. Use thinner glass."
            )

    def _check_lenslets_behind_lens(self) -> None:
        if self.separation <= 0:
            raise GeometryError(
                f"the lenslets would stand {-self.separation * 1e3:.6g} mm before the main lens: "
                f"its image is at z2 = {self.image_distance * 1e3:.6g} mm and a = "
                f"{(self.separation - self.image_distance) * 1e3:.6g} mm. "
                "Use a shorter lenslet focal length or a magnification nearer to -1."
            )

    def in_metres(self, found: DepthMap, source: LightField | Calibration) -> DepthMap:
        """Depth of each place from the focused plane [m]: `lumigraph.depth.metric`, as the glass has it.

        Parameters
        ----------
        found
            Disparities or refocus factors of views, or patches of a camera 2.0.
        source
            These views, or the calibration.
        """
        from lumigraph.depth import metric

        pupil = self.exit_pupil
        f, scale = pupil.magnification * pupil.focal_length, pupil.magnification**2
        seen = metric(
            found, source, focal_length=f, object_distance=pupil.object_distance, wavelength=self.wavelength
        )
        values = arrays.to_numpy(seen.values).astype(float) / scale
        return seen.replaced(values, "depth", 1 / scale)

    def object_to_pupil(self) -> float:
        """Distance from the focused plane to the entrance pupil, the centre of perspective [m]."""
        return self.exit_pupil.object_distance / self.exit_pupil.magnification**2


def _check_room(what: str, way: tuple[float, float], most: float, where: str) -> None:
    """Refuse an offset (y, x) beyond the room for it [m]."""
    if (far := max(map(abs, way))) > most * (1 + 1e-9) + 1e-15:
        raise GeometryError(
            f"{what} is {far * 1e6:.6g} µm but the {where} has room for {most * 1e6:.6g} µm. Use less, or "
            "change fill_factor."
        )
