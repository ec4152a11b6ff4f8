"""Windows about corners and dots, in which they are looked for."""

import math

import numpy as np
from scipy.spatial import KDTree

from lumigraph.errors import CalibrationError
from lumigraph.metric.corners import Board
from lumigraph.metric.rims import WINDOW

_PART = 0.42
"""Half the window about a corner, over the way to the nearest other one: no window holds two."""

_RIM = 0.5
"""Width of a window beyond a dot's [px]: it holds the edge, and fits into most micro-images."""

_MOST = 6  # px, of those about corners

LEAST_SQUARE = 5.7
"""Least square of a board, or distance between dots, behind a lenslet [px] or in a view [samples]."""


def ways(places: np.ndarray) -> np.ndarray:
    """(n,) From each of n places (n, 2) to the nearest other one, n at least 2."""
    return np.asarray(KDTree(places).query(places, 2)[0])[:, 1]


def nearest(places: np.ndarray) -> float:
    """Least way between any two of n places (n, 2), n at least 2."""
    return float(ways(places).min())


def radius(ways: np.ndarray, board: Board, frame: int, where: str) -> int:
    """Radius of the windows about places of a board, by the way from each to the nearest (n,) [px].

    Raises
    ------
    CalibrationError
        Places so close to each other that a window would hold two.
    """
    apart = float(ways.min())
    if apart < LEAST_SQUARE:
        raise CalibrationError(
            f"on picture {frame} the squares, or ways between dots, are {apart:.3g} {where}, but "
            f"{LEAST_SQUARE:.2g} are needed. Use a board with larger ones, or bring it nearer."
        )
    if board.radius:
        return max(WINDOW, round(apart * board.radius / nearest(board.points()[:, 1:]) + _RIM))
    return max(WINDOW, min(_MOST, int(apart * _PART), int(apart * _free(board))))


def _free(board: Board) -> float:
    """Way from a corner to the nearest marker, whose dark rim would pull at it, over the squares' width."""
    if board.pattern != "charuco" or board.size is None:
        return 1.0
    return (1 - board.size / board.spacing) / math.sqrt(2)
