"""Slopes of the lines of all epipolar-plane images at once, by least squares about a first estimate."""

from collections.abc import Iterator
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
from lumigraph.depth.sweep import Swept, along
from lumigraph.depth.visible import BEFORE, visible
from lumigraph.depth.volume import box

_spline: Any = spline_filter

_AGREED = (1.5, 3.0)  # of the noise: what views differ by where a stiff surface fits, and where it does not
_EDGE = 0.003  # contrast between neighbours [of a picture from 0 to 1] where a surface may end
_USUAL, _AROUND = 1.3, 8  # times the mean contrast within so many px, which is texture
_LOOSEST = 0.1  # part of its stiffness that a surface keeps at the sharpest edge
_LEAST_SAID, _WINDOW = 0.15, 3  # of what gradients seem to say; samples to each side that tell it
_MOST_LEFT = 0.2  # of a picture from 0 to 1: more says only that a place is wrong
_BESIDE = 2  # px beside an occluder whose differences show its edge


@dataclass(frozen=True, slots=True)
class _Round:
    """Surface of a round of least squares.

    Parameters
    ----------
    kink
        Second difference above which a bend costs its amount, not its square [px in the outermost view].
    jump
        Second difference that counts as an edge [px in the outermost view].
    stiffness
        Per variance of the noise, and per `_lever`.
    tear
        Between neighbours that are not of one surface [px in the outermost view].
    """

    kink: float
    jump: float
    stiffness: float
    tear: float


_STIFF, _SUPPLE = _Round(0.05, 2.0, 4000.0, 1.2), _Round(4e-3, 1.2, 2000.0, 1.2)
"""The first round mends what a sweep by narrow windows gets wrong, the second follows leaves."""


def refined(
    pictures: Pictures, swept: Swept, shading: Shading, progress: Progress
) -> tuple[np.ndarray, Evidence]:
    """Movements (y, x) in the outermost view [px], refined on all views, and what they rest on.

    The map of a sweep is refined on some of the views first, then on all.

    Each round computes by how much a place should move for every view that sees it, r = g Δ: the residual r
    against the middle view, and the gradient g along the view's own direction. The answers, weighted by what
    they say, are joined by a smooth surface.
    """
    grey = pictures.data.mean(2)
    lines = _Lines(pictures, _splines(grey, pictures.lit), contrast(grey[pictures.middle]))
    some = replace(lines, pictures=few(pictures))
    moves, left = some.moved(swept.moves, shading, _STIFF)
    progress(0.5)
    asked = _asked(pictures, lines.splines, moves, left)
    moves = lines.changed(moves, asked, _SUPPLE)
    progress(1.0)
    return moves, replace(_evidence(lines, asked, moves, swept.rivals), behind=swept.behind)


def few(pictures: Pictures) -> Pictures:
    """The same with every second lit view of the cross and the diagonals, from the outermost ones on."""
    lit = np.zeros_like(pictures.lit)
    lit[pictures.middle] = True
    for way in np.ndindex(3, 3):
        if way != (1, 1):
            for place in along(pictures, way)[::-2]:
                lit[place] = True
    return replace(pictures, lit=lit)


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

    def moved(self, moves: np.ndarray, shading: Shading, surface: _Round) -> tuple[np.ndarray, Shading]:
        """A map after a round, and the shading that is left."""
        asked = _asked(self.pictures, self.splines, moves, shading)
        return self.changed(moves, asked, surface), asked.shading

    def changed(self, moves: np.ndarray, asked: "_LineDemand", surface: _Round) -> np.ndarray:
        """Map (y, x) moved by the changes that views imply."""
        stiffness = _STIFF.stiffness * self.pictures.noise**2 * _lever(self.pictures)
        how, torn = Stiffness(stiffness, surface.kink, surface.jump), tears(moves, surface.tear)
        kept = self._edges * self._kept(asked, surface)
        change = update(moves, asked.information, asked.pull, how, kept, torn) - moves
        return moves + np.clip(change, -BEFORE, BEFORE)

    def _kept(self, asked: "_LineDemand", surface: _Round) -> np.ndarray:
        """Part (y, x) of the first round's stiffness: all where views agree to noise, else the round's."""
        left = box(asked.residual, 1) / self.pictures.noise
        part = np.clip((left - _AGREED[0]) / (_AGREED[1] - _AGREED[0]), 0, 1)
        return (surface.stiffness / _STIFF.stiffness) ** part


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
