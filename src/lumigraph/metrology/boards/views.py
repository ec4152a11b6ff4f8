"""Corners or dots of a board in the views of raw images of a plenoptic 1.0 camera."""

import math
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter, spline_filter

from lumigraph.analysis.crossings import crossed
from lumigraph.analysis.saddles import settle
from lumigraph.core.arrays import to_numpy
from lumigraph.core.calibration import Calibration
from lumigraph.core.raw import RawImage
from lumigraph.errors import CalibrationError
from lumigraph.metrology.boards import chessboard, windows
from lumigraph.metrology.boards.corners import Board
from lumigraph.metrology.boards.order import ordered, told_of
from lumigraph.preparation import decode
from lumigraph.preparation.prepare import of_raw
from lumigraph.rendering.geometry import raw_places

LEAST_VIEWS = 5
"""Views in which a corner must be seen."""

DIRECTIONS = 7
"""Views along an axis: the fewer, the less noise and the less of it is shared."""

_SOFT = 1.0  # samples: of a blur that moves no corner, but keeps samples from pulling at them
_STRAY = 1.5  # samples: from where a corner is expected
_RIM = 1.0  # px: of a micro-image, whose blur moves what views there see
_OFF = 3.0  # times the median distance from the corner's own line


@of_raw
def on_picture(raw: RawImage, calibration: Calibration, board: Board, frame: int) -> tuple[np.ndarray, ...]:
    """Columns of `Corners` of one raw image.

    The board is found on the middle view. From there on, views farther out are searched for the saddles of
    the brightness, or for dots, where the views before lead to expect them: a corner moves evenly
    from view to view.
    """
    pitch = calibration.lattice.pitch
    count = min(DIRECTIONS, int(pitch) - (int(pitch) + 1) % 2)
    views = decode(raw, calibration, directions=count)
    data = np.asarray(to_numpy(views.data), np.float64)
    data = data.mean(4) if data.ndim == 5 else data
    which = np.argwhere(np.ones(data.shape[:2], bool))
    _, way = raw_places(views, calibration, np.zeros((len(which), 2)), which)
    near = np.hypot(*way.T) <= reach(calibration, count)
    which, way = which[near], way[near]
    first = _board(data[count // 2, count // 2], board, f"the middle view of picture {frame}")
    known = np.flatnonzero(np.isfinite(first[:, 0]))
    radius = windows.radius(windows.ways(first[known]), board, frame, "samples of a view wide")
    track = _Track.of(first[known], radius, len(way), dots=board.radius > 0)
    for k in np.argsort(np.hypot(*way.T), kind="stable"):
        track.follow(data[tuple(which[k])], way, int(k))
    corner, view = np.nonzero(track.straight(way))
    if not len(corner):
        raise CalibrationError(
            f"picture {frame} shows the board, but no corner in {LEAST_VIEWS} views or more. Take it in "
            "better light, or nearer to the plane in focus."
        )
    center, ways = raw_places(views, calibration, track.places[corner, view], which[view])
    return np.full(len(corner), frame), known[corner], center + ways, center, np.zeros(len(corner), int)


def reach(calibration: Calibration, count: int) -> float:
    """Largest distance of the middles of `count` views from a micro-image's centre, inside the rim [px]."""
    pitch = calibration.lattice.pitch
    return (calibration.fill or 1.0) * pitch / 2 - _RIM - pitch / count / math.sqrt(2)


def _board(middle: np.ndarray, board: Board, what: str) -> np.ndarray:
    """Corners (n, 2) on the middle view [samples], from either end of a board that looks the same turned."""
    if board.pattern != "corners":
        return chessboard.find(middle, board, what)
    found, seen = chessboard.whole(middle, board)
    if np.isfinite(found).all():
        with told_of(what):
            return ordered(found, board.points()[:, 1:])
    raise CalibrationError(
        f"{what} does not show a whole {board.what}; {seen} corners of a board are seen. Leave the picture "
        "out, or give the board's own numbers."
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Track:
    """Places (n, m, 2) of n corners in m views [samples], NaN where they were not found."""

    first: np.ndarray
    radius: int
    places: np.ndarray
    dots: bool

    @classmethod
    def of(cls, first: np.ndarray, radius: int, views: int, *, dots: bool) -> "_Track":
        return cls(first, radius, np.full((len(first), views, 2), np.nan), dots)

    def follow(self, view: np.ndarray, way: np.ndarray, k: int) -> None:
        """Look for the corners in one view more."""
        middle, slope = self._lines(way)
        start = middle + slope[:, None] * way[k]
        splines = spline_filter(gaussian_filter(view, _SOFT), 3)
        at, kept = settle(splines, start, self.radius, stray=_STRAY, dots=self.dots)
        at = at if self.dots else crossed(view, at, self.radius)
        inside = ((at >= self.radius) & (at <= np.array(view.shape) - 1 - self.radius)).all(1)
        self.places[kept & inside, k] = at[kept & inside]

    def straight(self, way: np.ndarray) -> np.ndarray:
        """Mask (n, m) of places on their corner's line; none for corners that too few views show."""
        for _ in range(3):
            middle, slope = self._lines(way)
            off = np.hypot(*np.moveaxis(self.places - middle[:, None] - slope[:, None, None] * way, -1, 0))
            typical = np.nanmedian(np.where(np.isfinite(off).any(1, keepdims=True), off, 0), axis=1)
            self.places[off > np.maximum(0.02, _OFF * typical)[:, None]] = np.nan
        good = np.isfinite(self.places[..., 0])
        return good & (good.sum(1) >= LEAST_VIEWS)[:, None]

    def _lines(self, way: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Place (n, 2) in the view of way 0, and how far a corner moves with the way [samples/px] (n,)."""
        good = np.isfinite(self.places[..., 0])
        count = np.maximum(good.sum(1), 1)[:, None]
        ways = good[..., None] * way
        mean = ways.sum(1) / count
        places = np.where(good[..., None], self.places, 0)
        place = np.where(good.any(1, keepdims=True), places.sum(1) / count, self.first)
        across = good[..., None] * (way - mean[:, None])
        spread = (across**2).sum((1, 2))
        moved = (across * (places - place[:, None])).sum((1, 2))
        slope = np.divide(moved, spread, out=np.zeros(len(spread)), where=spread > 0)
        return place - slope[:, None] * mean, slope
