"""A grid of cameras as a light field: which view is which.

A camera that stands farther right sees near things farther left. In a `LightField` (docs/conventions.md)
near things (α' < 1) move with u, x = α'x' + u(1 - α'), as they do behind a lens, whose pictures are turned.
So the views stand in the opposite order of the cameras: u ascends from the rightmost camera to the leftmost,
v from the lowest to the highest. Disparities of stereo, positive for near, are then slopes ds/du.
"""

import numpy as np

from lumigraph.core.grid import Grid
from lumigraph.core.lightfield import LightField

SEPARATION = 20.0
"""Of a light field of cameras without lengths, in widths of the camera grid: the scale of α'."""


def from_cameras(data: np.ndarray, spacing: tuple[float, float] = (1.0, 1.0)) -> LightField:
    """The light field of pictures (row, column, y, x[, c]), the first camera top left.

    Pixels count as lenslets one spacing apart where lengths are not known, so that a disparity of d pixels
    per view is 1 - α' = d.

    Parameters
    ----------
    data
        Pictures.
    spacing
        Between cameras (down, right); its mean is the unit of all lengths.
    """
    rows, columns = data.shape[:2]
    down, right = (abs(step) or 1.0 for step in spacing)
    unit = (down + right) / 2
    aperture = Grid((rows, columns), (down, right))
    views = np.ascontiguousarray(data[::-1, ::-1])
    return LightField(views, aperture, Grid((data.shape[2], data.shape[3]), (unit, unit)), SEPARATION * unit)


def to_cameras(views: LightField) -> np.ndarray:
    """Pictures (row, column, y, x[, c]) of a light field, the first camera top left."""
    return views.data[::-1, ::-1]
