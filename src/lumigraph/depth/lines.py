"""Slopes of the lines of all epipolar-plane images at once, by least squares about a first estimate."""

from collections.abc import Iterator
from typing import Any

import numpy as np
from scipy.ndimage import map_coordinates, maximum_filter, spline_filter

from lumigraph.core.progress import Progress
from lumigraph.depth.pictures import Pictures
from lumigraph.depth.smooth import Stiffness, tears, update
from lumigraph.depth.volume import box

_spline: Any = spline_filter

_ROUNDS = (2.0, 1.2)
"""Second difference that counts as an edge, round by round [px in the outermost view]."""

_KINK = 4e-3  # px in the outermost view
_STIFFNESS = 3e5
_BEFORE = 1.2  # how much nearer an occluder is [px in the outermost view]
_TEAR = 2.0  # px in the outermost view between neighbours that are not of one surface
_BESIDE = 2  # px beside an occluder whose differences show its edge


def refined(pictures: Pictures, moves: np.ndarray, progress: Progress) -> tuple[np.ndarray, np.ndarray]:
    """Movements (y, x) in the outermost view [px], refined on all views, and their standard deviation.

    Each round asks every view that sees a place by how much it should move there, r = g Δ: the residual r
    against the middle view, and the gradient g along the view's own direction. The answers, weighted by what
    they say, are joined by a smooth surface.
    """
    grey = pictures.data.mean(2)
    lines = np.stack([[_spline(view, 3, output=np.float32) for view in row] for row in grey])
    moves = moves.astype(np.float32)
    information = np.zeros_like(moves)
    for k, jump in enumerate(_ROUNDS):
        pull, information = _asked(pictures, grey[pictures.middle], lines, moves)
        how = Stiffness(_STIFFNESS * pictures.noise**2 * _share(pictures), _KINK, jump)
        change = update(moves, information, pull, how, tears=tears(moves, _TEAR)) - moves
        moves = moves + np.clip(change, -_BEFORE, _BEFORE)
        progress((k + 1) / len(_ROUNDS))
    return moves, pictures.noise / np.sqrt(box(information, 3) + 1e-12)


def _share(pictures: Pictures) -> float:
    """Part of 80 views that there are."""
    return float(pictures.lit.sum()) / 80


def _asked(
    pictures: Pictures, center: np.ndarray, lines: np.ndarray, moves: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """What the views pull at each place (y, x), and their information about it."""
    pull, information = np.zeros_like(moves), np.zeros_like(moves)
    slope = np.gradient(center)
    places = np.meshgrid(*(np.arange(n, dtype=np.float32) for n in moves.shape), indexing="ij")
    usual = 2.5 * pictures.noise
    for v, u, seen in visible(pictures, moves):
        at = [
            place + moves * w for place, w in zip(places, (pictures.down[v], pictures.right[u]), strict=True)
        ]
        view = map_coordinates(lines[v, u], at, order=3, mode="nearest", prefilter=False)
        residual = view - center
        along = np.gradient(view)
        gradient = 0.5 * (along[0] + slope[0]) * np.float32(pictures.down[v])
        gradient += 0.5 * (along[1] + slope[1]) * np.float32(pictures.right[u])
        weight = seen / (1 + (box(np.abs(residual), 1) / usual) ** 2)
        weight *= (at[0] >= 0) & (at[0] <= moves.shape[0] - 1) & (at[1] >= 0) & (at[1] <= moves.shape[1] - 1)
        pull -= weight * residual * gradient
        information += weight * gradient * gradient
    clear = maximum_filter(moves, 2 * _BESIDE + 1) - moves < _BEFORE
    return pull * clear, information * clear


def visible(pictures: Pictures, moves: np.ndarray) -> Iterator[tuple[int, int, np.ndarray]]:
    """For each lit view (v, u) but the middle one, which places (y, x) of the middle view it sees.

    Places are put into the view from far to near: where another one ends up on top, they are hidden.
    """
    order = np.argsort(moves, axis=None)
    y, x = np.divmod(order, moves.shape[1])
    sorted_moves = moves.ravel()[order]
    last = [n - 1 for n in moves.shape]
    for v, u in np.argwhere(pictures.lit):
        if (v, u) == pictures.middle:
            continue
        row = np.clip(np.rint(y + sorted_moves * pictures.down[v]), 0, last[0]).astype(np.intp)
        column = np.clip(np.rint(x + sorted_moves * pictures.right[u]), 0, last[1]).astype(np.intp)
        nearest = np.empty_like(moves)
        nearest[row, column] = sorted_moves
        seen = np.empty(moves.size, bool)
        seen[order] = nearest[row, column] < sorted_moves + _BEFORE
        yield int(v), int(u), seen.reshape(moves.shape)
