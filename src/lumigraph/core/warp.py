"""Displacement of lattice points by a tilt and by a lens' distortion."""

from dataclasses import dataclass, replace

import numpy as np

from lumigraph.core import checks
from lumigraph.core.brief import brief
from lumigraph.core.lattice import Vector
from lumigraph.errors import CalibrationError

_STEPS = 60
_ENOUGH = 1e-10  # px, of an inverted distortion


@dataclass(frozen=True, slots=True)
class Warp:
    r"""Map from the points of a regular lattice to the micro-images on a picture, both in pixels.

    With q the way from `center` to a lattice point, t the `tilt` and k the `radial` distortion,

    .. math:: q_1 = q / (1 + t \cdot q), \qquad q_2 = q_1 (1 + k |q_1|^2)

    is the way to the micro-image. The first is the projective change that a tilted plane makes beyond what
    the basis vectors hold; the second the first term of a lens' distortion, barrel-shaped below 0.

    Parameters
    ----------
    center
        Point (y, x) that stays [px].
    tilt
        (y, x) [1/px]: positive where micro-images of positive y (x) stand closer together.
    radial
        [1/px²].

    Raises
    ------
    CalibrationError
        A value that is not finite.

    Examples
    --------
    >>> warp = Warp((100.0, 100.0), (0.0, 1e-4), 0.0)
    >>> warp.applied(np.array([100.0, 200.0])).round(2).tolist()
    [100.0, 199.01]
    """

    center: Vector
    tilt: Vector = (0.0, 0.0)
    radial: float = 0.0

    __repr__ = brief

    def __post_init__(self) -> None:
        for name in ("center", "tilt"):
            y, x = getattr(self, name)
            pair = tuple(checks.finite(f"warp.{name}", v, "", CalibrationError) for v in (y, x))
            object.__setattr__(self, name, pair)
        radial = checks.finite("warp.radial", self.radial, "1/px²", CalibrationError)
        object.__setattr__(self, "radial", radial)

    def applied(self, points: np.ndarray) -> np.ndarray:
        """Micro-images (..., 2) as (y, x) of lattice points (..., 2)."""
        q = np.asarray(points, float) - self.center
        q = q / (1 + q @ np.array(self.tilt))[..., None]
        return self.center + q * (1 + self.radial * (q**2).sum(-1, keepdims=True))

    def removed(self, points: np.ndarray) -> np.ndarray:
        """Points (..., 2) of the regular lattice's plane that belong to places (..., 2) on the picture."""
        q = np.asarray(points, float) - self.center
        if self.radial:
            q = q * _shrink(np.hypot(q[..., 0], q[..., 1]), self.radial)[..., None]
        return self.center + q / (1 - q @ np.array(self.tilt))[..., None]

    def transposed(self) -> "Warp":
        """The same for a picture with y and x exchanged."""
        return replace(self, center=self.center[::-1], tilt=self.tilt[::-1])

    def largest(self, shape: tuple[int, int]) -> float:
        """Largest displacement of the corners and side midpoints of a picture [px]."""
        rows, columns = (np.array([0, (n - 1) / 2, n - 1]) for n in shape)
        points = np.stack(np.meshgrid(rows, columns, indexing="ij"), -1)
        return float(np.hypot(*np.moveaxis(self.applied(points) - points, -1, 0)).max())


def _shrink(radius: np.ndarray, radial: float) -> np.ndarray:
    """Ratio r / radius where r + radial r³ = radius, by Newton's steps from r = radius.

    Beyond the fold of a barrel distortion no r exists; there the nearest is kept.
    """
    fold = np.sqrt(-1 / (3 * radial)) if radial < 0 else np.inf
    r = np.minimum(radius, 0.999 * fold)
    for _ in range(_STEPS):
        step = (r + radial * r**3 - radius) / np.maximum(1 + 3 * radial * r**2, 1e-3)
        r = np.minimum(r - step, 0.9999 * fold)
        if not np.any(np.abs(step) > _ENOUGH * np.maximum(radius, 1)):
            break
    return r / np.where(radius > 0, radius, 1) + (radius == 0)
