"""Outward displacement of corners in micro-images of a camera 2.0, against rays.

Toward the rim of a micro-image the main lens' stop cuts the beam of its lenslet, within the width of the
lenslet's diffraction, and light of neighbours comes in. A white image corrects the brightness, not the
one-sided loss. So edges are found outwards: by 0.005 px at a third of the radius, and by 0.05 px at two
thirds, behind lenslets of 120 µm at f/20.
"""

import math
from collections.abc import Iterator
from functools import lru_cache

import numpy as np
from scipy.interpolate import RegularGridInterpolator

from lumigraph.analysis.crossings import crossed
from lumigraph.analysis.saddles import disc
from lumigraph.metric.waves import Waves

WINDOW = 2
"""Radius of the window about a corner behind a lenslet [px], however large squares are: one of 3 px is pulled
by half as much again, and which one it was would have to be known of each picture."""

MARGIN = 3.0
"""Between the farthest corner and a micro-image's rim [px]."""

RATIO = 1.15
"""Between slopes for which it is computed."""

_STEP = 2  # ways that are computed, per pixel
_TURNS = (0.2, 0.6)  # of a corner's edges against the way from the middle [rad]
_FAR = 2  # neighbours whose light counts
_REACH = 14  # px: from a pixel to the farthest places whose light it is told; what is farther comes round


@lru_cache(maxsize=16)
def outwards(waves: Waves, pitch: float, slopes: tuple[float, ...]) -> RegularGridInterpolator:
    """Outward displacement of corners [px], by distance from the middle [px] and logarithm of slopes.

    Parameters
    ----------
    waves
        Of points behind the lenslets.
    pitch
        Of the micro-images [px].
    slopes
        How far a point moves over how far its micro-images do: of one sign, two or more, ascending in size.
    """
    count = max(2, math.ceil(_STEP * max(0.0, waves.fill * pitch / 2 - MARGIN)) + 1)
    ways = np.arange(count) / _STEP
    found = sum(_along(direction, waves, pitch, slopes, ways) for direction in _directions(waves))
    mean = found / (len(list(_directions(waves))) * len(_TURNS))
    return RegularGridInterpolator((ways, np.log(np.abs(slopes))), mean)


def _directions(waves: Waves) -> Iterator[np.ndarray]:
    """Unit vectors along a row of lenslets, and halfway to the next."""
    row = np.array(waves.basis[0]) / math.hypot(*waves.basis[0])
    for turn in (0.0, np.arccos(waves.basis[0] @ np.array(waves.basis[1])) / 2):
        yield np.array([[math.cos(turn), math.sin(turn)], [-math.sin(turn), math.cos(turn)]]) @ row


def _along(
    direction: np.ndarray,
    waves: Waves,
    pitch: float,
    slopes: tuple[float, ...],
    ways: np.ndarray,
) -> np.ndarray:
    """(ways, slopes) Sums over `_TURNS` in one direction from the middle."""
    axes = np.array([direction, [direction[1], -direction[0]]])  # outwards, and across
    steps = np.array(np.meshgrid(
        np.arange(-WINDOW * _STEP, len(ways) + WINDOW * _STEP) / _STEP, np.arange(-WINDOW, WINDOW + 1.0),
        indexing="ij",
    ))  # fmt: skip
    pixels = np.moveaxis(steps, 0, -1) @ axes / pitch
    u = waves.directions(math.ceil(2 * _REACH / pitch * max(map(abs, slopes))) + 2)
    fields = np.array([[waves.opened(u, pixel, _FAR) for pixel in row] for row in pixels], np.complex64)
    found = []
    for slope in slopes:
        middle = np.exp(-2j * np.pi * slope / waves.width * np.einsum("yxc,ijc->ijyx", u, pixels))
        light, at = waves.light(u, fields / middle.astype(np.complex64), slope)
        aside = np.stack(np.meshgrid(at, at, indexing="ij"), -1) @ axes.T * (pitch / -slope)
        found.append(_shown(light / light.sum((2, 3), keepdims=True), aside, len(ways)))
    return np.array(found).T


def _shown(light: np.ndarray, aside: np.ndarray, ways: int) -> np.ndarray:
    """(ways,) Where corners are found less where they are [px], by light from beside pixels."""
    size, inside = 2 * WINDOW + 3, disc(WINDOW).astype(int)
    boards = np.array([[_corner(aside + pixel, turn) for pixel in inside.T] for turn in _TURNS], light.dtype)
    first = _STEP * (inside[0] + WINDOW)
    seen = light[np.arange(ways)[:, None] + first, inside[1] + WINDOW]
    picture = np.zeros((ways * len(_TURNS), size, size))
    picture[:, inside[0] + WINDOW + 1, inside[1] + WINDOW + 1] = np.einsum(
        "wnyx,tnyx->wtn", seen, boards, optimize=True
    ).reshape(len(picture), -1)
    middles = np.stack([np.arange(len(picture)) * size + WINDOW + 1, np.full(len(picture), WINDOW + 1)], 1)
    found = crossed(picture.reshape(-1, size), middles.astype(float), WINDOW) - middles
    return found[:, 0].reshape(ways, -1).sum(1)


def _corner(places: np.ndarray, turn: float) -> np.ndarray:
    """-1 to 1 of a chessboard's corner, as pixels see it whose middles are at places (y, x, 2) [px]."""
    one = places @ (math.cos(turn), math.sin(turn))
    other = places @ (-math.sin(turn), math.cos(turn))
    return np.clip(2 * one, -1, 1) * np.clip(2 * other, -1, 1)
