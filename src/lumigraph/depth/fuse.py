"""Several estimates of one depth as one smooth map."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.ndimage import distance_transform_edt

from lumigraph.core import checks
from lumigraph.core.arrays import Array, like, to_numpy
from lumigraph.core.depth_map import DepthMap
from lumigraph.depth.smooth import Stiffness, update
from lumigraph.errors import GeometryError

_ROUNDS = 3
_KINK, _JUMP = 0.005, 0.2  # second differences, of the spread of the values
_OUTLIER = 0.1  # of the spread: estimates farther off count little
_CONTRAST = 0.05  # between neighbours of a picture from 0 to 1: an edge, where a map may bend
_UNSURE = 0.1  # of the usual information
_MOST = 1e3  # information of a confidence of 1


def fuse(
    maps: DepthMap | Sequence[DepthMap], picture: Array | None = None, *, smoothness: float = 1.0
) -> DepthMap:
    r"""One map from several, each place as near to the sure ones as a smooth surface may be.

    A confidence c counts as the information c/(1 - c); an estimate that is off by r from the others counts
    1/(1 + (r / 0.1 spread)²) as much. The surface minimises the squared distances with these weights, and
    the second differences: it may be slanted, and bends or tears where the values do, sooner at the
    picture's edges. Places that no map knows are filled in.

    Parameters
    ----------
    maps
        One or more, of one quantity and shape; see `alpha_of` and `disparity_of`. NaN counts as unknown.
    picture
        (y, x[, c]), of the same places.
    smoothness
        How stiff the surface is; 0 hardly smooths.

    Returns
    -------
    DepthMap
        Its confidence is high where sure estimates agree.

    Raises
    ------
    GeometryError
        No map, several quantities or shapes, no finite value, or a negative smoothness.

    Examples
    --------
    >>> rough = DepthMap(np.array([[1.0, 1.1, 5.0, 0.9]] * 4), np.array([[0.9, 0.9, 0.01, 0.9]] * 4), "alpha")
    >>> bool(fuse(rough).values.max() < 1.3)
    True
    """
    given = [maps] if isinstance(maps, DepthMap) else list(maps)
    values, information = _stacked(given)
    checks.finite("smoothness", smoothness, "1")
    if smoothness < 0:
        raise GeometryError(f"smoothness is {smoothness:g} but must be 0 or above.")
    start = _start(values, information)
    spread = float(np.subtract(*np.quantile(start, (0.98, 0.02)))) or max(abs(float(start.mean())), 1.0)
    edges = np.ones(start.shape) if picture is None else _edges(picture, start.shape)
    found = start / spread
    how = Stiffness(0.3 * smoothness + 1e-6, _KINK, _JUMP)
    for _ in range(_ROUNDS):
        away = values / spread - found
        weights = information / (1 + (away / _OUTLIER) ** 2)
        found = update(found, weights.sum(0), (weights * away).sum(0), how, edges)
    agreed = (information / (1 + ((values / spread - found) / _OUTLIER) ** 2)).sum(0)
    return DepthMap(
        like(found * spread, given[0].values), like(agreed / (1 + agreed), given[0].values), given[0].quantity
    )


def _stacked(maps: list[DepthMap]) -> tuple[np.ndarray, np.ndarray]:
    """Values and information (k, y, x), unknown ones 0."""
    if not maps:
        raise GeometryError("there is no map to fuse. Give one at least.")
    for one in maps:
        checks.instance("map", one, DepthMap)
        if (one.shape, one.quantity) != (maps[0].shape, maps[0].quantity):
            raise GeometryError(
                f"maps hold {maps[0].quantity} of shape {maps[0].shape} and {one.quantity} of shape "
                f"{one.shape} but must be alike. Use alpha_of or disparity_of."
            )
    values = np.stack([to_numpy(one.values) for one in maps]).astype(float)
    trust = np.stack([to_numpy(one.confidence) for one in maps]).astype(float)
    known = np.isfinite(values) & np.isfinite(trust)
    if not known.any():
        raise GeometryError("no map has a finite value. Measure again with a wider range.")
    trust = np.clip(np.where(known, trust, 0), 0, 1)
    return np.where(known, values, 0), known * trust / (1 - trust + 1 / _MOST)


def _start(values: np.ndarray, information: np.ndarray) -> np.ndarray:
    """The surest value of each place; of a place without a sure one, the nearest other place's."""
    best = information.argmax(0)[None]
    start = np.take_along_axis(values, best, 0)[0]
    sure = np.take_along_axis(information, best, 0)[0]
    unknown = sure <= _UNSURE * np.median(sure)
    if unknown.any() and not unknown.all():
        nearest: Any = distance_transform_edt(unknown, return_distances=False, return_indices=True)
        start = start[tuple(nearest)]
    return start


def _edges(picture: Array, shape: tuple[int, ...]) -> np.ndarray:
    """1 where a picture is even, towards 0 at its edges (y, x)."""
    image = to_numpy(picture).astype(float)
    image = image.mean(2) if image.ndim == 3 else image
    if image.shape != shape:
        raise GeometryError(
            f"the picture has shape {image.shape} but the maps {shape}: they must be the same."
        )
    checks.finite_array("picture", image, GeometryError)
    image = image / (float(np.quantile(np.abs(image), 0.999)) or 1.0)
    down, right = np.gradient(image)
    return 1 / (1 + (np.hypot(down, right) / _CONTRAST) ** 2)
