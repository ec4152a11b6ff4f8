"""Light of a point in the lenslet plane, at any place there: the main lens' diffraction, in focus or not."""

import math
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.special import j0

from lumigraph.core.grid import Grid
from lumigraph.elements import ThinLens, Train
from lumigraph.operators import cells as _cells
from lumigraph.operators import exact_light
from lumigraph.operators.camera import CameraOptics
from lumigraph.operators.cell_response import legendre

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
    """Of a point at a distance from the main lens [m], followed to `widest` from its image [m].

    Where the image is makes no difference, but to the exact model: at `place` in the lenslet plane [m].
    """
    lens = _cells.lens(camera)
    first = next(iter(lens.elements))
    if camera.model == "exact" and (place != (0.0, 0.0) or len(lens.elements) > 1):
        return exact_light.Oblique(camera, lens, distance, widest, place)
    if len(lens.elements) == 1 and isinstance(first, ThinLens) and first.diameter is not None:
        if camera.model == "exact":
            return Round(exact_light.radial(camera, distance, widest))
        return Round(_radial(camera, first.focal_length, distance, widest))
    return Sampled(camera, lens, distance, widest)


@dataclass(frozen=True, slots=True)
class Round:
    """Behind a round lens: a Hankel transform, the same in all directions."""

    radial: CubicSpline

    def at(self, y: np.ndarray, x: np.ndarray) -> np.ndarray:
        """As `PointLight.at`."""
        return self.radial(np.hypot(y[:, None], x))


def _radial(camera: CameraOptics, focal_length: float, distance: float, widest: float) -> CubicSpline:
    half, squared = camera.pupil_diameter / 2, camera.wavelength * camera.separation
    focus = np.pi / camera.wavelength * (1 / distance + 1 / camera.separation - 1 / focal_length)
    turns = (abs(focus) * half**2 + 2 * np.pi * widest * half / squared) / np.pi
    rho, weight = legendre(0, half, 64 + 3 * int(turns))
    at = np.arange(0, widest + 2 * squared / half, squared / half / 64)
    pupil = np.exp(1j * focus * rho**2) * 2 * np.pi * rho * weight
    parts = np.array_split(2 * np.pi / squared * at, math.ceil(len(at) * len(rho) / _BLOCK))
    values = np.concatenate([j0(np.outer(part, rho)) @ pupil for part in parts])
    return CubicSpline(at, values / (squared * half * np.sqrt(np.pi)))


@dataclass(frozen=True, slots=True)
class Sampled:
    """Behind any lens: a matrix Fourier transform of its pupil."""

    camera: CameraOptics
    lens: Train
    distance: float
    widest: float
    samples: int = PUPIL
    _pupil: list = field(default_factory=list, repr=False)

    def at(self, y: np.ndarray, x: np.ndarray) -> np.ndarray:
        """As `PointLight.at`."""
        grid, pupil = self.behind()
        turn = -2j * np.pi / (self.camera.wavelength * self.camera.separation)
        return np.exp(turn * np.outer(y, grid.y)) @ (pupil @ np.exp(turn * np.outer(grid.x, x)))

    def behind(self) -> tuple[Grid, np.ndarray]:
        """The pupil's grid and its samples, for light of 1 behind a round stop."""
        if not self._pupil:
            # Light comes again after as many λL/D as there are samples.
            count = max(self.samples, math.ceil(3 * self.widest / _cells.airy(self.camera)))
            wide = math.ceil(count * _cells.stop_reach(self.lens))
            grid = Grid.square(wide + 8, self.camera.pupil_diameter / count)
            pupil = _cells.over_lens(self.camera, self.lens, self.distance, grid)
            squared = self.camera.wavelength * self.camera.separation
            light = (np.abs(pupil) ** 2).sum() * squared**2 / np.prod(grid.pitch)
            self._pupil.extend((grid, pupil * np.sqrt(_cells.stop_area(self.lens) / light)))
        return self._pupil[0], self._pupil[1]

    def turned(self, phase: np.ndarray) -> "Sampled":
        """How the light changes with a factor of this phase (y, x) [rad] on the pupil's grid."""
        grid, pupil = self.behind()
        return replace(self, _pupil=[grid, 1j * phase * pupil])
