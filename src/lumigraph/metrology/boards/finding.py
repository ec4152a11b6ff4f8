"""Corners or dots of a board on raw images: in micro-images of a camera 2.0, in `views` of a camera 1.0."""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from scipy.ndimage import spline_filter

from lumigraph.analysis.crossings import crossed
from lumigraph.analysis.pupil_edge import pupil_edge
from lumigraph.analysis.saddles import settle
from lumigraph.core.arrays import Array, to_numpy
from lumigraph.core.calibration import Calibration
from lumigraph.core.checks import Pair
from lumigraph.core.prepared import PreparedImage
from lumigraph.core.progress import Progress, silent
from lumigraph.core.raw import RawImage
from lumigraph.depth.correlation import of_signs
from lumigraph.errors import CalibrationError
from lumigraph.metrology.boards import chessboard, rims, views, windows
from lumigraph.metrology.boards.corners import Board, Corners
from lumigraph.metrology.boards.spill import GREEN, Spill
from lumigraph.preparation.prepare import of_raw
from lumigraph.rendering import render
from lumigraph.rendering.interpolate import as_float
from lumigraph.rendering.patches import Patches, PatchLayout

LEAST_SEEN = 3
"""Lenslets that must show a corner."""

_DIM = 0.7
"""Largest reach of a beam beyond the main lens' stop where edges are searched, over half its width."""

_APART = 0.96  # pitches: width of micro-images up to which their edges tell stop and focus

_ROUNDS = 3  # corners found, places of the next round told by those found
_STRAY = 2.5  # px: from where a corner is expected
_OFF = 3.0  # times the median distance from the corner's own line


def find_corners(
    raws: Sequence[RawImage | Array],
    board: Board,
    calibration: Calibration | None = None,
    *,
    in_views: bool = False,
    wavelength: float | None = GREEN,
    progress: Progress = silent,
) -> Corners:
    """Corners or dots of a board on raw images of a plenoptic camera, as lenslets or views show them.

    Of a camera 2.0, a picture is rendered of each raw image, sharp all over (`lumigraph.depth.correlation`),
    and the board found on it by OpenCV. That says where each lenslet should show each corner; there it is
    looked for in the micro-image itself, as the saddle of the brightness, which no even blur moves, or as the
    middle of a dot, which is where the dot's outline has its middle, not the dot (`board` allows for it). All
    places of one corner must lie on its line, place = centre - k (X - centre): others are left out.

    Lenslets of a camera 1.0 show no corners. Its raw images are decoded to 7 x 7 views or fewer, and each
    view that lies wholly within the main lens' stop is searched for the same saddles or dots.

    Parameters
    ----------
    raws
        Pictures (y, x[, c]) of the whole board, or part of a ChArUco board, best by `lumigraph.prepare`
        with a white image: without one the edges of micro-images pull corners outwards. They are
        numbered from 0.
    board
        Inner corners of a chessboard with a white margin, dots, or a ChArUco board.
    calibration
        Of raw images that were not prepared.
    in_views
        Whether the raw images are of a camera 1.0.
    wavelength
        Of the light [m]: how much lenslets of a camera 1.0 spill into their neighbours' micro-images, and
        how far outwards micro-images of a camera 2.0 show corners, which `board` allows for; None for
        pictures that rays drew.
    progress
        Called as ``progress(fraction)``.

    Raises
    ------
    CalibrationError
        No pictures, one without the whole board, corners in no order that a flat board has, or squares too
        small to be resolved.
    LumigraphError
        OpenCV, which finds boards but for chessboards in views, is not installed.

    References
    ----------
    The board: A. Duda and U. Frese, "Accurate detection and localization of checkerboard corners for
    calibration", BMVC 2018. Corners in micro-images: M. Labussiere et al., IJCV 130 (2022); here by saddles.
    """
    found = []
    for frame, raw in enumerate(raws):
        found.append((views.on_picture if in_views else _on_picture)(raw, calibration, board, frame))
        progress((frame + 1) / len(raws))
    if not found:
        raise CalibrationError("there are no raw images. Give three or more of the board.")
    columns = (np.concatenate(column) for column in zip(*found, strict=True))
    corners = Corners(*columns, in_views=in_views)
    known = calibration or getattr(raws[0], "calibration", None)
    if wavelength is None or known is None or (board.radius and not in_views):
        return corners
    told = (0.0, ()) if in_views else (corners.sharp, _edges(raws[0], known))
    return replace(corners, spill=Spill(known.lattice, known.fill or 1.0, wavelength, *told))


