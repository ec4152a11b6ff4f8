"""The lens equation, there and back."""

import math

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from lumigraph.design import thin_lens
from lumigraph.errors import GeometryError

lengths = st.floats(1e-3, 10.0)
ratios = st.floats(1.001, 1000.0)


@given(lengths, ratios)
def test_object_and_image_distance_undo_each_other(f, ratio):
    z1 = f * ratio
    assert thin_lens.object_distance(f, thin_lens.image_distance(f, z1)) == pytest.approx(z1, rel=1e-9)


@given(lengths, ratios)
def test_the_focal_length_follows_from_both_distances(f, ratio):
    z2 = thin_lens.image_distance(f, f * ratio)
    assert thin_lens.focal_length(f * ratio, z2) == pytest.approx(f, rel=1e-9)


@given(lengths, st.floats(0.01, 100.0), st.floats(0.1, 10.0))
def test_distances_scale_with_all_lengths(f, ratio, scale):
    assume(abs(ratio - 1) > 1e-3)
    here, there = (
        thin_lens.image_distance(f, f * ratio),
        thin_lens.image_distance(f * scale, f * ratio * scale),
    )
    assert there == pytest.approx(here * scale, rel=1e-9)


def test_newton_form_holds():
    f, z1 = 0.05, 0.17
    assert (z1 - f) * (thin_lens.image_distance(f, z1) - f) == pytest.approx(f * f, rel=1e-12)


def test_a_near_object_has_a_virtual_image():
    assert thin_lens.image_distance(0.06, 0.03) == pytest.approx(-0.06)


def test_unit_magnification_at_twice_the_focal_length():
    assert thin_lens.magnification(0.316, thin_lens.image_distance(0.158, 0.316)) == 1.0


def test_an_object_in_the_focal_plane_is_refused():
    with pytest.raises(
        GeometryError, match=r"the object stands in the focal plane \(60 mm\).* Move the object"
    ):
        thin_lens.image_distance(0.06, 0.06)


def test_an_image_in_the_focal_plane_is_refused():
    with pytest.raises(
        GeometryError, match=r"the image stands in the focal plane \(60 mm\).* Move the image"
    ):
        thin_lens.object_distance(0.06, 0.06)


@pytest.mark.parametrize("bad", [0.0, -0.1, math.nan, math.inf])
def test_focal_lengths_must_be_above_zero(bad):
    with pytest.raises(GeometryError, match=r"focal_length is .* must be"):
        thin_lens.image_distance(bad, 0.1)
