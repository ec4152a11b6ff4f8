"""Views of planes whose depth is known: what a method of measuring depth makes of them is its bias."""

import numpy as np

from lumigraph.core.calibration import Calibration
from lumigraph.core.lightfield import LightField
from lumigraph.rendering import decode
from lumigraph.scene import Scene, Slice
from lumigraph.simulation.camera import ImagedCamera
from lumigraph.simulation.imaging import simulate

_WAVES, _FINEST, _CONTRAST = 40, 0.6, 0.15  # of the texture: how many, lenslets^-1 times 2 pi, and of each


def plane_views(camera: ImagedCamera, calibration: Calibration, dz: float) -> LightField:
    """Views of a textured plane before the middle of a plenoptic camera 1.0, by wave optics.

    Parameters
    ----------
    camera, calibration
        One of few lenslets, and where its micro-images stand.
    dz
        Depth of the plane, from the focused one [m].
    """
    assert camera.lattice is not None  # a plenoptic camera's
    grid, unit = camera.object_grid, camera.lattice.pitch * camera.object_distance / camera.separation
    rng = np.random.default_rng(1)
    ky, kx = rng.uniform(-_FINEST, _FINEST, (2, _WAVES))
    phases = ky[:, None, None] * (grid.y[:, None] / unit) + kx[:, None, None] * (grid.x / unit)
    picture = 1 + _CONTRAST * np.cos(phases + rng.uniform(0, 6, (_WAVES, 1, 1))).sum(0)
    target = Scene((Slice(np.maximum(picture, 0), grid, dz),))
    return decode(simulate(camera, target), calibration)
