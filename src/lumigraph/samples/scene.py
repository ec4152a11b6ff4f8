"""Light fields of the painted scene, with the disparity of everything in it."""

from dataclasses import dataclass

import numpy as np

from lumigraph.core import checks
from lumigraph.core.depth_map import DepthMap
from lumigraph.core.grid import Grid
from lumigraph.core.lightfield import LightField
from lumigraph.samples.still_life import LAYERS
from lumigraph.units import mm, um

FINER = 2
"""Places along each axis of a sample whose mean it is."""


@dataclass(frozen=True, slots=True, eq=False)
class SceneSample:
    """A light field of a known scene.

    Parameters
    ----------
    views
        Light field (v, u, t, s, 3), float32, 0 to 1, linear.
    disparity
        Truth for the middle view (t, s) [px per view], positive nearer.
    """

    views: LightField
    disparity: DepthMap


def scene(size: tuple[int, int] = (192, 256), views: int = 9) -> SceneSample:
    """A toy robot before a garland of lights, behind leaves, on a table: opaque things at known depths.

    The focused plane (α' = 1) passes just behind the robot. Nothing is read from disk: the views are painted
    when they are asked for, in some seconds, always the same to the last bit.

    Parameters
    ----------
    size
        Samples (t, s) of each view, 16 or more.
    views
        Views along each axis, 3 or more; the middle one is number ``views // 2``.

    Raises
    ------
    LumigraphError
        Sizes out of range.

    Examples
    --------
    >>> sample = scene((24, 32), 3)
    >>> sample.views.data.shape, sample.disparity.unit
    ((3, 3, 24, 32, 3), 'px')
    """
    rows, columns = (checks.whole(f"size[{k}]", n, 16) for k, n in enumerate(size))
    count = checks.whole("views", views, 3)
    y = ((np.arange(rows * FINER) + 0.5) / FINER / rows - 0.5).astype(np.float32)[:, None]
    x = ((np.arange(columns * FINER) + 0.5) / FINER - columns / 2).astype(np.float32) / rows
    places = (np.arange(count) - count // 2) / (count - 1)
    data = np.empty((count, count, rows, columns, 3), np.float32)
    for k, v in enumerate(places):
        for j, u in enumerate(places):
            fine = _seen(y, x, (float(v), float(u)))[0]
            data[k, j] = fine.reshape(rows, FINER, columns, FINER, 3).mean((1, 3))
    truth = _seen(y[FINER // 2 :: FINER], x[FINER // 2 :: FINER], (0.0, 0.0))[1] * (rows / (count - 1))
    known = DepthMap(truth.astype(np.float32), np.ones((rows, columns), np.float32), "disparity")
    aperture, lenslets = Grid.square(count, 20 * mm / count), Grid((rows, columns), (150 * um, 150 * um))
    return SceneSample(LightField(data, aperture, lenslets, 60 * mm), known)


def _seen(y: np.ndarray, x: np.ndarray, place: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    """Colours (..., 3) and parallaxes from a place on the aperture; the front hides the back."""
    picture, near = np.zeros((len(y), len(x), 3), np.float32), np.zeros((len(y), len(x)))
    for layer in LAYERS:
        canvas = layer.seen(y, x, place)
        picture[canvas.cover] = canvas.colour[canvas.cover]
        near = np.where(canvas.cover, layer.at(y), near)
    return picture, near
