import math

import numpy as np
import pytest

from lumigraph.core.arrays import to_numpy
from lumigraph.core.field import Field
from lumigraph.core.grid import Grid
from lumigraph.elements import CircularAperture, RectangularAperture
from lumigraph.errors import GeometryError

GRID = Grid((60, 81), (1e-5, 0.8e-5))


def open_area(stop, grid=GRID):
    return stop.transmission(grid, 633e-9).sum() * math.prod(grid.pitch)


def test_a_grey_circle_is_open_over_its_exact_area():
    # A hard one is off by 3e-3 here.
    stop = CircularAperture(4.13e-4, center=(1.3e-5, -0.7e-5))
    assert open_area(stop) == pytest.approx(math.pi * (4.13e-4) ** 2 / 4, rel=1e-9)


def test_a_grey_rectangle_is_open_over_its_exact_area():
    stop = RectangularAperture((3.21e-4, 1.234e-4), center=(1.3e-5, -0.7e-5))
    assert open_area(stop) == pytest.approx(3.21e-4 * 1.234e-4, rel=1e-9)


@pytest.mark.parametrize("kind", [CircularAperture, RectangularAperture])
@pytest.mark.parametrize("edge", ["grey", "hard"])
def test_an_obstruction_is_the_complement(kind, edge):
    opening = kind(3e-4, edge=edge).transmission(GRID, 1e-6)
    screen = kind(3e-4, edge=edge, obstruction=True).transmission(GRID, 1e-6)
    np.testing.assert_allclose(opening + screen, 1.0, atol=1e-15)


def test_a_hard_edge_is_zero_or_one_by_the_samples_centre():
    grid = Grid.square(11, 1.0)
    hard = CircularAperture(6.0, edge="hard").transmission(grid, 1e-6)
    np.testing.assert_array_equal(hard, (grid.y[:, None] ** 2 + grid.x**2 <= 9) * 1.0)
    rectangle = RectangularAperture((2.0, 4.0), edge="hard").transmission(grid, 1e-6)
    assert rectangle.sum() == 3 * 5


@pytest.mark.parametrize("name", ["complex64", "complex128"])
def test_a_stop_keeps_library_precision_and_input(xp, name):
    data = xp.asarray(np.ones(GRID.shape, name))
    result = CircularAperture(3e-4)(Field(data, GRID, 1e-6))
    assert isinstance(result.data, type(data))
    assert str(result.data.dtype).endswith(name)
    np.testing.assert_array_equal(to_numpy(data), 1)
    expected = CircularAperture(3e-4).transmission(GRID, 1e-6)
    np.testing.assert_allclose(to_numpy(result.data), expected, atol=1e-7)


def test_power_through_a_hard_stop_is_its_open_samples():
    field = Field(np.ones((2, *GRID.shape)), GRID, 1e-6)
    stop = CircularAperture(3e-4, edge="hard")
    np.testing.assert_allclose(stop(field).power, open_area(stop), rtol=1e-12)


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda: CircularAperture(0.0), "diameter is 0 m but must be above 0 m"),
        (lambda: CircularAperture(1.0, edge="soft"), r"edge is 'soft' but must be 'grey' \(area fractions\)"),
        (lambda: RectangularAperture((1.0, -1.0)), "width is -1 m but must be above 0 m"),
        (lambda: RectangularAperture((1.0, 1.0), edge="soft"), "edge is 'soft'"),
    ],
)
def test_impossible_stops_are_refused(build, message):
    with pytest.raises(GeometryError, match=message):
        build()
