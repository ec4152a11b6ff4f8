"""Response of a pixel to light that arrives at an angle."""

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import scipy

from lumigraph.core import checks
from lumigraph.errors import GeometryError


@dataclass(frozen=True, slots=True)
class AngularResponse:
    r"""Response of a pixel over that to light along its chief ray: a product of both axes' own.

    .. math:: R(\theta_y, \theta_x) = r(\theta_y) \, r(\theta_x), \qquad
              r(\theta) = \cos^n \theta \cdot v(|\theta|)

    with the angles from the chief ray in the planes along y and along x, as data sheets give "horizontal" and
    "vertical" curves.

    Parameters
    ----------
    power
        n; 0 for none.
    angles, values
        Table v: angles from 0 on [rad], and the response there, above 0 and at most 1. Between them
        it is interpolated without overshoot (PCHIP); beyond the last angle it keeps the last value.

    Raises
    ------
    GeometryError
        A negative power; angles that do not rise from 0 or reach 90°; values out of range or of another
        number.

    Examples
    --------
    >>> AngularResponse(power=2).of(math.radians(60)).round(6).tolist()
    0.25
    """

    power: float = 0.0
    angles: tuple[float, ...] = ()
    values: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if checks.finite("power", self.power, "1") < 0:
            raise GeometryError(f"power is {self.power:g} but must be at least 0.")
        if len(self.angles) != len(self.values) or len(self.angles) == 1:
            raise GeometryError(
                f"there are {len(self.angles)} angles and {len(self.values)} values. "
                "Give as many of both, two at least, or none."
            )
        rising = all(a < b for a, b in pairwise(self.angles))
        if self.angles and not (self.angles[0] == 0 and rising and self.angles[-1] < math.pi / 2):
            shown = ", ".join(f"{math.degrees(a):g}" for a in self.angles)
            raise GeometryError(f"angles are {shown} deg but must rise from 0 and stay below 90 deg.")
        if any(not 0 < value <= 1 for value in self.values):
            shown = ", ".join(f"{value:g}" for value in self.values)
            raise GeometryError(f"values are {shown} but must be above 0 and at most 1.")

    @property
    def is_flat(self) -> bool:
        """True if the response is 1 at all angles."""
        return not self.power and all(value == 1 for value in self.values)

    def of(self, angle: np.ndarray | float) -> np.ndarray:
        """Response r at angles along one axis [rad]."""
        angle = np.abs(np.asarray(angle, float))
        response = np.cos(np.minimum(angle, math.pi / 2)) ** self.power
        if self.angles:
            response = response * scipy.interpolate.PchipInterpolator(self.angles, self.values)(
                np.minimum(angle, self.angles[-1])
            )
        return response

    def amplitude(self, tangent: np.ndarray | float) -> np.ndarray:
        """Factor √r of amplitudes that arrive at angles of a tangent."""
        return np.sqrt(self.of(np.arctan(tangent)))
