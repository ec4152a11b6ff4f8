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
from lumigraph.operators import cells as _cells
from lumigraph.operators.camera import CameraOptics
from lumigraph.operators.cell_response import legendre, sphere

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


@dataclass(frozen=True)
class Oblique:
    """Light around an image that stands anywhere in the lenslet plane, of a lens that may have aberrations.

    Beside the sphere, the way R from a place of the stop to ξ + v is R - d v + v H v / 2, by its derivatives
    at the image ξ: light is a Fourier transform over the directions d, with H to first order.

    Parameters
    ----------
    camera, lens
        The camera, and its main lens turned with the lenslets.
    distance
        Of the point before the main lens [m].
    widest
        How far from its image light is followed [m].
    place
        The image, ξ [m].
    """

    camera: CameraOptics
    lens: Train
    distance: float
    widest: float
    place: tuple[float, float]

    def at(self, y: np.ndarray, x: np.ndarray) -> np.ndarray:
        """As `PointLight.at`."""
        k, (down, across) = 2 * np.pi / self.camera.wavelength, self.directions
        left, right = np.exp(1j * k * np.outer(y, down)), np.exp(1j * k * np.outer(across, x))
        light = left @ (self.stop @ right)
        squares = (y[:, None] ** 2, 2 * np.outer(y, x), x**2)
        for factor, bend in zip(squares, self._bends(), strict=True):
            light += 1j * k / 2 * factor * (left @ ((self.stop * bend) @ right))
        return light

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
        count = max(SAMPLES, math.ceil(3 * self.widest / _cells.airy(self.camera)))
        step = max(float(np.ptp(part)) for part in rim) / count
        numbers = (np.arange(count + 8) - (count + 7) / 2) * step
        down, across = (numbers + (part.max() + part.min()) / 2 for part in rim)
        return down, across

    @cached_property
    def cosines(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Of all directions, along y, x and the axis."""
        y, x = (part + at / self.chief for part, at in zip(self.directions, self.place, strict=True))
        return y[:, None], x[None, :], np.sqrt(1 - y[:, None] ** 2 - x**2)

    @cached_property
    def stop(self) -> np.ndarray:
        """Amplitude (y, x) of the directions, for light of 1 through the stop."""
        camera, (to_y, to_x, along) = self.camera, self.cosines
        L, half, k = camera.separation, camera.pupil_diameter / 2, 2 * np.pi / camera.wavelength
        image, (at_y, at_x) = image_distance(camera, self.distance), self.place
        y, x, near = at_y - L * to_y / along, at_x - L * to_x / along, image / L
        path = _from_axis(y - at_y, x - at_x, L) - _from_axis(at_y, at_x, L)
        path -= _from_axis(y - near * at_y, x - near * at_x, image)
        path += _from_axis(near * at_y, near * at_x, image)
        phase = sum((p.phase(y, x) for p in self.lens.elements if isinstance(p, ZernikePlate)), k * path)
        step = self.directions[0][1] - self.directions[0][0]
        within = np.clip(0.5 - (np.hypot(y, x) - half) / (step * L / along**2), 0, 1)
        share = step**2 * L / (camera.wavelength * half * math.sqrt(math.pi))
        return within * np.exp(1j * phase) * share / along**2

    def _bends(self) -> list[np.ndarray]:
        """H's yy, yx and xx [1/m]."""
        (at_y, at_x), (to_y, to_x, along) = self.place, self.cosines
        pairs = (1, to_y * to_y, at_y * at_y), (0, to_y * to_x, at_y * at_x), (1, to_x * to_x, at_x * at_x)
        way = self.camera.separation / along
        return [(one - to) / way - (one - at / self.chief**2) / self.chief for one, to, at in pairs]


def _from_axis(y: np.ndarray | float, x: np.ndarray | float, radius: float) -> np.ndarray:
    """`sphere` at a place [m]."""
    return sphere(np.square(y) + np.square(x), radius)
