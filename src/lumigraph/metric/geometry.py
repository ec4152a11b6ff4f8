r"""Rays from points through a main lens and the centres of lenslets to the sensor.

The frame is upright, as raw images are: x to the right, y down, z away from the camera. The ray to the image
V n' of a point, through lenslet c at L, meets the sensor b behind it at

.. math:: s = c + b (c - V n')/(L - V)

Derivation, with views of cameras 1.0: docs/theory/metric.md. All functions take complex numbers, for `slope`.
"""

from collections.abc import Callable

import numpy as np

NAMES = (
    "f", "L", "b", "L/E", "axis y", "axis x", "tilt y", "tilt x", "k1", "k2", "k3", "p1", "p2",
)  # fmt: skip
"""Names of a camera's numbers; the gains of its kinds of lenslets follow."""

_TINY = 1e-24

_STEP = 1e-20


def slope(function: Callable[[np.ndarray], np.ndarray], at: np.ndarray, which: int | slice) -> np.ndarray:
    """Derivative of a function of numbers `at` by one of them, or by several together, to the last bit.

    By a complex step: W. Squire and G. Trapp, SIAM Rev. 40, 110 (1998).
    """
    step = at.astype(np.complex128)
    step[which] += 1j * _STEP
    return np.imag(function(step)) / _STEP


def project(
    numbers: np.ndarray, points: np.ndarray, center: np.ndarray, kind: np.ndarray, pixel_pitch: float
) -> np.ndarray:
    """Places (n, 2) [px] of points (n, 3) as (z, y, x) behind lenslets: see `MetricCamera.project`."""
    f, L, b, ratio = numbers[:4]
    axis, tilt, gains = numbers[4:6], numbers[6:8], numbers[len(NAMES) :]
    distance = points[:, :1]
    image = f * distance / (distance - f)
    lateral = image * distorted(points[:, 1:] / distance, numbers[8:11], numbers[11:13])
    seen = (center - axis) * pixel_pitch
    lenslet, sag = lenslets(seen, L, b, L / ratio, tilt)
    place = lenslet + (lenslet - lateral) * (b - sag) / (L + sag - image)
    return (seen + gains[kind][:, None] * (place - seen)) / pixel_pitch + axis


def magnification(numbers: np.ndarray, distance: np.ndarray) -> np.ndarray:
    """Magnification b/a of the lenslets (n,) at distances from the main lens (n,) [m]; Galilean below 0."""
    f, L, b = numbers[:3]
    return b / (L - f * distance / (distance - f))


def pitch_ratio(numbers: np.ndarray) -> np.ndarray:
    """(1,) Pitch of micro-images over that of the lenslets, 1 + b/E."""
    _, L, b, ratio = numbers[:4]
    return np.array([1 + b * ratio / L])


def slopes_of_pitch_ratio(numbers: np.ndarray) -> np.ndarray:
    """(numbers,) Derivatives of `pitch_ratio`."""
    return np.concatenate([slope(pitch_ratio, numbers, np.s_[k]) for k in range(len(numbers))])


def centers(
    numbers: np.ndarray, points: np.ndarray, seen_at: tuple[np.ndarray, np.ndarray], kind: np.ndarray,
    pixel_pitch: float,
) -> np.ndarray:  # fmt: skip
    """Centres (n, 2) [px] of the micro-images that show points (n, 3), (z, y, x), at given ways from them.

    ``seen_at`` are places and centres (n, 2) [px] as measured; the tilt of the array is taken there.
    """
    place, center = seen_at
    f, L, b, ratio = numbers[:4]
    axis, tilt, gains = numbers[4:6], numbers[6:8], numbers[len(NAMES) :]
    distance = points[:, :1]
    image = f * distance / (distance - f)
    lateral = image * distorted(points[:, 1:] / distance, numbers[8:11], numbers[11:13])
    _, sag = lenslets((center - axis) * pixel_pitch, L, b, L / ratio, tilt)
    way = (place - center) * pixel_pitch / gains[kind][:, None]
    away, behind, part = L + sag - image, b - sag, (L / ratio + sag) / (L / ratio + b)
    return (way * away + lateral * behind) / (part * (away + behind) - away) / pixel_pitch + axis


