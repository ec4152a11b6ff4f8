"""What every method shares: power, inversion, adjoint, shifts, windows, array libraries."""

import warnings
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import lumigraph.studies.thesis.methods  # noqa: F401 (adds the thesis' methods, which are tested too)
from lumigraph.core.arrays import to_numpy
from lumigraph.core.field import Field
from lumigraph.core.grid import Grid
from lumigraph.errors import SamplingWarning
from lumigraph.propagation import METHODS, Propagate, propagate
from lumigraph.propagation.angular_spectrum import transfer_function

pytestmark = pytest.mark.filterwarnings(  # noise fills its window, and all of its frequencies
    "ignore:.* of the light left the window:lumigraph.errors.SamplingWarning",
)

WAVELENGTH = 633e-9
SPECTRAL = ("angular_spectrum", "band_limited", "band_limited_circular", "corrected_band_limited")
SAME_PITCH = (*SPECTRAL, "multi_step_fresnel")


def noise(rng, shape, dtype=np.complex128):
    return (rng.standard_normal(shape) + 1j * rng.standard_normal(shape)).astype(dtype)


def quiet(*args, **kwargs):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SamplingWarning)
        return propagate(*args, **kwargs)


def close(a, b, tolerance):
    assert np.linalg.norm(to_numpy(a) - to_numpy(b)) <= tolerance * np.linalg.norm(to_numpy(b))


@pytest.mark.parametrize("method", ["angular_spectrum", "multi_step_fresnel"])
def test_power_and_field_come_back_on_a_periodic_window(method, rng):
    # Without band limit and padding the transfer function is a pure phase: exact to rounding.
    field = Field(noise(rng, (48, 60)), Grid((48, 60), 8e-6), WAVELENGTH)
    there = quiet(field, 30e-3, method, pad=0)
    assert float(there.power) == pytest.approx(float(field.power), rel=1e-12)
    close(quiet(there, -30e-3, method, pad=0).data, field.data, 1e-12)


@pytest.mark.parametrize("method", METHODS)
def test_a_smooth_beam_keeps_its_power_and_comes_back(method):
    grid = Grid.square(120, 10e-6)
    beam = np.exp(-((grid.y[:, None] - 30e-6) ** 2 + grid.x**2) / (0.15e-3) ** 2)
    field = Field(beam.astype(complex), grid, WAVELENGTH)
    own = {"grid": grid} if method in ("zoom", "fresnel") else {}
    there = quiet(field, 38e-3, method, **own)
    assert float(there.power) == pytest.approx(float(field.power), rel=1e-8)
    close(quiet(there, -38e-3, method, **own).data, field.data, 1e-5)


@settings(max_examples=20, deadline=None)
@given(
    method=st.sampled_from(sorted(METHODS)),
    shape=st.tuples(st.integers(1, 24), st.integers(1, 24)),
    distance=st.floats(1e-3, 0.5),
    seed=st.integers(0, 2**16),
)
def test_propagation_is_linear(method, shape, distance, seed):
    rng, grid = np.random.default_rng(seed), Grid(shape, 9e-6)
    a, b = noise(rng, shape), noise(rng, shape)
    own = {"grid": Grid((7, 9), 11e-6)} if method == "zoom" else {}
    parts = [quiet(Field(x, grid, WAVELENGTH), distance, method, **own).data for x in (a, b, a - 2j * b)]
    assert np.allclose(parts[2], parts[0] - 2j * parts[1], rtol=0, atol=1e-10 * np.abs(parts).max() + 1e-300)


@pytest.mark.parametrize("method", SAME_PITCH)
@pytest.mark.parametrize("shape", [(40, 56), (41, 55)])
def test_going_back_is_the_adjoint(method, shape, rng):
    # <P x, y> = <x, P* y> with input and output windows of different size and place. A real or unconjugated
    # adjoint fails by order one; evanescent waves, which do not come back, need p < λ/2.
    grid = Grid(shape, 7e-6)
    output = Grid((30, 70), 7e-6, (21e-6, -14e-6))
    x, y = noise(rng, shape), noise(rng, output.shape)
    # corrected_band_limited takes its circle from the input's width: the adjoint needs windows of one width
    if method == "corrected_band_limited":
        output, y = grid, noise(rng, shape)
    forth = quiet(Field(x, grid, WAVELENGTH), 20e-3, method, pad=0, grid=output).data
    back = quiet(Field(y, output, WAVELENGTH), -20e-3, method, pad=0, grid=grid).data
    left, right = np.vdot(y, forth), np.vdot(back, x)
    assert abs(left - right) < 1e-12 * np.linalg.norm(x) * np.linalg.norm(y)


