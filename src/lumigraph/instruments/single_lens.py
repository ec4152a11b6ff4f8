"""A camera without lenslets."""

import warnings
from collections.abc import Sequence
from functools import cached_property
from typing import ClassVar

from pydantic import model_validator

from lumigraph.core import checks
from lumigraph.core.grid import Grid
from lumigraph.core.linear import Linear, stack
from lumigraph.core.progress import part
from lumigraph.design import resolution
from lumigraph.elements import Train
from lumigraph.errors import FormatError, GeometryError, SamplingError, SamplingWarning
from lumigraph.instruments import grids
from lumigraph.instruments.angular import refuse_angles
from lumigraph.instruments.making import Making
from lumigraph.instruments.with_parts import CameraGradients
from lumigraph.operators import CameraOptics, single_lens_operator
from lumigraph.operators.single_lens import FINEST
from lumigraph.propagation import Propagate


class SingleLensCamera(CameraGradients):
    """A main lens and a sensor at its image.

    Parameters
    ----------
    wavelength, object_distance
        [m] or text with a unit.
    main_lens
        `MainLens`, with its diameter.
    sensor
        `Pixels`, with its shape.

    Raises
    ------
    FormatError
        The diameter or the shape is missing; a wrong key or unit.
    GeometryError
        The object is inside the focal length; values that no camera can have.

    Examples
    --------
    >>> camera = SingleLensCamera(
    ...     wavelength="633 nm", object_distance="316 mm",
    ...     main_lens={"focal_length": "158 mm", "diameter": "5 mm"},
    ...     sensor={"pixel_pitch": "5 um", "shape": [2000, 2000]},
    ... )
    >>> round(camera.f_number, 1)
    63.2
    """

    KIND: ClassVar[str] = "single-lens"

    @model_validator(mode="after")
    def _is_complete(self) -> "SingleLensCamera":
        if self.main_lens.diameter is None:
            raise FormatError(
                "main_lens.diameter is missing. A camera without lenslets needs it: nothing else sets it."
            )
        if self.pixels.shape is None:
            raise FormatError("sensor.shape is missing. A camera without lenslets needs it: write [ny, nx].")
        refuse_angles(self.pixels.angular_response, "cameras without lenslets")
        self._check_beyond_focus()
        return self

    @property
    def pupil_diameter(self) -> float:
        """Diameter D of the main lens' stop [m]."""
        assert self.main_lens.diameter is not None  # checked above
        return self.main_lens.diameter

    @cached_property
    def sampling(self) -> grids.Sampling:
        """Required and actual sampling of the planes."""
        wavelength, z1, z2, diameter = (
            self.wavelength,
            self.object_distance,
            self.image_distance,
            self.pupil_diameter,
        )
        sensor = self.sensor
        image_half = tuple(n * sensor.pixel_pitch / 2 for n in sensor.shape)
        object_half = tuple(half / self.magnification for half in image_half)
        steepest = (max(image_half) + diameter / 2) / z2
        rules = grids.plane_rules(
            wavelength, self.main_lens.focal_length, diameter, resolution.f_number(z2, diameter), steepest
        )
        object_rules = grids.object_rules(wavelength, z1, diameter, max(object_half), grids.smallest(rules))
        return grids.Sampling(
            rules=rules,
            pitch=grids.smallest(rules),
            object_rules=object_rules,
            object_pitch=grids.smallest(object_rules),
            object_half=(object_half[0], object_half[1]),
            pupil_half=(diameter / 2, diameter / 2),
            lenslet_half=None,
            image_half=(image_half[0], image_half[1]),
        )

    def image_train(self) -> Train:
        """Elements from the field just before the main lens to the sensor."""
        return Train(
            (self.lens_train(), Propagate(self.image_distance, "band_limited", grid=self.image_grid))
        )

    def operator_grid(self, samples: int | None = None) -> Grid:
        """Object samples of its `operator`: those of the focused plane."""
        if samples is not None:
            raise GeometryError("the camera has no lenslets to count by. Leave samples_per_lenslet out.")
        return self.object_grid

    def _planes(
        self, optics: CameraOptics, depths: Sequence[float] | None, grid: Grid, making: Making
    ) -> Linear:
        if not 1e-2 >= checks.finite("accuracy", making.accuracy, "1", SamplingError) >= FINEST:
            raise SamplingError(
                f"accuracy is {making.accuracy:g} but a single lens is imaged to {FINEST:g}, relative rms. "
                f"Ask for {FINEST:g} to 0.01."
            )
        maps, planes = [], (0.0,) if depths is None else depths
        for number, dz in enumerate(planes):
            maps.append(_warned(single_lens_operator(optics, grid, dz, making.accuracy), dz, making.accuracy))
            part(making.progress, number, len(planes))(1.0)
        return maps[0] if depths is None else stack(maps, depths=depths)


def _warned(operator: Linear, dz: float, accuracy: float) -> Linear:
    """The operator, with a warning if it is less accurate than requested."""
    if operator.error > accuracy:
        warnings.warn(
            f"an accuracy of {accuracy:g} was asked for but images of the plane at {dz:g} m, far out of "
            f"focus, are off by some {operator.error:.2g} rms. Ask for a coarser accuracy, or less blur.",
            SamplingWarning,
            stacklevel=2,
        )
    return operator
