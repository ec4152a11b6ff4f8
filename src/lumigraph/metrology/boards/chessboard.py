"""Boards on pictures, by OpenCV: chessboards, dots, and chessboards with markers (ChArUco)."""

from contextlib import suppress
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from lumigraph.analysis.chart import find_chart
from lumigraph.errors import CalibrationError, LumigraphError, SamplingError
from lumigraph.metrology.boards.corners import Board
from lumigraph.metrology.boards.order import ordered, told_of

LEAST_KNOWN = 6
"""Corners of a ChArUco board, of which the others may be hidden or beside the picture."""

_WIDE = 1000  # samples to which smaller pictures are enlarged: detectors know dots and markers by their area


def find(picture: np.ndarray, board: Board, what: str) -> np.ndarray:
    """Corners or dots (n, 2) as (y, x) [samples], in the board's order; NaN of those that are not seen.

    Rows run downwards of columns to the right. The first is at either end of a board that looks the same
    turned by 180°. Of a ChArUco board some may be hidden, of others none.

    Parameters
    ----------
    picture
        (y, x).
    board
        What to look for.
    what
        The picture's name in errors.

    Raises
    ------
    CalibrationError
        No such board, or places in an order that no flat board has, and that cannot be put in order.
    LumigraphError
        OpenCV is not installed, or does not know the dictionary of markers.
    """
    cv2 = _opencv("finding the board")
    look = {"corners": _corners, "charuco": _charuco}.get(board.pattern, _dots)
    found = look(cv2, _eight_bits(picture), board)
    seen = np.isfinite(found[:, 0])
    if not seen.any():
        raise CalibrationError(
            f"{what} does not show a whole {board.what}. Leave the picture out, or give the board's own "
            "numbers."
        )
    if seen.sum() < LEAST_KNOWN:
        raise CalibrationError(
            f"{what} shows {seen.sum()} of {len(seen)} corners of the {board.what}, but {LEAST_KNOWN} are "
            "needed. Leave it out, or bring more of the board into the picture."
        )
    with told_of(what):
        found[seen] = ordered(found[seen], board.points()[seen, 1:])
    return found


def _corners(cv2: Any, picture: np.ndarray, board: Board) -> np.ndarray:
    down, across = board.shape
    flags = cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_EXHAUSTIVE | cv2.CALIB_CB_ACCURACY
    found, corners = cv2.findChessboardCornersSB(picture, (across, down), flags=flags)
    if not found:
        return whole(picture, board)[0]
    with suppress(CalibrationError):
        return ordered(_upright(corners), board.points()[:, 1:])
    again, _ = whole(picture, board)  # now and then OpenCV puts one corner amid the side of a square
    return again if np.isfinite(again).all() else _upright(corners)


def whole(picture: np.ndarray, board: Board) -> tuple[np.ndarray, int]:
    """Corners (n, 2) of a whole chessboard (`find_chart`), NaN where it is not seen, and how many are seen.

    It finds boards of few squares on small pictures, which OpenCV misses, and none that others hide in part.
    Between a board's outer squares and a dark rim of the picture are saddles, too: the board is all of its
    rows and columns, if they are found once.
    """
    (down, across), seen = board.shape, 0
    with suppress(SamplingError):
        chart = find_chart(picture)
        index, seen = chart.indices - chart.indices.min(0), len(chart)
        number = np.full(index.max(0) + 1, -1)
        number[tuple(index.T)] = np.arange(seen)
        grids = [*_full(number, (down, across))]
        grids += [grid.T for grid in _full(number, (across, down))] if down != across else []
        if len(grids) == 1:
            return chart.corners[grids[0].ravel()], seen
    return np.full((down * across, 2), np.nan), seen


