r"""Wave of a point of light in the main lens, on few samples across it, however exact the image must be.

Light near the image follows from samples of the wave if these stand close enough, but a stop's sharp edge has
all frequencies: samples that are grey in proportion to their open area are right to first order in their
pitch h alone. Here the stop's edge is smoothed by a kernel whose spectrum is 1 wherever light is followed,
and 0 where the samples' spectrum repeats, so that no sampling error is left (`band` has it along one axis).
A stop of radius R lets through, at a distance r from its middle,

.. math:: g(r) = 2\pi R \int \hat K(u) \, J_1(2\pi R u) \, J_0(2\pi r u) \, du.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.special import j0, j1

from lumigraph.core.grid import Grid
from lumigraph.elements import CircularAperture, Element, PupilMask, ThinLens, Train, ZernikePlate
from lumigraph.errors import GeometryError
from lumigraph.operators.lenslets.array_libraries import Array, ArrayLibrary, Numbers
from lumigraph.operators.lenslets.cell_response import legendre
from lumigraph.operators.sampling import cells as _cells
from lumigraph.operators.sampling.band import HALF_WIDTH, kernel
from lumigraph.operators.sampling.camera import CameraOptics

FLAT = 0.325
"""Frequencies [1/sample] up to which the kernel's spectrum is 1, to 1e-5."""

HIGHEST = 0.72
"""Frequency [1/sample] above which the kernel's spectrum is 0, to 1e-7."""


REACH = HALF_WIDTH + 0.77
"""How far a smooth edge reaches [samples]; no sample on an axis stands there, on one side or the other."""


@dataclass(frozen=True, slots=True)
class Opening:
    """Elliptic stop.

    Parameters
    ----------
    half
        Half of its diameter [m].
    center
        (y, x) [m].
    axes
        Widths along `direction` and across it, over the diameter.
    direction
        From +x towards +y [rad].
    """

    half: float
    center: tuple[float, float] = (0.0, 0.0)
    axes: tuple[float, float] = (1.0, 1.0)
    direction: float = 0.0

    @property
    def area(self) -> float:
        """Open area [m²]."""
        return math.pi * self.half**2 * math.prod(self.axes)

    @property
    def slack(self) -> float:
        """Factor by which samples must stand closer than for a round stop."""
        return max(self.axes) / min(self.axes)

    def through(self, grid: Grid) -> np.ndarray:
        """Part of the amplitude (y, x) that it lets through, with smooth edges."""
        pitch = grid.pitch[0]
        ratios = self.half / pitch, self.center[0] / pitch, self.center[1] / pitch
        return _through(grid.shape[0], *(round(one, 9) for one in ratios), self.axes, self.direction)


@lru_cache(maxsize=8)
def _through(
    count: int, half: float, y: float, x: float, axes: tuple[float, float], direction: float
) -> np.ndarray:
    """Amplitude (y, x) through an ellipse on so many samples around the axis; lengths in samples."""
    at, sin, cos = np.arange(count) - count // 2, math.sin(direction), math.cos(direction)
    down, across = at[:, None] - y, at - x
    rho = np.hypot((across * cos + down * sin) / axes[0], (down * cos - across * sin) / axes[1])
    return smooth_edge(half * min(axes), (rho - half) * min(axes))


