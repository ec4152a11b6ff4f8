r"""Light of a point in the lenslet plane, behind an ideal main lens and beyond the paraxial.

The lens brings the light of any point to one, at ξ z/L before or behind the lenslets' plane, and sends it
there from its stop by Rayleigh and Sommerfeld's integral,

.. math:: U(w) = \frac{L}{i \lambda} \int \frac{1}{R^2} e^{i k (R - R')} d^2 \rho

with the ways R from a place ρ of the stop to w and R' to the image. The sphere around the stop's middle,
exp(ik√(L² + w²)), is left out, as in `point_light`.
"""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.special import j0, j1

from lumigraph.elements import ThinLens, Train, ZernikePlate
from lumigraph.operators.lenslets.cell_response import legendre, sphere
from lumigraph.operators.lenslets.exact_waves import DirectionSum
from lumigraph.operators.sampling import cells as _cells
from lumigraph.operators.sampling.camera import CameraOptics

SAMPLES = 640
"""Across the stop for light that is not round, or more where it is followed far."""

_BLOCK = 2**21
"""Numbers worked on at a time."""


def image_distance(camera: CameraOptics, distance: float) -> float:
    """Main lens to the image of a point at a distance before it, z [m]."""
    (found,) = (part.focal_length for part in camera.lens.elements if isinstance(part, ThinLens))
    return 1 / (1 / found - 1 / distance)


def radial(camera: CameraOptics, distance: float, widest: float) -> CubicSpline:
    """Amplitude [1/m] by the distance from the axis [m], of a point on it.

    With R² = L² + w² + ρ² the way from (ρ, φ) in the stop is √(R² - 2ρw cos φ), to second order in ρw/R².
    """
    half, L, k = camera.pupil_diameter / 2, camera.separation, 2 * np.pi / camera.wavelength
    image, squared = image_distance(camera, distance), camera.wavelength * camera.separation
    turns = (k * abs(half**2 * (1 / L - 1 / image)) / 2 + 2 * np.pi * widest * half / squared) / np.pi
    rho, weight = legendre(0, half, 64 + 3 * int(turns))
    at, values = np.arange(0, widest + 2 * squared / half, squared / half / 64), []
    for part in np.array_split(at[:, None], math.ceil(len(at) * len(rho) / _BLOCK)):
        around = np.sqrt(L * L + part**2)
        way = np.sqrt(around**2 + rho**2)
        turn, second = k * rho * part / way, k * (rho * part) ** 2 / (2 * way**3)
        zeroth, first = j0(turn), j1(turn)
        beside = zeroth - 1j * second * (zeroth - first / np.where(turn > 0, turn, 1) - 0.5 * (turn == 0))
        phase = k * (rho**2 / (way + around) - sphere(rho**2, image))
        values.append((beside * np.exp(1j * phase) * (L / way) ** 2) @ (2 * np.pi * rho * weight))
    return CubicSpline(at, np.concatenate(values) / (squared * half * np.sqrt(np.pi)))


@dataclass(frozen=True, slots=True, eq=False)
class DirectionalLight:
    """Light in some directions, for light of 1 through the stop.

    Parameters
    ----------
    phase, strength
        Of the amplitude, and the logarithm of what else it is.
    within
        How far inside the stop's edge [samples], and a half.
    bends
        H's yy, yx and xx over k [1/rad].
    """

    phase: np.ndarray
    strength: np.ndarray
    within: np.ndarray
    bends: np.ndarray

    @property
    def amplitude(self) -> np.ndarray:
        """Complex amplitude, with grey samples at the stop's edge."""
        return np.clip(self.within, 0, 1) * np.exp(self.strength + 1j * self.phase)


