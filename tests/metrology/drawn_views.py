"""Raw images of boards in a camera 1.0, drawn by rays through its lenslets."""

import numpy as np

from lumigraph.core.calibration import Calibration
from lumigraph.core.lattice import Lattice
from lumigraph.metrology import Board, MetricCamera
from lumigraph.metrology.boards import geometry
from metrology import drawn

BOARD = Board((3, 4), 3.3e-3)
COUNT, PITCH, PIXEL = 47, 11.3, 5.5e-6
SHAPE = (round(COUNT * PITCH), round(COUNT * PITCH))
CAMERA = MetricCamera(
    50e-3, 57e-3, 0.9e-3, 54e-3, PIXEL, (SHAPE[0] / 2 + 3, SHAPE[1] / 2 - 4), (4e-4, -6e-4), (0.05, 0.0, 0.0)
)
"""In focus at 0.41 m."""

PARTS = 5
"""Of a lenslet along its sides, each of which sees its own place on the board."""


def calibration() -> Calibration:
    """Of its square array, turned a little."""
    none = np.zeros((0, 2))
    lattice = Lattice.square(PITCH, 0.004, (SHAPE[0] / 2 + 0.3, SHAPE[1] / 2 + 1.1))
    return Calibration(lattice, SHAPE, none.astype(int), none, 0.0, pixel_pitch=PIXEL, fill=0.96)


def raw(
    where: np.ndarray,
    rng: np.random.Generator,
    noise: float = 0.01,
    board: Board = BOARD,
    seen_by: MetricCamera = CAMERA,
) -> np.ndarray:
    """Raw image (y, x) of an evenly lit board at a pose."""
    known, place = calibration(), np.stack([each.ravel() for each in np.indices(SHAPE)], 1).astype(float)
    center = known.position(np.stack(known.index(*place.T), -1))
    lit = _lit(place - center)
    seen, bright = np.zeros(len(place)), lit > 0
    at, lenslet = _on_board(where, place[bright] - center[bright], center[bright], seen_by)
    finest = np.sqrt(np.abs(np.linalg.det(lenslet))) / PARTS
    steps = np.stack(np.meshgrid(*2 * [(np.arange(PARTS) + 0.5) / PARTS - 0.5]), -1).reshape(-1, 2)
    seen[bright] = sum(drawn.painted(at + lenslet @ step, finest, board) for step in steps) / len(steps)
    return (lit * seen + rng.normal(0, noise, len(seen))).reshape(SHAPE).astype(np.float32)


def white() -> np.ndarray:
    """White image (y, x)."""
    known, place = calibration(), np.stack([each.ravel() for each in np.indices(SHAPE)], 1).astype(float)
    way = place - known.position(np.stack(known.index(*place.T), -1))
    return _lit(way).reshape(SHAPE).astype(np.float32)


def _lit(way: np.ndarray) -> np.ndarray:
    """Light of each pixel, softer at the micro-image's edge than a pixel."""
    return np.clip(0.96 * PITCH / 2 - np.hypot(*way.T) + 0.5, 0, 1)


def _on_board(
    where: np.ndarray, way: np.ndarray, center: np.ndarray, seen_by: MetricCamera
) -> tuple[np.ndarray, np.ndarray]:
    """Points of the board (n, 2) [m] that ways from centres see, by Newton's method; lenslets there."""
    at, kind = np.zeros((len(way), 2)) + 4e-3, np.zeros(len(way), int)

    def shown(at: np.ndarray) -> np.ndarray:
        points = geometry.moved(np.concatenate([np.zeros((len(at), 1)), at], 1), where)
        return geometry.centers(seen_by.numbers, points, (center + way, center), kind, PIXEL)

    slope = np.zeros((len(way), 2, 2))
    for k in range(4):
        here = shown(at)
        if k < 2:  # it hardly changes afterwards
            slope = np.stack([shown(at + step) - here for step in ((1e-6, 0), (0, 1e-6))], -1) / 1e-6
        at = at - np.clip(np.linalg.solve(slope, (here - center)[..., None])[..., 0], -0.05, 0.05)
    return at, PITCH * np.linalg.inv(slope)
