"""Saddles of the brightness, such as corners of a chessboard, and dark dots: no even blur moves them."""

import numpy as np
from scipy.ndimage import map_coordinates

STILL = 0.02
"""Length of the last step [px] of a saddle that has been found."""

_STEPS = 12  # of one search
_ODD = 0.15
"""Part of a window's contrast that changes when it is turned by 180°: a corner has none but noise."""


def settle(
    splines: np.ndarray, start: np.ndarray, radius: int, *, stray: float, dots: bool = False
) -> tuple[np.ndarray, np.ndarray]:
    """The saddle near each of n places, or the dark dot, and which of them are some.

    Parameters
    ----------
    splines
        A picture (y, x) as `scipy.ndimage.spline_filter` of order 3 gives it.
    start
        Places (n, 2) as (y, x) [px].
    radius
        Of the round window in which a quadratic is fitted [px].
    stray
        Farthest from its start [px].
    dots
        Whether to look for the middles of dark dots that the window holds.

    Returns
    -------
    tuple
        Places (n, 2), and true or false (n,): one that holds still, near its start, and alike on
        opposite sides.
    """
    y, x = disc(radius)
    solve, at = quadratic(y, x, radius / 2), start

    def step(at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return _towards_rest(_windows(splines, at, y, x) @ solve, dots)

    for _ in range(_STEPS):
        at = at + step(at)[0]
    move, right = step(at)
    kept = right & (np.hypot(*(at - start).T) < stray) & (np.hypot(*move.T) < STILL)
    kept[kept] = _odd(_windows(splines, at[kept], y, x)) < _ODD
    return at, kept


def _windows(splines: np.ndarray, at: np.ndarray, y: np.ndarray, x: np.ndarray) -> np.ndarray:
    places = np.stack([at[:, :1] + y, at[:, 1:] + x])
    return map_coordinates(splines, places, order=3, mode="nearest", prefilter=False)


def disc(radius: int) -> np.ndarray:
    """Ways (2, k) from the middle of a round window to its pixels."""
    ways = np.mgrid[-radius : radius + 1, -radius : radius + 1].reshape(2, -1).astype(np.float64)
    return ways[:, np.hypot(*ways) <= radius + 0.5]


def _odd(values: np.ndarray) -> np.ndarray:
    """Part of the contrast of windows (n, k) that turns its sign when they are turned by 180°."""
    values = values - values.mean(1, keepdims=True)
    return ((values - values[:, ::-1]) ** 2).sum(1) / np.maximum(4 * (values**2).sum(1), 1e-30)


def quadratic(y: np.ndarray, x: np.ndarray, width: float) -> np.ndarray:
    """Matrix (k, 6) from values (n, k) to the quadratic 1, y, x, y²/2, yx, x²/2 that fits them best."""
    weight = np.exp(-(y**2 + x**2) / (4 * width**2))  # its square is a Gaussian of `width`
    terms = np.stack([np.ones_like(y), y, x, y * y / 2, y * x, x * x / 2], 1)
    return (np.linalg.pinv(terms * weight[:, None]) * weight).T


def _towards_rest(terms: np.ndarray, dots: bool) -> tuple[np.ndarray, np.ndarray]:
    """Step (n, 2) [px], at most 1, to where the gradient is 0, and a mask of saddles (or hollows)."""
    _, gy, gx, yy, yx, xx = terms.T
    determinant = yy * xx - yx**2
    right = (determinant > 0) & (yy > 0) if dots else determinant < 0
    safe = np.where(right, determinant, np.inf)
    step = np.stack([(yx * gx - xx * gy) / safe, (yx * gy - yy * gx) / safe], 1)
    return np.clip(step, -1.0, 1.0), right
