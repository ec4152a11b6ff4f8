"""Plane sweep: how well the views agree when a place is taken to lie at each of many disparities.

Only the cross of views through the middle one is used: each is moved along one axis only. What stands before
a place hides it from the views of one side; so the better of the left and the right half counts, and the
better of the upper and the lower.
"""

import math

import numpy as np

from lumigraph.core import memory
from lumigraph.core.progress import Progress, silent
from lumigraph.depth.pictures import Pictures
from lumigraph.depth.volume import box, cheapest, guided, semi_global
from lumigraph.errors import GeometryError

_STEP = 0.4  # between labels: how far a point moves in the outermost view [px]
_MOST_LABELS = 2000
_MOST_DIFFERENCE = 0.017  # of a picture from 0 to 1: more says only that the label is wrong
_FAR = 0.15  # part of a picture's width that a point may cross from the middle view to the outermost
_COARSE = 4
_MODEST = 0.05  # preference for small movements where the views do not say


def labels(low: float, high: float) -> np.ndarray:
    """Movements in the outermost view (n,) [px] that are compared, two beyond each end."""
    count = math.ceil((high - low) / _STEP) + 1
    if count + 4 > _MOST_LABELS:
        raise GeometryError(
            f"disparities span {high - low:.4g} px in the outermost view, which takes {count} labels where "
            f"{_MOST_LABELS} are the most. Give a smaller range as disparities=(low, high)."
        )
    middle, half = (low + high) / 2, (count - 1) / 2 + 2
    return (middle + _STEP * np.linspace(-half, half, count + 4)).astype(np.float32)


def swept(pictures: Pictures, moves: np.ndarray, progress: Progress) -> np.ndarray:
    """Movement (y, x) of each place in the outermost view [px], to a fraction of a label.

    Raises
    ------
    LumigraphError
        The cost of all labels would not fit in memory.
    """
    shape = pictures.center.shape[1:]
    memory.require(
        4.5 * 4 * len(moves) * shape[0] * shape[1],
        f"the cost of {len(moves)} disparities for {shape[0]} x {shape[1]} places",
        "Give a range of disparities {factor:.1f}x narrower.",
    )
    most = max(_MOST_DIFFERENCE, 3 * pictures.noise)
    cost = costs(pictures, moves, most, progress)
    guide = pictures.center.mean(0)
    cost = guided(cost, guide, 3)
    cost = semi_global(cost, guide, 0.2 * most, most)
    return moves[0] + cheapest(cost)[0] * (moves[1] - moves[0])


def costs(pictures: Pictures, moves: np.ndarray, most: float, progress: Progress) -> np.ndarray:
    """Disagreement (n, y, x) of the cross of views for each movement, at most 2 `most`."""
    halves = _halves(pictures)
    out = np.zeros((len(moves), *pictures.center.shape[1:]), np.float32)
    for k, move in enumerate(moves):
        for sides in halves:
            means = [_disagreement(pictures, side, float(move), most) for side in sides]
            out[k] += np.minimum(*means) if len(means) == 2 else means[0]
        progress((k + 1) / len(moves))
    return out


_Side = list[tuple[np.ndarray, float, int]]


def _halves(pictures: Pictures) -> list[list[_Side]]:
    """For each axis the views (c, y, x) on its two sides, with where they stand and the axis they move on."""
    v, u = pictures.middle
    arms = [
        [(pictures.data[k, u], pictures.down[k], 1) for k in np.flatnonzero(pictures.lit[:, u])],
        [(pictures.data[v, k], pictures.right[k], 2) for k in np.flatnonzero(pictures.lit[v])],
    ]
    halves = [[[one for one in arm if side * one[1] > 0] for side in (-1, 1)] for arm in arms]
    kept = [[side for side in arm if side] for arm in halves]
    if not any(kept):
        raise GeometryError("only the middle view is lit: there is no parallax. Decode without a stop.")
    return [arm for arm in kept if arm]


def _disagreement(pictures: Pictures, side: _Side, move: float, most: float) -> np.ndarray:
    """Mean over the views of one side of how much they differ from the middle one (y, x)."""
    total = np.zeros(pictures.center.shape[1:], np.float32)
    for view, place, axis in side:
        difference = moved(view, move * place, axis)
        difference -= pictures.center
        np.abs(difference, out=difference)
        difference = np.minimum(difference.mean(0), most)
        _outside(difference, move * place, axis - 1)[...] = most
        total += difference
    return total / len(side)


def _outside(image: np.ndarray, distance: float, axis: int) -> np.ndarray:
    """The part of an image (y, x) that is read beyond its edge when moved by `distance`."""
    count = min(math.ceil(abs(distance)), image.shape[axis])
    places = slice(0, count) if distance < 0 else slice(image.shape[axis] - count, None)
    return image[places] if axis == 0 else image[:, places]


def moved(picture: np.ndarray, distance: float, axis: int) -> np.ndarray:
    """The picture read `distance` samples farther along an axis, linearly between samples; edges repeated."""
    count, below = picture.shape[axis], math.floor(distance)
    part = np.float32(distance - below)
    places = np.arange(count) + below
    first = np.take(picture, np.clip(places, 0, count - 1), axis)
    if part == 0:
        return first
    second = np.take(picture, np.clip(places + 1, 0, count - 1), axis)
    second -= first
    second *= part
    second += first
    return second


def span(pictures: Pictures) -> tuple[float, float]:
    """Least and most movement in the outermost view [px] that the picture shows, with some to spare.

    A sweep of pictures `_COARSE` times smaller over all that a lens camera could show.
    """
    size = _COARSE if min(pictures.center.shape[1:]) >= 16 * _COARSE else 1
    small = _shrunk(pictures, size)
    most = max(2.0, _FAR * max(pictures.center.shape[1:]))
    moves = np.arange(-most, most + 0.5, 0.5).astype(np.float32) / np.float32(size)
    limit = 3 * max(_MOST_DIFFERENCE, 3 * pictures.noise / size)
    guide = small.center.mean(0)
    cost = guided(costs(small, moves, limit, silent), guide, 2)
    texture = np.maximum(np.median(cost, axis=0) - cost.min(0) - 2 * pictures.noise / size, 0)
    cost += (_MODEST * limit * np.abs(moves) / moves[-1])[:, None, None]
    cost = semi_global(cost, guide, 0.1 * limit, limit)
    best, _ = cheapest(cost)
    found = (moves[0] + best * (moves[1] - moves[0])) * size
    low, high = _quantiles(found, texture**2, (0.01, 0.99))
    spare = 0.1 * (high - low) + 2 * _STEP
    return low - spare, high + spare


def _shrunk(pictures: Pictures, size: int) -> Pictures:
    ny, nx = (n // size for n in pictures.center.shape[1:])
    data = pictures.data[..., : ny * size, : nx * size]
    data = data.reshape(*data.shape[:3], ny, size, nx, size).mean((4, 6))
    return Pictures(data, pictures.down, pictures.right, pictures.lit, pictures.noise, pictures.reach)


def _quantiles(values: np.ndarray, weights: np.ndarray, parts: tuple[float, float]) -> tuple[float, float]:
    weights = box(weights, 1).ravel() + 1e-12
    order = np.argsort(values, axis=None)
    sums = np.cumsum(weights[order], dtype=float)
    places = np.searchsorted(sums, np.array(parts) * sums[-1])
    low, high = values.ravel()[order][np.clip(places, 0, len(order) - 1)]
    return float(low), float(high)
