"""Vignetted views: the places where their light is cut off, and their brightness elsewhere."""

import math

import numpy as np
from scipy.ndimage import maximum_filter, uniform_filter

from lumigraph.depth.volume import box

_VIGNETTED = 2.25  # ratio of a view's brightness to the middle one's: more from place to place is no parallax
_BROAD, _PEDESTAL = 10, 0.05  # windows to a side that brightness is compared in, each this much brighter
_LEVEL = 0.05  # of a window's radius, squared: how much a plane is drawn towards a level one
_LEAST = 0.2  # ratio of square roots below which a view is not made brighter any more
_BLACK = 0.03  # of white: what is cut off has less, but for a camera's black level and scattered light
_ALONE = 3  # px: smaller places are black, or in shadow
_CHANGES = 0.25  # part of a window that is black in this view, but lit in others
_LIT = 0.5  # part of it that may be black in all views
_BESIDE = 2  # px beside what is cut off: light falls off there


def even(data: np.ndarray, lit: np.ndarray, middle: tuple[int, int]) -> np.ndarray | None:
    """Mask (v, u, y, x) of places that vignetted views see; there they are made even, in place.

    Each becomes as bright as the middle one, and shows what that does where it is cut off. None, and nothing
    is changed, where no view's brightness beside the middle one's varies over the picture by more than
    `_VIGNETTED`: parallax does not move that much light between windows of a tenth of the picture.

    Parameters
    ----------
    data
        Square roots of the views (v, u, c, y, x), about 1 where they are white.
    lit
        Which views (v, u) are not dark.
    middle
        Index of the middle one.
    """
    views = [(int(v), int(u)) for v, u in np.argwhere(lit)]
    center = data[middle].copy()
    usual = _brightness(center)
    if not any(_varies(data[at], usual) for at in views):
        return None
    seen = _seen(data, views)
    for at in views:
        data[at] /= _ratio(data[at], center, seen[at] & seen[middle])
        np.copyto(data[at], center, where=~seen[at])
    return seen


def _radius(shape: tuple[int, ...]) -> int:
    return max(16, min(shape[-2:]) // _BROAD)


def _brightness(picture: np.ndarray) -> np.ndarray:
    """Brightness of a picture (c, y, x) over a window (y, x), with a small pedestal."""
    return box(picture.mean(0), _radius(picture.shape)) + np.float32(_PEDESTAL)


def _varies(picture: np.ndarray, usual: np.ndarray) -> bool:
    """True if the brightness of a picture (c, y, x) over another's (y, x) varies."""
    low, high = np.percentile((_brightness(picture) / usual)[::4, ::4], (5, 95))
    return bool(high > math.sqrt(_VIGNETTED) * low)


def _seen(data: np.ndarray, views: list[tuple[int, int]]) -> np.ndarray:
    """Mask (v, u, y, x) of places that are not cut off: a cut-off place is black where others are lit.

    Black things are black in all views, and move little within a window; so does what stands before a dark
    ground.
    """
    black = np.zeros((*data.shape[:2], *data.shape[-2:]), bool)
    share = np.ones(black.shape, np.float32)
    size, radius = 2 * _ALONE + 1, _radius(black.shape)
    inside = _sum(np.ones(black.shape[-2:], np.float32), radius)
    for at in views:
        dark = maximum_filter(data[at].mean(0), size) < math.sqrt(_BLACK)
        black[at] = maximum_filter(dark, size + 2 * _BESIDE)
        share[at] = _sum(black[at].astype(np.float32), radius) / inside
    least = share.min((0, 1))
    return ~(black & (share - least > _CHANGES) & (least < _LIT))


def _sum(image: np.ndarray, radius: int) -> np.ndarray:
    """Sum over (2 radius + 1)² samples, 0 beyond the edges, as a part of them all."""
    return uniform_filter(image, 2 * radius + 1, mode="constant")


def _ratio(picture: np.ndarray, center: np.ndarray, used: np.ndarray) -> np.ndarray:
    """Brightness (y, x) of a picture (c, y, x) over another's: a plane in each window, by places used (y, x).

    The mean of a window is the brightness at the middle of what is used of it, which lies elsewhere beside
    what is cut off, and beside the picture's border.
    """
    radius = _radius(used.shape)
    y, x = (a - a.mean() for a in np.ogrid[: used.shape[0], : used.shape[1]])
    own, other = (used * (one.mean(0, dtype=float) + _PEDESTAL) for one in (picture, center))
    level, down, right = _moments(other, (y, x), radius)
    yy = box(other * y * y, radius) - y * (2 * down + y * level)
    xx = box(other * x * x, radius) - x * (2 * right + x * level)
    yx = box(other * y * x, radius) - y * right - x * down - y * x * level
    least = _LEVEL * radius**2 * level + 1e-9
    yy, xx = yy + least, xx + least
    scale = yy * xx - yx * yx
    by_y, by_x = (xx * down - yx * right) / scale, (yy * right - yx * down) / scale
    seen, seen_down, seen_right = _moments(own, (y, x), radius)
    found = seen - by_y * seen_down - by_x * seen_right + 1e-9
    found /= level - by_y * down - by_x * right + 1e-9
    return np.clip(found, _LEAST, 1 / _LEAST).astype(np.float32)


def _moments(
    light: np.ndarray, places: tuple[np.ndarray, np.ndarray], radius: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mean of light (y, x) in the window about each place, and of light times its distance, along y and x."""
    y, x = places
    level = box(light, radius)
    return level, box(light * y, radius) - y * level, box(light * x, radius) - x * level