@pytest.mark.parametrize("method", METHODS)
def test_shifting_the_input_shifts_the_output(method, rng):
    data, moved = noise(rng, (20, 26)), (16e-6, -40e-6)
    here, there = Grid((20, 26), 8e-6), Grid((20, 26), 8e-6, moved)
    grids = ({}, {}) if method != "zoom" else ({"grid": here}, {"grid": there})
    a = quiet(Field(data, here, WAVELENGTH), 5e-3, method, **grids[0])
    b = quiet(Field(data, there, WAVELENGTH), 5e-3, method, **grids[1])
    close(b.data, a.data, 1e-9)
    assert b.grid.center == pytest.approx(moved)


@pytest.mark.parametrize("method", SAME_PITCH)
@pytest.mark.parametrize("pad", [0, 0.5, 1, 2])
def test_an_output_window_is_a_crop_of_the_whole(method, pad, rng):
    grid = Grid((50, 47), 6e-6)
    field = Field(noise(rng, grid.shape), grid, WAVELENGTH)
    part = Grid((21, 16), 6e-6, (-24e-6, 36e-6))
    whole, some = (quiet(field, 12e-3, method, pad=pad, grid=g).data for g in (grid, part))
    top, left = part.samples_to(grid)
    close(some, whole[top : top + 21, left : left + 16], 1e-12)


@pytest.mark.parametrize("method", SPECTRAL)
@pytest.mark.parametrize("distance", [0.0, 2e-4, 12e-3])  # all frequencies pass, or few
@pytest.mark.parametrize("pad", [0, 1])
def test_every_few_samples_are_those_of_the_whole(method, distance, pad, rng, xp):
    grid = Grid((50, 48), 6e-6)
    field = Field(xp.asarray(noise(rng, grid.shape)), grid, WAVELENGTH)
    few = Grid((13, 9), (12e-6, 24e-6), (-24e-6, 18e-6))
    whole, some = (quiet(field, distance, method, pad=pad, grid=g) for g in (grid, few))
    top, left = (
        round((few_axis[0] - axis[0]) / 6e-6) for few_axis, axis in ((few.y, grid.y), (few.x, grid.x))
    )
    close(some.data, to_numpy(whole.data)[top : top + 26 : 2, left : left + 36 : 4], 1e-12)
    assert some.grid == few


@pytest.mark.parametrize("method", ["fresnel", "zoom"])
def test_a_grid_of_its_own_computes_only_the_asked_points(method, rng):
    grid = Grid((30, 37), 6e-6)
    field = Field(noise(rng, grid.shape), grid, WAVELENGTH)
    whole, part = Grid((40, 41), 9e-6), Grid((5, 6), 9e-6, (-18e-6, 27e-6))
    top, left = part.samples_to(whole)
    a, b = (quiet(field, 12e-3, method, grid=g).data for g in (whole, part))
    close(b, a[top : top + 5, left : left + 6], 1e-12 if method == "fresnel" else 0.05)


def test_a_larger_window_sees_what_a_padded_input_sees(rng):
    # Output beyond the input on all sides: the same linear convolution as with zeros around the input.
    small, large = Grid((24, 30), 8e-6), Grid((60, 64), 8e-6)
    data = np.exp(-(small.y[:, None] ** 2 + small.x**2) / (30e-6) ** 2) * (1 + 0j)
    padded = np.zeros(large.shape, complex)
    top, left = small.samples_to(large)
    padded[top : top + 24, left : left + 30] = data
    a = propagate(Field(data, small, WAVELENGTH), 4e-3, grid=large)
    b = propagate(Field(padded, large, WAVELENGTH), 4e-3)
    close(a.data, b.data, 1e-5)


def test_light_does_not_wrap_round_on_a_doubled_window():
    # A point at the edge: unpadded, as much light arrives on the far side; padded, what really goes there.
    grid = Grid((1, 200), 5e-6)
    edge = np.zeros(grid.shape, complex)
    edge[0, 0] = 1
    field = Field(edge, grid, WAVELENGTH)
    far = {pad: quiet(field, 2e-3, pad=pad).intensity[0, 150:].sum() for pad in (0, 1)}
    assert far[1] < 0.02 * far[0]