def _edges(raw: RawImage | Array, calibration: Calibration) -> tuple[Pair, ...]:
    """Width and blur of micro-images of each kind over their pitch, by the white image of a picture."""
    if not isinstance(raw, PreparedImage) or raw.divisor is None:
        return ()
    white, count = raw.divisor.astype(np.float32), calibration.lattice.kinds
    white = white.mean(2) if white.ndim == 3 else white
    try:
        found = [pupil_edge(white, calibration, kind if count > 1 else None) for kind in range(count)]
    except CalibrationError:  # micro-images that are too small, or run into each other
        return ()
    if max(edge.width / edge.pitch for edge in found) > _APART:
        return ()
    return tuple((edge.width / edge.pitch, edge.blur / edge.pitch) for edge in found)


@of_raw
def _on_picture(raw: RawImage, calibration: Calibration, board: Board, frame: int) -> tuple[np.ndarray, ...]:
    """Columns of `Corners` of one raw image."""
    image = to_numpy(as_float(raw.data))
    raw = replace(raw, data=image.mean(2) if image.ndim == 3 else image)
    found, missed = [], []
    for sign in of_signs(raw, calibration):
        try:
            found.append(_sights(raw, calibration, board, frame, to_numpy(sign.depth(raw.data).values)))
        except CalibrationError as error:
            missed.append(error)
    if not found:
        raise missed[0]
    lines, sights = max(found, key=lambda one: len(one[1]))
    kinds = calibration.lattice.kind(*sights.index.T)
    return (
        np.full(len(sights), frame),
        lines.corner[sights.corner],
        sights.center + sights.way,
        sights.center,
        kinds,
    )


def _sights(
    raw: RawImage, calibration: Calibration, board: Board, frame: int, sizes: np.ndarray
) -> tuple["_CornerLines", "_Sights"]:
    """Corners seen behind lenslets, from lenslets' patches (rows, cols) [px].

    A board's squares repeat, so patches of either sign may explain them: corners of the board are seen on
    straight lines behind neighbouring lenslets for the right one alone.
    """
    lines = _CornerLines.of(raw, calibration, board, frame, sizes)
    radius = lines.window(board, frame)
    search = _CornerSearch.of(raw.data, radius, dots=board.radius > 0)
    lines, sights = search.found(lines, calibration)
    for _ in range(_ROUNDS - 1):
        lines, sights = search.found(lines, calibration)
    if not len(sights):
        raise CalibrationError(
            f"picture {frame} shows the board, but no corner behind {LEAST_SEEN} lenslets or more. Move the "
            "board to where the micro-images are sharp."
        )
    return lines, sights[lines.clear(sights, calibration, radius)]


def clear_radius(calibration: Calibration, ratio: np.ndarray, margin: float = rims.WINDOW) -> np.ndarray:
    """Radius (n,) about a micro-image's centre within which its rim does not displace corners [px].

    The beam of a lenslet is `ratio` times as wide on the micro-image. Where the stop cuts it, light falls off
    outwards within an edge's blur, so that the edge is found farther out.
    """
    dim = _DIM * np.abs(ratio) * calibration.lattice.pitch / 2
    return lit_radius(calibration, margin) + 2 - np.maximum(2.0, dim + 0.5)


def lit_radius(calibration: Calibration, margin: float = rims.WINDOW) -> float:
    """Radius about a micro-image's centre within which a corner has `margin` of light around it [px]."""
    return (calibration.fill or 1.0) * calibration.lattice.pitch / 2 - margin - 2


@dataclass(frozen=True, slots=True, eq=False)
class _Sights:
    """n pairs of corner and lenslet: way from the micro-image's centre to the corner (n, 2) [px]."""

    corner: np.ndarray
    index: np.ndarray
    flat: np.ndarray
    center: np.ndarray
    way: np.ndarray

    def __len__(self) -> int:
        return len(self.corner)

    def __getitem__(self, chosen: np.ndarray) -> "_Sights":
        return _Sights(*(getattr(self, f.name)[chosen] for f in fields(self)))


