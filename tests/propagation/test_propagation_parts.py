"""Windows, bands, cache, sampling rules and the two evaluations of a zoom's Fourier sums."""

import numpy as np
import pytest
import scipy.fft
from hypothesis import given
from hypothesis import strategies as st

from lumigraph.core.field import Field
from lumigraph.core.grid import Grid
from lumigraph.propagation import propagate, sampling
from lumigraph.propagation.cache import CACHE
from lumigraph.propagation.halves import Halves, both
from lumigraph.propagation.pruned import Band, Transfer, convolve, nonzero_rows
from lumigraph.propagation.window import smooth_size, window_shape
from lumigraph.propagation.zoom import Samples, _chirp_z, _fourier_matrix
from lumigraph.studies.thesis.methods import corrected_cutoff

pytestmark = pytest.mark.filterwarnings(  # noise fills its window, and all of its frequencies
    "ignore:.* of the light left the window:lumigraph.errors.SamplingWarning",
)


@given(n=st.integers(1, 20000), multiple=st.integers(1, 3))
def test_a_smooth_size_is_quick_close_and_a_multiple(n, multiple):
    size = smooth_size(n, multiple)
    assert n <= size <= max(1.1 * n, n + 11)  # 109 to 120, of threes
    assert size % multiple == 0
    rest = size
    for prime in (2, 3, 5, 7, 11):
        while rest % prime == 0:
            rest //= prime
    assert rest == 1


def test_large_powers_of_two_are_passed_over():
    assert [smooth_size(n) for n in (2000, 2048, 4096, 4000)] == [2000, 2058, 4116, 4000]


@given(
    n_in=st.integers(1, 60),
    n_out=st.integers(1, 60),
    first=st.integers(-100, 100),
    pad=st.sampled_from([1.0, 2.5]),
)
def test_no_two_samples_share_a_wrapped_kernel_value(n_in, n_out, first, pad):
    grid, output = Grid((n_in, n_in), 1.0), Grid((n_out, n_out), 1.0)
    size = window_shape(grid, output, pad, (first, first))[0]
    ways = np.arange(first - n_in + 1, first + n_out)
    assert 2 * np.abs(ways).max() < size
    assert size >= (1 + pad) * n_in


def test_an_unpadded_window_is_the_hull_of_both_grids():
    grid = Grid((7, 10), 1.0)
    assert window_shape(grid, grid, 0, (0, 0)) == (7, 10)
    assert window_shape(grid, Grid((7, 10), 1.0), 0, (-3, 5)) == (10, 15)
    assert window_shape(grid, grid, 0, (0, 0), (2, 2)) == (8, 10)


@given(
    ny=st.integers(1, 40), nx=st.integers(1, 40), limit=st.tuples(st.floats(0, 0.6), st.floats(0, 0.6)),
    seed=st.integers(0, 999), extra=st.integers(0, 30),
)  # fmt: skip
def test_pruned_convolution_is_the_full_one(ny, nx, limit, seed, extra):
    rng = np.random.default_rng(seed)
    data = rng.standard_normal((2, ny, nx)) + 1j * rng.standard_normal((2, ny, nx))
    data[:, : rng.integers(ny)] = 0
    window = Grid((ny + extra, nx + extra), 1.0)
    rows, columns = Band.below(window.fy, limit[0]), Band.below(window.fx, limit[1])
    H = rng.standard_normal(window.shape) + 1j
    values = np.ascontiguousarray(columns.take(np.swapaxes(rows.take(H.T), 0, 1)).T)
    inside_y = np.abs(window.fy) <= max(limit[0], 0)
    inside = inside_y[:, None] & (np.abs(window.fx) <= limit[1])
    full = scipy.fft.ifft2(scipy.fft.fft2(data, window.shape) * np.where(inside, H, 0))
    shape = (int(rng.integers(1, ny + extra + 1)), int(rng.integers(1, nx + extra + 1)))
    found = convolve(data, Transfer(values, rows, columns), shape)
    assert np.abs(found - full[:, : shape[0], : shape[1]]).max() < 1e-10 * max(1, np.abs(full).max())


def test_zero_rows_are_found():
    data = np.zeros((6, 3), complex)
    assert nonzero_rows(data) == (6, 6)
    data[2, 1] = data[3, 0] = 1j
    assert nonzero_rows(data) == (2, 4)


@given(n=st.integers(1, 50), m=st.integers(1, 50), seed=st.integers(0, 99), sign=st.sampled_from([1, -1]))
def test_chirp_z_is_the_matrix_product(n, m, seed, sign):
    rng = np.random.default_rng(seed)
    source, target = (Samples(k, float(rng.normal()), float(rng.uniform(0.01, 0.3))) for k in (n, m))
    data = rng.standard_normal((3, n)) + 1j
    expected = data @ np.exp(sign * 2j * np.pi * np.outer(source.values, target.values))
    assert np.abs(_chirp_z(data, source, target, sign) - expected).max() < 1e-9
    assert np.abs(data @ _fourier_matrix(data, source, target, sign) - expected).max() < 1e-10