@pytest.mark.parametrize("distance", [50e-3, 2e-3])
def test_multi_step_fresnel_is_the_unpadded_paraxial_angular_spectrum(distance, rng):
    # The identity of whole and part steps with exp(-iπλz f²) at even N; 2e-13 here, 1e-11 asked for.
    grid = Grid((40, 64), (6e-6, 7e-6))
    data = noise(rng, grid.shape)
    f2 = grid.fy[:, None] ** 2 + grid.fx**2
    carrier = np.exp(2j * np.pi * np.fmod(distance / WAVELENGTH, 1))
    expected = np.fft.ifft2(np.fft.fft2(data) * np.exp(-1j * np.pi * WAVELENGTH * distance * f2)) * carrier
    found = quiet(Field(data, grid, WAVELENGTH), distance, "multi_step_fresnel", pad=0)
    assert np.abs(found.data - expected).max() < 1e-11


@pytest.mark.parametrize("distance", [3e-3, 40e-3, -40e-3])
def test_zoom_agrees_with_band_limited_on_a_common_grid(distance):
    # Smooth beam, so that both band edges are dark; chirp-z and matrix product on the way.
    grid = Grid((150, 160), 6e-6, (12e-6, 0.0))
    x0 = 60e-6
    beam = np.exp(-(grid.y[:, None] ** 2 + (grid.x - x0) ** 2) / (80e-6) ** 2 + 2j * np.pi * 8e3 * grid.x)
    field, output = Field(beam, grid, WAVELENGTH), Grid((90, 100), 6e-6, (0.0, 120e-6))
    close(
        propagate(field, distance, "zoom", grid=output).data,
        propagate(field, distance, grid=output).data,
        2e-5,
    )


@pytest.mark.parametrize("distance", [40e-3, -40e-3])
def test_zoom_follows_a_tilted_beam_off_the_axis(distance):
    # Ray optics: the centre moves by z tan θ, here 1.27 mm, three windows away.
    grid, tilt = Grid.square(80, 5e-6), 5e4
    wave = np.exp(-(grid.y[:, None] ** 2 + grid.x**2) / (60e-6) ** 2 + 2j * np.pi * tilt * grid.x)
    sine = WAVELENGTH * tilt
    centre = distance * sine / np.sqrt(1 - sine**2)
    output = Grid((101, 101), 5e-6, (0.0, centre))
    image = propagate(Field(wave, grid, WAVELENGTH), distance, "zoom", grid=output)
    assert float(image.power / Field(wave, grid, WAVELENGTH).power) > 0.99
    assert np.average(output.x, weights=image.intensity.sum(0)) == pytest.approx(centre, abs=1e-6)


@pytest.mark.parametrize("method", SPECTRAL)
def test_each_method_keeps_the_frequencies_it_says(method):
    # A point's spectrum is flat, so that the spectrum of its image is the transfer function itself.
    grid, distance = Grid((80, 100), 5e-6), 40e-3
    point = np.zeros(grid.shape, complex)
    point[0, 0] = 1
    found = np.fft.fft2(quiet(Field(point, grid, WAVELENGTH), distance, method, pad=0).data)
    free = [1 / (WAVELENGTH * np.hypot(2 * distance / size, 1)) for size in grid.size]
    wide = [size / (WAVELENGTH * distance) for size in grid.size]
    y, x = np.abs(grid.fy)[:, None], np.abs(grid.fx)
    kept = {
        "angular_spectrum": (y >= 0) & (x >= 0),
        "band_limited": (y <= free[0]) & (x <= free[1]),
        "band_limited_circular": (y / free[0]) ** 2 + (x / free[1]) ** 2 <= 1,
        "corrected_band_limited": (y / wide[0]) ** 2 + (x / wide[1]) ** 2 <= 1,
    }[method]
    assert np.array_equal(np.abs(found) > 0.5, kept)
    phase = 2j * np.pi * distance / WAVELENGTH * np.sqrt(1 - (WAVELENGTH * y) ** 2 - (WAVELENGTH * x) ** 2)
    assert np.abs(found - np.where(kept, np.exp(phase), 0)).max() < 1e-8


def test_zoom_computes_a_finer_shifted_window_of_a_gaussian_beam():
    grid, waist, distance = Grid.square(120, 10e-6), 0.15e-3, 38e-3
    field = Field(np.exp(-(grid.y[:, None] ** 2 + grid.x**2) / waist**2) + 0j, grid, WAVELENGTH)
    fine = Grid((33, 40), (1.7e-6, 2.3e-6), (70e-6, -90e-6))
    q = 1 / (1 + 1j * distance * WAVELENGTH / (np.pi * waist**2))
    expected = q * np.exp(-(fine.y[:, None] ** 2 + fine.x**2) / waist**2 * q)
    expected = expected * np.exp(2j * np.pi * np.fmod(distance / WAVELENGTH, 1))
    close(propagate(field, distance, "zoom", grid=fine).data, expected, 1e-6)