@dataclass(frozen=True)
class ObliqueLight:
    """Light around an image that stands anywhere in the lenslet plane, of a lens that may have aberrations.

    Beside the sphere, the way R from a place of the stop to ξ + v is R - d v + v H v / 2, by its derivatives
    at the image ξ: light is a Fourier transform over the directions d, with H to first order.

    Parameters
    ----------
    camera, lens
        The camera, and its main lens turned with the lenslets.
    distance
        Of the point before the main lens [m].
    samples
        Across the stop.
    place
        The image, ξ [m].
    beyond
        Directions beyond the stop on each side, for what its edge is smoothed by.
    """

    camera: CameraOptics
    lens: Train
    distance: float
    samples: int
    place: tuple[float, float]
    beyond: int = 4

    def at(self, y: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Amplitude in the lenslet plane, as of `PointLight.at`."""
        return self.beams(y, x).light

    def beams(self, y: np.ndarray, x: np.ndarray) -> DirectionSum:
        """The same by its directions."""
        k, over = 2 * np.pi / self.camera.wavelength, self._stop
        return DirectionSum.of((k * y, k * x), self.directions, over.amplitude, over.bends)

    @cached_property
    def chief(self) -> float:
        """Middle of the stop to the image [m]."""
        return math.hypot(self.camera.separation, *self.place)

    @cached_property
    def directions(self) -> tuple[np.ndarray, np.ndarray]:
        """Cosines along y and along x, from those of the chief ray on, that hold the stop."""
        edge = self.camera.pupil_diameter / 2 * np.exp(2j * np.pi * np.arange(64) / 64)
        offsets = self.place[0] + edge.imag, self.place[1] + edge.real
        way = np.sqrt(self.camera.separation**2 + offsets[0] ** 2 + offsets[1] ** 2)
        rim = [to / way - at / self.chief for to, at in zip(offsets, self.place, strict=True)]
        step = max(float(np.ptp(part)) for part in rim) / self.samples
        count = self.samples + 2 * self.beyond
        numbers = (np.arange(count) - (count - 1) / 2) * step
        down, across = (numbers + (part.max() + part.min()) / 2 for part in rim)
        return down, across

    @cached_property
    def _stop(self) -> DirectionalLight:
        return self.over(self.directions[0][:, None], self.directions[1])

    def over(self, y: np.ndarray, x: np.ndarray) -> DirectionalLight:
        """Light in directions, as cosines along both axes from those of the chief ray on."""
        camera, (at_y, at_x) = self.camera, self.place
        to_y, to_x = y + at_y / self.chief, x + at_x / self.chief
        along = np.sqrt(1 - to_y**2 - to_x**2)
        L, half, k = camera.separation, camera.pupil_diameter / 2, 2 * np.pi / camera.wavelength
        image = image_distance(camera, self.distance)
        y, x, near = at_y - L * to_y / along, at_x - L * to_x / along, image / L
        path = _from_axis(y - at_y, x - at_x, L) - _from_axis(at_y, at_x, L)
        path -= _from_axis(y - near * at_y, x - near * at_x, image)
        path += _from_axis(near * at_y, near * at_x, image)
        phase = sum((p.phase(y, x) for p in self.lens.elements if isinstance(p, ZernikePlate)), k * path)
        step = self.directions[0][1] - self.directions[0][0]
        within = 0.5 - (np.hypot(y, x) - half) / (step * L / along**2)
        share = math.log(step**2 * L / (camera.wavelength * half * math.sqrt(math.pi)))
        bends = np.stack(self._bends(to_y, to_x, along)) / k
        return DirectionalLight(phase, share - 2 * np.log(along), within, bends)

    def _bends(self, to_y: np.ndarray, to_x: np.ndarray, along: np.ndarray) -> list[np.ndarray]:
        """H's yy, yx and xx [1/m]."""
        (at_y, at_x), way = self.place, self.camera.separation / along
        pairs = (1, to_y * to_y, at_y * at_y), (0, to_y * to_x, at_y * at_x), (1, to_x * to_x, at_x * at_x)
        return [(one - to) / way - (one - at / self.chief**2) / self.chief for one, to, at in pairs]


def samples(camera: CameraOptics, widest: float) -> int:
    """Number of samples across the stop, for light that is followed so far from its image [m]."""
    return max(SAMPLES, math.ceil(3 * widest / _cells.airy(camera)))


def _from_axis(y: np.ndarray | float, x: np.ndarray | float, radius: float) -> np.ndarray:
    """`sphere` at a place [m]."""
    return sphere(np.square(y) + np.square(x), radius)
