"""Closed forms of the light-field microscope, against values of the literature and limits."""

import math

import pytest

from lumigraph.design import microscope as design
from lumigraph.errors import GeometryError

WAVE, NA, INDEX, M, PITCH = 593e-9, 1.2, 1.35, 60.0, 100e-6


def test_the_magnification_of_an_objective_is_for_its_makers_tube_lens():
    assert design.tube_lens("zeiss") == 0.165
    assert design.objective_focal_length(40, design.tube_lens("Olympus")) == pytest.approx(4.5e-3)


def test_an_unknown_maker_is_told_the_known_ones():
    with pytest.raises(
        GeometryError, match=r"maker 'Foo' is not known\. Give its focal length, or one of Nikon"
    ):
        design.tube_lens("Foo")


def test_an_aperture_above_the_index_is_refused():
    with pytest.raises(
        GeometryError, match=r"aperture 1\.4 is not below the medium's refractive index 1\.33"
    ):
        design.sine(1.4, 1.33)


def test_lenslets_of_the_matched_f_number_fill_their_pitch_with_the_pupil():
    # The marginal ray leaves the native image at NA/M: over f_µ it moves by half a pitch.
    f = design.matched_f_number(NA, M) * PITCH
    assert NA / M * f == pytest.approx(PITCH / 2)


@pytest.mark.parametrize(("na", "n", "zero"), [(0.5, 1.0, 3.920), (0.8, 1.33, 1.964), (1.2, 1.33, 0.703)])
def test_the_axial_zero_is_near_that_of_the_debye_integral(na, n, zero):
    # Closed form: light even over cos θ. The paraxial 2nλ/NA² is 7 % off already at NA 0.5.
    assert design.axial_resolution(525e-9, na, n) * 1e6 == pytest.approx(zero, rel=0.015)


def test_the_axial_resolution_is_paraxial_for_small_apertures():
    """1 - cos θ was 0 where an index of 1e9 stood in a camera file."""
    assert design.axial_resolution(500e-9, 1.2, 1e9) == pytest.approx(2e9 * 500e-9 / 1.2**2, rel=1e-12)
    assert design.axial_resolution(500e-9, 0.05, 1.0) == pytest.approx(2 * 500e-9 / 0.05**2, rel=1e-3)


def test_the_band_limit_is_sparrows_distance_of_a_lenslet_seen_from_that_depth():
    dz = 20e-6
    aperture = PITCH / M / (2 * dz)
    period = 2 * 0.47 * WAVE / aperture / 2  # two points half a period apart just merge
    assert 1 / design.band_limit(WAVE, M, PITCH, dz) == pytest.approx(2 * period / 2 * 1, rel=1e-12)
    assert design.band_limit(WAVE, M, PITCH, -2 * dz) == pytest.approx(
        design.band_limit(WAVE, M, PITCH, dz) / 2
    )


def test_the_band_limit_says_nothing_near_the_focused_plane():
    near = design.near_field(WAVE, M, PITCH)
    assert near == pytest.approx((PITCH / M) ** 2 / (2 * WAVE))
    with pytest.raises(
        GeometryError, match=r"dz is 1 µm but the band limit holds from 2\.342 µm on either side"
    ):
        design.band_limit(WAVE, M, PITCH, 1e-6)


def test_a_plane_is_sampled_once_per_lenslet_as_long_as_a_points_light_is_not_wider():
    def distance(dz):
        return design.sampling_distance(WAVE, (NA, INDEX), PITCH / M, dz)

    edge = PITCH / M / (2 * math.tan(math.asin(NA / INDEX)))
    assert distance(0.0) == distance(0.99 * edge) == distance(-edge) == PITCH / M
    assert distance(1.01 * edge) == pytest.approx(WAVE / (4 * NA))
    assert distance(20e-6) == pytest.approx(1 / design.band_limit(WAVE, M, PITCH, 20e-6) / 2)


def test_a_low_pass_falls_from_a_lenslet_to_what_is_sampled():
    def width(dz):
        return design.low_pass_distance(WAVE, (NA, INDEX), PITCH / M, dz)

    edge = PITCH / M / (2 * math.tan(math.asin(NA / INDEX)))
    assert width(0.5 * edge) == PITCH / M
    assert width(-2.5 * edge) == pytest.approx(PITCH / M / 2)
    assert width(5 * edge) == design.sampling_distance(WAVE, (NA, INDEX), PITCH / M, 5 * edge)


def test_fourier_lenslets_share_field_and_resolution():
    relay, pitch, f = 75e-3, 1.25e-3, 25e-3
    assert design.fourier_field(relay, 20, pitch, f) == pytest.approx(pitch * relay / (20 * f))
    # A lenslet as wide as the pupil has the resolution of the objective, λ / (2 NA).
    whole = 2 * relay * 0.5 / 20
    assert design.fourier_resolution(525e-9, relay, 20, whole) == pytest.approx(525e-9 / (2 * 0.5))


def test_directions_and_refocus_range_grow_with_the_lenslet():
    few, many = (design.directions(WAVE, NA, M, p) for p in (50e-6, 100e-6))
    assert many == pytest.approx(2 * few)
    assert design.refocus_range(WAVE, NA, INDEX, many) > 3 * design.refocus_range(WAVE, NA, INDEX, few)


def test_depth_of_field_adds_the_detectors_share():
    alone = design.depth_of_field(WAVE, NA, INDEX)
    assert design.depth_of_field(WAVE, NA, INDEX, 1e-6) - alone == pytest.approx(INDEX * 1e-6 / NA)
