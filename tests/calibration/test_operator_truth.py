"""Calibration of white images that the operator made: wave optics, not drawn discs."""

import math

import numpy as np
import pytest
from scipy.ndimage import map_coordinates

from cameras import focused
from lumigraph import calibrate
from lumigraph.core.grid import Grid
from lumigraph.core.warp import Warp
from lumigraph.operators import periodic_operator
from lumigraph.units import um

COUNTS = {"square": (21, 21), "hex": (24, 21)}
PITCHES = (7.0, 8.4, 10.5, 13.3, 17.25, 21.7, 27.1, 34.865, 45.5, 58.2, 74.9, 91.0)


def white(layout, pitch, angle, accuracy, rng):
    """A white image with 20 dB of noise and 1 % dead lenslets, tilted; the true inner centres [px]."""
    shape = {"layout": layout, "count": COUNTS[layout], "rotation": math.radians(angle)}
    known = focused(**shape)
    camera = focused(pixel_pitch=100 * um * (1 + known.lenslet_distance / known.separation) / pitch, **shape)
    grid = camera.object_grid
    size = max(n * p for n, p in zip(grid.shape, grid.pitch, strict=True))
    n = 2 * math.ceil(size / (18 * um))  # light from twice as far as the lenslets look
    operator = periodic_operator(camera, Grid((n, n), 18 * um), accuracy=accuracy)
    image = operator.forward(np.ones((n, n), np.float32))
    cut = round(2.6 * pitch)  # a sensor inside the array, whose outer lenslets lack their neighbours' light
    image = image[cut:-cut, cut:-cut]
    middle = (np.array(image.shape) - 1) / 2
    warp = Warp((middle[0], middle[1]), tuple(rng.uniform(-0.006, 0.006, 2) / np.array(image.shape)))
    places = np.stack(np.indices(image.shape), -1).astype(float)
    image = map_coordinates(image, np.moveaxis(warp.removed(places), -1, 0), order=3, mode="nearest")
    index = np.stack(np.meshgrid(*[np.arange(-15, 16)] * 2, indexing="ij"), -1).reshape(-1, 2)
    true = camera.calibration.position(index) - cut
    true = warp.applied(true[np.abs(true - middle).max(1) < 7 * pitch])
    for y, x in true[rng.choice(len(true), math.ceil(len(true) / 100), replace=False)]:
        image[np.hypot(places[..., 0] - y, places[..., 1] - x) < 0.55 * pitch] *= 0.02
    return image + image.mean() / 10 * rng.standard_normal(image.shape), true


def check(layout, pitch, angle, accuracy):
    image, true = white(layout, pitch, angle, accuracy, np.random.default_rng(int(pitch * 100)))
    found = calibrate(image)
    assert found.lattice.layout == layout
    index = np.stack(found.index(*true.T), -1)
    assert len(np.unique(index, axis=0)) == len(true)
    assert np.sqrt(((found.position(index) - true) ** 2).sum(1).mean()) < 0.05


def test_centres_are_those_of_the_camera():
    check("square", 17.25, -2, 1e-2)


@pytest.mark.long
@pytest.mark.parametrize("layout", list(COUNTS))
@pytest.mark.parametrize(("number", "pitch"), list(enumerate(PITCHES)))
def test_centres_are_those_of_the_camera_at_all_pitches(layout, number, pitch):
    """Turned either way in turns; to 1e-2, as pixels have a tenth of the mean in noise."""
    check(layout, pitch, (-2, 1.3)[(number + (layout == "hex")) % 2], 1e-2)
