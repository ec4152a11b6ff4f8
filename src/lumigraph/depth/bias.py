"""Refocus factors without the bias of diffraction: `unbiased`."""

from collections.abc import Callable

import numpy as np

from lumigraph.core.depth_map import DepthMap
from lumigraph.core.lightfield import LightField
from lumigraph.core.progress import Progress
from lumigraph.depth.from_focus import BiasCurve

_KNOTS = 7
_SPARE, _SHARE = 0.05, 0.25  # beyond the factors that were found: at least, and over their range
_NEAREST = 0.5


def unbiased(
    found: DepthMap,
    views_at: Callable[[float], LightField],
    measure: Callable[[LightField], DepthMap],
    *,
    farthest: float,
    progress: Progress,
) -> DepthMap:
    """Map of refocus factors, corrected by the same method's results on planes of known depth.

    Parameters
    ----------
    found
        Refocus factors.
    views_at
        Light field of a textured plane at a true refocus factor, such as `simulation.plane_views` gives.
    measure
        The method that gave `found`.
    farthest
        Refocus factor of the farthest plane worth a try.
    progress
        Called as ``progress(fraction)``.
    """
    alpha = np.asarray(found.alpha, float)
    low, high = np.nanquantile(alpha, (0.02, 0.98))
    spare = _SPARE + _SHARE * (high - low)
    true = np.linspace(max(low - spare, _NEAREST), min(high + spare, farthest), _KNOTS)
    measured = []
    for done, one in enumerate(true, 1):
        again = measure(views_at(float(one)))
        rows, columns = (slice(n // 4, n - n // 4) for n in again.shape)
        measured.append(float(np.nanmedian(np.asarray(again.values)[rows, columns])))
        progress(done / _KNOTS)
    return found.replaced(BiasCurve(np.array(measured), true)(alpha), "alpha")
