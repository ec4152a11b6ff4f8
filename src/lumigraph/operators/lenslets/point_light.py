"""Light of a point in the lenslet plane, at any place there: the main lens' diffraction, in focus or not."""

import math
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Protocol

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.special import j0

from lumigraph.core.grid import Grid
from lumigraph.elements import ThinLens, Train
from lumigraph.operators.lenslets import exact_light
from lumigraph.operators.lenslets.cell_response import legendre
from lumigraph.operators.sampling import cells as _cells
from lumigraph.operators.sampling.camera import CameraOptics

PUPIL = 1024
"""Samples across the main lens, or more where its light is followed far."""

_BLOCK = 2**21
"""Numbers worked on at a time."""


class PointLight(Protocol):
    """Amplitude of a point's light around its image, without the lenslet plane's phase exp(iπw²/(λL))."""

    def at(self, y: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Amplitude (y, x) at distances from the point's image [m], for light of 1 in all [1/m]."""
        ...


def point_light(
    camera: CameraOptics, distance: float, widest: float, place: tuple[float, float] = (0.0, 0.0)
) -> PointLight:
    """Light of a point at a distance from the main lens [m], followed to `widest` from its image [m].

    Where the image is makes no difference, but to the exact model: at `place` in the lenslet plane [m].
    """
    if camera.model != "exact":
        return paraxial_light(camera, distance, widest)
    lens = _cells.lens(camera)
    if place != (0.0, 0.0) or _round(lens) is None:
        return exact_light.ObliqueLight(camera, lens, distance, exact_light.samples(camera, widest), place)
    return RoundPupilLight(exact_light.radial(camera, distance, widest))


def _round(lens: Train) -> ThinLens | None:
    """The only element of a lens, where that has a round stop."""
    first = next(iter(lens.elements))
    if len(lens.elements) == 1 and isinstance(first, ThinLens) and first.diameter is not None:
        return first
    return None


def paraxial_light(
    camera: CameraOptics, distance: float, widest: float, samples: int = PUPIL
) -> "RoundPupilLight | SampledPupilLight":
    """Light of a point behind a paraxial lens, with at least so many samples across it."""
    lens = _cells.lens(camera)
    if (first := _round(lens)) is not None:
        half, squared = camera.pupil_diameter / 2, camera.wavelength * camera.separation
        focus = 1 / distance + 1 / camera.separation - 1 / first.focal_length
        airy = squared / half / 2
        far = airy * 2 ** (math.ceil(8 * math.log2(max(widest / airy, 1.0))) / 8)  # points share it
        return RoundPupilLight(_radial(half, squared, np.pi / camera.wavelength * focus, far))
    return SampledPupilLight(camera, lens, distance, widest, samples)


@dataclass(frozen=True, slots=True)
class RoundPupilLight:
    """Light behind a round lens: a Hankel transform, the same in all directions.

    Parameters
    ----------
    radial
        Amplitude by the distance from the image.
    """

    radial: CubicSpline

    def at(self, y: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Amplitude (y, x) in the lenslet plane, as of `PointLight.at`."""
        return self.radial(np.hypot(y[:, None], x))


@lru_cache(maxsize=64)
def _radial(half: float, squared: float, focus: float, widest: float) -> CubicSpline:
    """Light behind a stop of radius `half`, with λL `squared`, as `RoundPupilLight` has it."""
    turns = (abs(focus) * half**2 + 2 * np.pi * widest * half / squared) / np.pi
    rho, weight = legendre(0, half, 64 + 2 * int(turns))
    at = np.arange(0, widest + 2 * squared / half, squared / half / 32)
    pupil = np.exp(1j * focus * rho**2) * 2 * np.pi * rho * weight / (squared * half * np.sqrt(np.pi))
    both = np.stack([pupil.real, pupil.imag], axis=1)
    parts = np.array_split(2 * np.pi / squared * at, math.ceil(len(at) * len(rho) / _BLOCK))
    values = np.concatenate([j0(np.outer(part, rho)) @ both for part in parts])
    return CubicSpline(at, values[:, 0] + 1j * values[:, 1])


@dataclass(frozen=True, slots=True)
class SampledPupilLight:
    """Light behind any lens: a matrix Fourier transform of its pupil.

    Parameters
    ----------
    camera, lens
        The camera, and its main lens turned with the lenslets.
    distance
        Of the point before the main lens [m].
    widest
        How far from its image light is followed [m].
    samples
        Across the main lens, at least.
    reach
        How far places are sampled from the axis, over half of the camera's diameter; None for its stop's.
    """

    camera: CameraOptics
    lens: Train
    distance: float
    widest: float
    samples: int = PUPIL
    reach: float | None = None
    _pupil: list = field(default_factory=list, repr=False)

    def at(self, y: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Amplitude (y, x) in the lenslet plane, as of `PointLight.at`."""
        grid, pupil = self.behind()
        turn = -2j * np.pi / (self.camera.wavelength * self.camera.separation)
        return np.exp(turn * np.outer(y, grid.y)) @ (pupil @ np.exp(turn * np.outer(grid.x, x)))

    @property
    def grid(self) -> Grid:
        """The pupil's."""
        # Light comes again after as many λL/D as there are samples.
        count = max(self.samples, math.ceil(3 * self.widest / _cells.airy(self.camera)))
        wide = math.ceil(count * (self.reach or _cells.stop_reach(self.lens)))
        return Grid.square(wide + 8, self.camera.pupil_diameter / count)

    def behind(self) -> tuple[Grid, np.ndarray]:
        """The pupil's grid and its samples, for light of 1 behind a round stop."""
        if not self._pupil:
            grid = self.grid
            pupil = _cells.over_lens(self.camera, self.lens, self.distance, grid)
            squared = self.camera.wavelength * self.camera.separation
            light = np.vdot(pupil, pupil).real * squared**2 / np.prod(grid.pitch)
            self._pupil.extend((grid, pupil * np.sqrt(_cells.stop_area(self.lens) / light)))
        return self._pupil[0], self._pupil[1]
