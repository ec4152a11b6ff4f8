"""f-numbers and what diffraction leaves, against integrals and the thesis' numbers."""

import numpy as np
import pytest
from scipy.special import j1

from lumigraph.design import resolution
from lumigraph.errors import GeometryError


def test_the_airy_zero_is_a_zero_of_the_airy_pattern():
    assert abs(j1(np.pi * resolution.AIRY_ZERO)) < 1e-12


def test_numerical_aperture_is_the_sine_of_the_half_angle_for_slow_lenses():
    f_number = 50.0
    assert resolution.numerical_aperture(f_number) == pytest.approx(
        np.sin(np.arctan(0.5 / f_number)), rel=1e-4
    )


def test_first_zero_of_the_thesis_2f_system():
    # 48.8 um for 5 mm, 67.8 um for 3.6 mm (the thesis prints 67 um for 5 mm).
    assert resolution.airy_first_zero(633e-9, 0.316 / 5e-3) == pytest.approx(48.8e-6, abs=0.05e-6)
    assert resolution.airy_first_zero(633e-9, 0.316 / 3.6e-3) == pytest.approx(67.8e-6, abs=0.05e-6)


def test_the_coherent_cutoff_is_half_the_incoherent_one():
    assert 2 * resolution.coherent_cutoff(5e-7, 8.0) == resolution.incoherent_cutoff(5e-7, 8.0) == 250_000.0


def test_depth_of_field_ends_at_a_quarter_wave():
    wavelength, f_number = 633e-9, 20.0
    dz = resolution.depth_of_field(wavelength, f_number) / 2
    sag = dz / (8 * f_number**2)  # of the wavefront at the edge of the pupil, small angles
    assert sag == pytest.approx(wavelength / 4, rel=1e-12)


@pytest.mark.parametrize("function", [resolution.incoherent_cutoff, resolution.airy_first_zero])
def test_f_numbers_must_be_above_zero(function):
    with pytest.raises(GeometryError, match=r"f_number is 0 but must be above 0\.$"):
        function(633e-9, 0.0)
