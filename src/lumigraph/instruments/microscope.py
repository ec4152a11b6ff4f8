"""The light-field microscope."""

import math
from collections.abc import Sequence
from os import PathLike
from typing import ClassVar

import numpy as np

from lumigraph.core import checks
from lumigraph.core.calibration import Calibration
from lumigraph.core.linear import Linear
from lumigraph.core.progress import Progress
from lumigraph.errors import GeometryError
from lumigraph.instruments import microscope_design
from lumigraph.instruments.parameters import MagnificationRange, Parameter
from lumigraph.instruments.point_view import PointImage
from lumigraph.instruments.scope_with_parts import MicroscopeGradients
from lumigraph.operators.lenslets.points import OUTSIDE
from lumigraph.operators.microscope.building import SampledLenslets, microscope_operator, require_accuracy
from lumigraph.operators.microscope.cell import CellSampling
from lumigraph.operators.microscope.fourier_microscope import fourier_operator
from lumigraph.operators.microscope.layout import SensorLayout, cell_sampling, laid_out
from lumigraph.operators.microscope.pixels import narrowed
from lumigraph.operators.microscope.pupil import PupilImages
from lumigraph.simulation.microscope_scene import SAMPLES, point_image

MODELLED = 1e-2
"""Accuracy of the model of a real camera: that of the light of 10 000 photons in a pixel."""

FINER = 1.5
"""Samples of light that is traced by rays, over whole pixels: those between are interpolated."""


