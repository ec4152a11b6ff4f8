"""Matches that are no better than those by chance."""

import numpy as np

from lumigraph.depth.pictures import Pictures
from lumigraph.depth.volume import box

_SLOW = 8  # px to each side: what varies over more is alike wherever a place is taken to lie
_WINDOW = 16  # px to each side that decide together: in small windows some place of noise is always alike
_CHANCE, _MATCH = 0.3, (0.4, 0.8)
"""Part of the texture that views show: so little by chance, so much by a match, among matches and else."""
_PATCH = 49  # px that a sweep joins to one
_SELECTED = 7.0  # standard errors: far more than the likest of many places of noise


def by_chance(pictures: Pictures, shown: np.ndarray) -> np.ndarray:
    """How likely (y, x) a map's match is one by chance, 0 to 1.

    Views at their places show the texture of the middle view again, all but its noise; of noise they show as
    much as the likest of many places does by chance; and of a texture that they do not see, nothing.

    Parameters
    ----------
    pictures
        Views, and the noise that the middle one has.
    shown
        Mean (y, x) of the views that see a place of the middle one, moved by the map.
    """
    center, noise = pictures.center.mean(0), pictures.noise**2
    center, shown = (part - box(part, _SLOW) for part in (center, shown))
    views = max(int(pictures.lit.sum()) - 1, 1)
    least = _SELECTED * noise / np.sqrt(_PATCH * views)
    part = box(center * shown, _WINDOW) / np.maximum(box(center**2, _WINDOW) - noise, least)
    alone, doubtful = _MATCH
    match = alone + (doubtful - alone) * (part < doubtful).mean()
    return np.clip((match - part) / (match - _CHANCE), 0, 1)
