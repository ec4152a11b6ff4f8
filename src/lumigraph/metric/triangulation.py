"""Positions of points from the micro-images that show them."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from lumigraph.core import checks
from lumigraph.core.brief import brief
from lumigraph.errors import CalibrationError
from lumigraph.metric import geometry
from lumigraph.metric.calibration import Measured
from lumigraph.metric.corners import Corners
from lumigraph.metric.start import Virtual, lines


@dataclass(frozen=True, slots=True, eq=False)
class Triangulated:
    """A point in space.

    Parameters
    ----------
    position
        (z, y, x) from the main lens [m].
    covariance
        (3, 3) by the noise of the places; and with the camera's uncertainty, which other points share.
    residual_px
        Root mean square along an axis.
    """

    position: np.ndarray
    covariance: np.ndarray
    residual_px: float

    __repr__ = brief

    @property
    def errors(self) -> np.ndarray:
        """Standard deviations (z, y, x) [m]."""
        return np.sqrt(np.diag(self.covariance))


def triangulate(
    measured: Measured, place: np.ndarray, center: np.ndarray, kind: np.ndarray | int = 0,
    *, in_views: bool = False,
) -> Triangulated:  # fmt: skip
    """Position of a point that several lenslets show.

    Parameters
    ----------
    measured
        The camera.
    place
        (n, 2) Where it shows (y, x) [px], n >= 2.
    center
        (n, 2) The micro-images' centres (y, x) [px].
    kind
        Of the lenslets, (n,) or one for all.
    in_views
        Whether the point was found in views of a camera 1.0: see `Corners`. Light that lenslets spread and
        spill is allowed for as it was for the camera (`Measured.spill`), as it moves a corner.

    Raises
    ------
    CalibrationError
        Fewer than two micro-images, shapes that differ, or rays that do not meet before the camera.
    """
    place, center = (np.asarray(value, np.float64) for value in (place, center))
    if place.ndim != 2 or place.shape != center.shape or place.shape[1] != 2 or len(place) < 2:
        raise CalibrationError(
            f"place and center have shapes {place.shape} and {center.shape} but must both be (n, 2), n >= 2."
        )
    checks.finite_array("place", place, CalibrationError)
    checks.finite_array("center", center, CalibrationError)
    kinds = np.broadcast_to(np.asarray(kind), len(place))
    camera, noise, unsure = measured.camera, measured.noise, np.zeros_like(place)
    if measured.spill is not None:
        one = np.zeros(len(place), int)
        seen = Corners(one, one, place, center, kinds, in_views=in_views, spill=measured.spill)
        cleared = seen.cleared(camera)
        unsure = measured.spill.unsure(camera) * (place - cleared.place)
        place, center = cleared.place, cleared.center
    start = _first(measured, place, center, in_views)
    blur = None if in_views else geometry.magnification(camera.numbers, np.full(len(place), start[0]))
    own = noise.each(kinds, blur)[:, None]

    def misfit(numbers: np.ndarray, point: np.ndarray) -> np.ndarray:
        if in_views:
            seen_at = place, center
            return geometry.centers(numbers, point[None], seen_at, kinds, camera.pixel_pitch) - center
        return geometry.project(numbers, point[None], center, kinds, camera.pixel_pitch) - place

    def white(numbers: np.ndarray, point: np.ndarray) -> np.ndarray:
        return (misfit(numbers, point) / own).ravel()

    def slopes(point: np.ndarray) -> np.ndarray:
        return np.stack(
            [geometry.slope(lambda p: white(camera.numbers, p), point, k) for k in range(3)], axis=1
        )

    jacobian: Any = slopes
    found = least_squares(
        lambda p: white(camera.numbers, p), start, jacobian, x_scale=float(np.abs(start[0]))
    )
    inverse = np.linalg.pinv(slopes(found.x))
    numbers = range(len(camera.numbers))
    sway = inverse @ np.stack(
        [geometry.slope(lambda n: white(n, found.x), camera.numbers, k) for k in numbers], axis=1
    )
    # What all places of a point share moves them together, along either axis.
    together = noise.shared * inverse @ np.kron(1 / own, np.eye(2))
    spilt = inverse @ (unsure / own).reshape(-1, 1)
    covariance = inverse @ inverse.T + together @ together.T + spilt @ spilt.T
    covariance = covariance + sway @ measured.covariance @ sway.T
    return Triangulated(found.x, covariance, float(np.sqrt(np.mean(misfit(camera.numbers, found.x) ** 2))))


def _first(measured: Measured, place: np.ndarray, center: np.ndarray, in_views: bool) -> np.ndarray:
    """Intersection of the rays, without distortion."""
    camera = measured.camera
    sight = np.zeros(len(place), int)
    slope, shift, _ = lines(place - camera.axis, center - camera.axis, sight, in_views)
    one = Virtual(sight[:1], sight[:1], slope, shift)
    f, L, b = camera.focal_length, camera.separation, camera.lenslet_distance
    (point,) = one.points(f, L, b, camera.pixel_pitch)
    if not np.isfinite(point).all():
        raise CalibrationError(
            f"the places move by {slope[0]:.4g} of what the lenslets do: no point before the camera does so. "
            "Check that they show the same point."
        )
    return point
