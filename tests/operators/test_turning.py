"""Planes turned by three shears: against formulas, adjoint, power."""

import math

import numpy as np
import pytest

from lumigraph.core.arrays import to_numpy
from lumigraph.core.grid import Grid
from lumigraph.operators.sampling.rotate_by_shears import CroppedPlane, ShearRotation, turn_margin

GRID = Grid((70, 83), (1.0, 1.2), (3.0, -2.0))


def blob(y, x):
    """An oblong Gaussian off the axis, of no symmetry under a turn."""
    return np.exp(-(((y - 6) / 3) ** 2) - ((x + 9) / 4.5) ** 2)


@pytest.mark.parametrize("angle", [0.3, -0.7, 0.02])
def test_a_turned_gaussian_is_its_formula(angle):
    """To rounding of what the Gaussian has beyond the samples' band and window, 1e-7."""
    y, x = GRID.y[:, None], GRID.x[None]
    sin, cos = math.sin(angle), math.cos(angle)
    turned = ShearRotation(GRID, angle).forward(blob(y, x))
    np.testing.assert_allclose(turned, blob(x * sin + y * cos, x * cos - y * sin), atol=1e-6)


def test_the_way_back_undoes_it_and_power_is_kept():
    plane = blob(GRID.y[:, None], GRID.x)
    turned = ShearRotation(GRID, 0.4).forward(plane)
    assert (turned**2).sum() == pytest.approx((plane**2).sum(), rel=1e-9)
    assert turned.sum() == pytest.approx(plane.sum(), rel=1e-9)
    np.testing.assert_allclose(ShearRotation(GRID, -0.4).forward(turned), plane, atol=1e-7)


def test_the_adjoint_is_the_transpose(xp, rng):
    turn = ShearRotation(GRID, 0.35)
    x, y = (rng.random(GRID.shape).astype(np.float32) for _ in range(2))
    forward, back = turn.forward(xp.asarray(x)), turn.adjoint(xp.asarray(y))
    assert str(forward.dtype).endswith("float32")
    left = (to_numpy(forward).astype(float) * y).sum()
    assert left == pytest.approx((x * to_numpy(back).astype(float)).sum(), rel=1e-6)


def test_the_margin_is_enough_for_the_corners():
    """A light in each corner stands where it should, and nothing comes back on the other side."""
    size, angle = (40.0, 60.0), 0.5
    margin = turn_margin(size, angle)
    grid = Grid((math.ceil(size[0] + 2 * margin[0]), math.ceil(size[1] + 2 * margin[1])), 1.0)
    sin, cos = math.sin(angle), math.cos(angle)
    y, x = grid.y[:, None], grid.x[None]
    for corner in ((17, 27), (17, -27), (-17, 27), (-17, -27)):
        spot = np.exp(-((y - corner[0]) ** 2 + (x - corner[1]) ** 2) / 4)
        there = x * sin + y * cos - corner[0], x * cos - y * sin - corner[1]
        turned = ShearRotation(grid, angle).forward(spot)
        expected = np.exp(-(there[0] ** 2 + there[1] ** 2) / 4)
        np.testing.assert_allclose(turned, expected, atol=1e-4)


def test_a_crop_and_its_transpose(xp, rng):
    crop = CroppedPlane((9, 12), (2, 3))
    x, y = rng.random((9, 12)), rng.random((5, 6))
    forward, back = to_numpy(crop.forward(xp.asarray(x))), to_numpy(crop.T.forward(xp.asarray(y)))
    np.testing.assert_array_equal(forward, x[2:7, 3:9])
    assert (forward * y).sum() == pytest.approx((x * back).sum(), rel=1e-12)


def test_no_margin_is_no_crop(rng):
    plane = rng.random((5, 6))
    for crop in (CroppedPlane((5, 6), (0, 0)), CroppedPlane((5, 6), (0, 0)).T):
        np.testing.assert_array_equal(crop.forward(plane), plane)
