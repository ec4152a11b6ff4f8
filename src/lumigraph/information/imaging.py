"""Scenes, their raw images and the noise in these, as a linear problem with Gaussian chances."""

import math
from dataclasses import dataclass, replace
from typing import cast

import numpy as np

from lumigraph.core.grid import Grid
from lumigraph.core.linear import Linear
from lumigraph.errors import GeometryError
from lumigraph.information.bounds import Light, reading
from lumigraph.information.points import near_axis
from lumigraph.information.scenes import Scenes, coloured, frequencies, ring_means, rings
from lumigraph.instruments import Camera, LensletCamera, LightFieldMicroscope
from lumigraph.instruments.capabilities import WithPupil
from lumigraph.instruments.instrument import Instrument
from lumigraph.operators.fourier_microscope import fourier_operator
from lumigraph.operators.sample_images import sample_images
from lumigraph.sensor import Sensor
from lumigraph.simulation.microscope_scene import SAMPLES

ENOUGH = 1e-3
"""Part of a sum that conjugate gradients may leave."""

STEPS = 500
"""Steps of conjugate gradients, at most."""

Seeing = tuple[Linear, np.ndarray, Sensor]
"""Operator of planes, the object's area whose light is 1 in a pixel (nz,) [m²], and the sensor."""


@dataclass(frozen=True, slots=True, eq=False)
class Imaging:
    """Raw images of scenes.

    Parameters
    ----------
    operator
        To raw images, of planes on its own grid.
    across
        Two matrices, from the samples of a scene to the grid's, along y and x.
    light
        (nz,), electrons per pixel for what the operator has as 1.
    power
        (n, n), variances of a scene's waves.
    mean, noise
        (ny, nx), electrons of the mean scene; their standard deviation.
    usual
        (nz, n, n): information of waves in the mean over their direction, over that of the scenes: where
        conjugate gradients begin.
    """

    operator: Linear
    across: tuple[np.ndarray, np.ndarray]
    light: np.ndarray
    power: np.ndarray
    mean: np.ndarray
    noise: np.ndarray
    usual: np.ndarray

    @property
    def planes(self) -> int:
        """Depths that shine at once."""
        return len(self.light)

    def electrons(self, scene: np.ndarray) -> np.ndarray:
        """Mean electrons (ny, nx) of scenes (nz, n, n), without those of dark current and background."""
        return _forward(self.operator, self.across, self.light, scene)

    def returned(self, raw: np.ndarray) -> np.ndarray:
        """The transpose: (nz, n, n) of a raw image."""
        y, x = self.across
        back = self.operator.adjoint(raw.astype(np.float32)).astype(np.float64)
        return self.light[:, None, None] * (y.T @ back @ x)

    def solved(self, right: np.ndarray, least: float = 0.0) -> np.ndarray:
        """Solution v (nz, n, n) of (1 + C^½ Aᵀ N⁻¹ A C^½) v = right, by conjugate gradients.

        They end where the square of what is missing, in the norm of the left side, is below `least`; or,
        for 0, below a part of right · v.
        """
        v, rest = np.zeros_like(right), right.copy()
        ahead = self._begun(rest)
        step, size = ahead, float((rest * ahead).sum())
        for _ in range(STEPS):
            if size <= (least or ENOUGH * max(float((right * v).sum()), 1e-300)):
                return v
            image = self._weighed(step)
            length = size / float((step * image).sum())
            v, rest = v + length * step, rest - length * image
            ahead, before = self._begun(rest), size
            size = float((rest * ahead).sum())
            step = ahead + size / before * step
        raise GeometryError(
            f"the reconstruction does not converge in {STEPS} steps: the light is too strong for the noise. "
            "Use fewer photons."
        )

    def covered(self, z: np.ndarray) -> np.ndarray:
        """P z: the remaining covariance times an object (nz, n, n)."""
        return coloured(self.solved(coloured(z, self.power)), self.power)

    def reconstructed(self, raw: np.ndarray) -> np.ndarray:
        """Scenes (nz, n, n) that explain a raw image (ny, nx) [electrons] best, by a linear rule."""
        seen = self.returned((raw - self.mean) / self.noise**2)
        found = self.solved(coloured(seen, self.power), ENOUGH * seen.size)
        return 1 + coloured(found, self.power)

    def _weighed(self, v: np.ndarray) -> np.ndarray:
        raw = self.electrons(coloured(v, self.power)) / self.noise**2
        return v + coloured(self.returned(raw), self.power)

    def _begun(self, rest: np.ndarray) -> np.ndarray:
        return np.fft.ifft2(np.fft.fft2(rest) / (1 + self.usual)).real


