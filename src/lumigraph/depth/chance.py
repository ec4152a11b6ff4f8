"""Matches that are no better than those by chance."""

import numpy as np

from lumigraph.depth.pictures import Pictures, noise_near
from lumigraph.depth.volume import box

_SLOW = 8  # px to each side: what varies over more is no texture
_WINDOW = 16  # px to each side that decide together: in small windows some place of noise is always alike
_CHANCE, _MATCH = 0.3, (0.4, 0.8)
"""Part of the texture that views show: so little by chance, so much by a match, among matches and else."""
_PATCH = 49  # px that a sweep joins to one
_SELECTED = 7.0  # standard errors: far more than the likest of many places of noise


def by_chance(shared: np.ndarray, own: np.ndarray, noise: np.ndarray | float, count: float) -> np.ndarray:
    """Probability (y, x) that a map's match is one by chance, 0 to 1.

    What sees a place where it is shows its texture again, all but the noise; of noise it shows as much as the
    likest of many places does by chance; and of a texture that it does not see, nothing.

    Parameters
    ----------
    shared
        Products (y, x) of a place's texture as two see it that are independent in noise.
    own
        Squares (y, x) of its texture as one sees it, with the noise.
    noise
        Standard deviation of that, one or (y, x): part of a picture may have more than another.
    count
        Of those whose mean is in `shared`.
    """
    least = _SELECTED * noise**2 / np.sqrt(_PATCH * max(count, 1))
    part = box(shared, _WINDOW) / np.maximum(box(own, _WINDOW) - noise**2, least)
    alone, doubtful = _MATCH
    match = alone + (doubtful - alone) * (part < doubtful).mean()
    return np.clip((match - part) / (match - _CHANCE), 0, 1)


def slowly(picture: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Slow variation of a picture (y, x), by means of known places around each."""
    return box(picture * known, _SLOW) / np.maximum(box(known.astype(picture.dtype), _SLOW), 1e-6)


def of_views(pictures: Pictures, shown: np.ndarray) -> np.ndarray:
    """`by_chance` of a map, by the mean (y, x) of what the views that see a place show, moved by it."""
    own, shown = (part - box(part, _SLOW) for part in (pictures.center.mean(0), shown))
    noise = noise_near(pictures.center.mean(0))
    return by_chance(own * shown, own**2, noise, int(pictures.lit.sum()) - 1)
