"""Meshes: triangles between the points of neighbouring places, cut where depth jumps."""

import numpy as np
from scipy.ndimage import median_filter

_AROUND = 7  # places across in which the usual step of a slanted surface is found
_JUMP = 4.0  # times the usual step, sample and error: a steeper step is an edge of what stands in front


def triangles(points: np.ndarray, kept: np.ndarray, error: float) -> np.ndarray:
    """Triangles (m, 3) of the kept points, numbered row by row; counter-clockwise as the camera sees them.

    Parameters
    ----------
    points
        Positions (rows, columns, 3) as (z, y, x) [m]; unkept ones may be NaN.
    kept
        Mask (rows, columns) of points that are there.
    error
        Expected error of their distances z [m]: so much of a step is noise.

    Notes
    -----
    Two triangles fill each square of four places. One is left out where a step of z along its sides is more
    than four times the sum of the median step around, which a slanted surface has, the distance between the
    places across the line of sight, and the error.
    """
    down, right = (_joined(points, kept, error, axis) for axis in (0, 1))
    number = np.cumsum(kept, dtype=np.int32).reshape(kept.shape) - 1
    upper = down[:, :-1] & right[:-1]
    lower = down[:, 1:] & right[1:]
    first, second = number[:-1, :-1], number[1:, 1:]
    beside, below = number[:-1, 1:], number[1:, :-1]
    return np.concatenate(
        [np.stack([first, below, beside], -1)[upper], np.stack([second, beside, below], -1)[lower]]
    )


def _joined(points: np.ndarray, kept: np.ndarray, error: float, axis: int) -> np.ndarray:
    """Mask of neighbours along an axis, one fewer, that are both kept and of one surface."""
    there = np.logical_and(*(np.take(kept, range(k, kept.shape[axis] - 1 + k), axis) for k in (0, 1)))
    steps = np.where(there[..., None], np.diff(points, axis=axis), 0)
    across, along = np.hypot(steps[..., 1], steps[..., 2]), np.abs(steps[..., 0])
    return there & (along <= _JUMP * (median_filter(along, _AROUND) + across + error))
