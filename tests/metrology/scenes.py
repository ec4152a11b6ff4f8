"""Boards drawn through a known camera: corners with noise, and the truth."""

import numpy as np

from lumigraph.metrology import Board, Corners, MetricCamera, Nominal
from lumigraph.metrology.boards import geometry

BOARD = Board((5, 7), 10e-3)
CAMERA = MetricCamera(
    50e-3, 57e-3, 0.42e-3, 45e-3, 5.5e-6, (1540.0, 2060.0),
    tilt=(6e-4, -4e-4), radial=(0.05, 0.0, 0.0), gains=(1.01, 0.99),
)  # fmt: skip
NOMINAL = Nominal(50e-3, 5.5e-6, (3068, 4080))
PITCH, STEP = 23.3, 46.6  # px; every second lenslet


def corners(
    rng: np.random.Generator, *, frames: int = 6, noise: float = 0.3, shared: float = 0.0,
    board: Board = BOARD, trend: float = 0.0,
) -> Corners:  # fmt: skip
    """Of boards at 0.22 to 0.33 m that lean, through every lenslet that shows them.

    `noise` is that at a magnification of 0.1; its square changes as a power `trend` of it.
    """
    y, x = np.mgrid[60:3000:STEP, 60:4000:STEP]
    centers, kinds = np.stack([y.ravel(), x.ravel()], 1), (np.indices(y.shape).sum(0) % 2).ravel()
    rows = []
    for frame in range(frames):
        turn = rng.uniform(-0.7, 0.7, 3) * (1, 1, 0) if frame else np.zeros(3)
        turn = np.array([rng.uniform(-0.1, 0.1), *turn[:2]])
        shift = np.array([rng.uniform(0.22, 0.33), -0.02, -0.03]) + rng.uniform(-0.01, 0.01, 3)
        points = geometry.moved(board.points(), np.concatenate([turn, shift]))
        for corner, point in enumerate(points):
            places = CAMERA.project(point, centers, kinds)
            lit = np.hypot(*(places - centers).T) < 0.42 * PITCH
            own = noise * (abs(CAMERA.magnification(point[0])) / 0.1) ** (trend / 2)
            off = rng.normal(0, own, (lit.sum(), 2)) + rng.normal(0, shared, 2)
            rows.append(
                np.column_stack(
                    [np.full((lit.sum(), 2), (frame, corner)), places[lit] + off, centers[lit], kinds[lit]]
                )
            )
    table = np.concatenate(rows)
    whole = table.astype(int)
    return Corners(whole[:, 0], whole[:, 1], table[:, 2:4], table[:, 4:6], whole[:, 6])


VIEWS_CAMERA = MetricCamera(
    50e-3, 57e-3, 1.2e-3, 52e-3, 5.5e-6, (1540.0, 2060.0), tilt=(6e-4, -4e-4), radial=(0.05, 0.0, 0.0)
)  # fmt: skip


def in_views(camera: MetricCamera, point: np.ndarray, way: np.ndarray) -> np.ndarray:
    """Centres (n, 2) of the micro-images that show a point (3,) at ways (n, 2) from them [px]."""
    center, kind = np.zeros_like(way), np.zeros(len(way), int)
    for _ in range(3):  # the array's tilt is taken at the centre
        center = geometry.centers(
            camera.numbers, point[None], (center + way, center), kind, camera.pixel_pitch
        )
    return center


def corners_in_views(
    rng: np.random.Generator, *, frames: int = 8, views: int = 5, noise: float = 0.4, shared: float = 0.3,
    board: Board = BOARD,
) -> Corners:  # fmt: skip
    """Of boards at 0.3 to 0.6 m that lean, in views of a camera 1.0; some are in its lenslets' image."""
    way = np.stack(np.meshgrid(*2 * [np.linspace(-6.5, 6.5, views)]), -1).reshape(-1, 2)
    rows = []
    for frame in range(frames):
        turn = np.array([rng.uniform(-0.1, 0.1), *rng.uniform(-0.7, 0.7, 2)])
        shift = np.array([rng.uniform(0.3, 0.6), -0.02, -0.03]) + rng.uniform(-0.01, 0.01, 3)
        points = geometry.moved(board.points(), np.concatenate([turn, shift]))
        for corner, point in enumerate(points):
            center = in_views(VIEWS_CAMERA, point, way)
            center = center + rng.normal(0, noise, way.shape) + rng.normal(0, shared, 2)
            what = np.full((len(way), 2), (frame, corner))
            rows.append(np.column_stack([what, center + way, center]))
    table = np.concatenate(rows)
    whole = table[:, :2].astype(int)
    return Corners(*whole.T, table[:, 2:4], table[:, 4:6], 0 * whole[:, 0], in_views=True)
