"""Raw images of boards, drawn by rays through a known camera."""

from itertools import product

import numpy as np
from scipy.ndimage import gaussian_filter, map_coordinates
from scipy.spatial import KDTree
from scipy.stats import norm

from lumigraph.core.calibration import Calibration
from lumigraph.core.lattice import Lattice
from lumigraph.metrology import Board, MetricCamera
from lumigraph.metrology.boards import geometry

BOARD = Board((4, 5), 2.8e-3)
SHAPE, PITCH, PIXEL = (420, 500), 24.3, 5.5e-6
LIT = 0.94
BLUR, STEP = 0.7, 0.5  # px: blur before the pixels, and steps in which it is drawn; wider ones alias


def camera(side: float, kinds: int = 1) -> MetricCamera:
    """Keplerian (side 1) or Galilean (-1), of m = 0.3 for what is 0.45 m away."""
    image, b = 50e-3 * 0.45 / 0.4, 0.45e-3
    separation = image + side * b / 0.3
    gains = (1.0, 1.006, 0.994)[:kinds]
    axis = (SHAPE[0] / 2 + 3, SHAPE[1] / 2 - 4)
    return MetricCamera(
        50e-3, separation, b, 0.9 * separation, PIXEL, axis, (4e-4, -6e-4), (0.05, 0.0, 0.0), gains=gains
    )


def calibration(kinds: int = 1) -> Calibration:
    """Of its hexagonal array, turned a little."""
    none = np.zeros((0, 2))
    lattice = Lattice.hex(PITCH, 0.004, (12.3, 13.1), kinds=kinds)
    return Calibration(lattice, SHAPE, none.astype(int), none, 0.0, pixel_pitch=PIXEL, fill=LIT)


def pose(turn: tuple[float, float, float], distance: float = 0.45, board: Board = BOARD) -> np.ndarray:
    """Of a board whose middle is on the axis."""
    middle = np.array([0.0, *((n - 1) / 2 * board.spacing for n in board.shape)])
    turned = geometry.moved(middle, np.array([*turn, 0.0, 0.0, 0.0]))
    return np.concatenate([turn, np.array([distance, 0.0, 0.0]) - turned])


def raw(
    seen_by: MetricCamera,
    where: np.ndarray,
    kinds: int = 1,
    board: Board = BOARD,
    rng: np.random.Generator | None = None,
) -> np.ndarray:
    """Raw image (y, x) of an evenly lit board, blurred before pixels take their mean, with 1 % of noise."""
    place, center, kind = _pixels(kinds)
    at, pixel = _on_board(seen_by, where, place, center, kind)
    size = np.sqrt(np.abs(np.linalg.det(pixel)))
    seen = painted(at, 4 * size, board)
    lit = white(kinds).ravel()
    near = (lit > 0) & (np.abs(np.abs(seen - 0.5) - 0.4) > 1e-3)  # other pixels see one brightness alone
    light = lit * seen
    light[near] = 0
    for step, part in _spread():
        here = painted(at[near] + pixel[near] @ step, STEP * size[near], board)
        light[near] += part * _lit(place[near] + step, center[near]) * here
    noise = (rng or np.random.default_rng(0)).normal(0, 0.01, SHAPE)
    return (light.reshape(SHAPE) + noise).astype(np.float32)


def white(kinds: int = 1) -> np.ndarray:
    """White image (y, x)."""
    place, center, _ = _pixels(kinds)
    light = sum(part * _lit(place + step, center) for step, part in _spread())
    return np.asarray(light).reshape(SHAPE).astype(np.float32)


def _spread() -> list[tuple[np.ndarray, float]]:
    """Ways (2,) [px] to what a pixel sees of a blurred image, and their parts."""
    ways = STEP * np.arange(-3, 4)
    parts = norm.cdf((ways + 0.5) / BLUR) - norm.cdf((ways - 0.5) / BLUR)
    parts /= parts.sum()
    return [(np.array(way), float(np.prod(part))) for way, part in zip(
        product(ways, ways), product(parts, parts), strict=True
    )]  # fmt: skip


