"""Boards that lean the other way: a flat board that leans little looks nearly the same turned over its sight.

The pictures of a board whose normal is mirrored at the line of sight differ only in perspective, so that a
camera and poses may settle with a board that leans the wrong way. Its corners are then farther off than those
of other pictures, and the camera's lengths are off by several of their deviations.

G. Schweighofer and A. Pinz, "Robust pose estimation from a planar target", IEEE Trans. PAMI 28, 2024 (2006).
"""

import numpy as np

from lumigraph.metric import geometry
from lumigraph.metric.adjustment import Adjusted, adjust, placed
from lumigraph.metric.camera import Nominal
from lumigraph.metric.corners import Board, Corners
from lumigraph.metric.noise import Noise
from lumigraph.metric.start import pose

_NEAR = 2.0
"""Times a picture's residual that it may have with its board turned over, for both to be adjusted."""

_SAME = 0.02
"""Between the turns of a pose and of the other one [rad], of boards that face the camera: they are one."""


def turned_over(found: Adjusted, corners: Corners, board: Board, nominal: Nominal) -> Adjusted:
    """The adjustment with boards turned over where corners fit better so.

    Parameters
    ----------
    found
        Of all pictures.
    corners, board, nominal
        What was adjusted, of what, and what is known.
    """
    for k, frame in enumerate(corners.frames):
        mine = corners.frame == frame
        other = _other(found, corners[mine], board, k)
        away = float(np.linalg.norm(other[1][:3] - found.poses[k][:3]))
        if away > _SAME and _rms(other[0]) < _NEAR * _rms(found.residual[mine]):
            poses = found.poses.copy()
            poses[k] = other[1]
            again = adjust(corners, board, nominal, found.camera, poses)
            found = again if _cost(again, found) < _cost(found, found) else found
    return found


def mirrored(points: np.ndarray) -> np.ndarray:
    """Points (n, 3) of a flat board whose normal is mirrored at the line of sight to its middle."""
    middle = points.mean(0)
    sight, normal = middle / np.linalg.norm(middle), np.linalg.svd(points - middle)[2][-1]
    half = [2 * np.outer(axis, axis) - np.eye(3) for axis in (sight, normal)]  # turns by 180 degrees
    return middle + (points - middle) @ (half[0] @ half[1]).T


def _other(found: Adjusted, corners: Corners, board: Board, k: int) -> tuple[np.ndarray, np.ndarray]:
    """Residual (n, 2) [px] and pose of a picture whose board begins turned over."""
    points = board.points()
    start = pose(points, mirrored(geometry.moved(points, found.poses[k])))
    even = Noise(np.ones(len(found.camera.gains)), 0.0)
    problem, unknowns = placed(corners, board, found.camera, even, start)
    return problem.misfit(unknowns), unknowns[-6:]


def _rms(residual: np.ndarray) -> float:
    return float(np.sqrt(np.median(residual**2)))


def _cost(found: Adjusted, beside: Adjusted) -> float:
    """Cost of all residuals, wild ones too, over the typical one of another adjustment."""
    return float(np.log1p((found.residual / max(_rms(beside.residual), 1e-6)) ** 2).sum())
