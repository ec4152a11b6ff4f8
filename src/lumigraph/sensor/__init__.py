"""From intensity on a grid to what a sensor reads out.

- `sensor`: `Sensor`, pixels that count photons, with noise and bits
- `pixels`: `integrate`, mean intensity over each pixel's area, and its adjoint
- `colour`: `mosaic`, a Bayer filter
"""

from lumigraph.sensor.colour import mosaic
from lumigraph.sensor.pixels import integrate, integrate_adjoint
from lumigraph.sensor.sensor import Sensor

__all__ = ["Sensor", "integrate", "integrate_adjoint", "mosaic"]