def test_one_step_onto_its_own_pitch_and_onto_that_grid_agree(rng):
    grid = Grid((30, 41), (8e-6, 9e-6), (5e-6, -8e-6))
    field = Field(noise(rng, grid.shape), grid, WAVELENGTH)
    for distance in (9e-3, -9e-3):
        own = propagate(field, distance, "fresnel")
        close(quiet(field, distance, "fresnel", grid=own.grid).data, own.data, 1e-11)


def test_evanescent_waves_decay_forwards_and_are_dropped_backwards():
    f = np.array([0.0, 1 / WAVELENGTH, 2 / WAVELENGTH])
    ahead, back = (transfer_function(f, np.zeros(1), z, WAVELENGTH)[:, 0] for z in (1e-6, -1e-6))
    assert ahead[2] == pytest.approx(np.exp(-2 * np.pi * 1e-6 / WAVELENGTH * np.sqrt(3)))
    assert back[2] == 0
    assert back[:2] == pytest.approx(ahead[:2].conj())


def test_the_phase_of_the_transfer_function_keeps_float64_precision():
    # The phase in exact fractions; computed in float32 it would be wrong by radians at 10 m.
    z, wavelength, f = 10.0, 633e-9, 2.5e4
    s = Fraction(wavelength) ** 2 * Fraction(f) ** 2
    series = 1 - s / 2 - s**2 / 8 - s**3 / 16 - 5 * s**4 / 128
    turns = Fraction(z) / Fraction(wavelength) * series
    expected = np.exp(2j * np.pi * float(turns % 1))
    assert abs(transfer_function(np.array([f]), np.zeros(1), z, wavelength)[0, 0] - expected) < 1e-8


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("single", [True, False])
def test_every_array_library_gives_the_same_in_its_own_type(xp, method, single, rng):
    data = noise(rng, (2, 18, 21))
    grid = Grid((18, 21), 9e-6)
    own = {"grid": Grid((9, 25), 9e-6 if method != "zoom" else 7e-6)}
    expected = quiet(Field(data, grid, WAVELENGTH), 8e-3, method, **own).data
    array = xp.asarray(data.astype(np.complex64 if single else np.complex128))
    before = to_numpy(array).copy()
    found = quiet(Field(array, grid, WAVELENGTH), 8e-3, method, **own).data
    assert type(found) is type(array)
    assert found.dtype == array.dtype
    assert tuple(found.shape) == (2, 9, 25)
    close(found, expected, 2e-6 if single else 1e-12)
    assert np.array_equal(to_numpy(array), before)


@pytest.mark.parametrize("method", METHODS)
def test_pytorch_differentiates_through_every_method(method, rng):
    torch = pytest.importorskip("torch", reason="PyTorch is not installed (make torch)")
    grid = Grid((6, 7), 9e-6)
    data = torch.asarray(noise(rng, grid.shape), dtype=torch.complex128).requires_grad_()

    def power(x):
        return quiet(Field(x, grid, WAVELENGTH), 3e-3, method, grid=Grid((5, 6), 9e-6)).intensity.sum()

    assert torch.autograd.gradcheck(power, (data,))


@pytest.mark.parametrize("method", [m for m in METHODS if m not in ("fresnel", "zoom")])
def test_zero_distance_only_crops_and_pads(method, rng):
    field = Field(noise(rng, (6, 8)), Grid((6, 8), 1e-5), WAVELENGTH)
    assert propagate(field, 0, method) is field
    other = Grid((9, 6), 1e-5, (-1e-5, 2e-5))  # two rows before, one after, one column after
    found = propagate(field, 0.0, method, grid=other)
    assert found.grid == other
    expected = np.zeros((9, 6), complex)
    top, left = other.samples_to(field.grid)
    for i in range(9):
        for j in range(6):
            if 0 <= i + top < 6 and 0 <= j + left < 8:
                expected[i, j] = field.data[i + top, j + left]
    assert np.array_equal(found.data, expected)


def test_the_element_is_the_verb(rng):
    field = Field(noise(rng, (12, 14)), Grid((12, 14), 1e-5), WAVELENGTH)
    element = Propagate(1e-3, "band_limited", 0.5, Grid((5, 5), 1e-5))
    assert np.array_equal(element(field).data, propagate(field, 1e-3, pad=0.5, grid=Grid((5, 5), 1e-5)).data)