def shares(z: np.ndarray, found: np.ndarray) -> np.ndarray:
    """Share of each wave of z (nz, n, n) in zᵀ P z over the number of samples; `found` is P z."""
    return (np.conj(np.fft.fft2(z)) * np.fft.fft2(found)).real / z.shape[-1] ** 4


def imaging(
    instrument: Instrument, depths: np.ndarray, scenes: Scenes, light: Light, accuracy: float
) -> Imaging:
    """Linear problem of an instrument and scenes at depths that shine at once; see `reconstruction_error`."""
    check(instrument, depths, scenes)
    operator, area, sensor = _operator(instrument, depths, scenes, accuracy)
    grid = operator.object_grid
    assert grid is not None
    across = waves_between(grid.y, scenes), waves_between(grid.x, scenes)
    electrons = _electrons(sensor, scenes, light) * area
    even = np.ones((len(depths), scenes.samples, scenes.samples))
    mean = np.maximum(_forward(operator, across, electrons, even), 0)
    mean = mean + sensor.dark_signal + sensor.quantum_efficiency * light.background
    found = Imaging(
        operator, across, electrons, scenes.power, mean,
        np.sqrt(mean + reading(sensor) ** 2), np.zeros_like(even),
    )  # fmt: skip
    return replace(found, usual=_usual(found))


def waves_between(places: np.ndarray, scenes: Scenes) -> np.ndarray:
    """Matrix (places, n) from a scene's samples to places [m]: by waves within the square, dark beyond."""
    n, half = scenes.samples, scenes.size / 2
    own = (np.arange(n) - (n - 1) / 2) * scenes.pitch
    apart = (places[:, None] - own) / scenes.pitch
    small = np.abs(np.sin(np.pi * apart / n)) < 1e-12
    below = np.where(small, 1.0, np.sin(np.pi * apart / n))
    found = np.sin(np.pi * apart) / (n * below)
    if n % 2 == 0:
        found *= np.cos(np.pi * apart / n)
    found[small] = 1.0
    return found * (np.abs(places) <= half * (1 + 1e-9))[:, None]


def _forward(
    operator: Linear, across: tuple[np.ndarray, np.ndarray], light: np.ndarray, scene: np.ndarray
) -> np.ndarray:
    y, x = across
    planes = light[:, None, None] * (y @ scene @ x.T)
    return np.asarray(operator.forward(planes.astype(np.float32)), np.float64)


def _usual(seen: Imaging) -> np.ndarray:
    n = len(seen.power)
    rng, at, count = np.random.default_rng(0), frequencies(n), rings(n)
    waves = np.fft.fft2(rng.standard_normal((seen.planes, n, n)))
    waves *= n / np.abs(waves)
    z = np.fft.ifft2(waves).real
    told = seen.returned(seen.electrons(z) / seen.noise**2)
    information = (np.conj(waves) * np.fft.fft2(told)).real / n**2
    found = [np.interp(at, np.arange(1, count + 1), ring_means(one, at, count)) for one in information]
    return np.maximum(np.stack(found), 0) * seen.power * n**2


def _operator(instrument: Instrument, depths: np.ndarray, scenes: Scenes, accuracy: float) -> Seeing:
    if isinstance(instrument, WithPupil):
        return _of_microscope(cast(LightFieldMicroscope, instrument), depths, scenes, accuracy)
    return _of_camera(cast(Camera, instrument), depths, scenes, accuracy)


def _electrons(sensor: Sensor, scenes: Scenes, light: Light) -> float:
    """Electrons of an area of the mean scene [1/m²]."""
    return sensor.quantum_efficiency * light.photons / scenes.pitch**2


def electrons(instrument: Instrument, depths: np.ndarray, scenes: Scenes, light: Light) -> np.ndarray:
    """`Imaging.light` of an instrument."""
    return _electrons(instrument.sensor, scenes, light) * _area(instrument, depths)


def _area(instrument: Instrument, depths: np.ndarray) -> np.ndarray:
    """Area of the object (nz,) that stands for a pixel [m²]."""
    if isinstance(instrument, WithPupil):
        scope = cast(LightFieldMicroscope, instrument)
        area = (scope.lenslet_size * scope.sensor.pixel_pitch / scope.micro_image_pitch) ** 2
        if scope.in_pupil:
            points = scope.fourier_points()
            area = math.prod(scope.object_grid.pitch) / points.whole
        return np.full(len(depths), area)
    optics = cast(Camera, instrument).optics()
    return (optics.sensor.pixel_pitch * (optics.object_distance + depths) / optics.separation) ** 2