@dataclass(frozen=True, slots=True, eq=False)
class _CornerLines:
    """Each corner's place in the lattice (k, 2) [px], and how far its image moves against a lenslet (k,).

    Corners of a board that are not in the picture are not among them: `corner` (k,) has their numbers.
    """

    corner: np.ndarray
    places: np.ndarray
    ratio: np.ndarray

    @classmethod
    def of(
        cls, raw: RawImage, calibration: Calibration, board: Board, frame: int, sizes: np.ndarray
    ) -> "_CornerLines":
        """Lines of a board's corners, found on the picture that lenslets' patches render."""
        patches = Patches.of(sizes, calibration)
        layout = PatchLayout.of(calibration, patches, None)
        seen = chessboard.find(render(raw, calibration, sizes, blend=True), board, f"picture {frame}")
        corner = np.flatnonzero(np.isfinite(seen[:, 0]))
        places = np.stack([layout.y[0], layout.x[0]]) + layout.step * seen[corner]
        indices = np.linalg.solve(
            calibration.lattice.matrix, (places - np.asarray(calibration.lattice.origin)).T
        )
        return cls(
            corner, places, patches.between(*indices) / calibration.lattice.pitch * np.ones(len(places))
        )

    def window(self, board: Board, frame: int) -> int:
        """Radius of the window about a corner behind a lenslet [px]."""
        ways = windows.ways(self.places) * np.abs(self.ratio)
        found = windows.radius(ways, board, frame, "px wide behind a lenslet")
        return found if board.radius else rims.WINDOW

    def sights(self, calibration: Calibration, margin: int) -> _Sights:
        """Lenslets that should show each corner with `margin` [px] around it."""
        rows, columns = calibration.shape
        index = calibration.indices_within((0, rows - 1), (0, columns - 1))
        flat = calibration.lattice.position(index)
        way = -self.ratio[:, None, None] * (self.places[:, None] - flat)
        corner, lenslet = np.nonzero(np.hypot(*np.moveaxis(way, -1, 0)) <= lit_radius(calibration, margin))
        chosen = index[lenslet]
        return _Sights(corner, chosen, flat[lenslet], calibration.position(chosen), way[corner, lenslet])

    def clear(self, sights: _Sights, calibration: Calibration, margin: int) -> np.ndarray:
        """(n,) Which sights no micro-image's rim pulls at, or all of a corner that has too few of them."""
        clear = np.hypot(*sights.way.T) <= clear_radius(calibration, self.ratio[sights.corner], margin)
        few = np.bincount(sights.corner, clear, len(self.corner)) < LEAST_SEEN
        return clear | few[sights.corner]

    def fitted(self, sights: _Sights) -> tuple["_CornerLines", _Sights]:
        """The lines that fit the sights of each corner, and the sights on them."""
        places, ratio, kept = self.places.copy(), self.ratio.copy(), np.zeros(len(sights), bool)
        for corner in np.unique(sights.corner):
            mine = np.flatnonzero(sights.corner == corner)
            place, slope, fit = _line(sights.flat[mine], sights.way[mine])
            if fit.sum() >= LEAST_SEEN:
                places[corner], ratio[corner], kept[mine] = place, slope, fit
        return replace(self, places=places, ratio=ratio), sights[kept]


def _line(flat: np.ndarray, way: np.ndarray) -> tuple[np.ndarray, float, np.ndarray]:
    """X and k of way = -k (X - flat), and which ways lie on it."""
    fit = np.ones(len(way), bool)
    place, slope = np.zeros(2), 0.0
    for _ in range(4):
        if fit.sum() < LEAST_SEEN:
            return place, slope, np.zeros(len(way), bool)
        middle, mean = flat[fit].mean(0), way[fit].mean(0)
        across, moved = flat[fit] - middle, way[fit] - mean
        slope = float((across * moved).sum() / (across**2).sum())
        place = middle - mean / slope
        off = np.hypot(*(way + slope * (place - flat)).T)
        fit = off <= max(0.1, _OFF * float(np.median(off[fit])))
    return place, slope, fit


@dataclass(frozen=True, slots=True, eq=False)
class _CornerSearch:
    """A raw image in which saddles of the brightness, or dots, are looked for in windows of a radius [px]."""

    image: np.ndarray
    splines: np.ndarray
    radius: int
    dots: bool

    @classmethod
    def of(cls, image: np.ndarray, radius: int, *, dots: bool) -> "_CornerSearch":
        return cls(image.astype(np.float64), spline_filter(image.astype(np.float64), 3), radius, dots)

    def found(self, lines: _CornerLines, calibration: Calibration) -> tuple[_CornerLines, _Sights]:
        """Corners where lines expect them, and the lines that they are on."""
        return lines.fitted(self.settled(lines.sights(calibration, self.radius)))

    def settled(self, sights: _Sights) -> _Sights:
        """The sights of saddles or dots near the expected places, moved there."""
        start = sights.center + sights.way
        at, kept = settle(self.splines, start, self.radius, stray=_STRAY, dots=self.dots)
        at = at if self.dots else crossed(self.image, at, self.radius)
        return replace(sights, way=at - sights.center)[kept]
