"""Chessboards on pictures, by OpenCV."""

import numpy as np

from lumigraph.errors import LumigraphError
from lumigraph.metric.corners import Board
from lumigraph.metric.order import ordered


def find(picture: np.ndarray, board: Board) -> np.ndarray | None:
    """Inner corners (n, 2) as (y, x) [samples], row by row with rows downwards of columns to the right.

    The first is at either end of a board that looks the same turned by 180°. None where the picture does
    not show them all.

    Raises
    ------
    CalibrationError
        Corners that OpenCV gives in an order that no flat board has, and that cannot be put in order.
    """
    try:
        import cv2
    except ImportError as error:
        raise LumigraphError(
            "finding the board needs OpenCV. Install it with: pip install 'lumigraph[board]'."
        ) from error
    down, across = board.shape
    flags = cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_EXHAUSTIVE | cv2.CALIB_CB_ACCURACY
    found, corners = cv2.findChessboardCornersSB(_eight_bits(picture), (across, down), flags=flags)
    if not found:
        return None
    places = corners.reshape(-1, 2)[:, ::-1].astype(np.float64)
    return ordered(places, board.points()[:, 1:])


def _eight_bits(picture: np.ndarray) -> np.ndarray:
    low, high = np.quantile(picture, (0.005, 0.995))
    scaled = (picture - low) / (max(high - low, np.finfo(np.float32).tiny)) * 255
    return np.clip(np.rint(scaled), 0, 255).astype(np.uint8)