def _pixels(kinds: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Places of all pixels, centres of their micro-images, kinds of their lenslets."""
    known, place = calibration(kinds), np.stack([each.ravel() for each in np.indices(SHAPE)], 1)
    index = np.stack(known.index(*place.T), -1)
    return place, known.position(index), known.lattice.kind(*index.T)


def _lit(place: np.ndarray, center: np.ndarray) -> np.ndarray:
    """Light of each pixel, softer at the edge than a pixel."""
    return np.clip(LIT * PITCH / 2 - np.hypot(*(place - center).T) + 0.5, 0, 1)


def _on_board(
    seen_by: MetricCamera, where: np.ndarray, pixel: np.ndarray, center: np.ndarray, kind: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Points of the board (n, 2) [m] that pixels see, by Newton's method; pixels' sides there [m]."""
    at, slope = np.full((len(pixel), 2), 8e-3), np.zeros((len(pixel), 2, 2))
    for k in range(5):
        here = _seen(seen_by, where, at, center, kind)
        if k < 2:  # it hardly changes afterwards
            ends = (_seen(seen_by, where, at + step, center, kind) for step in ((1e-6, 0), (0, 1e-6)))
            slope = np.stack([one - here for one in ends], -1) / 1e-6
        at = at - np.clip(np.linalg.solve(slope, (here - pixel)[..., None])[..., 0], -0.02, 0.02)
    return at, np.linalg.inv(slope)


def _seen(
    seen_by: MetricCamera, where: np.ndarray, at: np.ndarray, center: np.ndarray, kind: np.ndarray
) -> np.ndarray:
    points = np.concatenate([np.zeros((len(at), 1)), at], 1)
    return seen_by.project(geometry.moved(points, where), center, kind)


def painted(at: np.ndarray, soft: np.ndarray, board: Board) -> np.ndarray:
    """Brightness (n,) of a board at places (n, 2) [m], its edges as soft as so much of it (n,) [m]."""
    return {"corners": squares, "charuco": charuco}.get(board.pattern, dots)(at, soft, board)


def dots(at: np.ndarray, soft: np.ndarray, board: Board) -> np.ndarray:
    """Dark dots on white."""
    away = np.asarray(KDTree(board.points()[:, 1:]).query(at)[0])
    return 0.9 - 0.8 * np.clip(0.5 + (board.radius - away) / soft, 0, 1)


def charuco(at: np.ndarray, soft: np.ndarray, board: Board) -> np.ndarray:
    """The board as OpenCV prints it, its edges as soft as in the middle of the picture."""
    import cv2

    fine, (down, across) = 60, (n + 1 for n in board.shape)
    words = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, board.dictionary))
    print_ = cv2.aruco.CharucoBoard((across, down), board.spacing, board.size, words)
    image = 0.1 + 0.8 * print_.generateImage((fine * across, fine * down)).astype(float) / 255
    cells = 1 + at / board.spacing
    image = gaussian_filter(
        np.pad(image, fine, constant_values=0.9), 0.3 * fine * np.median(soft) / board.spacing
    )
    return map_coordinates(image, (fine * (cells + 1) - 0.5).T, order=1, mode="nearest")


def squares(at: np.ndarray, soft: np.ndarray, board: Board) -> np.ndarray:
    """Brightness (n,) of a board at places (n, 2) [m], its edges as soft as so much of it (n,) [m]."""
    cells = at / board.spacing
    edges = np.abs(np.mod(cells + 0.5, 2) - 1) - 0.5
    sharp = np.clip(2 * edges * (board.spacing / soft)[:, None], -1, 1).prod(1)
    outside = (cells < -1).any(1) | (cells > np.array(board.shape)).any(1)
    return np.where(outside, 0.9, 0.5 + 0.4 * sharp)
