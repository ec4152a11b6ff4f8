"""Pictures of depth maps."""

import numpy as np

from lumigraph.core.arrays import to_numpy
from lumigraph.core.depth_map import DepthMap
from lumigraph.core.lightfield import LightField
from lumigraph.rendering import detail, finer

_ENDS = 0.01, 0.99


def drawn(found: DepthMap, views: LightField | None = None) -> np.ndarray:
    """Picture of a map (y, x), from 0 to 1: near to far as white to black, unknown as black.

    Parameters
    ----------
    found
        Map of any quantity.
    views
        Light field that it was measured on: the picture is as fine as those that `lumigraph.refocus` makes.

    Examples
    --------
    >>> found = DepthMap(np.array([[0.0, 1.0, np.nan]]), np.ones((1, 3)), "depth")
    >>> drawn(found).round(2).tolist()
    [[1.0, 0.0, 0.0]]
    """
    values = to_numpy(found.values).astype(float)
    if views is not None:
        values = finer(values, detail(views))
    low, high = np.nanquantile(values, _ENDS) if np.isfinite(values).any() else (0.0, 1.0)
    part = (values - low) / ((high - low) or 1)
    nearer_is_more = found.quantity in ("disparity", "patch")
    return np.nan_to_num(np.clip(part if nearer_is_more else 1 - part, 0, 1))
