"""Linear maps: what they accept, and how they are combined."""

import numpy as np
import pytest
from scipy.sparse import csr_array

from lumigraph.core.arrays import to_numpy
from lumigraph.core.grid import Grid
from lumigraph.core.linear import Linear, stack
from lumigraph.core.matrix import Matrix
from lumigraph.errors import GeometryError

GRID = Grid((3, 4), 1.0)


@pytest.fixture
def maps(rng):
    return [Matrix(rng.random((10, 12)), (2, 5), (3, 4), object_grid=GRID) for _ in range(3)]


def transposed(a: Linear, rng) -> bool:
    x, y = rng.random(a.shape[1]), rng.random(a.shape[0])
    return (a.forward(x) * y).sum() == pytest.approx((x * a.adjoint(y)).sum(), rel=1e-12)


def test_the_raw_image_of_planes_is_the_sum_of_theirs(maps, xp, rng):
    slices, volume = stack(maps, depths=(-1e-3, 0.0, 2e-3)), rng.random((3, 3, 4))
    assert slices.shape == ((2, 5), (3, 3, 4))
    assert slices.object_grid == GRID
    assert slices.depths == (-1e-3, 0.0, 2e-3)
    expected = sum(plane.forward(layer) for plane, layer in zip(maps, volume, strict=True))
    np.testing.assert_allclose(to_numpy(slices.forward(xp.asarray(volume))), expected, rtol=1e-12)
    assert to_numpy(slices.adjoint(xp.asarray(rng.random((2, 5))))).shape == volume.shape
    assert transposed(slices, rng)


def test_a_point_spread_function_is_a_column(maps):
    image = stack(maps).psf((1, 2, 3))
    assert image.dtype == np.float32
    np.testing.assert_allclose(image.ravel(), maps[1].matrix[:, 11], rtol=1e-6)


def test_sums_are_weighted(maps, rng):
    mixed, x = 0.25 * maps[0] + 2.0 * maps[1], rng.random((3, 4))
    expected = 0.25 * maps[0].forward(x) + 2 * maps[1].forward(x)
    np.testing.assert_allclose(mixed.forward(x), expected, rtol=1e-12)
    assert transposed(mixed, rng)


def test_a_product_is_the_right_map_first_and_goes_back_in_reverse(maps, rng):
    after = Matrix(rng.random((7, 10)), (7,), (2, 5))
    both, x = after @ maps[0], rng.random((3, 4))
    assert both.shape == ((7,), (3, 4))
    np.testing.assert_allclose(both.forward(x), after.matrix @ maps[0].matrix @ x.ravel(), rtol=1e-12)
    assert transposed(both, rng)
    np.testing.assert_array_equal(both.T.forward(np.ones(7)), both.adjoint(np.ones(7)))


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_a_sparse_matrix_is_the_dense_one_in_every_library(xp, rng, dtype):
    dense = rng.random((10, 12)) * (rng.random((10, 12)) < 0.3)
    sparse = Matrix(csr_array(dense), (2, 5), (3, 4))
    x, y = rng.random((3, 4)).astype(dtype), rng.random((2, 5)).astype(dtype)
    forward, back = sparse.forward(xp.asarray(x)), sparse.adjoint(xp.asarray(y))
    assert str(forward.dtype).endswith(np.dtype(dtype).name)
    np.testing.assert_allclose(to_numpy(forward).ravel(), dense @ x.ravel(), rtol=1e-5)
    np.testing.assert_allclose(to_numpy(back).ravel(), dense.T @ y.ravel(), rtol=1e-5, atol=1e-12)


@pytest.mark.parametrize("dtype", ["uint16", "int64", "bool"])
def test_integers_and_truth_values_become_single_precision(maps, xp, dtype):
    x = np.arange(12).reshape(3, 4) % 5
    found = maps[0].forward(xp.asarray(x.astype(dtype)))
    assert str(found.dtype).endswith("float32")
    expected = maps[0].forward(x.astype(dtype).astype(np.float32))
    np.testing.assert_allclose(to_numpy(found), expected, rtol=1e-6)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (np.ones((4, 3)), r"an object has shape \(4, 3\) but the operator takes \(3, 4\)"),
        (np.ones((3, 4), complex), "an object is complex but an operator takes intensities"),
        (np.full((3, 4), np.nan), "an object has 12 NaN or infinite values of 12"),
        ([[1.0] * 4] * 3, "an object is of type list but must be an array"),
    ],
)
def test_what_it_does_not_take_is_refused_in_one_line(maps, given, message):
    with pytest.raises(GeometryError, match=message) as caught:
        maps[0].forward(given)
    assert "\n" not in str(caught.value)


def test_numbers_whose_sum_overflows_are_no_error(maps):
    assert np.isfinite(maps[0].forward(np.full((3, 4), 3e37, np.float32))).all()


@pytest.mark.parametrize("index", [(3, 0), (0,), (0, 0, 0), 5])
def test_a_sample_that_is_not_there_is_refused(maps, index):
    with pytest.raises(GeometryError, match=r"index is .* but the object has shape \(3, 4\)"):
        maps[0].psf(index)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda a: a @ a, r"gives shape \(2, 5\) but the one after it takes \(3, 4\)"),
        (lambda a: a + a.T, "maps that add up need one shape"),
        (lambda a: stack([]), "maps that add up need one shape"),
        (lambda a: Matrix(np.ones((3, 3)), (3,), (2, 2)), r"the matrix has shape \(3, 3\) but"),
    ],
)
def test_maps_that_do_not_fit_are_refused(maps, make, message):
    with pytest.raises(GeometryError, match=message):
        make(maps[0])


def test_a_map_is_shown_in_three_lines(maps):
    told = repr(stack(maps, depths=(-1e-3, 0.0, 2e-3)))
    assert told.count("\n") == 2
    assert "2 × 5 pixels of 3 × 3 × 4 samples, 1 m x 1 m apart, depths -1 mm to 2 mm" in told
    assert "MB" in told
    assert "Maps of several planes" in stack(maps)._repr_html_()
