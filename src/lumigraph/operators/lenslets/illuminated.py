"""Cells of the image that a point of light illuminates; others are left dark."""

import math
from dataclasses import dataclass

import numpy as np

from lumigraph.elements import Train
from lumigraph.operators.lenslets import main_lens
from lumigraph.operators.lenslets.array_libraries import NUMPY
from lumigraph.operators.sampling import cells as _cells
from lumigraph.operators.sampling.camera import CameraOptics
from lumigraph.operators.sampling.optics import Optics

LEFT_OUT = 0.3
"""Part of the accuracy that cells may have that are left dark."""

WIDER, TAIL = 1.5, 2.0
"""How far light is followed: so many radii of a blur, and so many λL/D over the accuracy's root beyond.

An Airy disc's rms beyond r [λL/D] is 0.08/r² of its own.
"""

PER_CELL = 4
"""Samples along a cell that tell how bright it is."""


@dataclass(frozen=True, slots=True)
class IlluminatedCells:
    """Rows and columns of the image's cells that a point lights, and their samples (y, x)."""

    cells: tuple[range, range] = (range(0), range(0))
    window: tuple[slice, slice] = (slice(0), slice(0))


def on_lenslets(optics: Optics, positions: np.ndarray, distance: float | np.ndarray) -> np.ndarray:
    """Images (n, 2) in the lenslet plane of points (n, 2) [m], in the frame that turns with the lenslets."""
    sin, cos = math.sin(optics.rotation), math.cos(optics.rotation)
    y, x = -optics.camera.separation / distance * positions.T
    return np.stack([y * cos - x * sin, y * sin + x * cos], axis=1)


def share(optics: Optics) -> float:
    """Intensity of the image over that of light of 1, of a point of intensity 1."""
    size = optics.camera.object_pitch * optics.camera.separation / optics.distance
    return (size / optics.image_scale) ** 2


def farthest(optics: Optics, places: np.ndarray) -> float:
    """Distance from any of the places to any light that the image's cells see [m]."""
    cells, reach = optics.cells, 0.0
    for edge, n, ring, size, axis, at in zip(
        cells.edge, cells.count, cells.ring, cells.size, optics.axes, places.T, strict=True
    ):
        low = edge - ring * size - axis.neighbourhood - size
        high = edge + (n + ring) * size + axis.neighbourhood + size
        reach = math.hypot(reach, max(high - at.min(), at.max() - low))
    return reach


def amplitude(
    camera: CameraOptics, lens: Train, distance: float, widest: float, places: tuple[np.ndarray, np.ndarray]
) -> np.ndarray:
    """Amplitude (y, x) at places from a point's image, as far as `widest`; 0 beyond, along an axis [m]."""
    slack = main_lens.opening_of(lens).slack
    spread = widest + main_lens.widest_ray(camera, lens, distance)
    grid = main_lens.pupil_grid(
        camera, main_lens.samples_across(camera, spread, slack), _cells.stop_reach(lens)
    )
    wave = main_lens.wave(NUMPY, main_lens.wave_numbers(camera, lens, distance, grid))
    turn = -2j * np.pi / (camera.wavelength * camera.separation)
    near = [np.flatnonzero(np.abs(at) <= widest) for at in places]
    down, across = (np.exp(turn * np.outer(at[mine], grid.y)) for at, mine in zip(places, near, strict=True))
    found = np.zeros([len(at) for at in places], complex)
    found[np.ix_(*near)] = down @ wave @ across.T
    return found


def followed_to(camera: CameraOptics, lens: Train, distance: float, accuracy: float) -> float:
    """Distance from its image to which a point's light is followed [m]."""
    blur = main_lens.widest_ray(camera, lens, distance)
    return WIDER * blur + TAIL / math.sqrt(accuracy) * _cells.airy(camera)


def illuminated(optics: Optics, lens: Train, place: np.ndarray) -> IlluminatedCells:
    """Cells with all but `LEFT_OUT` of the accuracy of the light of a point imaged at a place (2,) [m]."""
    widest = min(
        farthest(optics, place[None]),
        followed_to(optics.camera, lens, optics.distance, optics.fineness.accuracy),
    )
    y, x = _coarse_places(optics, place)
    return chosen(optics, np.abs(amplitude(optics.camera, lens, optics.distance, widest, (y, x))) ** 2)


def _coarse_places(optics: Optics, place: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Some places of all cells along y and along x, from a point's image [m]."""
    cells = optics.cells
    y, x = (
        edge - ring * size + (np.arange((n + 2 * ring) * PER_CELL) + 0.5) / PER_CELL * size - at
        for edge, ring, size, n, at in zip(
            cells.edge, cells.ring, cells.size, cells.count, place, strict=True
        )
    )
    return y, x


def chosen(optics: Optics, bright: np.ndarray) -> IlluminatedCells:
    """Cells of an intensity at `PER_CELL` places (y, x) of each."""
    cells, far = optics.cells, []
    (ny, nx), (ry, rx) = cells.image, cells.ring
    bright = bright.reshape(ny, PER_CELL, nx, PER_CELL).mean((1, 3)) ** 2
    bright[:ry], bright[ny - ry :], bright[:, :rx], bright[:, nx - rx :] = 0, 0, 0, 0  # without lenslets
    budget = (LEFT_OUT * optics.fineness.accuracy) ** 2 * bright.sum() / 4
    for k, n in enumerate(cells.image):
        spill = math.ceil((optics.spill + optics.fineness.ring * optics.array.lattice.pitch) / cells.size[k])
        line = bright.sum(1 - k)
        first = int(np.searchsorted(np.cumsum(line), budget))
        last = n - 1 - int(np.searchsorted(np.cumsum(line[::-1]), budget))
        far.append(range(max(0, first - spill), min(n, last + spill + 1)))
    y, x = (slice(mine.start * n, mine.stop * n) for mine, n in zip(far, cells.samples, strict=True))
    return IlluminatedCells((far[0], far[1]), (y, x))
