"""Textured scenes in closed form, whose disparities and patches are known."""

import numpy as np

from lumigraph.core.calibration import Calibration
from lumigraph.core.grid import Grid
from lumigraph.core.lightfield import LightField


def texture(rng, waves=40, longest=0.9):
    """A function of (y, x): a sum of waves of up to `longest` radians per sample, from 0 to 2 or so."""
    ky, kx = rng.uniform(-longest, longest, (2, waves))
    phase = rng.uniform(0, 2 * np.pi, waves)

    def at(y, x):
        total = np.zeros(np.broadcast(y, x).shape)
        for a, b, c in zip(ky, kx, phase, strict=True):
            total += np.cos(a * y + b * x + c)
        return 1 + 0.9 * total / np.sqrt(waves)

    return at


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


def traced_raw(lattice, shape, surfaces, focus, rays=3):
    """Raw image of a plenoptic 2.0 camera by rays: what stands in front hides, lenslets blur out of focus.

    Surfaces are (texture, patch, mask), the nearest first, functions of (y, x) in the plane of the lattice;
    the last one has no mask. A ray through the lenslet C, `o` beside its middle, that ends at C + r comes
    from Y = C - r P/s + o (s - f)/s of a surface of patch s, if the lenslet is sharp at the patch f.
    """
    y, x = np.meshgrid(*(np.arange(n, dtype=float) for n in shape), indexing="ij")
    index = lattice.index(y, x)
    center = lattice.position(np.stack(index, -1))
    sharp, pitch = np.asarray(focus, float)[lattice.kind(*index)], lattice.pitch
    steps = (np.arange(rays) + 0.5) / rays - 0.5
    through = [(a * pitch, b * pitch) for a in steps for b in steps if np.hypot(a, b) < 0.51]
    total = np.zeros(shape)
    for beside in through:
        light, missed = np.zeros(shape), np.ones(shape, bool)
        for paint, patch, mask in surfaces:
            size = patch(center[..., 0], center[..., 1]) + np.zeros(shape)
            for _ in range(6):  # where it meets the surface: a fixed point
                place = [
                    center[..., k] - (a - center[..., k]) * pitch / size + beside[k] * (size - sharp) / size
                    for k, a in enumerate((y, x))
                ]
                size = patch(*place) + np.zeros(shape)
            hit = missed & (True if mask is None else mask(*place))
            light = np.where(hit, np.maximum(paint(*place), 0), light)
            missed &= ~hit
        total += light
    none = np.zeros((0, 2), int)
    return total / len(through), Calibration(lattice, shape, none, none.astype(float), 0.0)
