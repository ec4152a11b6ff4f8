"""Images of the points of a cell of a lenslet array: what the lenslet-periodic operator repeats."""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.interpolate import CubicSpline
from scipy.special import j0

from lumigraph.core.grid import Grid
from lumigraph.elements import ThinLens
from lumigraph.errors import SamplingWarning
from lumigraph.scene import sources
from lumigraph.simulation.camera import Camera
from lumigraph.simulation.cell_response import STEP, Axis, Response, legendre

PUPIL = 1024
"""Samples across the main lens."""


@dataclass(frozen=True, slots=True, eq=False)
class Wave:
    """Amplitude of a point's light in the lenslet plane, at whole multiples of the points' pitch.

    Parameters
    ----------
    data
        (y, x), complex64, for light of 1 in all at that pitch.
    first
        Multiples (y, x) of the first sample.
    """

    data: np.ndarray
    first: tuple[int, int]

    @property
    def even(self) -> bool:
        """Whether it is the same in a mirror, left and right and up and down."""
        middle = [-f for f in self.first]
        span = [min(m, n - 1 - m) for m, n in zip(middle, self.data.shape, strict=True)]
        core = self.data[middle[0] - span[0] : middle[0] + span[0] + 1]
        core = core[:, middle[1] - span[1] : middle[1] + span[1] + 1]
        tolerance = 1e-5 * float(np.abs(core).max())
        return all(np.abs(core - np.flip(core, axis)).max() < tolerance for axis in (0, 1))


def wave(camera: Camera, distance: float, axes: tuple[Axis, Axis], reach: Sequence[int]) -> Wave:
    """Of a point on the axis, without the phase exp(iπw²/(λL)), wide enough for cells `reach` away."""
    multiples = []
    for axis, cells in zip(axes, reach, strict=True):
        n = axis.margin + (cells + 1) * axis.points + STEP
        multiples.append(np.arange(-n, n + 1))
    pitch = [axis.size / axis.points for axis in axes]
    y, x = (m * step for m, step in zip(multiples, pitch, strict=True))
    lens = camera.lens_train().elements
    if len(lens) == 1 and isinstance(lens[0], ThinLens) and lens[0].diameter is not None:
        data = _round(camera, distance, np.hypot(y[:, None], x))
    else:
        data = _sampled(camera, distance, y, x)
    data *= np.sqrt(np.prod(pitch))
    return Wave(data.astype(np.complex64), (int(multiples[0][0]), int(multiples[1][0])))


def _round(camera: Camera, distance: float, radius: np.ndarray) -> np.ndarray:
    """Amplitude behind a round lens at a radius [m], for light of 1 in all: a Hankel transform."""
    (lens,) = camera.lens_train().elements
    assert isinstance(lens, ThinLens)
    half, squared = camera.pupil_diameter / 2, camera.wavelength * camera.separation
    focus = np.pi / camera.wavelength * (1 / distance + 1 / camera.separation - 1 / lens.focal_length)
    widest = float(radius.max())
    turns = (abs(focus) * half**2 + 2 * np.pi * widest * half / squared) / np.pi
    rho, weight = legendre(0, half, 64 + 3 * int(turns))
    at = np.arange(0, widest + squared / half, squared / half / 64)
    pupil = np.exp(1j * focus * rho**2) * 2 * np.pi * rho * weight
    values = j0(2 * np.pi / squared * np.outer(at, rho)) @ pupil
    return CubicSpline(at, values)(radius) / (squared * half * np.sqrt(np.pi))


def _sampled(camera: Camera, distance: float, y: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Amplitude (y, x) behind any lens, for light of 1 in all: a matrix Fourier transform of its pupil."""
    grid = Grid.square(PUPIL + 8, camera.pupil_diameter / PUPIL)
    with warnings.catch_warnings():  # what is sampled is the product of all phases
        warnings.simplefilter("ignore", SamplingWarning)
        point = sources.point_source(grid, camera.wavelength, distance, paraxial=True)
        pupil = camera.lens_train()(point).data
    squared = camera.wavelength * camera.separation
    pupil = pupil * np.outer(*(np.exp(1j * np.pi * c**2 / squared) for c in (grid.y, grid.x)))
    light = (np.abs(pupil) ** 2).sum() * squared**2 / np.prod(grid.pitch)
    down = np.exp(-2j * np.pi / squared * np.outer(y, grid.y))
    across = np.exp(-2j * np.pi / squared * np.outer(grid.x, x))
    return down @ pupil @ across / np.sqrt(light)


def images(light: Wave, lenslets: Response, axes: tuple[Axis, Axis], row: int, columns: range) -> np.ndarray:
    """Intensity (columns, points, samples) in a cell of the points of the cells (row, columns) beside it."""
    y, x = axes
    down, across = lenslets.down.astype(np.complex64), lenslets.across.astype(np.complex64).T
    result = np.empty((len(columns), y.points, x.points, y.samples * x.samples), np.float32)
    starts = [-x.margin - (d * x.points + k) - light.first[1] for d in columns for k in range(x.points)]
    first, last = starts[0], starts[-1]  # descending, one by one
    for k in range(y.points):
        top = -y.margin - (row * y.points + k) - light.first[0]
        part = down @ light.data[top : top + STEP * down.shape[1] : STEP]
        windows = sliding_window_view(part, STEP * across.shape[0] - 1, axis=1)[:, last : first + 1, ::STEP]
        field = windows[:, ::-1] @ across
        if lenslets.core is None:
            field = field.transpose(1, 0, 2)
        else:
            field = field.transpose(1, 0, 2).reshape(len(starts), -1) @ lenslets.core.T
        intensity = field.real**2 + field.imag**2
        result[:, k] = intensity.reshape(len(columns), x.points, -1)
    return result.reshape(len(columns), y.points * x.points, -1)


def mirrored(factor: np.ndarray, shape: tuple[int, int], up: bool, left: bool) -> np.ndarray:
    """Rows (shape[0] shape[1], r) of a plane turned over, up and down or left and right."""
    plane = factor.reshape(*shape, -1)
    return plane[:: -1 if up else 1, :: -1 if left else 1].reshape(factor.shape)


def factors(block: np.ndarray, least: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """``block ≈ left @ right``, (points, r) and (r, samples), and their strengths above `least`.

    Most blocks have few: a sketch of a fifth of the points finds them, or finds that it needs them all.
    """
    points = block.shape[0]
    if np.linalg.norm(block) <= least:
        return np.zeros((points, 0)), np.zeros((0, block.shape[1])), np.zeros(0)
    sketch = np.random.default_rng(0).standard_normal((points, points // 5), np.float32)
    for basis in (np.linalg.qr(block @ (block.T @ sketch))[0], None):
        seen = (block if basis is None else basis.T @ block).astype(np.float64)
        strength, vectors = np.linalg.eigh(seen @ seen.T)
        strength = np.sqrt(np.maximum(strength, 0))
        if strength[0] < least / 2:
            break
    kept = strength > least
    left, right = vectors[:, kept], vectors[:, kept].T @ seen
    return left if basis is None else basis @ left, right, strength[kept]
