r"""Measures of white images of a misaligned bench in closed form, relative to those of the camera file.

A lenslet at c of the array, which is turned, shifted and tilted by θ along n, is shown at

.. math:: s = S c \, \frac{L + b}{L - (n \cdot c) \sin\theta}, \qquad S = 1 + n n^T (\cos\theta - 1)

by rays through the middle of the stop (docs/theory/metric.md). So the lattice vectors grow by
:math:`(1 + b/L)`, the slope is :math:`\tan\theta / (L + b)`, and the stop's image is :math:`D b / L` wide.
Before a telecentric array, L is so large that the first two are lost; there the widths' growth over the
picture shows the tilt, by the part :math:`\tan\theta / b` a metre.
"""

import math
from dataclasses import dataclass

import numpy as np

from lumigraph.metrology.alignment.setup import STATES

MEASURES = 9
"""Two lattice vectors, origin, slope and width (see `twin.shown`) [px].

Of a telecentric bench there follow the growths of the width along y and x [1 over the reach].
"""


@dataclass(frozen=True, slots=True, eq=False)
class BenchRays:
    """A bench by its rays.

    Parameters
    ----------
    lengths
        Main lens to array, array to sensor, and a pixel [m].
    start
        Measures (9 or 11,) of the white image of the camera file.
    reach
        Distance from the middle that its slope refers to [px].
    width
        How the width follows the stop's image (1 for sharp edges), and by how much less for each part that
        the image grows.
    """

    lengths: tuple[float, float, float]
    start: np.ndarray
    reach: float
    width: tuple[float, float] = (1.0, 0.0)

    def measures(self, state: np.ndarray) -> np.ndarray:
        """Measures (9 or 11,) of a bench with these `STATES` (10,)."""
        value = dict(zip(STATES, state.tolist(), strict=True))
        L, b, pixel = self.lengths
        near, far = L - value["height"] + value["separation"], b + value["height"] + value["sensor"]
        grown = (1 + far / near) / (1 + b / L)
        stretch, slope = _tilted(value["tilt_y"], value["tilt_x"])
        cos, sin = math.cos(value["turn"]), math.sin(value["turn"])
        turned = np.array([[cos, -sin], [sin, cos]])
        lattice = self.start[:4].reshape(2, 2) @ turned @ stretch * (grown * (1 + value["pitch"]))
        shift = np.array([value["shift_y"], value["shift_x"]])
        origin = self.start[4:6] + shift @ stretch * ((1 + far / near) / pixel)
        leaning = self.start[6:8] + self.reach**2 * pixel * slope / (near + far)
        image = (1 + value["aperture"]) * (far / near) / (b / L) - 1
        first, second = self.width
        width = self.start[8] * (1 + first * image + second * image**2)
        growing = self.reach * pixel * slope / far if len(self.start) > MEASURES else ()
        return np.concatenate([lattice.ravel(), origin, leaning, [width], growing])

    def slopes(self, state: np.ndarray) -> np.ndarray:
        """Derivatives (9 or 11, 10) of the measures by the states."""
        columns = []
        for k in range(len(STATES)):
            step = np.eye(len(STATES))[k] * 1e-6
            columns.append((self.measures(state + step) - self.measures(state - step)) / 2e-6)
        return np.stack(columns, 1)


def _tilted(tilt_y: float, tilt_x: float) -> tuple[np.ndarray, np.ndarray]:
    """Shortening (2, 2) along a tilt, and its direction times its tangent (2,)."""
    angle = math.hypot(tilt_y, tilt_x)
    if angle == 0:
        return np.eye(2), np.zeros(2)
    way = np.array([tilt_y, tilt_x]) / angle
    return np.eye(2) + np.outer(way, way) * (math.cos(angle) - 1), way * math.tan(angle)
