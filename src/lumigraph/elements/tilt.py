"""`TiltAndBow`: tilt and bow of the lenslet array, and tilt of the sensor."""

from dataclasses import dataclass
from typing import Any

from lumigraph.core import checks
from lumigraph.errors import GeometryError

STEEPEST = 0.1
"""Tilt [rad] beyond which cosines and slanted apertures are no small matter."""

Pair = tuple[float, float]


@dataclass(frozen=True, slots=True)
class TiltAndBow:
    """Tilt and bow of an array, and tilt of a sensor, about the axis; distances from the main lens grow.

    Parameters
    ----------
    array, sensor
        Tangents along y and x, in physical coordinates, which raw images show turned by 180°.
    bow
        Farther by this times the squared distance from the axis [1/m].

    Raises
    ------
    GeometryError
        A tilt beyond `STEEPEST`.
    """

    array: Pair = (0.0, 0.0)
    bow: float = 0.0
    sensor: Pair = (0.0, 0.0)

    def __post_init__(self) -> None:
        object.__setattr__(self, "bow", checks.finite("bow", self.bow))
        for name in ("array", "sensor"):
            if (
                steepest := max(map(abs, checks.pair(f"the tilt of the {name}", getattr(self, name))))
            ) > STEEPEST:
                raise GeometryError(
                    f"the {name} is tilted by {steepest * 1e3:.4g} mrad but must stay within "
                    f"{STEEPEST * 1e3:g} mrad: beyond, more than distances changes."
                )

    def of_array(self, y: Any, x: Any) -> Any:
        """Extra distance of lenslets at (y, x) from the main lens [m]."""
        return self.array[0] * y + self.array[1] * x + self.bow * (y**2 + x**2)

    def of_sensor(self, y: Any, x: Any) -> Any:
        """Extra distance of pixels at (y, x) from the main lens [m]."""
        return self.sensor[0] * y + self.sensor[1] * x
