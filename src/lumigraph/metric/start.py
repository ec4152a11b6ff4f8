"""A first camera and first poses, without any guess but a focal length: a search over two lengths.

Where a corner shows behind lenslets is linear in their places, s = A c + t: A says how far its image is from
the lenslets, in lenslet distances, and t where. Any pair (L, b) makes points in space of these; the right one
makes them boards, which a rotation and a displacement lay onto the known corners (W. Kabsch, Acta Cryst. A32
(1976)).
"""

import math
from dataclasses import dataclass

import numpy as np

from lumigraph.errors import CalibrationError
from lumigraph.metric.camera import MetricCamera, Nominal
from lumigraph.metric.corners import Board, Corners

LEAST_PLACES, LEAST_CORNERS = 3, 6
"""Lenslets that show a corner, and corners of a picture, for the search."""

_LENGTHS = 40
"""Steps of either length."""


@dataclass(frozen=True, slots=True, eq=False)
class Virtual:
    """Corners as the lenslets show them: n sights.

    Parameters
    ----------
    frame, corner
        (n,)
    slope
        (n,) A of s = A c + t.
    shift
        (n, 2) t [px], from the middle of the sensor.
    """

    frame: np.ndarray
    corner: np.ndarray
    slope: np.ndarray
    shift: np.ndarray

    def points(self, f: float, L: float, b: float, pixel_pitch: float) -> np.ndarray:
        """Positions (n, 3) as (z, y, x) [m] before a thin lens; NaN for those that none could be at."""
        away = self.slope * (L + b) / L - 1
        with np.errstate(divide="ignore", invalid="ignore"):
            image = L - b / away
            distance = f * image / (image - f)
            lateral = -self.shift * (pixel_pitch / away)[:, None]
            points = np.column_stack([distance, lateral * (distance / image)[:, None]])
        points[~((image > f) & np.isfinite(distance))] = np.nan
        return points


def virtual(corners: Corners, middle: tuple[float, float]) -> Virtual:
    """Slope and shift of each corner that enough lenslets show.

    Raises
    ------
    CalibrationError
        Fewer than `LEAST_CORNERS` such corners on every picture.
    """
    sight = corners.sights()
    count = np.bincount(sight)
    center, place = corners.center - middle, corners.place - middle
    means = [np.stack([np.bincount(sight, v) / count for v in a.T], 1) for a in (center, place)]
    inner, outer = center - means[0][sight], place - means[1][sight]
    spread = np.bincount(sight, np.sum(inner**2, axis=1))
    slope = np.bincount(sight, np.sum(inner * outer, axis=1)) / np.maximum(spread, 1e-9)
    first = np.unique(sight, return_index=True)[1]
    good = (count >= LEAST_PLACES) & (spread > 0)
    frame, corner = corners.frame[first], corners.corner[first]
    found = Virtual(*(v[good] for v in (frame, corner, slope, means[1] - slope[:, None] * means[0])))
    pictures, many = np.unique(found.frame, return_counts=True)
    kept = np.isin(found.frame, pictures[many >= LEAST_CORNERS])
    if not kept.any():
        raise CalibrationError(
            f"no picture has {LEAST_CORNERS} corners that {LEAST_PLACES} lenslets show each; the best has "
            f"{max(many, default=0)}. Take the board closer, or focus so that neighbouring lenslets overlap."
        )
    return Virtual(found.frame[kept], found.corner[kept], found.slope[kept], found.shift[kept])


def search(corners: Corners, board: Board, nominal: Nominal) -> tuple[MetricCamera, dict[int, np.ndarray]]:
    """The camera, a thin lens without distortion, and the pose (6,) of each picture's board.

    Pictures with too few corners for a pose have none.
    """
    seen, known = virtual(corners, nominal.middle), board.points()
    f, pitch = nominal.focal_length, nominal.pixel_pitch
    best, least = None, math.inf
    for L in f * (1 + np.geomspace(0.005, 2, _LENGTHS)):
        for b in _distances(corners, pitch):
            error = _misfit(seen, known, seen.points(f, L, b, pitch), least)
            if error < least:
                best, least = (L, b), error
    if best is None:
        raise CalibrationError(
            f"no distances of lenslets and sensor behind a main lens of {f * 1e3:g} mm make boards of these "
            "corners. Check the focal length, the pixel pitch and the numbers of the corners."
        )
    L, b = map(float, best)
    points, poses = seen.points(f, L, b, pitch), {}
    for frame in np.unique(seen.frame):
        mine = seen.frame == frame
        usable = mine & np.isfinite(points[:, 0])
        if usable.sum() >= LEAST_CORNERS:
            poses[int(frame)] = pose(known[seen.corner[usable]], points[usable])
    gains = (1.0,) * (int(corners.kind.max()) + 1)
    return MetricCamera(f, L, b, L, pitch, nominal.middle, gains=gains), poses


def _distances(corners: Corners, pixel_pitch: float) -> np.ndarray:
    """Lenslets to sensor [m]: from a half to forty times what micro-images are apart."""
    center = corners.center[np.argsort(corners.sights(), kind="stable")]
    steps = np.hypot(*np.diff(center, axis=0).T)
    pitch = float(np.median(steps[steps > 0.5])) * pixel_pitch
    return np.geomspace(0.5, 40, _LENGTHS) * pitch


def _misfit(seen: Virtual, known: np.ndarray, points: np.ndarray, enough: float) -> float:
    """Sum of the angles between points and the boards that fit them best; infinite for impossible ones."""
    total = 0.0
    for frame in np.unique(seen.frame):
        mine = seen.frame == frame
        if not np.isfinite(points[mine]).all():
            return math.inf
        model = known[seen.corner[mine]]
        turn, shift = _rigid(model, points[mine])
        off = (model @ turn.T + shift - points[mine]) / points[mine, :1]
        total += float(np.abs(off * (0.1, 1, 1)).sum())  # distances are the noisiest
        if total > enough:
            return math.inf
    return total


def _rigid(model: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rotation (3, 3) and displacement (3,) that lay the model (n, 3) onto the points."""
    middle, center = model.mean(0), points.mean(0)
    left, _, right = np.linalg.svd((model - middle).T @ (points - center))
    sign = np.sign(np.linalg.det(right.T @ left.T))
    turn = right.T @ np.diag([1.0, 1.0, sign]) @ left.T
    return turn, center - turn @ middle


def pose(model: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Pose (6,) of a board whose corners (n, 3) are at points (n, 3)."""
    from scipy.spatial.transform import Rotation

    turn, shift = _rigid(model, points)
    vector = Rotation.from_matrix(turn[::-1, ::-1]).as_rotvec()[::-1]
    return np.concatenate([vector, shift])
