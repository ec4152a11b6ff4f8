"""Views of planes whose depth is known: what a method of measuring depth makes of them is its bias."""

from typing import Any

import numpy as np

from lumigraph.core.lightfield import LightField
from lumigraph.design import plenoptic1
from lumigraph.rendering import decode
from lumigraph.scene import Scene, Slice
from lumigraph.simulation.imaging import simulate

_MOST_LENSLETS = 33  # of the camera that is simulated: a part of it tells
_WAVES, _FINEST, _CONTRAST = 40, 0.6, 0.15  # of the texture: how many, lenslets^-1 times 2 pi, and of each


def plane_views(camera: Any, alpha: float) -> LightField:
    """Views of a textured plane before the middle of a plenoptic camera 1.0, by wave optics.

    Parameters
    ----------
    camera
        A `PlenopticCamera`.
    alpha
        Refocus factor of the plane.
    """
    lenslets = camera.lenslets.model_dump(exclude_unset=True)
    lenslets["count"] = tuple(min(n, _MOST_LENSLETS) for n in camera.lenslets.count)
    small = camera.replace(lenslets=lenslets, sensor={"pixel_pitch": camera.sensor.pixel_pitch})
    dz = plenoptic1.defocus(camera.main_lens.focal_length, camera.object_distance, alpha)
    grid, unit = small.object_grid, small.lenslets.pitch * camera.object_distance / camera.separation
    rng = np.random.default_rng(1)
    ky, kx = rng.uniform(-_FINEST, _FINEST, (2, _WAVES))
    phases = ky[:, None, None] * (grid.y[:, None] / unit) + kx[:, None, None] * (grid.x / unit)
    picture = 1 + _CONTRAST * np.cos(phases + rng.uniform(0, 6, (_WAVES, 1, 1))).sum(0)
    target = Scene((Slice(np.maximum(picture, 0), grid, dz),))
    return decode(simulate(small, target), small.calibration)