@given(n=st.integers(1, 12), m=st.integers(1, 12), k=st.integers(1, 9), seed=st.integers(0, 999))
def test_even_and_odd_halves_make_the_whole_kernel(n, m, k, seed):
    rng = np.random.default_rng(seed)
    area, pitch = 633e-9 * 0.1, 1e-5
    here, there = (rng.normal() + np.arange(n)) * pitch, (rng.normal() + np.arange(m)) * 7e-5
    data = np.asfortranarray(rng.standard_normal((2, n, k)) + 1j * rng.standard_normal((2, n, k)))
    kernel = np.exp(1j * np.pi * (there[:, None] - here) ** 2 / area) * pitch / np.sqrt(1j * area)
    found = Halves.of((there, here), pitch, area, data).down(data)
    np.testing.assert_allclose(found, kernel @ data, atol=1e-11 * np.abs(kernel).max())
    across = Halves.of((there, here[:1]), pitch, area, data)
    found = both(Halves.of((there, here), pitch, area, data), data[..., :1], across)
    expected = kernel @ data[..., :1] @ kernel[:, :1].T
    np.testing.assert_allclose(found, expected, atol=1e-11 * np.abs(kernel).max() ** 2)


def test_a_transfer_function_is_built_once_and_only_its_band_is_kept():
    field = Field(np.ones((50, 60), np.complex64), Grid((50, 60), 5e-6), 633e-9)
    CACHE.clear()
    propagate(field, 5e-3)
    once = CACHE.used
    limits = sampling.band_limits(Grid((100, 120), 5e-6), 5e-3, 633e-9)
    kept = [2 * int(limit * n * 5e-6) + 1 for limit, n in zip(limits, (100, 120), strict=True)]
    assert once == 8 * kept[0] * kept[1] < 8 * 100 * 120
    propagate(field, 5e-3)
    assert CACHE.used == once
    for change in ({"distance": 6e-3}, {"pad": 2.0}, {"grid": Grid((50, 60), 5e-6, (5e-6, 0))}):
        propagate(field, **{"distance": 5e-3, **change})
        assert CACHE.used > once
        once = CACHE.used


def test_sampling_rules_in_numbers():
    grid = Grid((1000, 2000), 5e-6)
    assert sampling.fresnel_step(grid, 633e-9) == pytest.approx((39.494e-3, 78.989e-3), rel=1e-4)
    assert sampling.longest_distance(grid, 633e-9) == pytest.approx(39.494e-3, rel=1e-4)
    assert sampling.shortest_distance(grid, 633e-9) == pytest.approx(78.989e-3, rel=1e-4)
    assert sampling.smallest_window(5e-3, 10e-3) == pytest.approx(15e-3)
    assert sampling.lens_pitch(5.2e-3, 150e-6, 633e-9) == pytest.approx(21.944e-6, rel=1e-4)
    assert sampling.intensity_pitch(63.2, 633e-9) == pytest.approx(20.003e-6, rel=1e-4)


def test_the_band_limit_is_where_the_phase_turns_by_half_a_turn_per_sample():
    grid, z, wavelength = Grid.square(600, 5e-6), 0.3, 633e-9
    limit = sampling.band_limits(grid, z, wavelength)[1]
    step = 1 / grid.size[1]
    turns = z / wavelength * np.sqrt(1 - (wavelength * (limit + step * np.array([-0.5, 0.5]))) ** 2)
    assert abs(turns[1] - turns[0]) == pytest.approx(0.5, rel=1e-5)
    assert corrected_cutoff(grid, z, wavelength)[1] == pytest.approx(2 * limit, rel=1e-4)


def test_the_fresnel_phase_error_is_the_next_term_of_the_distance():
    z, r, wavelength = 0.1, 5e-3, 633e-9
    exact = 2 * np.pi / wavelength * (z + r**2 / (2 * z) - np.hypot(z, r))
    assert sampling.fresnel_phase_error(z, r, wavelength) == pytest.approx(exact, rel=2e-3)


@pytest.mark.filterwarnings("ignore:the field is sampled too coarsely:lumigraph.errors.SamplingWarning")
def test_half_of_the_light_reaches_the_focus_at_twice_the_lens_pitch():
    # One-dimensional lens: 0.99 of the power at the right limit, 0.50 at the one printed in the thesis' 2.90.
    # A window of one row, unpadded, holds only fy = 0: a one-dimensional wave.
    focal_length, wavelength, grid = 50e-3, 633e-9, Grid((1, 5000), 5e-6)
    power = {}
    for factor in (1, 2):
        r = factor * wavelength * focal_length / (2 * grid.pitch[1])
        assert sampling.lens_pitch(focal_length, 2 * r, wavelength) == pytest.approx(grid.pitch[1] / factor)
        lens = np.exp(-1j * np.pi * grid.x**2 / (wavelength * focal_length)) * (np.abs(grid.x) <= r)
        image = propagate(Field(lens[None], grid, wavelength), focal_length, "angular_spectrum", pad=0)
        near = np.abs(grid.x) <= 0.1e-3
        power[factor] = image.intensity[0, near].sum() / (np.abs(lens) ** 2).sum()
    assert power[1] == pytest.approx(0.99, abs=0.02)
    assert power[2] == pytest.approx(0.50, abs=0.02)
