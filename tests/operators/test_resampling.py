"""Band-limited pictures on other samples: values between samples, exact pixel means, transposes."""

import numpy as np
import pytest

from lumigraph.core.arrays import to_numpy
from lumigraph.core.banded import Banded, banded
from lumigraph.core.grid import Grid
from lumigraph.operators.sampling.resampling import averaged, represented


def dense(matrix: Banded) -> np.ndarray:
    return matrix.down(np.eye(matrix.columns))


@pytest.fixture
def matrix(rng):
    rows, columns = np.sort(rng.uniform(0, 40, 150)), np.arange(-3.0, 45.0)
    return banded(rows, columns, lambda d: np.where(np.abs(d) <= 2.5, np.cos(d), 0), 2.5)


def test_a_banded_matrix_is_its_entries(matrix):
    """In three blocks, each of few columns."""
    rows = np.sort(np.random.default_rng(20240229).uniform(0, 40, 150))
    d = rows[:, None] - np.arange(-3.0, 45.0)
    np.testing.assert_allclose(dense(matrix), np.where(np.abs(d) <= 2.5, np.cos(d), 0), atol=1e-15)
    assert len(matrix.blocks) == 3
    assert all(block.shape[1] < 30 for _, block in matrix.blocks)


def test_descending_rows_are_as_good(rng):
    rows, columns = -np.sort(rng.uniform(-40, 0, 100)), np.arange(50.0)
    found = dense(banded(rows, columns, lambda d: np.where(np.abs(d) <= 2.5, 1 + d, 0), 2.5))
    d = rows[:, None] - columns
    np.testing.assert_allclose(found, np.where(np.abs(d) <= 2.5, 1 + d, 0))


def test_adjoints_are_transposes(matrix, xp, rng):
    x, y = (rng.random(shape).astype(np.float32) for shape in ((48, 5), (150, 5)))
    forward, back = matrix.down(xp.asarray(x)), matrix.up(xp.asarray(y))
    assert str(forward.dtype).endswith("float32")
    assert str(back.dtype).endswith("float32")
    np.testing.assert_allclose(to_numpy(back), dense(matrix).T @ y, rtol=1e-5)
    np.testing.assert_allclose(to_numpy(forward), dense(matrix) @ x, rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(to_numpy(matrix.right(xp.asarray(x.T))), dense(matrix).dot(x).T, atol=1e-5)
    np.testing.assert_allclose(to_numpy(matrix.left(xp.asarray(y.T))), (dense(matrix).T @ y).T, atol=1e-5)


@pytest.mark.parametrize("map_of", [represented, averaged])
def test_the_adjoint_of_a_picture_is_the_transpose(map_of, xp, rng):
    one, other = Grid((40, 31), (2.0, 3.0), (1.0, -2.0)), Grid((30, 33), (3.1, 2.2), (-4.0, 5.0))
    both = map_of(one, other)
    rows = other.shape
    x, y = rng.random(one.shape), rng.random(rows)
    forward, back = both.forward(xp.asarray(x)), both.adjoint(xp.asarray(y))
    assert forward.shape == rows
    assert back.shape == one.shape
    assert (to_numpy(forward) * y).sum() == pytest.approx((x * to_numpy(back)).sum(), rel=1e-12)


def wave(frequency, y, x):
    return 2 + np.cos(2 * np.pi * frequency[0] * y + 1)[:, None] * np.cos(2 * np.pi * frequency[1] * x - 0.5)


def test_points_hold_a_band_limited_object_turned_by_180_degrees():
    """Samples 0.7 apart become points 1 apart; below 1/3 of a period per point nothing is lost, to 1e-4."""
    source, points = Grid((120, 130), (0.7, 0.65), (3.0, -2.0)), Grid((41, 37), (1.0, 1.0), (4.2, -1.3))
    frequency = (0.31, 0.25)
    found = represented(source, points).forward(wave(frequency, source.y, source.x))
    y, x = points.y[::-1], points.x[::-1]
    inner = (slice(12, -12), slice(12, -12))
    np.testing.assert_allclose(found[inner], wave(frequency, y, x)[inner], atol=2e-4)


def test_an_even_number_of_points_starts_at_the_largest():
    """Turned by 180° about the axis, sample n//2 still stands at the centre: one more on the far side."""
    source, points = Grid((60, 60), (1.0, 1.0)), Grid((24, 24), (1.0, 1.0))
    ramp = np.broadcast_to(source.y[:, None], source.shape)
    found = represented(source, points).forward(ramp)
    np.testing.assert_allclose(found[:, 12], np.arange(12, -12, -1.0), atol=2e-3)


def test_what_an_object_sums_up_to_is_kept(rng):
    source, points = Grid((20, 22), (0.8, 0.9)), Grid((61, 61), (1.0, 1.0))
    samples = rng.random(source.shape)
    kept = represented(source, points).forward(samples).sum()
    assert kept == pytest.approx(samples.sum() * 0.8 * 0.9, rel=1e-5)


def test_pixels_have_the_mean_over_their_area():
    """Of a cosine: its value at the middle times sinc(width × frequency); turned by 180°."""
    plane, pixels = Grid((90, 80), (0.5, 0.6), (1.0, 2.0)), Grid((15, 13), (1.3, 1.7), (-1.0, 0.4))
    frequency = (0.3, 0.2)  # of half a period per sample: 0.15 and 0.12 per sample
    found = averaged(plane, pixels).forward(wave(frequency, plane.y, plane.x))
    weight = np.sinc(1.3 * frequency[0]) * np.sinc(1.7 * frequency[1])
    expected = 2 + weight * (wave(frequency, -pixels.y, -pixels.x) - 2)
    np.testing.assert_allclose(found, expected, atol=3e-5)


def test_pixels_side_by_side_collect_all_of_the_light(rng):
    plane, pixels = Grid((31, 31), (0.5, 0.5)), Grid((41, 41), (1.0, 1.0))
    light = rng.random(plane.shape)
    assert averaged(plane, pixels).forward(light).sum() == pytest.approx(light.sum() * 0.25, rel=1e-5)


@pytest.mark.parametrize("map_of", [represented, averaged])
def test_axes_that_are_sampled_alike_share_one_matrix(map_of):
    square, wide = Grid.square(40, 2.0), Grid((40, 40), (2.0, 2.5))
    both = map_of(square, square)
    assert both.y is both.x
    for other in (wide, Grid((40, 40), 2.0, (0.0, 1.0)), Grid((40, 42), 2.0)):
        unlike = map_of(other, square)
        assert unlike.y is not unlike.x
        np.testing.assert_array_equal(dense(unlike.y), dense(both.y))
        assert dense(unlike.x).shape != dense(both.x).shape or (dense(unlike.x) != dense(both.x)).any()
