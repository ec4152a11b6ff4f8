import math

import numpy as np
import pytest

from lumigraph.core.arrays import to_numpy
from lumigraph.core.field import Field
from lumigraph.core.grid import Grid
from lumigraph.elements import ThinLens
from lumigraph.errors import GeometryError, SamplingWarning
from lumigraph.propagation import propagate
from lumigraph.scene.sources import gaussian_beam, plane_wave, point_source

WAVELENGTH = 633e-9


def test_a_gaussian_beam_is_focused_as_its_complex_radius_says():
    # q' = q / (1 - q/f) behind the lens, then q' + z: Siegman, Lasers, table 20.1.
    grid, f, waist = Grid.square(240, 9e-6), 60e-3, 0.3e-3
    beam = gaussian_beam(grid, WAVELENGTH, waist, distance=0.1)
    z = 0.8 * f
    q = 0.1 - 1j * math.pi * waist**2 / WAVELENGTH
    behind = 1 / (1 / q - 1 / f) + z
    radius = math.sqrt(WAVELENGTH / math.pi / (1 / behind).imag)
    image = propagate(ThinLens(f)(beam), z, "band_limited", pad=1.0).intensity
    expected = np.exp(-2 * (grid.y[:, None] ** 2 + grid.x**2) / radius**2)
    expected *= float(beam.power) * 2 / (math.pi * radius**2)
    # Paraxial against exact propagation: kzθ⁴/8 = 7e-4 rad at 1/e². A lens of f + 1 % is off by 4 %.
    np.testing.assert_allclose(image, expected, atol=1e-3 * expected.max())


def test_a_lens_images_a_point_two_focal_lengths_away_upside_down():
    grid, f = Grid.square(300, 6e-6), 40e-3
    source = point_source(grid, WAVELENGTH, 2 * f, position=(100e-6, -60e-6))
    image = propagate(ThinLens(f, diameter=1.2e-3)(source), 2 * f, "band_limited", pad=1.0).intensity
    y, x = (np.average(axis, weights=image.sum(1 - k) ** 2) for k, axis in enumerate((grid.y, grid.x)))
    assert (y, x) == pytest.approx((-100e-6, 60e-6), abs=0.5e-6)


def test_a_lens_only_turns_phases_inside_its_stop():
    grid = Grid.square(64, 5e-6)
    factor = ThinLens(20e-3, diameter=200e-6).transmission(grid, WAVELENGTH)
    assert np.abs(factor).sum() * 25e-12 == pytest.approx(math.pi * 1e-8, rel=1e-9)
    np.testing.assert_allclose(
        np.angle(factor[32, 32:40]), -math.pi * (np.arange(8) * 5e-6) ** 2 / (WAVELENGTH * 20e-3), atol=1e-12
    )


def test_a_decentred_lens_is_the_lens_moved():
    here, there = ThinLens(20e-3, 1e-4), ThinLens(20e-3, 1e-4, center=(3e-5, -2e-5))
    moved = np.roll(here.transmission(Grid.square(64, 5e-6), WAVELENGTH), (6, -4), (0, 1))
    np.testing.assert_allclose(there.transmission(Grid.square(64, 5e-6), WAVELENGTH), moved, atol=1e-9)


@pytest.mark.parametrize("name", ["complex64", "complex128"])
def test_a_lens_keeps_library_and_precision(xp, name):
    grid = Grid.square(16, 5e-6)
    data = xp.asarray(np.ones((16, 16), name))
    result = ThinLens(20e-3)(Field(data, grid, WAVELENGTH)).data
    assert isinstance(result, type(data))
    assert str(result.dtype).endswith(name)
    expected = ThinLens(20e-3).transmission(grid, WAVELENGTH)
    # Cast last: the rounding of complex64, not the error of a phase computed in it.
    np.testing.assert_allclose(to_numpy(result), expected, atol=1e-7 if name == "complex64" else 0)


def test_a_coarse_grid_warns_with_numbers_and_the_limit_does_not():
    lens = ThinLens(10e-3, diameter=1e-3)  # λf/(2r) = 6.33 um
    with pytest.warns(
        SamplingWarning, match=r"a lens of f = 10 mm and radius 0\.5 mm has samples 7 µm apart .*"
    ):
        lens(plane_wave(Grid.square(200, 7e-6), WAVELENGTH))
    with pytest.warns(SamplingWarning, match=r"along y but needs 6\.33 µm. Use a finer grid"):
        lens(plane_wave(Grid.square(200, 7e-6), WAVELENGTH))
    lens(plane_wave(Grid.square(200, 6.32e-6), WAVELENGTH))
    # Without a stop, or with one larger than the field, the field's own half width counts.
    ThinLens(10e-3)(plane_wave(Grid.square(100, 7e-6), WAVELENGTH))


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda: ThinLens(0.0), "focal_length is 0 m. Give a length"),
        (lambda: ThinLens(math.inf), "focal_length is inf but must be a finite number"),
        (lambda: ThinLens(0.1, -1.0), "diameter is -1 m but must be above 0 m"),
        (lambda: ThinLens(0.1, edge="soft"), "edge is 'soft'"),
    ],
)
def test_impossible_lenses_are_refused(build, message):
    with pytest.raises(GeometryError, match=message):
        build()
