"""Opening state of a page: focus on the subject, and the picture that shows it."""

import math

import numpy as np
from scipy.ndimage import uniform_filter

from lumigraph.core.arrays import to_numpy
from lumigraph.core.grid import Grid
from lumigraph.core.lightfield import LightField
from lumigraph.rendering import all_in_focus, refocus
from lumigraph.rendering.focus_range import focus_range
from lumigraph.rendering.refocus import shifts
from lumigraph.viewer.encoding import Coded

_TRIED = 65  # refocus factors
_WINDOW = 2.0  # lenslets about the subject that must agree
_PATCHES = 24  # across the picture, among which the subject is found
_MIDDLE = 0.2  # of the picture's sides: how far from the middle a subject is still looked for


def subject(views: LightField) -> tuple[int, int]:
    """Place (t, s) with the most detail in the middle view, the nearer to the middle the better."""
    nv, nu, nt, ns = views.data.shape[:4]
    picture = np.asarray(to_numpy(views.data[nv // 2, nu // 2, ...]), float)
    picture = picture.mean(-1) if picture.ndim == 3 else picture
    side = 2 * max(2, round(min(nt, ns) / _PATCHES)) + 1
    detail = uniform_filter(picture**2, side) - uniform_filter(picture, side) ** 2
    y, x = np.arange(nt)[:, None] / nt - 0.5, np.arange(ns) / ns - 0.5
    t, s = np.unravel_index(np.argmax(detail * np.exp(-(y**2 + x**2) / _MIDDLE**2)), (nt, ns))
    return int(t), int(s)


def subject_focus(views: LightField) -> float:
    """Refocus factor at which the views agree best about the subject; 1 where one view leaves all open."""
    if views.data.shape[0] * views.data.shape[1] < 2:
        return 1.0
    alphas = np.linspace(*focus_range(views), _TRIED)
    place, size = subject(views), views.data.shape[2:4]
    moved = max(np.abs(shift).max() for alpha in alphas[[0, -1]] for shift in shifts(views, float(alpha)))
    reach = math.ceil(moved + 4 * _WINDOW)
    rows, columns = (
        slice(max(0, k - reach), min(n, k + reach + 1)) for k, n in zip(place, size, strict=True)
    )
    data = views.data[:, :, rows, columns, ...]
    valid = None if views.valid is None else views.valid[:, :, rows, columns]
    grid = Grid(data.shape[2:4], views.lenslets.pitch)
    part = LightField(data, views.aperture, grid, views.separation, valid)
    found = all_in_focus(part, alphas, window=_WINDOW, oversample=1).alpha
    return round(float(found[place[0] - rows.start, place[1] - columns.start]), 5)


def poster(views: LightField, alpha: float, oversample: int, white: float) -> Coded:
    """The refocused picture as one of 8 bits (1, y, x[, c])."""
    picture = to_numpy(refocus(views, alpha, oversample=oversample))
    numbers = np.rint(255 * np.clip(picture / white, 0, 1)).astype(np.uint8)
    return Coded(numbers[None], white / 255)
