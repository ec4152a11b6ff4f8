"""Images of the points of one lenslet's cell by rays: each lenslet sees them from its place, without waves.

With the sensor in the lenslets' focal plane a pixel sees one direction, n sin θ = NA ρ at the part ρ of the
micro-image's radius f NA/M; the rays of an isotropic emitter have the density 1/cos θ over the micro-image.

M. Levoy et al., ACM Trans. Graph. 25, 924 (2006).
"""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from lumigraph.elements.objective import Objective
from lumigraph.operators.microscope_cell import CellSampling, Lenslet

PER_PIXEL = 4
"""Rays along each side of a pixel."""

PER_POINT = 5
"""Places along each side of the square that an object sample stands for."""


def ray_images(
    objective: Objective,
    lenslet: Lenslet,
    sampling: CellSampling,
    points: Sequence[tuple[float, float]],
    dz: float,
) -> np.ndarray:
    """Images of points (ky, kx) of a cell at depth `dz`, whose light behind open lenslets is 1.

    Returns
    -------
    array
        (points, T², N²) float32 over T × T cells around the points' own, of pixels that are active all over:
        one that is active in part has as much as if all of it were like that part.
    """
    s, N = sampling.points, sampling.pixels
    rim = objective.numerical_aperture / lenslet.magnification * lenslet.distance / lenslet.pitch
    outer = max(0, math.ceil(rim - 0.5))  # micro-images that reach into their neighbours
    whole = _weights(objective, rim, _rays(replace(sampling, width=1 / N), outer)[2])[2].sum()
    pixel, cell, at = _rays(sampling, outer)
    sine, cosine, weight = _weights(objective, rim, at)
    inside = weight > 0
    weight = weight.ravel() / (whole * PER_POINT**2)
    moves = dz * lenslet.magnification / lenslet.pitch / cosine
    reach = math.ceil(np.abs(moves * sine)[inside.any(0)].max() + 0.5) + outer if inside.any() else 1
    T = 2 * reach + 1
    own = (pixel[:, None] * N + pixel).ravel()
    images = np.zeros((len(points), T * T, N * N), np.float32)
    spread = ((np.arange(PER_POINT) + 0.5) / PER_POINT - 0.5) / s
    for row, (ky, kx) in enumerate(points):
        for ey, ex in np.stack(np.meshgrid(spread, spread), -1).reshape(-1, 2):
            y = (ky - (s - 1) / 2) / s + ey + moves * sine[:, None]
            x = (kx - (s - 1) / 2) / s + ex + moves * sine
            light = weight * _open(lenslet, y - np.rint(y), x - np.rint(x)).ravel()
            dy, dx = (np.rint(v).astype(int) for v in (y, x))
            place = (
                np.clip(dy + cell[:, None] + reach, 0, T - 1) * T + np.clip(dx + cell + reach, 0, T - 1)
            ).ravel()
            found = np.bincount(place * N * N + own, light, T * T * N * N)
            images[row] += found.reshape(T * T, N * N)
    return images


def _weights(objective: Objective, rim: float, at: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Sines along an axis, cosines and light (0 beyond the stop) of rays, from a lenslet's centre."""
    sine = at / rim * objective.numerical_aperture / objective.medium
    slant = sine[:, None] ** 2 + sine**2
    inside = slant < (objective.aperture / objective.medium) ** 2
    cosine = np.sqrt(1 - np.where(inside, slant, 0))
    return sine, cosine, inside / cosine


def _rays(sampling: CellSampling, outer: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Pixel, cell from the lenslet's own, and place from its centre [cells] of each ray along an axis."""
    N = sampling.pixels
    index = np.arange(-outer * N, (outer + 1) * N).repeat(PER_PIXEL)
    within = np.tile((np.arange(PER_PIXEL) + 0.5) / PER_PIXEL - 0.5, (2 * outer + 1) * N)
    return index % N, index // N, (index + 0.5) / N - 0.5 + within * sampling.width


def _open(lenslet: Lenslet, y: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Mask of light at (y, x) from a lenslet's centre [pitches] that falls on its open part."""
    half = lenslet.width / lenslet.pitch / 2
    away = np.hypot(y, x) if lenslet.is_round else np.maximum(np.abs(y), np.abs(x))
    return away <= half
