"""Conversion of disparities to refocus factors, and back, by the pitches of views."""

from lumigraph.core.arrays import to_numpy
from lumigraph.core.depth_map import DepthMap
from lumigraph.core.lightfield import LightField


def disparity_per_alpha(views: LightField) -> tuple[float, float]:
    """Shift per view along t and s [lenslets] for 1 - α' = 1: aperture pitch over lenslet pitch.

    x = α'x' + u (1 - α') moves by (1 - α') Δu from one view to the next, Δu apart on the main lens.
    """
    (dv, du), (dt, ds) = views.aperture.pitch, views.lenslets.pitch
    return dv / dt, du / ds


def alpha_of(found: DepthMap, views: LightField) -> DepthMap:
    """Refocus factors α' = 1 - disparity Δs/Δu of a map of disparities.

    Parameters
    ----------
    found
        Disparities [px], along s; a map of refocus factors is returned as it is.
    views
        The light field that they were measured on: its pitches.

    Examples
    --------
    >>> import numpy as np
    >>> from lumigraph.core.grid import Grid
    >>> views = LightField(np.zeros((3, 3, 1, 1)), Grid((3, 3), 2.0), Grid((1, 1), 1.0), 10.0)
    >>> float(alpha_of(DepthMap(np.array([[0.1]]), np.ones((1, 1)), "disparity"), views).values[0, 0])
    0.95
    """
    found.check("disparity", "alpha")
    if found.quantity == "alpha":
        return found
    per = disparity_per_alpha(views)[1]
    return found.replaced(1 - to_numpy(found.values) / per, "alpha", 1 / per)


def disparity_of(found: DepthMap, views: LightField) -> DepthMap:
    """Disparities (1 - α') Δu/Δs [px] of a map of refocus factors; the inverse of `alpha_of`."""
    found.check("disparity", "alpha")
    if found.quantity == "disparity":
        return found
    per = disparity_per_alpha(views)[1]
    return found.replaced((1 - to_numpy(found.values)) * per, "disparity", per)