def dots(
    numbers: np.ndarray, points: np.ndarray, poses: np.ndarray, radius: float, *, in_views: bool
) -> np.ndarray:
    r"""Positions (n, 3) that stand where the outlines of n dots, seen from the side, have their middles.

    An outline is an ellipse, whose middle does not show the dot's: it shows the pole, with respect to the
    dot, of the line of the board that is seen at infinity. With d the distance from the plane that
    the lenslets see at infinity (their own image through the main lens; in views, nearly the lens itself),

    .. math:: p = u - \rho^2 \nabla d / d

    on the board, where d changes evenly: R. Hartley and A. Zisserman, "Multiple View Geometry", 2004, 2.2.3
    and 3.5.2. A lens images planes onto planes, so this is exact but for distortion and the array's tilt.

    Parameters
    ----------
    numbers
        Of the camera.
    points, poses
        Middles of the dots (n, 3) in the board's frame, and poses as `moved` takes them.
    radius
        ρ of the dots [m].
    in_views
        Whether they are seen in views of a camera 1.0.
    """
    f, L, b, ratio = numbers[:4]
    part = L / ratio / (L / ratio + b)
    # Both denominators, of `project` and `centers`, times (distance - f), are `rise` z + `base`.
    rise, base = (L - f), -L * f
    if in_views:
        rise, base = (part - 1) * rise + part * b, (part - 1) * base - part * b * f
    still = np.concatenate([poses[..., :3], 0 * poses[..., 3:]], axis=-1)
    at = moved(points, poses)
    down, across = (moved(np.broadcast_to(axis, points.shape), still) for axis in np.eye(3)[1:])
    leaning = down * down[:, :1] + across * across[:, :1]  # the board's own vector of steepest distance
    return at - radius**2 * rise * leaning / (rise * at[:, :1] + base)


def lenslets(
    seen: np.ndarray, L: complex, b: complex, pupil: complex, tilt: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Positions (n, 2) and distances beyond L (n, 1) of the lenslets of micro-images at `seen` [m]."""
    sag = (seen * (L / (L + b))) @ tilt[:, None]
    return seen * ((pupil + sag) / (pupil + b)), sag


def distorted(direction: np.ndarray, radial: np.ndarray, tangential: np.ndarray) -> np.ndarray:
    """Directions (n, 2) as (y, x) after Brown's distortion (Photogramm. Eng. 32, 444, 1966)."""
    y, x = direction[:, :1], direction[:, 1:]
    r2 = y * y + x * x
    grown = direction * (1 + r2 * (radial[0] + r2 * (radial[1] + r2 * radial[2])))
    p1, p2 = tangential
    skew_y = p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
    skew_x = 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
    return grown + np.concatenate([skew_y, skew_x], axis=1)


def moved(points: np.ndarray, poses: np.ndarray) -> np.ndarray:
    """Points (n, 3) of a board in the camera's frame.

    Parameters
    ----------
    points
        As (z, y, x) [m].
    poses
        (n, 6) or (6,): rotation vector (z, y, x) [rad], right-handed in the frame (x, y, z), then
        displacement (z, y, x) [m].
    """
    a, b, c = (poses[..., k] for k in range(3))
    z, y, x = (points[..., k] for k in range(3))
    squared = a * a + b * b + c * c + _TINY
    angle = np.sqrt(squared)
    cosine, sine, along = np.cos(angle), np.sin(angle) / angle, a * z + b * y + c * x
    along = along * (1 - cosine) / squared
    # (z, y, x) is left-handed: the cross product changes its sign.
    turned = (
        z * cosine + (c * y - b * x) * sine + a * along,
        y * cosine + (a * x - c * z) * sine + b * along,
        x * cosine + (b * z - a * y) * sine + c * along,
    )
    return np.stack(turned, axis=-1) + poses[..., 3:]
