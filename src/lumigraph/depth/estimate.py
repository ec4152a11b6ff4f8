"""Depth of views by one call: the methods for light fields, alone or together."""

import math
from collections.abc import Sequence
from typing import Literal

import numpy as np

from lumigraph.core import checks
from lumigraph.core.depth_map import DepthMap
from lumigraph.core.lightfield import LightField
from lumigraph.core.progress import Progress, silent
from lumigraph.depth.epi import epi
from lumigraph.depth.from_focus import from_focus
from lumigraph.depth.fuse import fuse
from lumigraph.depth.quantities import alpha_of, disparity_of
from lumigraph.errors import GeometryError

Method = Literal["epi", "focus", "fused"]

ALPHAS = tuple(0.9 + 0.01 * k for k in range(21))
"""Refocus factors of a focal stack, unless others are given."""

_MOST_PLANES = 101


def estimate(
    views: LightField,
    method: Method = "epi",
    *,
    disparities: tuple[float, float] | None = None,
    alphas: Sequence[float] | None = None,
    smoothness: float = 0.0,
    progress: Progress = silent,
) -> DepthMap:
    """Depth map of the middle view: what `lumigraph.depth(views)` returns.

    Parameters
    ----------
    views
        Light field (v, u, t, s[, c]).
    method
        epi: disparities by lines of epipolar-plane images; focus: refocus factors by the sharpest picture of
        a focal stack; fused: both, as disparities.
    disparities
        Least and most that may occur [px per view]; None finds them.
    alphas
        Refocus factors of the focal stack; None takes 0.9 to 1.1, and for "fused" those that epi has found.
    smoothness
        Weight of smoothness where the map is not sure; 0 leaves it out, 1 is usual, see `fuse`.
    progress
        Called as ``progress(fraction)``.

    Raises
    ------
    GeometryError
        Not a light field, or another method. Raw images of cameras 2.0 have `dense` and `correlation`.
    """
    checks.choice("method", method, ("epi", "focus", "fused"))
    if not isinstance(views, LightField):
        raise GeometryError(
            f"views is of type {type(views).__name__} but must be a LightField. Decode the raw image first; "
            "for one of a camera 2.0 use lumigraph.depth.dense(raw, calibration)."
        )
    found: list[DepthMap] = []
    if method != "focus":
        found.append(epi(views, disparities, progress=progress))
    if method != "epi":
        planes = _planes(found, views) if alphas is None and found else ALPHAS if alphas is None else alphas
        sharp = from_focus(views, planes)
        found.append(sharp if method == "focus" else disparity_of(sharp, views))
    if method != "fused" and not smoothness:
        return found[0]
    v, u = (n // 2 for n in views.aperture.shape)
    return fuse(found, views.view(v, u), smoothness=smoothness or 1.0)


def _planes(found: Sequence[DepthMap], views: LightField) -> list[float]:
    """Refocus factors of the focal stack where disparities are known: a pixel apart in the outer views."""
    low, high = np.nanquantile(np.asarray(found[0].values, float), (0.02, 0.98))
    count = max(views.aperture.shape)
    spare = 2 / count
    ends = DepthMap(np.array([[high + spare, low - spare]]), np.ones((1, 2)), "disparity")
    first, last = np.maximum(np.asarray(alpha_of(ends, views).values)[0], 0.05)
    planes = math.ceil((high - low + 2 * spare) * count) + 1
    return [float(alpha) for alpha in np.linspace(first, last, min(max(21, planes), _MOST_PLANES))]
