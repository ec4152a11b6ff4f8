"""Closed forms of the focused plenoptic camera against Tables 5.2 to 6.1 of the thesis and rays."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lumigraph.design import matching, plenoptic2, resolution
from lumigraph.errors import GeometryError

P, FM, F, Z1 = 150e-6, 5.2e-3, 0.06, 0.12
WAVELENGTH = 632.8e-9
"""With which the cut-offs of Table 5.4 come out to their digit; Table 6.1 was made with 633 nm."""

magnifications = st.one_of(st.floats(0.05, 5.0), st.floats(-0.95, -0.05))


@pytest.mark.parametrize(
    ("m", "a", "b", "diameter"), [(0.5, 15.6, 7.8, 2.3), (0.3, 22.53, 6.76, 2.66), (0.25, 26.0, 6.5, 2.77)]
)
def test_table_5_2(m, a, b, diameter):
    # To 0.01 mm; the printed numbers have one decimal, and 5.3 mm of Table 5.1 would give a = 15.9 mm.
    distance = plenoptic2.lenslet_distance(FM, m)
    assert distance == pytest.approx(b * 1e-3, abs=0.01e-3)
    assert plenoptic2.relay_distance(FM, m) == pytest.approx(a * 1e-3, abs=0.01e-3)
    found = matching.diameters(P, Z1, Z1 + a * 1e-3, distance)
    assert found.matched == pytest.approx(diameter * 1e-3, abs=0.01e-3)


@pytest.mark.parametrize(
    ("m", "main_lobe", "rendered_lobe", "main_cutoff", "rendered_cutoff"),
    [(0.5, 80.0, 160.6, 30390, 15195), (0.3, 69.4, 231.9, 35065, 10520), (0.25, 66.9, 267.6, 36468, 9117)],
)
def test_tables_5_3_and_5_4(m, main_lobe, rendered_lobe, main_cutoff, rendered_cutoff):
    a, b = plenoptic2.relay_distance(FM, m), plenoptic2.lenslet_distance(FM, m)
    f_number = resolution.f_number(Z1, matching.diameters(P, Z1, Z1 + a, b).matched)
    assert f_number == pytest.approx(b / P, rel=1e-12)
    assert 2 * resolution.airy_first_zero(WAVELENGTH, f_number) == pytest.approx(main_lobe * 1e-6, abs=1e-6)
    assert plenoptic2.rendered_lobe(633e-9, P, a) == pytest.approx(rendered_lobe * 1e-6, abs=0.1e-6)
    assert resolution.incoherent_cutoff(WAVELENGTH, f_number) == pytest.approx(main_cutoff, abs=0.6)
    assert plenoptic2.rendered_cutoff(WAVELENGTH, P, m, b) == pytest.approx(rendered_cutoff, abs=0.6)


TABLE_6_1 = [  # m, a, b [m], NA, F#, ν main, ν plenoptic; the thesis' digits, wrong cells corrected
    (0.1, 0.05720, 0.00572, 0.01311, 38.1334, 20713.8832, 2071.3883),
    (0.15, 0.03987, 0.00598, 0.0125, 39.8667, 19813.2797, 2971.9919),
    (0.2, 0.0312, 0.00624, 0.0120, 41.6, 18987.7263, 3797.5452),
    (0.25, 0.0260, 0.0065, 0.01154, 43.3334, 18228.2173, 4557.0543),
    (0.3, 0.02253, 0.00676, 0.0111, 45.0667, 17527.1320, 5258.1396),
    (0.4, 0.0182, 0.00728, 0.0103, 48.5334, 16275.1940, 6510.0776),
    (0.5, 0.0156, 0.0078, 0.0096, 52.0, 15190.1811, 7595.0905),
    (0.6, 0.01387, 0.00832, 0.0090, 55.4667, 14240.7945, 8544.4765),
    (0.75, 0.01213, 0.0091, 0.0082, 60.6667, 13020.1552, 9765.1164),
    (0.9, 0.01098, 0.00988, 0.0076, 65.8666, 11992.2482, 10793.02),
    (0.95, 0.01067, 0.01014, 0.0074, 67.6, 11684.7547, 11100.5169),
    (1.0, 0.0104, 0.0104, 0.0072, 69.3334, 11392.6358, 11392.6358),
]


@pytest.mark.parametrize("row", TABLE_6_1, ids=lambda row: f"m={row[0]}")
def test_table_6_1(row):
    m, a, b, na, f_number, main, plenoptic = row
    distance = plenoptic2.lenslet_distance(FM, m)
    assert distance == pytest.approx(b, abs=0.6e-5)
    assert plenoptic2.relay_distance(FM, m) == pytest.approx(a, abs=0.6e-5)
    working = distance / P
    assert working == pytest.approx(f_number, abs=1e-3)
    assert resolution.numerical_aperture(working) == pytest.approx(na, abs=0.51e-4)
    # The table's cut-offs are coherent ones, with rounded f-numbers.
    assert resolution.coherent_cutoff(633e-9, working) == pytest.approx(main, rel=2e-5)
    assert plenoptic2.rendered_cutoff(633e-9, P, m, distance) / 2 == pytest.approx(plenoptic, rel=2e-5)


@given(magnifications, st.floats(1e-4, 0.1))
def test_lenslets_image_a_to_b(m, focal_length):
    a, b = plenoptic2.relay_distance(focal_length, m), plenoptic2.lenslet_distance(focal_length, m)
    assert 1 / a + 1 / b == pytest.approx(1 / focal_length, rel=1e-9)
    assert b / a == pytest.approx(m, rel=1e-12)


@given(magnifications)
def test_the_focused_plane_has_the_magnification_of_the_array(m):
    length, b = Z1 + plenoptic2.relay_distance(FM, m), plenoptic2.lenslet_distance(FM, m)
    if length > 0:
        assert plenoptic2.magnification_at(F, Z1, length, b) == pytest.approx(m, rel=1e-9)


def test_farther_objects_have_a_longer_relay_and_a_smaller_magnification():
    # z2' = f·0.13/0.07 = 111.43 mm, so a' = 24.17 mm; with b' refocused it would be 0.274.
    assert plenoptic2.magnification_at(F, 0.13, 0.1356, 7.8e-3) == pytest.approx(0.3227, abs=1e-4)


def test_the_patch_tiles_neighbouring_micro_images():
    """Rays through the centres of two neighbouring lenslets: their image points, m times magnified."""
    m, z2 = 0.5, 0.12
    length = z2 + plenoptic2.relay_distance(FM, m)
    apart = (P / length) * z2
    assert plenoptic2.patch(P, m, z2, length) == pytest.approx(m * apart, rel=1e-12)
    assert plenoptic2.patch(P, -m, z2, length) < 0


@pytest.mark.parametrize("m", [0.0, -1.0, -2.0])
def test_impossible_magnifications_are_refused(m):
    with pytest.raises(GeometryError, match=r"magnification is .* above 0 \(Keplerian\) or between -1 and 0"):
        plenoptic2.lenslet_distance(FM, m)


def test_an_object_inside_the_focal_length_has_no_magnification():
    with pytest.raises(GeometryError, match=r"the object is 50 mm .* focal length of 60 mm.* Move it beyond"):
        plenoptic2.magnification_at(F, 0.05, 0.13, 6e-3)


def test_an_image_on_the_lenslets_has_no_magnification():
    with pytest.raises(GeometryError, match=r"falls on the lenslets.* Choose another depth"):
        plenoptic2.magnification_at(F, 0.12, 0.12, 6e-3)


def test_views_are_counted_for_either_sign():
    assert plenoptic2.views_per_axis(0.5) == plenoptic2.views_per_axis(-0.5) == 2.0
