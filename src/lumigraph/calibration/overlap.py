"""Centres of micro-images whose discs overlap: beyond a size, the brightest places are between them."""

import math
from typing import NamedTuple

import numpy as np
from scipy.special import j1

from lumigraph.calibration.centres import lit, placed
from lumigraph.calibration.fitting import Fitted, fit, recentred
from lumigraph.calibration.template import sharpened
from lumigraph.core.lattice import Lattice

SIZES = np.arange(0.5, 1.6, 0.01)
"""Sizes of discs over the pitch that are tried."""
VANISHING = {"hex": 1.045, "square": 1.19}
"""Sizes of discs over the pitch, before their first harmonic changes its sign (1.056 and 1.22)."""

_PLACES = 48  # along each side of the cell where discs are tried
_ORDERS = 3.2  # harmonics that are compared
_ALIKE = 0.97  # correlation of a mean micro-image with its discs; evenly lit ones reach 0.99
_BETTER = 0.35  # of what touching discs leave unexplained may overlapping ones leave
_ROUNDS = 4


class OverlappingDiscs(NamedTuple):
    """Discs that explain a mean micro-image: size over the pitch, and way to their centre (i, j)."""

    size: float
    move: np.ndarray


def overlapping(cell: np.ndarray, lattice: Lattice) -> OverlappingDiscs | None:
    """The discs that the mean micro-image is the sum of, where they overlap so far that gaps turn bright.

    The harmonics of discs of all sizes, anywhere in the cell, are compared with those of the mean
    micro-image `cell` (m, m). Overlapping ones are believed where they explain it far better than those
    with gaps; not on a rectangular lattice, whose micro-images need not be round.
    """
    if lattice.layout == "rectangular":
        return None
    reach = np.rint(np.fft.fftfreq(_PLACES) * _PLACES).astype(int)
    orders = np.stack(np.meshgrid(reach, reach, indexing="ij"), -1)
    waves = orders @ np.linalg.inv(lattice.matrix)
    order = np.hypot(waves[..., 0], waves[..., 1]) * lattice.pitch
    used = (order > 0) & (order <= _ORDERS) & (np.abs(orders).max(-1) < len(cell) / 2)
    measured = np.where(used, np.fft.fft2(cell)[tuple(np.moveaxis(orders % len(cell), -1, 0))], 0)
    norm = math.sqrt(float(np.square(np.abs(measured)).sum()))
    if norm <= 0:
        return None
    pixel = np.sinc(waves[..., 0]) * np.sinc(waves[..., 1]) * used
    likeness, places = [], []
    for disc in SIZES:
        argument = math.pi * disc * np.maximum(order, 1e-9)
        model_waves = 2 * j1(argument) / argument * pixel
        match = np.fft.ifft2(measured * model_waves).real * _PLACES**2
        place = np.unravel_index(int(np.argmax(match)), match.shape)
        likeness.append(float(match[place]) / (norm * math.sqrt(float(np.square(model_waves).sum()))))
        places.append(np.array(place) / _PLACES)
    best = int(np.argmax(likeness))
    apart = max(v for v, disc in zip(likeness, SIZES, strict=True) if disc < VANISHING[lattice.layout])
    if SIZES[best] < VANISHING[lattice.layout] or likeness[best] < _ALIKE:
        return None
    if 1 - likeness[best] > _BETTER * (1 - apart):
        return None
    return OverlappingDiscs(float(SIZES[best]), places[best])


def separated(picture: np.ndarray, fitted: Fitted, discs: OverlappingDiscs) -> Fitted:
    """Lattice and centres by the mean micro-image alone, from where the discs have their centre."""
    shape, lattice = (picture.shape[0], picture.shape[1]), fitted.lattice
    lattice = lattice.moved(*(lattice.matrix @ discs.move))
    result = Fitted(fitted.spots, lattice, fitted.warp)
    for _ in range(_ROUNDS):
        model = result.model(shape)
        result = fit(sharpened(picture, lit(placed(model)), model), model)
    return recentred(result, shape)