def _full(number: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """Parts (k, *shape) of a table that have no -1."""
    if (np.array(number.shape) < shape).any():
        return np.zeros((0, *shape), int)
    parts = sliding_window_view(number, shape).reshape(-1, *shape)
    return parts[(parts >= 0).all((1, 2))]


def _dots(cv2: Any, picture: np.ndarray, board: Board) -> np.ndarray:
    down, across = board.shape
    large, scale = _enlarged(cv2, picture)
    wanted = cv2.SimpleBlobDetector_Params()
    wanted.minArea, wanted.maxArea, wanted.minDistBetweenBlobs = 20.0, large.size / (down * across), 4.0
    wanted.filterByConvexity = wanted.filterByInertia = False
    detector = cv2.SimpleBlobDetector_create(wanted)
    kind = cv2.CALIB_CB_ASYMMETRIC_GRID if "asymmetric" in board.pattern else cv2.CALIB_CB_SYMMETRIC_GRID
    for flags in (kind, kind | cv2.CALIB_CB_CLUSTERING):
        found, dots = cv2.findCirclesGrid(large, (across, down), flags=flags, blobDetector=detector)
        if found:
            return (_upright(dots) + 0.5) / scale - 0.5
    return np.full((down * across, 2), np.nan)


def _charuco(cv2: Any, picture: np.ndarray, board: Board) -> np.ndarray:
    down, across = board.shape
    large, scale = _enlarged(cv2, picture)
    best = np.full((down * across, 2), np.nan)
    for legacy in (False, True):  # of OpenCV before 4.6, whose boards of an even number of rows are others
        target = cv2.aruco.CharucoBoard(
            (across + 1, down + 1), board.spacing, board.size, _dictionary(cv2, board)
        )
        target.setLegacyPattern(legacy)
        corners, numbers, *_ = cv2.aruco.CharucoDetector(target).detectBoard(large)
        if numbers is not None and len(numbers) > np.isfinite(best[:, 0]).sum():
            best[:] = np.nan
            best[np.ravel(numbers)] = (_upright(corners) + 0.5) / scale - 0.5
    return best


def _dictionary(cv2: Any, board: Board) -> Any:
    down, across = board.shape
    number = getattr(cv2.aruco, str(board.dictionary), None)
    if number is None:
        raise LumigraphError(f"OpenCV has no dictionary {board.dictionary}; one that it has is DICT_4X4_50.")
    found, needed = cv2.aruco.getPredefinedDictionary(number), (down + 1) * (across + 1) // 2
    if (held := len(found.bytesList)) < needed:
        raise LumigraphError(f"{board.dictionary} has {held} markers but the board {needed}.")
    return found


def markers(board: Board) -> np.ndarray:
    """Dark cells (n, k, k) of a ChArUco board's markers with their borders, row by row of its white squares.

    Raises
    ------
    LumigraphError
        OpenCV is not installed, or does not know the dictionary.
    """
    cv2 = _opencv("drawing markers")
    found, (down, across) = _dictionary(cv2, board), board.shape
    cells = found.markerSize + 2
    count = (down + 1) * (across + 1) // 2
    return np.stack([found.generateImageMarker(k, cells, borderBits=1) == 0 for k in range(count)])


def _opencv(what: str) -> Any:
    try:
        import cv2
    except ImportError as error:
        raise LumigraphError(
            f"{what} needs OpenCV. Install it with: pip install 'lumigraph[board]'."
        ) from error
    return cv2


def _upright(found: np.ndarray) -> np.ndarray:
    """Places (n, 2) as (y, x)."""
    return found.reshape(-1, 2)[:, ::-1].astype(np.float64)


def _enlarged(cv2: Any, picture: np.ndarray) -> tuple[np.ndarray, int]:
    """A picture of `_WIDE` samples or more, and by how much it is enlarged."""
    scale = max(1, -(-_WIDE // max(picture.shape)))
    return cv2.resize(picture, None, fx=scale, fy=scale, interpolation=cv2.INTER_CUBIC), scale


def _eight_bits(picture: np.ndarray) -> np.ndarray:
    low, high = np.quantile(picture, (0.005, 0.995))
    scaled = (picture - low) / (max(high - low, np.finfo(np.float32).tiny)) * 255
    return np.clip(np.rint(scaled), 0, 255).astype(np.uint8)
