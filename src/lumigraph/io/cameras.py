"""A grid of cameras as a light field: which view is which.

In a camera farther right near things appear farther left. In a `LightField` (docs/conventions.md)
near things (α' < 1) move with u, x = α'x' + u(1 - α'), as they do behind a lens, whose pictures are turned.
So the views stand in the opposite order of the cameras: u ascends from the rightmost camera to the leftmost,
v from the lowest to the highest. Disparities of stereo, positive for near, are then slopes ds/du.
"""

import numpy as np

from lumigraph.core.grid import Grid
from lumigraph.core.lightfield import LightField

PIXELS = 100
"""Pixels that count as one camera spacing where lengths are not known: the scale of α'."""

_SEPARATION = 20.0  # in camera spacings; as for a raw image without lengths


def from_cameras(data: np.ndarray, spacing: tuple[float, float] = (1.0, 1.0)) -> LightField:
    """The light field of pictures (row, column, y, x[, c]), the first camera top left.

    A hundred pixels count as one camera spacing, so that a disparity of d pixels per view is focused by
    α' = 1 - d/100, whatever the cameras' real distances.

    Parameters
    ----------
    data
        Pictures.
    spacing
        Between cameras (down, right); the mean of its sizes is the unit of all lengths. Below zero where the
        first row stands lowest, or the first column farthest right.
    """
    rows, columns = data.shape[:2]
    down, right = (abs(step) or 1.0 for step in spacing)
    unit = (down + right) / 2
    pixels = Grid((data.shape[2], data.shape[3]), (unit / PIXELS, unit / PIXELS))
    aperture = Grid((rows, columns), (down, right))
    views = np.ascontiguousarray(in_order_of_views(data, spacing))
    return LightField(views, aperture, pixels, _SEPARATION * unit)


def in_order_of_views(cameras: np.ndarray, spacing: tuple[float, float] = (1.0, 1.0)) -> np.ndarray:
    """What there is of each camera (row, column, ...) in the order of the views (v, u, ...), as a view of it.

    Parameters
    ----------
    cameras
        Pictures, or anything else.
    spacing
        Between cameras (down, right), of which the signs count.
    """
    down, right = spacing
    return cameras[:: 1 if down < 0 else -1, :: 1 if right < 0 else -1]


def to_cameras(views: LightField) -> np.ndarray:
    """Pictures (row, column, y, x[, c]) of a light field, the first camera top left."""
    return views.data[::-1, ::-1]