def _of_camera(camera: Camera, depths: np.ndarray, scenes: Scenes, accuracy: float) -> Seeing:
    nearest = min(camera.defocused(float(dz)) for dz in depths)
    small = near_axis(camera, depths, scenes.size)
    finest = camera.wavelength * nearest / camera.pupil_diameter
    grid, planes = _grid(scenes, finest), tuple(depths.tolist())
    if _repeats(small):
        operator = small.operator_on(grid, planes, accuracy=accuracy)
    else:
        volume = cast(LensletCamera, small).part_volume([], grid, planes, accuracy=accuracy)
        operator = sample_images(volume, planes)
    return operator, _area(small, depths), small.sensor


def _repeats(camera: Camera) -> bool:
    """True if the camera has an operator of its own: lenslets that are alike, or none."""
    array = camera.lenslet_array()
    return array is None or array.scatter is None


def _grid(scenes: Scenes, finest: float) -> Grid:
    """Grid fine enough that aliases of a scene's waves are finer than a lens resolves."""
    finer = math.ceil(scenes.pitch / finest + 0.5)
    n, pitch = scenes.samples * finer, scenes.pitch / finer
    middle = pitch / 2 if n % 2 == 0 else 0.0
    return Grid((n, n), (pitch, pitch), (middle, middle))


def _of_microscope(
    scope: LightFieldMicroscope, depths: np.ndarray, scenes: Scenes, accuracy: float
) -> Seeing:
    if scope.configuration == "fourier":
        points, pitch = scope.fourier_points(), scope.object_grid.pitch[0]
        across = min(scope.object_grid.shape[0], 2 * math.ceil(scenes.size / pitch / 2) + 1)
        operator = fourier_operator(points.objectives, points.mosaic, depths.tolist(), across)
    else:
        finest = scope.wavelength / (2 * scope.objective.numerical_aperture)
        samples = math.ceil(scope.lenslet_size * (1 / finest + 1 / (2 * scenes.pitch)))
        operator = scope.operator(depths.tolist(), max(samples, SAMPLES), accuracy=accuracy)
    return operator, _area(scope, depths), scope.sensor


def check(instrument: Instrument, depths: np.ndarray, scenes: Scenes) -> None:
    """Refuse scenes that an instrument cannot see, before any work.

    Raises
    ------
    GeometryError
        A scene wider than the field of view, or finer than a Fourier microscope's pixels; a depth that is not
        imaged; no camera and no microscope.
    """
    grid, shrunk = _seen_grid(instrument), 1.0
    if isinstance(instrument, Camera):
        shrunk = min(instrument.defocused(float(dz)) for dz in depths) / instrument.object_distance
    elif _is_fourier(instrument) and scenes.pitch < grid.pitch[0] * (1 - 1e-9):
        raise GeometryError(
            f"scenes have samples {scenes.pitch * 1e6:.6g} µm apart but the microscope's pixels see "
            f"{grid.pitch[0] * 1e6:.6g} µm. Use scenes of a larger pitch."
        )
    if scenes.size > min(grid.size) * shrunk * (1 + 1e-9):
        raise GeometryError(
            f"scenes are {scenes.size * 1e6:.6g} µm wide but the field of view is "
            f"{min(grid.size) * shrunk * 1e6:.6g} µm. Use fewer samples, or a smaller pitch."
        )


def usual_scenes(instrument: Instrument) -> Scenes:
    """Scenes of power 1/f² as fine as an instrument resolves in focus, or samples.

    A camera's main lens resolves λ z/D. A microscope takes five samples for each lenslet; a Fourier
    microscope one for each pixel, of which the scene has every second.
    """
    if isinstance(instrument, Camera):
        return Scenes(instrument.wavelength * instrument.object_distance / instrument.pupil_diameter / 2)
    return Scenes(_seen_grid(instrument).pitch[0] * (2 if _is_fourier(instrument) else 1))


def _is_fourier(instrument: Instrument) -> bool:
    return cast(LightFieldMicroscope, instrument).configuration == "fourier"


def _seen_grid(instrument: Instrument) -> Grid:
    if isinstance(instrument, WithPupil):
        return cast(LightFieldMicroscope, instrument).object_grid
    if isinstance(instrument, Camera):
        return instrument.object_grid
    raise GeometryError(f"{type(instrument).__name__} has no operator of planes.")
