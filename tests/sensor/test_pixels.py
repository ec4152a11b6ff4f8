import math

import numpy as np
import pytest

from lumigraph.core.arrays import to_numpy
from lumigraph.core.grid import Grid
from lumigraph.errors import GeometryError
from lumigraph.sensor import Sensor, integrate
from lumigraph.sensor.pixels import integrate_adjoint

GRID = Grid((30, 41), (1e-6, 0.8e-6), (2e-6, -1e-6))


def wave(grid, periods, phase=(0.0, 0.0)):
    """Product of two cosines that fit the grid's window."""
    along = [
        1 + 0.5 * np.cos(2 * math.pi * k * (c - c[0]) / w + p)
        for k, c, w, p in zip(periods, (grid.y, grid.x), grid.size, phase, strict=True)
    ]
    return np.outer(*along)


@pytest.mark.parametrize("pitch", [(3e-6, 2e-6), (0.37e-6, 0.21e-6)])
def test_a_wave_keeps_its_phase_and_loses_a_sinc_of_contrast(pitch):
    pixels = Grid((5, 7), pitch, GRID.center)
    mean = integrate(wave(GRID, (3, 5), (0.4, 1.0)), GRID, pixels, turned=False)
    sides = []
    for k, axis, phase in ((3, 0, 0.4), (5, 1, 1.0)):
        f, c = k / GRID.size[axis], (pixels.y, pixels.x)[axis]
        start = (GRID.y, GRID.x)[axis][0]
        sides.append(1 + 0.5 * np.sinc(f * pitch[axis]) * np.cos(2 * math.pi * f * (c - start) + phase))
    np.testing.assert_allclose(mean, np.outer(*sides), rtol=1e-12)


@pytest.mark.parametrize("shape", [(30, 41), (7, 13), (60, 33)])
def test_pixels_that_tile_the_window_keep_the_total(shape, rng):
    # Window from the first sample's outer edge to the last's.
    left, right, bottom, top = GRID.extent
    pitch = (bottom - top) / shape[0], (right - left) / shape[1]
    center = top + (shape[0] // 2 + 0.5) * pitch[0], left + (shape[1] // 2 + 0.5) * pitch[1]
    image = rng.random(GRID.shape)
    pixels = integrate(image, GRID, Grid(shape, pitch, center), turned=False)
    assert pixels.sum() * math.prod(pitch) == pytest.approx(image.sum() * math.prod(GRID.pitch), rel=1e-12)


def test_an_even_light_stays_even_and_ends_with_the_window():
    pixels = integrate(np.ones((10, 10)), Grid.square(10, 1.0), Grid.square(16, 1.0), turned=False)
    np.testing.assert_allclose(pixels[3:13, 3:13], 1.0, atol=1e-12)
    # Beyond the window it is dark, not repeated.
    outside = np.ones((16, 16), bool)
    outside[3:13, 3:13] = False
    assert (pixels[outside] == 0).all()


def test_pixels_that_reach_out_of_the_window_keep_the_part_inside():
    pixels = integrate(np.ones((1, 8)), Grid((1, 8), 1.0), Grid((1, 4), (1.0, 3.0), (0.0, 0.0)), turned=False)
    # Window from -4.5 to 3.5; pixels of 3 about -6, -3, 0 and 3.
    np.testing.assert_allclose(pixels[0], [0, 1, 1, 2 / 3], atol=1e-12)


def test_a_readout_is_turned_by_180_degrees_about_the_axis():
    grid, sensor = Grid.square(33, 1e-6), Sensor((11, 11), 3e-6)
    image = np.exp(-((grid.y[:, None] - 6e-6) ** 2 + (grid.x + 9e-6) ** 2) / (3e-6) ** 2)
    upright, physical = integrate(image, grid, sensor), integrate(image, grid, sensor, turned=False)
    assert np.unravel_index(physical.argmax(), (11, 11)) == (5 + 2, 5 - 3)
    assert np.unravel_index(upright.argmax(), (11, 11)) == (5 - 2, 5 + 3)
    np.testing.assert_allclose(upright, physical[::-1, ::-1], atol=1e-12)


def test_an_even_number_of_pixels_turns_about_the_axis_too():
    grid, sensor = Grid.square(40, 1e-6), Sensor((10, 10), 3e-6)
    image = np.exp(-((grid.y[:, None] - 6e-6) ** 2 + (grid.x + 9e-6) ** 2) / (3e-6) ** 2)
    assert np.unravel_index(integrate(image, grid, sensor).argmax(), (10, 10)) == (5 - 2, 5 + 3)


@pytest.mark.parametrize("turned", [True, False])
def test_the_adjoint_is_the_adjoint(rng, turned):
    pixels = Grid((9, 14), (2.3e-6, 1.7e-6))
    image, values = rng.normal(size=(2, *GRID.shape)), rng.normal(size=(2, 9, 14))
    forward = (integrate(image, GRID, pixels, turned=turned) * values).sum()
    back = (image * integrate_adjoint(values, GRID, pixels, turned=turned)).sum()
    assert forward == pytest.approx(back, rel=1e-12)


@pytest.mark.parametrize("name", ["float32", "float64"])
def test_integration_keeps_library_precision_and_batch(xp, name, rng):
    image = rng.random((2, *GRID.shape)).astype(name)
    array = xp.asarray(image)
    result = integrate(array, GRID, Sensor((6, 8), 4e-6))
    assert isinstance(result, type(array))
    assert str(result.dtype).endswith(name)
    expected = integrate(image.astype(float), GRID, Sensor((6, 8), 4e-6))
    np.testing.assert_allclose(to_numpy(result), expected, rtol=1e-5)


def test_other_shapes_are_refused():
    with pytest.raises(GeometryError, match=r"intensity has shape \(4, 4\) but the grid has \(30, 41\)"):
        integrate(np.ones((4, 4)), GRID, Sensor((4, 4), 1e-6))
    with pytest.raises(GeometryError, match=r"values have shape \(5, 4\) but the sensor has \(4, 4\) pixels"):
        integrate_adjoint(np.ones((5, 4)), GRID, Sensor((4, 4), 1e-6))
