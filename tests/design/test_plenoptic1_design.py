"""Closed forms of the plenoptic camera 1.0 against Table 4.1 of the thesis and rays."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lumigraph.design import matching, plenoptic1
from lumigraph.errors import GeometryError

F, Z1 = 0.12, 0.24


@pytest.mark.parametrize(
    ("dz", "alpha"), [(-0.05, 0.7368), (-0.025, 0.8837), (0.025, 1.0943), (0.05, 1.1724)]
)
def test_refocus_factors_of_the_thesis(dz, alpha):
    # Four printed digits; the printed equation 4.14 with s = 1 would give 0.8684 for the first.
    assert plenoptic1.refocus_factor(F, Z1, dz) == pytest.approx(alpha, abs=1e-4)


@given(st.floats(-0.9, 10.0))
def test_the_2f_form_is_the_general_one_at_unit_magnification(part):
    dz = part * F
    expected = (2 * F + 2 * dz) / (2 * F + dz)
    assert plenoptic1.refocus_factor(F, 2 * F, dz) == pytest.approx(expected, rel=1e-12)


@given(st.floats(1.05, 20.0), st.floats(1.05, 50.0))
def test_defocus_undoes_the_refocus_factor(near, other):
    z1, dz = F * near, F * (other - near)
    alpha = plenoptic1.refocus_factor(F, z1, dz)
    assert plenoptic1.defocus(F, z1, alpha) == pytest.approx(dz, abs=1e-9 * F * other**2)


def test_table_4_1():
    assert matching.diameters(150e-6, 0.24, 0.24, 0.01)[:2] == pytest.approx((3.6e-3, 3.6e-3), rel=1e-12)
    assert plenoptic1.micro_image_pitch(150e-6, 0.24, 0.01) == pytest.approx(156.25e-6, rel=1e-12)
    assert plenoptic1.resolvable_directions(633e-9, 150e-6, 0.01) == pytest.approx(2.9, abs=0.05)
    assert plenoptic1.angular_resolution(240 / 3.6, 30) == pytest.approx(5.0e-4, rel=1e-9)
    assert plenoptic1.diffraction_angle(633e-9, 150e-6) == pytest.approx(4.2e-3, abs=0.05e-3)


@given(st.floats(3e-7, 2e-6), st.floats(1e-4, 0.1))
def test_the_smallest_lenslet_resolves_two_directions(wavelength, focal_length):
    d = plenoptic1.smallest_lenslet(wavelength, focal_length)
    assert plenoptic1.resolvable_directions(wavelength, d, focal_length) == pytest.approx(2.0, rel=1e-12)


def test_an_object_inside_the_focal_length_is_refused():
    with pytest.raises(
        GeometryError, match=r"the object is 110 mm .* inside its focal length of 120 mm.* Use"
    ):
        plenoptic1.refocus_factor(F, Z1, -0.13)


def test_a_focused_plane_inside_the_focal_length_is_refused():
    with pytest.raises(GeometryError, match="the focused plane is 100 mm"):
        plenoptic1.refocus_factor(F, 0.1, 0.1)


def test_a_factor_beyond_infinity_is_refused():
    with pytest.raises(
        GeometryError, match=r"refocus factor 2.5 is beyond infinity.* have 2\. Use a smaller"
    ):
        plenoptic1.defocus(F, Z1, 2.5)
