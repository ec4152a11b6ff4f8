"""Measures of images against closed forms."""

import math

import numpy as np
import pytest
from scipy.special import j1

from lumigraph import analysis
from lumigraph.core.arrays import to_numpy
from lumigraph.core.grid import Grid
from lumigraph.errors import GeometryError, LumigraphError, SamplingError


def airy(r):
    v = np.pi * np.abs(r)
    return np.square(np.divide(2 * j1(v), v, out=np.ones_like(v), where=v > 0))


def test_snr_of_a_known_error(xp):
    reference = np.ones((4, 5))
    assert analysis.snr(xp.asarray(reference * 1.1), xp.asarray(reference)) == pytest.approx(20.0)
    assert analysis.snr(xp.asarray(reference), xp.asarray(reference)) == math.inf


def test_rms_error_forgets_the_scale_only_if_asked(rng):
    reference = rng.random((6, 7))
    assert analysis.rms_error(3 * reference, reference) == pytest.approx(0, abs=1e-12)
    assert analysis.rms_error(3 * reference, reference, scaled=False) == pytest.approx(2.0)


@pytest.mark.parametrize(
    ("image", "reference", "message"),
    [(np.ones(3), np.ones(4), r"shape \(3,\) but the reference \(4,\)"),
     (1j * np.ones(3), np.ones(3), "complex"), (np.ones(3), np.zeros(3), "zero everywhere")],
)  # fmt: skip
def test_images_that_cannot_be_compared(image, reference, message):
    with pytest.raises(LumigraphError, match=message):
        analysis.snr(image, reference)


def test_first_zero_of_an_airy_pattern_between_samples(xp):
    # Ten samples to the zero at 1.2197: a parabola through three of them would give 1.239.
    x = np.arange(-30, 31) * 0.125
    assert analysis.first_zero(xp.asarray(x), xp.asarray(airy(x))) == pytest.approx(1.21967, abs=1e-3)
    assert analysis.first_zero(x + 5, airy(x)) == pytest.approx(1.21967, abs=1e-3)  # from the peak


def test_first_zero_needs_a_minimum():
    with pytest.raises(SamplingError, match=r"no minimum between its peak at 0 and its end at 0\.4"):
        analysis.first_zero(np.arange(5) * 0.1, airy(np.arange(5) * 0.1))


def test_profiles_need_as_many_positions_as_values():
    with pytest.raises(LumigraphError, match=r"as many positions as values.*\(4,\) and \(5,\)"):
        analysis.first_zero(np.arange(4), np.arange(5))


def test_full_width_of_a_gaussian_and_its_levels():
    x = np.linspace(-3, 3, 601)
    profile = np.exp(-(x**2))
    assert analysis.full_width(x, profile) == pytest.approx(2 * math.sqrt(math.log(2)), abs=1e-4)
    assert analysis.full_width(x, profile, math.exp(-1)) == pytest.approx(2.0, abs=1e-4)


def test_full_width_refuses_a_half_profile_and_an_impossible_level():
    with pytest.raises(SamplingError, match=r"below 0\.5 of its maximum on both sides"):
        analysis.full_width(np.arange(4), np.array([1.0, 0.7, 0.2, 0.0]))
    with pytest.raises(LumigraphError, match=r"level is 1\.5 but must lie between 0 and 1"):
        analysis.full_width(np.arange(4), np.ones(4), 1.5)


def test_contrast_of_a_grating_over_a_broken_number_of_periods(xp):
    x = np.arange(137) * 0.013
    profile = 2 + 0.6 * np.cos(2 * np.pi * 3.1 * x + 0.7)
    assert analysis.contrast(xp.asarray(profile), 3.1, 0.013) == pytest.approx(0.3, abs=1e-9)
    bars = (np.arange(1000) // 10 % 2).astype(float)
    assert analysis.contrast(bars, 0.05, 1.0) == pytest.approx(4 / np.pi, rel=0.01)


@pytest.mark.parametrize(("frequency", "pitch"), [(0.6, 1.0), (0.01, 1.0)])
def test_contrast_needs_a_period_and_two_samples_for_it(frequency, pitch):
    with pytest.raises(SamplingError, match="at least one period and two samples"):
        analysis.contrast(np.ones(10), frequency, pitch)


@pytest.mark.parametrize("axis", [-1, -2])
def test_mtf_of_a_round_pupil(xp, axis):
    # Goodman 6-32. The square of the psf (thesis 5.21) would have a curve 0.1 lower in the middle.
    n, pitch = 256, 0.25
    x = (np.arange(n) - n // 2) * pitch
    psf = airy(np.hypot(x[:, None], x))
    f, values = analysis.mtf(xp.asarray(psf), pitch, axis)
    s = np.minimum(f, 1)
    theory = 2 / np.pi * (np.arccos(s) - s * np.sqrt(1 - s**2))
    assert to_numpy(values) == pytest.approx(theory, abs=0.012)  # light outside of the window
    assert type(values) is type(xp.asarray(psf))
    assert analysis.cutoff(f, values, 0.1) == pytest.approx(0.805, abs=0.02)


def test_mtf_keeps_single_precision_and_the_slice_along_one_axis():
    psf = np.zeros((8, 8), np.float32)
    psf[4, 3:5] = 1
    assert analysis.mtf(psf, 1.0)[1].dtype == np.float32
    assert analysis.mtf(psf, 1.0, -2)[1] == pytest.approx(1.0)
    assert analysis.mtf(psf, 1.0, -1)[1][-1] == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize(
    ("psf", "axis", "message"),
    [(np.ones(3), -1, r"shape \(3,\) and axis is -1"), (np.ones((3, 3)), 0, "axis is 0"),
     (1j * np.ones((3, 3)), -1, "complex"), (np.zeros((3, 3)), -1, "no light")],
)  # fmt: skip
def test_mtf_refuses(psf, axis, message):
    with pytest.raises(LumigraphError, match=message):
        analysis.mtf(psf, 1.0, axis)


def test_cutoff_refuses_a_curve_that_stays_up():
    with pytest.raises(SamplingError, match=r"does not fall below 0\.01 between 0 and 2"):
        analysis.cutoff(np.arange(3.0), np.ones(3))


def test_centroid_and_encircled_energy_of_an_airy_pattern():
    grid = Grid((301, 301), (0.05, 0.05), (1.0, -2.0))
    y, x = grid.y[:, None] - 1.0, grid.x + 2.0
    image = airy(np.hypot(y, x))
    assert analysis.centroid(image, grid) == pytest.approx((1.0, -2.0), abs=1e-9)
    found = analysis.encircled_energy(image, grid, 1.21967)
    # 0.838 of all light, 0.972 of which is in this window.
    assert found == pytest.approx(0.838 / 0.972, abs=0.01)
    assert analysis.encircled_energy(image, grid, 1.0, (1.0, 3.0)) < 0.01


def test_the_radius_of_encircled_energy_is_a_length():
    assert analysis.encircled_energy(np.ones((5, 5)), Grid.square(5, 2.0), 2.0) == pytest.approx(5 / 25)


def test_point_measures_refuse():
    grid = Grid.square(3, 1.0)
    with pytest.raises(GeometryError, match=r"shape \(2, 3\) but the grid \(3, 3\)"):
        analysis.centroid(np.ones((2, 3)), grid)
    with pytest.raises(LumigraphError, match="no light"):
        analysis.centroid(np.zeros((3, 3)), grid)
    with pytest.raises(LumigraphError, match="complex"):
        analysis.encircled_energy(1j * np.ones((3, 3)), grid, 1.0)
