"""Slopes of the lines of all epipolar-plane images at once, by least squares about a first estimate."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.ndimage import map_coordinates, maximum_filter, spline_filter

from lumigraph.core.progress import Progress
from lumigraph.depth.chance import of_views
from lumigraph.depth.expected import LINES, Evidence, contrast, deviation
from lumigraph.depth.pictures import Pictures
from lumigraph.depth.shading import WINDOW, Shading, ShadingFit
from lumigraph.depth.smooth import Stiffness, tears, update
from lumigraph.depth.visible import BEFORE, visible
from lumigraph.depth.volume import box
from lumigraph.depth.vote import agreed

_spline: Any = spline_filter

_JUMPS = (2.0, 1.2)
"""Second difference that counts as an edge, round by round [px in the outermost view]."""

_KINK = 4e-3  # px in the outermost view
_STIFFNESS = 4000.0  # per variance of the noise, and per `_lever`
_EDGE = 0.003  # contrast between neighbours [of a picture from 0 to 1] where a surface may end
_USUAL, _AROUND = 1.3, 8  # times the mean contrast within so many px, which is texture
_LOOSEST = 0.1  # part of its stiffness that a surface keeps at the sharpest edge
_LEAST_SAID, _WINDOW = 0.15, 3  # of what gradients seem to say; samples to each side that tell it
_MOST_LEFT = 0.2  # of a picture from 0 to 1: more says only that a place is wrong
_TEAR = 2.0  # px in the outermost view between neighbours that are not of one surface
_BESIDE = 2  # px beside an occluder whose differences show its edge


def refined(
    pictures: Pictures, swept: tuple[Sequence[np.ndarray], np.ndarray], shading: Shading, progress: Progress
) -> tuple[np.ndarray, Evidence]:
    """Movements (y, x) in the outermost view [px], refined on all views, and what they rest on.

    `swept` are one or two first maps of movements (y, x), and how far others lie that explain a place as
    well. Two are both refined on some of the views; each place takes the one that the views agree with, and
    what is so joined is refined on all.

    Each round computes by how much a place should move for every view that sees it, r = g Δ: the residual r
    against the middle view, and the gradient g along the view's own direction. The answers, weighted by what
    they say, are joined by a smooth surface.
    """
    (maps, rivals), grey = swept, pictures.data.mean(2)
    lines = _Lines(pictures, _splines(grey, pictures.lit), contrast(grey[pictures.middle]))
    some = replace(lines, pictures=few(pictures)) if len(maps) > 1 else lines
    found = [some.moved(one, shading, _JUMPS[0]) for one in maps]
    moves, left = found[0]
    progress(0.5)
    if len(found) > 1:
        moves = np.where(agreed(pictures, (moves, found[1][0]), left), found[1][0], moves)
    asked = _asked(pictures, lines.splines, moves, left)
    moves = lines.changed(moves, asked, _JUMPS[1])
    progress(1.0)
    return moves, _evidence(lines, asked, moves, rivals)


def few(pictures: Pictures) -> Pictures:
    """The same with every second lit view of the cross and the diagonals, from the outermost ones on."""
    lit = np.zeros_like(pictures.lit)
    lit[pictures.middle] = True
    for way in np.ndindex(3, 3):
        step = np.array(way) - 1
        if step.any():
            arm = list(_along(pictures, step))
            for place in arm[::-2]:
                lit[place] = True
    return replace(pictures, lit=lit)


def _along(pictures: Pictures, step: np.ndarray) -> Iterator[tuple[int, int]]:
    """Lit views in steps from the middle one."""
    v, u = np.array(pictures.middle) + step
    while 0 <= v < pictures.lit.shape[0] and 0 <= u < pictures.lit.shape[1]:
        if pictures.lit[v, u]:
            yield int(v), int(u)
        v, u = v + step[0], u + step[1]


def _splines(grey: np.ndarray, lit: np.ndarray) -> np.ndarray:
    """Splines of lit views (v, u, y, x), for `map_coordinates`."""
    out = np.zeros_like(grey)
    for view in np.argwhere(lit):
        _spline(grey[tuple(view)], 3, output=out[tuple(view)])
    return out


@dataclass(frozen=True)
class _Lines:
    """Views, their splines (v, u, y, x), and the contrast of the middle one (y, x)."""

    pictures: Pictures
    splines: np.ndarray
    contrast: np.ndarray

    @cached_property
    def _edges(self) -> np.ndarray:
        """Part (y, x) of the stiffness that a surface keeps where its picture has a contrast."""
        usual = box(self.contrast, _AROUND)
        above = np.maximum(self.contrast - _USUAL * usual, 0)
        return np.maximum(np.exp(-above / (_EDGE + usual)), _LOOSEST)

    def moved(self, moves: np.ndarray, shading: Shading, jump: float) -> tuple[np.ndarray, Shading]:
        """A map after a round, and the shading that is left."""
        asked = _asked(self.pictures, self.splines, moves, shading)
        return self.changed(moves, asked, jump), asked.shading

    def changed(self, moves: np.ndarray, asked: "_LineDemand", jump: float) -> np.ndarray:
        """Map (y, x) moved by the changes that views imply."""
        stiffness = _STIFFNESS * self.pictures.noise**2 * _lever(self.pictures)
        how = Stiffness(stiffness, _KINK, jump)
        change = update(moves, asked.information, asked.pull, how, self._edges, tears(moves, _TEAR)) - moves
        return moves + np.clip(change, -BEFORE, BEFORE)


def _evidence(lines: _Lines, asked: "_LineDemand", moves: np.ndarray, rivals: np.ndarray) -> Evidence:
    """Evidence for a map (y, x), by the pull of views on it.

    Noise has gradients, too, which carry no information.
    """
    pictures, usual = lines.pictures, box(asked.information, _WINDOW)
    nothing = 0.25 * pictures.noise**2 * _lever(pictures)
    said = np.maximum(1 - nothing / (usual + 1e-12), _LEAST_SAID)
    variance = np.maximum(box(asked.residual, 2), pictures.noise) ** 2 * asked.information * said
    information = asked.information * said
    return Evidence(
        *deviation(moves, information, variance, LINES),
        box(asked.disputed, 1),
        lines.contrast,
        rivals,
        of_views(pictures, asked.shown),
    )


def _lever(pictures: Pictures) -> float:
    """Sum of the views' squared distances from the middle one, in proportion to a texture's information."""
    squares = np.square(pictures.down)[:, None] + np.square(pictures.right)
    return float(squares[pictures.lit].sum())


@dataclass(frozen=True, slots=True)
class _LineDemand:
    """Pull of the views at each place (y, x), their information about it, and the shading that is left.

    `residual` is how much the views that see a place differ from the middle one, `disputed` the part of them
    that does by more than noise, and `shown` the mean of what they show.
    """

    pull: np.ndarray
    information: np.ndarray
    shading: Shading
    residual: np.ndarray
    disputed: np.ndarray
    shown: np.ndarray


def _asked(pictures: Pictures, lines: np.ndarray, moves: np.ndarray, shading: Shading) -> _LineDemand:
    center = pictures.center.mean(0)
    slope = np.gradient(center)
    pull, information, down, right, alike, off, count, shown = (np.zeros_like(moves) for _ in range(8))
    fit, usual = ShadingFit(moves.shape, pictures.noise), 2.5 * pictures.noise
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
        alike += weight
        off += seen * np.minimum(left, _MOST_LEFT)
        count += seen
        shown += np.where(seen, view, 0)
    shading = fit.solved(WINDOW)
    pull += shading.down * down + shading.right * right
    clear = maximum_filter(moves, 2 * _BESIDE + 1) - moves < BEFORE
    shown = np.where(count > 0, shown / np.maximum(count, 1), center)
    count = np.maximum(count, 1)
    return _LineDemand(pull * clear, information * clear, shading, off / count, 1 - alike / count, shown)


def _warped(
    pictures: Pictures, lines: np.ndarray, moves: np.ndarray
) -> Iterator[tuple[tuple[float, float], np.ndarray, np.ndarray]]:
    """Each view's place, mask (y, x) of the middle view's places that it sees, and its values there."""
    places = np.meshgrid(*(np.arange(n, dtype=np.float32) for n in moves.shape), indexing="ij")
    for v, u, seen in visible(pictures, moves):
        stands = float(pictures.down[v]), float(pictures.right[u])
        at = [place + moves * w for place, w in zip(places, stands, strict=True)]
        view = map_coordinates(lines[v, u], at, order=3, mode="nearest", prefilter=False)
        yield stands, seen & pictures.sees((v, u), at), view
