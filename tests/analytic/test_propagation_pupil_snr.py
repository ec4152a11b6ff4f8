"""The thesis' experiment 3.2: a hard 5 mm pupil against the exact diffraction integral.

SNR = 10 log10(Σ I_ref² / Σ (I - I_ref)²) over a window of 1 cm with 3000² samples.
"""

import warnings
from functools import cache

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

import lumigraph.studies.thesis.methods  # noqa: F401 (adds the thesis' methods, which are tested too)
from lumigraph.core.field import Field
from lumigraph.core.grid import Grid
from lumigraph.errors import SamplingWarning
from lumigraph.propagation import propagate
from lumigraph.units import mm, nm

WAVELENGTH, RADIUS = 633 * nm, 2.5 * mm
WINDOW = Grid.square(3000, 10 * mm / 3000)


@cache
def exact_profile(distance):
    """Rayleigh-Sommerfeld integral over the disk as a spline in r: Gauss in radius, trapezoid in angle.

    No part of the library is used. The phase turns by less than 180 rad over the angle and by less than
    210 rad over the radius, which the numbers of nodes resolve to rounding.
    """
    nodes, weights = np.polynomial.legendre.leggauss(100)
    rho = RADIUS * (nodes + 1) / 2
    weights = weights * RADIUS / 2 * rho
    angles = (np.arange(128) + 0.5) * np.pi / 128
    r, k = np.linspace(0, 7.1 * mm, 420), 2 * np.pi / WAVELENGTH
    field = np.empty(r.shape, complex)
    for i, value in enumerate(r):
        more = (value**2 + rho[:, None] ** 2 - 2 * value * rho[:, None] * np.cos(angles)) / distance**2
        way = distance * np.sqrt(1 + more)
        phase = k * distance * more / (1 + np.sqrt(1 + more))
        kernel = np.exp(1j * phase) * distance / way**2 * (1 - 1 / (1j * k * way))
        field[i] = (weights[:, None] * kernel).sum() * 2 * np.pi / len(angles) / (1j * WAVELENGTH)
    return CubicSpline(r, np.abs(field) ** 2)


def snr(image, distance):
    """Over every third row and column, which stand for all of them to 0.1 dB."""
    reference = exact_profile(distance)(np.hypot(image.grid.y[::3, None], image.grid.x[::3]))
    found = image.intensity[::3, ::3]
    return 10 * np.log10((reference**2).sum() / ((found - reference) ** 2).sum())


def hard_pupil(grid=WINDOW):
    return Field((np.hypot(grid.y[:, None], grid.x) <= RADIUS).astype(np.complex64), grid, WAVELENGTH)


@cache
def grey_pupil():
    """Edge pixels hold the share of their area inside the circle: 8 × 8 points each."""
    grid = WINDOW.resized(1504)
    share = (np.hypot(grid.y[:, None], grid.x) <= RADIUS).astype(np.complex64)
    iy, ix = np.nonzero(np.abs(np.hypot(grid.y[:, None], grid.x) - RADIUS) < grid.pitch[0])
    offsets = (np.arange(8) - 3.5) / 8 * grid.pitch[0]
    y, x = grid.y[iy][:, None, None] + offsets[:, None], grid.x[ix][:, None, None] + offsets
    share[iy, ix] = (np.hypot(y, x) <= RADIUS).mean((1, 2))
    return Field(share, grid, WAVELENGTH)


def unpadded(distance, method):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SamplingWarning)
        return snr(propagate(hard_pupil(), distance, method, pad=0), distance)


def test_the_reference_integral_agrees_with_the_closed_form_on_the_axis():
    s = np.hypot(1.0, RADIUS)
    closed = 1 - 1.0 / s * np.exp(2j * np.pi / WAVELENGTH * (s - 1.0))
    assert float(exact_profile(1.0)(0.0)) == pytest.approx(abs(closed) ** 2, rel=1e-8)


@pytest.mark.parametrize(("distance", "expected"), [(1.0, 27.6), (10.0, 18.0)])
def test_plain_angular_spectrum_without_padding(distance, expected):
    assert unpadded(distance, "angular_spectrum") == pytest.approx(expected, abs=1.5)


@pytest.mark.parametrize("distance", [1.0, 4.0, pytest.param(7.0, marks=pytest.mark.long)])
def test_the_corrected_band_limit_is_worse_than_the_band_limit_without_padding(distance):
    # The thesis says the opposite; both are circles here, as there.
    gain = unpadded(distance, "corrected_band_limited") - unpadded(distance, "band_limited_circular")
    assert -8 < gain < 0


@pytest.mark.parametrize(("distance", "least"), [(1.0, 57), (4.0, 49), (10.0, 43)])
def test_band_limited_on_a_doubled_window(distance, least):
    pupil = hard_pupil()
    assert snr(propagate(pupil, distance, pad=1, grid=pupil.grid), distance) >= least


@pytest.mark.parametrize("distance", [2.0, 4.0, 10.0])
def test_zoom_of_a_grey_pupil(distance):
    # Hard pixels alone cost 25 dB at 2 m; a hard band edge instead of the smooth one costs 20 to 30 dB.
    pupil = grey_pupil()
    image = propagate(pupil, distance, "zoom", grid=Grid.square(500, 20e-6))
    assert snr(image, distance) >= 75
