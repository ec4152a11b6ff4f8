import numpy as np
import pytest

from lumigraph.core.grid import Grid
from lumigraph.errors import GeometryError


def test_the_axis_is_sample_n_over_2_for_odd_and_even_sizes():
    grid = Grid((5, 6), (2.0, 0.5), (10.0, -1.0))
    assert grid.y[5 // 2] == 10.0
    assert grid.x[6 // 2] == -1.0
    np.testing.assert_allclose(np.diff(grid.y), 2.0)
    assert (grid.y.dtype, grid.fx.dtype) == (np.float64, np.float64)


def test_the_extent_reaches_half_a_sample_beyond_the_outer_samples_and_puts_the_first_row_on_top():
    left, right, bottom, top = Grid((2, 3), 1.0).extent
    assert (left, right, bottom, top) == (-1.5, 1.5, 0.5, -1.5)


def test_samples_to_counts_whole_samples_between_two_grids():
    inner, outer = Grid((3, 4), 0.5, (1.0, -0.5)), Grid((20, 21), 0.5)
    iy, ix = inner.samples_to(outer)
    np.testing.assert_allclose(outer.y[iy : iy + 3], inner.y)
    np.testing.assert_allclose(outer.x[ix : ix + 4], inner.x)


def test_samples_to_refuses_other_pitches_and_shifts_by_parts_of_a_sample():
    with pytest.raises(GeometryError, match="different pitches along y: 1 m and 2 m"):
        Grid((4, 4), 1.0).samples_to(Grid((4, 4), 2.0))
    with pytest.raises(GeometryError, match=r"shifted by 0\.3 samples along x"):
        Grid((4, 4), 1.0, (0.0, 0.3)).samples_to(Grid((4, 4), 1.0))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (((0, 4), 1.0), "both numbers must be at least 1"),
        (((4.5, 4), 1.0), "two whole numbers"),
        (((4, 4, 4), 1.0), "two whole numbers"),
        (((4, 4), -1.0), r"pitch \(y\) is -1 m but must be above 0 m"),
        (((4, 4), (1.0, 0.0)), r"pitch \(x\) is 0 m but must be above 0 m"),
        (((4, 4), float("nan")), "must be a finite number"),
        (((4, 4), (1.0, 2.0, 3.0)), "has 3 numbers but must be one, or two"),
        (((4, 4), 1.0, (0.0, float("inf"))), r"center \(x\) is inf but must be a finite number"),
        (((4, 4), True), "must be a finite number"),
    ],
)
def test_a_grid_refuses_what_no_grid_has(arguments, message):
    with pytest.raises(GeometryError, match=message):
        Grid(*arguments)