class LightFieldMicroscope(MicroscopeGradients):
    """A microscope with lenslets in front of its sensor.

    Parameters
    ----------
    wavelength
        Central wavelength of the emission [m], or text with a unit.
    objective
        `MicroscopeObjective`.
    lenslets
        `Lenslets`, square.
    sensor
        `Pixels`; without a shape all micro-images fit.
    configuration
        "1.0": lenslets at the native image, sensor in their focal plane. "2.0": lenslets `lenslet_offset`
        behind the native image, sensor at `sensor_distance`. "fourier": lenslets in the pupil that
        `fourier_lens` images.
    bandwidth
        Full width of the emission band [m]; left out, one wavelength.
    relay_magnification
        Magnification of the lenses between the lenslets' images and the sensor.
    lenslet_offset
        Native image to lenslets [m], positive behind it ("2.0").
    sensor_distance
        Lenslets to the plane imaged on the sensor, b [m]; left out, their focal length.
    fourier_lens
        Focal length of the lens between native image and lenslets [m] ("fourier").

    Raises
    ------
    FormatError
        A wrong or missing key, a wrong unit.
    GeometryError
        Values that no microscope can have.

    Examples
    --------
    >>> scope = LightFieldMicroscope.from_catalogue("lfm-guv")
    >>> round(scope.micro_image_pitch / scope.pixels.pixel_pitch, 2)
    15.38
    """

    KIND: ClassVar[str] = "light-field-microscope"

    def operator(
        self,
        depths: Sequence[float] | None = None,
        samples_per_lenslet: int | None = None,
        *,
        accuracy: float = 1e-3,
        pixels: int | Calibration | None = None,
        folder: str | PathLike[str] | None = None,
        progress: Progress | None = None,
    ) -> Linear:
        """Operator of this microscope for slices at `depths`, for `lumigraph.deconvolve`.

        Parameters
        ----------
        depths
            From the focused plane [m], positive farther from the objective, for an object (z, y, x); None
            for the focused plane alone, an object (y, x).
        samples_per_lenslet
            s: object samples along a lenslet; an odd number has one on its axis. None for 5. A Fourier
            microscope samples the object as its pixels do.
        accuracy
            Relative rms error of points' images. It sets how far light is followed, how finely it is sampled
            and how many samples behind a lenslet pixels are interpolated from. A Fourier microscope has none.
        pixels
            Pixels of the raw image: None, those of this description; a `Calibration`, those of a real
            camera, wherever its lenslets stand; a whole number N, N × N for each lenslet, as `rectify` gives.
        folder
            Keeps what is computed in files, mapped into memory when it is used.
        progress
            Called as ``progress(fraction)`` after each slice.

        Warns
        -----
        SamplingWarning
            Images that are less exact than asked for, with the depth where they are off most.

        Raises
        ------
        SamplingError
            What is computed does not fit in memory, and there is no folder.
        GeometryError
            No depths, or samples below 1.
        """
        planes = None if depths is None else _numbers(depths)
        if self.configuration == "fourier":
            return fourier_operator(self.objectives, self._mosaic(), planes)
        samples = (
            5 if samples_per_lenslet is None else checks.whole("samples_per_lenslet", samples_per_lenslet)
        )
        layout = self._layout(samples, pixels, planes or (0.0,), accuracy)
        return microscope_operator(
            self.objectives, self.lenslet, layout, planes,
            accuracy=accuracy, folder=folder, progress=progress,
        )  # fmt: skip

    def operator_for(
        self,
        calibration: Calibration | None,
        depths: Sequence[float] | None = None,
        samples_per_lenslet: int | None = None,
        progress: Progress | None = None,
    ) -> Linear:
        """Operator of a real camera's pixels, as accurate as photographs need; its object is a volume."""
        planes = depths or (0.0,)
        return self.operator(
            planes, samples_per_lenslet, accuracy=MODELLED, pixels=calibration, progress=progress
        )

    def would_be(self, share: float) -> str:
        """Relay magnification that would explain a lattice so many times as large."""
        relay = self.relay_magnification
        return f"a relay of {relay * share:.4g} instead of {relay:.4g}"

    def depth_reach(self) -> float:
        """A tenth of a millimetre [m]."""
        return 1e-4

    def point_view(self, dz: float = 0.0) -> PointImage:
        """Image of a point on the axis at a depth `dz` [m], by the scalar model and one wavelength."""
        return microscope_design.point_view(self, checks.finite("dz", dz))

    def _count(self) -> tuple[int, int]:
        return self.lenslets.count

    def parameters(self) -> tuple[Parameter, ...]:
        """Wavelength, objective, distances, lenslets, relay and pixels."""
        return microscope_design.parameters(self)

    def point_image(self, y: float, x: float, dz: float = 0.0, *, accuracy: float = 1e-3) -> np.ndarray:
        """Raw image (ny, nx) of a point anywhere [m], as bright as a sample of 1 of `object_grid`.

        `accuracy` is the relative rms error; a Fourier microscope has none, and sees no points beside its
        `object_grid`.

        Examples
        --------
        >>> scope = LightFieldMicroscope.from_catalogue("lfm-worm")
        >>> scope.point_image(10e-6, 0.0, 5e-6).shape == scope.sensor.shape
        True
        """
        return self.imaged_point(y, x, dz, accuracy)[0]

    def imaged_point(self, y: float, x: float, dz: float, accuracy: float) -> tuple[np.ndarray, float]:
        """Image as of `point_image`, with the estimated relative rms error."""
        y, x, dz = (checks.finite(name, at) for name, at in zip(("y", "x", "dz"), (y, x, dz), strict=True))
        if self.configuration == "fourier":
            return self._fourier_point(y, x, dz), math.nan
        beside = any(
            abs(at) > n * self.lenslet_size / 2 for at, n in zip((y, x), self.lenslets.count, strict=True)
        )
        finer = max(accuracy * OUTSIDE, 1e-5) if beside else accuracy
        layout = self._layout(SAMPLES, None, (dz,), finer)
        image, error = point_image(self.objectives, self.lenslet, layout, (y, x, dz), finer)
        return image, error / OUTSIDE if beside else error

    def _fourier_point(self, y: float, x: float, dz: float) -> np.ndarray:
        grid = self.object_grid
        if any(abs(at) > size / 2 for at, size in zip((y, x), grid.size, strict=True)):
            return np.zeros(self.sensor.shape)
        return self.fourier_points().image(y, x, dz)

    def pupil_images(
        self,
        terms: Sequence[int],
        *,
        farthest: float = 0.0,
        accuracy: float = 1e-2,
        pixels: int | Calibration | None = None,
        double: bool = False,
    ) -> PupilImages:
        """Images of points as functions of Zernike terms of the pupil, with derivatives by them.

        Parameters
        ----------
        terms
            Noll indices; their coefficients, in waves rms, add to the description's aberrations.
        farthest
            Largest distance of points from the focused plane [m]; it sets the pixels' interpolation.
        accuracy, pixels
            As in `operator`.
        double
            Double precision, for checks of derivatives.

        Raises
        ------
        GeometryError
            A Fourier microscope, rays, a term that is no Noll index.
        """
        if self.configuration == "fourier":
            raise GeometryError(
                "derivatives by the pupil's phase need configuration '1.0' or '2.0', not 'fourier'."
            )
        depths = checks.finite("farthest", farthest), -farthest  # one side is seen more finely
        layout = self._layout(SAMPLES, pixels, depths, accuracy)
        return PupilImages(self.objectives, self.lenslet, layout, tuple(terms), accuracy, double)

    def _layout(
        self, samples: int, pixels: int | Calibration | None, depths: Sequence[float], accuracy: float
    ) -> SampledLenslets:
        require_accuracy(accuracy)
        if isinstance(pixels, int) and not isinstance(pixels, bool):
            if pixels < 2:
                raise GeometryError(f"pixels is {pixels} but a lenslet needs at least 2 along each side.")
            return SampledLenslets(self.lenslets.count, self._sampled(samples, pixels, 1 / pixels, 0))
        calibration = self.calibration if pixels is None else pixels
        if not isinstance(calibration, Calibration):
            raise GeometryError(f"pixels is {pixels!r} but must be a whole number, a Calibration or None.")
        sampling = self._sampling(samples, calibration, tuple(depths), accuracy)
        return laid_out(sampling, calibration, self.lenslet_size)

    def _sampling(
        self, samples: int, calibration: Calibration, depths: tuple[float, ...], accuracy: float
    ) -> CellSampling:
        fill, pitch = self.pixels.fill_factor, calibration.lattice.pitch
        if self.objective.model == "rays":
            N = math.ceil(max(FINER, math.sqrt(2) / fill) * pitch)
            return self._sampled(samples, N, 1 / pitch, 1)
        shortest = min(self.objectives, key=lambda one: one.wavelength)
        behind = SensorLayout(calibration, fill)
        return cell_sampling(shortest, self.lenslet, behind, samples, depths, accuracy)

    def _sampled(self, samples: int, N: int, apart: float, degree: int) -> CellSampling:
        """Sampling by N samples along a lenslet, for pixels that stand so far apart [lenslets]."""
        fill = self.pixels.fill_factor
        width = narrowed(fill * apart, N) if degree == 1 else fill * apart
        return CellSampling(samples, N, width, degree, fill**2)

    def check_accuracy(self, accuracy: float) -> None:
        """Refuse an accuracy that `operator` cannot reach, before any work."""
        require_accuracy(accuracy)

    def magnifications(self) -> MagnificationRange:
        """Magnifications of the objective."""
        own = self.objective.magnification
        return MagnificationRange(
            "M, of the objective", own, (own / 4, own * 4),
            lambda m: self.replace(objective={"magnification": m}),
        )  # fmt: skip


def _numbers(depths: Sequence[float]) -> tuple[float, ...]:
    try:
        return tuple(float(dz) for dz in np.asarray(depths, np.float64).reshape(-1))
    except (TypeError, ValueError):
        raise GeometryError(
            f"depths are {depths!r} but must be numbers [m], such as (-5e-6, 0.0, 5e-6)."
        ) from None
