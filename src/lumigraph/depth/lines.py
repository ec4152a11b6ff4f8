"""Slopes of the lines of all epipolar-plane images at once, by least squares about a first estimate."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.ndimage import map_coordinates, maximum_filter, spline_filter

from lumigraph.core.progress import Progress
from lumigraph.depth.chance import by_chance
from lumigraph.depth.expected import Evidence, contrast
from lumigraph.depth.pictures import Pictures
from lumigraph.depth.shading import WINDOW, Fit, Shading
from lumigraph.depth.smooth import Stiffness, tears, update
from lumigraph.depth.volume import box

_spline: Any = spline_filter

_JUMPS = (2.0, 1.2)
"""Second difference that counts as an edge, round by round [px in the outermost view]."""

_KINK = 4e-3  # px in the outermost view
_STIFFNESS = 4000.0  # per variance of the noise, and per `_lever`
_EDGE = 0.003  # contrast between neighbours [of a picture from 0 to 1] where a surface may end
_USUAL, _AROUND = 1.3, 8  # times the mean contrast within so many px, which is texture
_LOOSEST = 0.1  # part of its stiffness that a surface keeps at the sharpest edge
_LEAST_SAID = 0.15  # of what gradients seem to say
_MOST_LEFT = 0.2  # of a picture from 0 to 1: more says only that a place is wrong
_BEFORE = 1.2  # how much nearer an occluder is [px in the outermost view]
_TEAR = 2.0  # px in the outermost view between neighbours that are not of one surface
_BESIDE = 2  # px beside an occluder whose differences show its edge


def refined(
    pictures: Pictures, swept: tuple[np.ndarray, np.ndarray], shading: Shading, progress: Progress
) -> tuple[np.ndarray, Evidence]:
    """Movements (y, x) in the outermost view [px], refined on all views, and what they rest on.

    `swept` are the first movements (y, x), and how far others lie that explain a place as well.

    Each round asks every view that sees a place by how much it should move there, r = g Δ: the residual r
    against the middle view, and the gradient g along the view's own direction. The answers, weighted by what
    they say, are joined by a smooth surface.
    """
    grey = pictures.data.mean(2)
    lines = np.stack([[_spline(view, 3, output=np.float32) for view in row] for row in grey])
    moves, rivals = (part.astype(np.float32) for part in swept)
    edged = contrast(grey[pictures.middle])
    edges, asked = _edges(edged), _asked(pictures, lines, moves, shading)
    stiffness = _STIFFNESS * pictures.noise**2 * _lever(pictures)
    for k, jump in enumerate(_JUMPS):
        if k:
            asked = _asked(pictures, lines, moves, asked.shading)
        how = Stiffness(stiffness, _KINK, jump)
        change = update(moves, asked.information, asked.pull, how, edges, tears(moves, _TEAR)) - moves
        moves = moves + np.clip(change, -_BEFORE, _BEFORE)
        progress((k + 1) / len(_JUMPS))
    deviation, chance = _deviation(pictures, asked), by_chance(pictures, asked.shown)
    return moves, Evidence(deviation, box(asked.disputed, 1), edged, rivals, chance)


def _deviation(pictures: Pictures, asked: "_Asked") -> np.ndarray:
    """Standard deviation (y, x) [px in the outermost view] by the residuals that are left.

    Noise has gradients of its own, which say nothing.
    """
    information = box(asked.information, 3)
    nothing = 0.25 * pictures.noise**2 * _lever(pictures)
    information = np.maximum(information - nothing, _LEAST_SAID * information)
    return np.maximum(box(asked.residual, 2), pictures.noise) / np.sqrt(information + 1e-12)


def _edges(edged: np.ndarray) -> np.ndarray:
    """Part (y, x) of the stiffness that a surface keeps where its picture has a contrast (y, x)."""
    usual = box(edged, _AROUND)
    above = np.maximum(edged - _USUAL * usual, 0)
    return np.maximum(np.exp(-above / (_EDGE + usual)), _LOOSEST)


def _lever(pictures: Pictures) -> float:
    """Sum of the squares of the views' distances from the middle one, by which what a texture says grows."""
    squares = np.square(pictures.down)[:, None] + np.square(pictures.right)
    return float(squares[pictures.lit].sum())


@dataclass(frozen=True, slots=True)
class _Asked:
    """What the views pull at each place (y, x), their information about it, and the shading that is left.

    `residual` is how much the views that see a place differ from the middle one, `disputed` the part of them
    that does by more than noise, and `shown` the mean of what they show.
    """

    pull: np.ndarray
    information: np.ndarray
    shading: Shading
    residual: np.ndarray
    disputed: np.ndarray
    shown: np.ndarray


def _asked(pictures: Pictures, lines: np.ndarray, moves: np.ndarray, shading: Shading) -> _Asked:
    center = pictures.center.mean(0)
    slope = np.gradient(center)
    pull, information, down, right, agreed, off, count, shown = (np.zeros_like(moves) for _ in range(8))
    fit, usual = Fit(moves.shape, pictures.noise), 2.5 * pictures.noise
    for (y, x), seen, view in _warped(pictures, lines, moves):
        residual, along = view - center, np.gradient(view)
        gradient = 0.5 * y * (along[0] + slope[0]) + 0.5 * x * (along[1] + slope[1])
        left = np.abs(residual - shading.at(y, x))
        weight = seen / (1 + (box(left, 1) / usual) ** 2)
        fit.add(residual, weight, gradient, y, x)
        pulled = weight * gradient
        pull -= pulled * residual
        information += pulled * gradient
        down += y * pulled
        right += x * pulled
        agreed += weight
        off += seen * np.minimum(left, _MOST_LEFT)
        count += seen
        shown += np.where(seen, view, 0)
    shading = fit.solved(WINDOW)
    pull += shading.down * down + shading.right * right
    clear = maximum_filter(moves, 2 * _BESIDE + 1) - moves < _BEFORE
    shown = np.where(count > 0, shown / np.maximum(count, 1), center)
    count = np.maximum(count, 1)
    return _Asked(pull * clear, information * clear, shading, off / count, 1 - agreed / count, shown)


def _warped(
    pictures: Pictures, lines: np.ndarray, moves: np.ndarray
) -> Iterator[tuple[tuple[float, float], np.ndarray, np.ndarray]]:
    """For each view where it stands, which places (y, x) of the middle one it sees, and what there."""
    places = np.meshgrid(*(np.arange(n, dtype=np.float32) for n in moves.shape), indexing="ij")
    for v, u, seen in visible(pictures, moves):
        stands = float(pictures.down[v]), float(pictures.right[u])
        at = [place + moves * w for place, w in zip(places, stands, strict=True)]
        view = map_coordinates(lines[v, u], at, order=3, mode="nearest", prefilter=False)
        yield stands, seen & pictures.sees((v, u), at), view


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
