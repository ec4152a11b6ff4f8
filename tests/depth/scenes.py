"""Textured scenes in closed form, whose disparities and patches are known."""

import numpy as np
from benchmarks.pixel_depth import texture, traced_raw

from lumigraph.core.calibration import Calibration
from lumigraph.core.grid import Grid
from lumigraph.core.lightfield import LightField

__all__ = ["focused_raw", "texture", "traced_raw", "views_of"]


def views_of(surfaces, shape=(64, 72), views=(7, 7)):
    """Light field and disparities (t, s) of (texture, disparity, mask) from the nearest to the farthest.

    A point at x in the middle view stands at x + d u in view u. Disparities and masks are functions of
    (y, x) in the middle view; the last surface has no mask.
    """
    grid = np.meshgrid(*(np.arange(n) - n // 2 for n in (*views, *shape)), indexing="ij", sparse=True)
    v, u, y, x = (a.astype(float) for a in grid)
    data = np.zeros((*views, *shape))
    truth = np.zeros(shape)
    for paint, disparity, mask in reversed(surfaces):
        y0, x0 = y + 0 * x, x + 0 * y
        for _ in range(30):  # where in the middle view: the fixed point of x0 = x - d(x0) u
            d = disparity(y0, x0)
            y0, x0 = y - d * v, x - d * u
        shown = np.ones(y0.shape, bool) if mask is None else mask(y0, x0)
        data = np.where(shown, np.maximum(paint(y0, x0), 0), data)
        own = disparity(y[0, 0] + 0 * x[0, 0], x[0, 0] + 0 * y[0, 0])
        here = True if mask is None else mask(y[0, 0], x[0, 0])
        truth = np.where(here, own, truth)
    return LightField(data, Grid(views, 1.0), Grid(shape, 1.0), 20.0), truth


def focused_raw(lattice, shape, paint, patch, blur=None):
    """Raw image of a plenoptic 2.0 camera: lenslet C shows the place Y = C - r P / patch at C + r.

    `patch(y, x)` is that of the place under the lenslet's centre. `blur(kind)` is the strength of the waves
    that lenslets of a kind let through.
    """
    y, x = np.meshgrid(*(np.arange(n, dtype=float) for n in shape), indexing="ij")
    i, j = lattice.index(y, x)
    center = lattice.position(np.stack([i, j], -1))
    size = patch(center[..., 0], center[..., 1])
    dy, dx = y - center[..., 0], x - center[..., 1]
    image = paint(center[..., 0] - dy * lattice.pitch / size, center[..., 1] - dx * lattice.pitch / size)
    if blur is not None:
        image = 1 + (image - 1) * blur(lattice.kind(i, j))
    none = np.zeros((0, 2), int)
    return image, Calibration(lattice, shape, none, none.astype(float), 0.0)