@lru_cache(maxsize=8)
def _aberrations(plate: ZernikePlate, count: int, pitch: float) -> np.ndarray:
    """Phase (y, x) of a plate of diameter 1 on so many samples around the axis [rad]."""
    at = (np.arange(count) - count // 2) * pitch
    return plate.phase(at[:, None], at)


def opening_of(lens: Train) -> Opening:
    """Stop of a main lens.

    Raises
    ------
    GeometryError
        A lens without a round or elliptic stop, or with several, or with elements of another kind.
    """
    found = [opening for part in lens.elements if (opening := _opening(part)) is not None]
    if len(found) != 1:
        raise GeometryError(
            f"the main lens has {len(found)} stops but images of points are of lenses with one, round or "
            "elliptic. Give one diameter, or use Snapshots."
        )
    return found[0]


def _opening(part: Element) -> Opening | None:
    if isinstance(part, ZernikePlate):
        return Opening(part.diameter / 2, part.center, part.axes, part.direction)
    if isinstance(part, CircularAperture) and not part.obstruction:
        return Opening(part.diameter / 2, part.center)
    if isinstance(part, PupilMask):
        return None
    if isinstance(part, ThinLens):
        return None if part.diameter is None else Opening(part.diameter / 2, part.center)
    raise GeometryError(
        f"the main lens has {type(part).__name__}, behind which images of points are not computed. Use "
        "Snapshots."
    )


def _phase(
    wavelength: float, separation: float, lens: Train, distance: float, y: np.ndarray, x: np.ndarray
) -> np.ndarray:
    """Phase of a point's wave behind the main lens [rad], over one that converges in the lenslet plane."""
    plates = [part for part in lens.elements if isinstance(part, ZernikePlate | PupilMask)]
    found = sum((part.phase(y, x) for part in plates), np.zeros(()))
    return found + _bend(wavelength, separation, lens, distance) * (np.square(y) + np.square(x))


def _bend(wavelength: float, separation: float, lens: Train, distance: float) -> float:
    """Defocus of a point's wave [rad/m²]."""
    lenses = [part for part in lens.elements if isinstance(part, ThinLens)]
    focus = sum(1 / float(part.focal_length) for part in lenses)
    return math.pi / wavelength * (1 / distance + 1 / separation - focus)


def widest_ray(camera: CameraOptics, lens: Train, distance: float) -> float:
    """Farthest from its image that a ray of a point arrives in the lenslet plane [m]."""
    return _widest_ray(camera.wavelength, camera.separation, tuple(lens.elements), distance)


@lru_cache(maxsize=64)
def _widest_ray(
    wavelength: float, separation: float, elements: tuple[Element, ...], distance: float
) -> float:
    lens = Train(elements)
    opening = opening_of(lens)
    at = np.linspace(-1, 1, 33) * opening.half * max(opening.axes)
    y, x = np.meshgrid(at + opening.center[0], at + opening.center[1], indexing="ij")
    inside = np.hypot(y - opening.center[0], x - opening.center[1]) <= at[-1] * 1.001
    step = opening.half * 1e-3
    down, across = (
        _phase(wavelength, separation, lens, distance, y + dy, x + dx)
        - _phase(wavelength, separation, lens, distance, y - dy, x - dx)
        for dy, dx in ((step, 0.0), (0.0, step))
    )
    bend = wavelength * separation / (2 * np.pi) / (2 * step)
    return bend * float(np.hypot(down, across)[inside].max())


def samples_across(camera: CameraOptics, widest: float, slack: float = 1.0) -> int:
    """Samples across the main lens' diameter, for light followed to `widest`, with its rays' spread [m]."""
    return max(32, 2 * math.ceil(slack * widest / FLAT / _cells.airy(camera) / 2))


def pupil_grid(camera: CameraOptics, samples: int, reach: float = 1.0) -> Grid:
    """Samples of the wave in the main lens, beyond its stop as far as a smooth edge reaches.

    Parameters
    ----------
    samples
        Across the camera's diameter.
    reach
        Farthest place of stops from the axis, over half of that diameter.
    """
    return Grid.square(2 * math.ceil(samples * reach / 2 + HALF_WIDTH + 1), camera.pupil_diameter / samples)


def wave_numbers(camera: CameraOptics, lens: Train, distance: float, grid: Grid) -> dict[str, Any]:
    """Numbers that the wave of a point in the main lens follows from; see `wave`.

    Its strength, the stop (y, x), aberrations (y, x) [rad], and the defocus at a distance of a sample [rad].
    The wave is of light of 1 behind a round stop of the camera's diameter.
    """
    squared, half = camera.wavelength * camera.separation, camera.pupil_diameter / 2
    light = math.prod(grid.pitch) / (squared * math.sqrt(math.pi) * half)
    bend = _bend(camera.wavelength, camera.separation, lens, distance) * grid.pitch[0] ** 2
    plates = [part for part in lens.elements if isinstance(part, ZernikePlate)]
    parts = [_over_grid(plate, grid) for plate in plates]
    stop = opening_of(lens).through(grid)
    for mask in (part for part in lens.elements if isinstance(part, PupilMask)):
        y, x = grid.y[:, None], grid.x
        parts.append(mask.phase(y, x))
        stop = stop * mask.amplitude(y, x)
    aberrations = sum(parts[1:], parts[0]) if parts else _none(grid.shape[0])
    return {"strength": light, "stop": stop, "aberrations": aberrations, "defocus": bend}


def wave(xp: ArrayLibrary, numbers: Numbers) -> Array:
    """Wave (y, x) of a point in the main lens, over one that converges in the lenslet plane.

    Its Fourier transform, the sum of the wave times exp(-2πi ρ w/(λL)) over samples ρ, is the amplitude at w
    from the image in the lenslet plane [1/m].
    """
    count = numbers["stop"].shape[0]
    at = (np.arange(count) - count // 2) ** 2
    phase = numbers["aberrations"] + numbers["defocus"] * xp.asarray(at[:, None] + at)
    return (numbers["strength"] * numbers["stop"]) * xp.exp(1j * phase)


def _over_grid(plate: ZernikePlate, grid: Grid) -> np.ndarray:
    center = plate.center[0] / plate.diameter, plate.center[1] / plate.diameter
    alike = replace(plate, diameter=1.0, center=center)
    return _aberrations(alike, grid.shape[0], round(grid.pitch[0] / plate.diameter, 15))


@lru_cache(maxsize=4)
def _none(count: int) -> np.ndarray:
    return np.zeros((count, count))


def smooth_edge(radius: float, beyond: np.ndarray) -> np.ndarray:
    """Part of the amplitude through a stop at distances beyond its edge, all in samples."""
    found = _edge(round(radius, 6))(np.clip(beyond, -REACH, REACH))
    return np.where(beyond < -REACH, 1.0, np.where(beyond > REACH, 0.0, found))


@lru_cache(maxsize=64)
def _edge(radius: float) -> CubicSpline:
    """Amplitude behind the edge of a stop of a radius, by the distance beyond it [samples]."""
    at = np.linspace(-HALF_WIDTH - 1, HALF_WIDTH + 1, 32 * (HALF_WIDTH + 1) + 1)
    u, weight = legendre(0, HIGHEST, 64 + math.ceil(5 * radius))
    known = weight * _spectrum()(u) * j1(2 * np.pi * radius * u)
    parts: Sequence[np.ndarray] = np.array_split(at, 1 + len(at) * len(u) // 2**20)
    through = [j0(2 * np.pi * np.outer(radius + part, u)) @ known for part in parts]
    return CubicSpline(at, 2 * np.pi * radius * np.concatenate(through))


@lru_cache(maxsize=1)
def _spectrum() -> CubicSpline:
    """Spectrum of `band`'s kernel by the frequency [1/sample]."""
    at, weight = legendre(-HALF_WIDTH, HALF_WIDTH, 200)
    u = np.linspace(0, HIGHEST, 721)
    return CubicSpline(u, np.cos(2 * np.pi * np.outer(u, at)) @ (weight * kernel(at)))
