"""Sensors: from intensity on a grid to the numbers read out.

- `sensor`: `Sensor`, pixels that count photons, with noise and bits
- `pixels`: `integrate`, mean intensity over each pixel's area, and its adjoint
- `colour`: `mosaic`, a Bayer filter; `demosaic`, the colour picture behind one
"""

from lumigraph.sensor.colour import demosaic, levels, mosaic
from lumigraph.sensor.pixels import integrate
from lumigraph.sensor.sensor import Sensor

__all__ = ["Sensor", "demosaic", "integrate", "levels", "mosaic"]


def __dir__() -> list[str]:
    return __all__
