"""Sub-pixel centre of every micro-image, where a lattice says that one should be."""

import math
from typing import NamedTuple

import numpy as np

from lumigraph.core.lattice import Lattice

_CHUNK = 1 << 24  # pixels gathered at a time
_ITERATIONS = 4
_SOFT = 0.2  # of the cell: over how much its window fades, so that pixels do not jump in and out


class Spots(NamedTuple):
    """Measured micro-images: `indices` (k, 2) as (i, j), `centers` (k, 2) as (y, x) [px], `light` (k,)."""

    indices: np.ndarray
    centers: np.ndarray
    light: np.ndarray


def measure(picture: np.ndarray, lattice: Lattice, *, part: float = 1.0) -> Spots:
    """Centres of the micro-images that lie wholly inside the picture and are lit.

    The centre is where the phase of the first harmonic over one cell vanishes along y and along x:
    unbiased for every micro-image that is symmetric about its centre, round or square, ringed or flat,
    well separated or with only a thin gap, and linear in the pixel values.

    Parameters
    ----------
    picture
        Flattened white image (y, x), zero in the dark.
    lattice
        Where the micro-images are, to a third of a pitch [px].
    part
        Central part of the picture's height and width to look at.
    """
    cell = _cell(lattice)
    ny, nx = picture.shape
    ranges = [
        (
            max((n - 1) * (1 - part) / 2, size / 2 - 0.5) - 1e-6,
            min((n - 1) * (1 + part) / 2, n - 0.5 - size / 2) + 1e-6,
        )
        for n, size in zip((ny, nx), cell, strict=True)
    ]
    indices = lattice.indices(ranges[0], ranges[1])
    guess = lattice.position(indices)
    step = max(1, int(_CHUNK / np.prod([size + 6 for size in cell])))
    parts = [_centre(picture, guess[k : k + step], cell) for k in range(0, len(guess), step)]
    centers = np.concatenate([p[0] for p in parts]) if parts else guess
    light = np.concatenate([p[1] for p in parts]) if parts else np.zeros((0, 3))
    keep = _lit(light) & (np.abs(centers - guess) < 0.35 * np.array(cell)).all(-1)
    return Spots(indices[keep], centers[keep], light[keep, 0])


def _cell(lattice: Lattice) -> tuple[float, float]:
    """Height and width of the box around a centre that holds one micro-image [px]."""
    first, second = lattice.pitches[1], lattice.pitches[0]
    if lattice.layout == "square":
        return first, second
    rows = lattice.pitch * math.sqrt(3) / 2
    return (rows, second) if abs(lattice.rotation) < math.pi / 12 else (lattice.pitch, rows)


def _centre(
    picture: np.ndarray, guess: np.ndarray, cell: tuple[float, float]
) -> tuple[np.ndarray, np.ndarray]:
    """Centres (k, 2) and light (k, 3): mean of the cell, first harmonic along y and along x."""
    first = np.rint(guess).astype(np.int64)
    reach = [math.ceil(size * (0.5 + _SOFT / 2)) + 2 for size in cell]
    offsets = [np.arange(-r, r + 1) for r in reach]
    rows = np.clip(first[:, :1] + offsets[0], 0, picture.shape[0] - 1)
    columns = np.clip(first[:, 1:] + offsets[1], 0, picture.shape[1] - 1)
    patches = picture[rows[:, :, None], columns[:, None, :]]
    shift = guess - first
    light = np.zeros((len(guess), 3))
    limit = 0.45 * np.array(cell)
    for _ in range(_ITERATIONS):
        distance = [offsets[a] - shift[:, a, None] for a in (0, 1)]
        window = [
            np.clip((size / 2 - np.abs(d)) / max(_SOFT * size, 1) + 0.5, 0, 1)
            for d, size in zip(distance, cell, strict=True)
        ]
        profile_y = np.matmul(patches, window[1].astype(np.float32)[:, :, None])[..., 0]
        profile_x = np.matmul(window[0].astype(np.float32)[:, None, :], patches)[:, 0]
        light[:, 0] = (profile_y * window[0]).sum(-1)
        move = np.empty_like(shift)
        for axis, profile in enumerate((profile_y, profile_x)):
            angle = 2 * math.pi * distance[axis] / cell[axis]
            weighted = profile * window[axis]
            cosine, sine = (weighted * np.cos(angle)).sum(-1), (weighted * np.sin(angle)).sum(-1)
            move[:, axis] = np.arctan2(sine, cosine) * cell[axis] / (2 * math.pi)
            light[:, axis + 1] = cosine
        shift = np.clip(shift + move, guess - first - limit, guess - first + limit)
    return first + shift, light


def _lit(light: np.ndarray) -> np.ndarray:
    """Which micro-images are bright and have dark edges; a tenth of a good one is enough."""
    if not len(light):
        return np.zeros(0, bool)
    good = np.percentile(light, 80, axis=0)
    return np.all(light > 0.1 * np.maximum(good, 1e-12), axis=-1)
