"""First camera and poses by a search over two lengths, from nothing but a focal length.

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

_STILL = 1e-6  # of the way between views, by which a point in the lenslets' image moves

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
    slope, shift, spread = lines(corners.place - middle, corners.center - middle, sight, corners.in_views)
    first = np.unique(sight, return_index=True)[1]
    good = (count >= LEAST_PLACES) & (spread > 0)
    if corners.in_views:
        slope, shift = _flat(slope, shift, corners.frame[first], good)
    frame, corner = corners.frame[first], corners.corner[first]
    found = Virtual(*(v[good] for v in (frame, corner, slope, shift)))
    pictures, many = np.unique(found.frame, return_counts=True)
    kept = np.isin(found.frame, pictures[many >= LEAST_CORNERS])
    if not kept.any():
        raise CalibrationError(
            f"no picture has {LEAST_CORNERS} corners that {LEAST_PLACES} lenslets show each; the best has "
            f"{max(many, default=0)}. Take the board closer, or focus so that neighbouring lenslets overlap."
        )
    return Virtual(found.frame[kept], found.corner[kept], found.slope[kept], found.shift[kept])


def lines(
    place: np.ndarray, center: np.ndarray, sight: np.ndarray, in_views: bool
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A (k,) and t (k, 2) of s = A c + t for each sight, and how far apart its lenslets or views are (k,).

    In views, the centres move by 1/(A - 1) of the ways from them to the places, which are exact there.
    """
    known, moved = (place - center, center) if in_views else (center, place)
    count = np.bincount(sight)
    means = [np.stack([np.bincount(sight, v) / count for v in a.T], 1) for a in (known, moved)]
    inner, outer = known - means[0][sight], moved - means[1][sight]
    spread = np.bincount(sight, np.sum(inner**2, axis=1))
    slope = np.bincount(sight, np.sum(inner * outer, axis=1)) / np.maximum(spread, 1e-9)
    if not in_views:
        return slope, means[1] - slope[:, None] * means[0], spread
    slope = np.where(np.abs(slope) < _STILL, _STILL, slope)
    shift = slope[:, None] * means[0] - means[1]
    return 1 + 1 / slope, shift / slope[:, None], spread


def _flat(
    slope: np.ndarray, shift: np.ndarray, frame: np.ndarray, good: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """A and t of corners in views, which move little between them, by all corners of a flat board together.

    By how much a plane's points move, 1/(A - 1), is linear in where they stand, but for what a lens bends.
    """
    moved = 1 / (slope - 1)
    at = -shift * moved[:, None]
    for one in np.unique(frame):
        mine = good & (frame == one)
        design = np.column_stack([np.ones(int(mine.sum())), at[mine]])
        moved[mine] = design @ np.linalg.lstsq(design, moved[mine], rcond=None)[0]
    moved = np.where(np.abs(moved) < _STILL, _STILL, moved)
    return 1 + 1 / moved, -at / moved[:, None]


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
    if corners.in_views:
        lit = 2 * float(np.abs(corners.place - corners.center).max())
        return np.geomspace(0.5, 40, _LENGTHS) * lit * pixel_pitch
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
