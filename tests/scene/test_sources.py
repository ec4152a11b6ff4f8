import math

import numpy as np
import pytest

from lumigraph.core.grid import Grid
from lumigraph.errors import GeometryError, SamplingWarning
from lumigraph.propagation import propagate
from lumigraph.scene.sources import gaussian_beam, plane_wave, point_source

WAVELENGTH = 500e-9


def test_a_plane_wave_turns_its_phase_with_the_sine_of_the_tilt():
    wave = plane_wave(Grid((8, 9), 1e-6), WAVELENGTH, tilt=(0.02, -0.1))
    np.testing.assert_allclose(np.abs(wave.data), 1.0)
    down = np.angle(wave.data[1:] / wave.data[:-1])
    right = np.angle(wave.data[:, 1:] / wave.data[:, :-1])
    np.testing.assert_allclose(down, 4 * math.pi * math.sin(0.02), atol=1e-12)
    np.testing.assert_allclose(right, -4 * math.pi * math.sin(0.1), atol=1e-12)


def test_a_spherical_wave_is_exact_in_phase_and_amplitude():
    grid = Grid((5, 6), 1e-5)
    wave = point_source(grid, WAVELENGTH, 0.3, position=(1e-4, -2e-4))
    r = math.sqrt(0.3**2 + (grid.y[1] - 1e-4) ** 2 + (grid.x[4] + 2e-4) ** 2)
    # Double precision keeps 3.8e6 rad to 1e-9.
    assert wave.data[1, 4] == pytest.approx(np.exp(2j * math.pi * r / WAVELENGTH) / r, rel=1e-8)


def test_near_the_axis_the_paraxial_wave_is_the_spherical_one():
    grid = Grid.square(20, 5e-6)
    exact, paraxial = (point_source(grid, WAVELENGTH, 0.1, paraxial=p).data for p in (False, True))
    # kr⁴/8z³ = 2e-7 rad at 70 um.
    np.testing.assert_allclose(paraxial, exact, rtol=1e-5)


def test_a_spherical_wave_grows_with_distance_as_propagation_says():
    # Only the middle: the window cuts the wave, whose edge diffracts.
    grid = Grid.square(400, 4e-6)
    near = point_source(grid, WAVELENGTH, 20e-3)
    taper = np.exp(-(((grid.y[:, None] ** 2 + grid.x**2) / (0.5e-3) ** 2) ** 4))
    far = propagate(near * taper, 2e-3, "band_limited", pad=1.0).data[190:210, 190:210]
    expected = point_source(grid, WAVELENGTH, 22e-3).data[190:210, 190:210]
    np.testing.assert_allclose(far, expected, rtol=2e-2)


def test_a_negative_distance_converges():
    grid = Grid.square(6, 1e-5)
    out, back = (point_source(grid, WAVELENGTH, z).data for z in (0.1, -0.1))
    np.testing.assert_allclose(back, out.conj())


def test_a_gaussian_beam_has_its_waist():
    grid = Grid((9, 12), 1e-5)
    expected = np.exp(-(grid.y[:, None] ** 2 + grid.x**2) / (40e-6) ** 2)
    np.testing.assert_allclose(gaussian_beam(grid, WAVELENGTH, 40e-6).data, expected, atol=1e-12)


def test_a_gaussian_beam_propagates_into_itself():
    grid = Grid.square(128, 5e-6)
    moved = propagate(gaussian_beam(grid, WAVELENGTH, 60e-6), 15e-3, "band_limited", pad=1.0)
    expected = gaussian_beam(grid, WAVELENGTH, 60e-6, distance=15e-3)
    # Paraxial against exact: kzθ⁴/8 with θ = λ/(πw) = 2.7e-3 is 1e-6 rad; 1 % more distance differs by 1e-2.
    np.testing.assert_allclose(moved.data, expected.data, atol=2e-6)


def test_sources_are_cast_last():
    grid = Grid.square(8, 1e-5)
    for source in (plane_wave, gaussian_beam):
        args = ((0.0, 0.01),) if source is plane_wave else (1e-5,)
        single, double = (
            source(grid, WAVELENGTH, *args, dtype=d).data for d in (np.complex64, np.complex128)
        )
        assert (single.dtype, double.dtype) == (np.complex64, np.complex128)
        np.testing.assert_array_equal(single, double.astype(np.complex64))
    assert point_source(grid, WAVELENGTH, 0.1, dtype=np.complex64).data.dtype == np.complex64


def test_coarse_grids_warn_with_numbers():
    grid = Grid.square(100, 5e-6)
    with pytest.warns(
        SamplingWarning, match=r"a tilted plane wave reaches sin θ = 0\.09983 along x .* up to 0\.05"
    ):
        plane_wave(grid, WAVELENGTH, tilt=(0, 0.1))
    with pytest.warns(SamplingWarning, match="a spherical wave reaches sin θ = 0.2425 along y"):
        point_source(grid, WAVELENGTH, 1e-3)


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (
            lambda g: plane_wave(g, 1e-6, (1.2, 1.2)),
            r"tilt is \(1\.2, 1\.2\) rad: its squared sines add to 1\.737, above",
        ),
        (lambda g: point_source(g, 1e-6, 0.0), "distance is 0 m: the point lies in the grid's plane"),
        (lambda g: gaussian_beam(g, 1e-6, 0.0), "waist is 0 m but must be above 0 m"),
        (lambda g: gaussian_beam(g, -1e-6, 1e-3), "wavelength is -1e-06 m"),
    ],
)
def test_impossible_waves_are_refused(build, message):
    with pytest.raises(GeometryError, match=message):
        build(Grid.square(4, 1e-6))
