"""Samples per lenslet of pictures made of views, where the caller does not choose."""

import numpy as np
from scipy.ndimage import distance_transform_edt

from lumigraph.core import checks
from lumigraph.core.lightfield import LightField

_FEWEST_PIXELS = 200
_MOST = 8


def detail(views: LightField) -> int:
    """Samples per lenslet that give the picture 200 pixels along its longer side: a power of two, at most 8.

    Cameras with lenslets have few of them, but many views, which fall between each other's lenslets.

    Examples
    --------
    >>> from lumigraph.core.grid import Grid
    >>> def views(n):
    ...     return LightField(np.zeros((3, 3, n, n)), Grid.square(3, 1.0), Grid.square(n, 1.0), 1.0)
    >>> detail(views(25)), detail(views(300))
    (8, 1)
    """
    times = 1
    while times < _MOST and max(views.lenslets.shape) * times < _FEWEST_PIXELS:
        times *= 2
    return times


def chosen(views: LightField, oversample: int | None) -> int:
    """Samples per lenslet as given, or those of `detail` where None.

    Raises
    ------
    GeometryError
        Not a whole number above 0.
    """
    if oversample is None:
        return detail(views)
    checks.shape("oversample", (oversample, oversample))
    return oversample


def finer(values: np.ndarray, times: int) -> np.ndarray:
    """Map (t, s) between the lenslets: ((nt - 1) times + 1, ...), linear, as fine as a refocused picture.

    A sample whose nearest lenslet is NaN is NaN; others ignore NaN.
    """
    known = np.isfinite(values)
    if times == 1 or not known.any():
        return np.repeat(np.repeat(values, times, 0), times, 1)[
            : (values.shape[0] - 1) * times + 1, : (values.shape[1] - 1) * times + 1
        ]
    if not known.all():
        nearest = np.asarray(distance_transform_edt(~known, return_distances=False, return_indices=True))
        values = values[nearest[0], nearest[1]]
    fine = _between(_between(values, times).T, times).T
    rows, columns = (
        np.minimum(np.floor(np.arange((n - 1) * times + 1) / times + 0.5).astype(int), n - 1)
        for n in known.shape
    )
    return np.where(known[np.ix_(rows, columns)], fine, np.nan)


def _between(values: np.ndarray, times: int) -> np.ndarray:
    """Values linear between the rows."""
    places = np.arange((len(values) - 1) * times + 1) / times
    first = np.minimum(places.astype(int), max(len(values) - 2, 0))
    part = (places - first)[:, None]
    return (1 - part) * values[first] + part * values[np.minimum(first + 1, len(values) - 1)]
