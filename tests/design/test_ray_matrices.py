"""Ray matrices of a plane, the bench's lenslets and its light."""

import math

import numpy as np
import pytest

from lumigraph.design import illumination, plenoptic2, ray_matrices, thin_lens
from lumigraph.errors import GeometryError


def test_a_lenslet_relays_the_image_by_its_magnification_and_turns_directions_the_other_way():
    matrix = ray_matrices.relay(15.6e-3, 7.8e-3, 5.2e-3)
    assert matrix == pytest.approx(np.array([[-0.5, 0], [-1 / 5.2e-3, -2]]), abs=1e-12)
    assert ray_matrices.inverse(matrix) == pytest.approx(np.linalg.inv(matrix))


def test_the_prescription_of_the_bench_has_the_focal_length_of_its_file():
    n, thickness, gap = 1.51515, 4e-3, 0.5e-3  # BK7 at 630 nm
    radius = thin_lens.plano_convex_focal_length(1.0, n) ** -1 * 0.12
    plane = ray_matrices.surface(math.inf, n, 1), ray_matrices.surface(math.inf, 1, n)
    whole = ray_matrices.system(
        plane[1], ray_matrices.free_space(thickness, n), ray_matrices.surface(-radius, n, 1),
        ray_matrices.free_space(gap), ray_matrices.surface(radius, 1, n),
        ray_matrices.free_space(thickness, n), plane[0],
    )  # fmt: skip
    assert -1 / whole[1, 0] == pytest.approx(0.06, rel=0.005)  # what a camera file may be off


def test_light_is_kept_by_every_system():
    def radiance(x, p):
        return np.exp(-((x / 1e-4) ** 2) - (p / 0.01) ** 2)

    behind = ray_matrices.through(
        ray_matrices.system(ray_matrices.free_space(5e-3), ray_matrices.lens(8e-3)), radiance
    )
    x, p = np.linspace(-1e-3, 1e-3, 801), np.linspace(-0.2, 0.2, 801)
    before, after = (ray_matrices.intensity(each, x, p).sum() for each in (radiance, behind))
    assert after == pytest.approx(before, rel=1e-6)


def test_what_no_system_has_is_refused():
    with pytest.raises(GeometryError, match=r"determinant 2 but a ray matrix is \(2, 2\) with 1"):
        ray_matrices.inverse(np.diag([1.0, 2.0]))
    with pytest.raises(GeometryError, match="focal_length is 0 m but must not be"):
        ray_matrices.lens(0.0)
    with pytest.raises(GeometryError, match="radius is 0 m but must not be 0"):
        ray_matrices.surface(0.0, 1.0, 1.5)


def test_the_stages_have_the_settings_of_table_6_1():
    for m, c, d in ((0.1, 5.72e-3, 51.48e-3), (0.5, 7.8e-3, 7.8e-3), (1.0, 10.4e-3, 0.0)):
        assert plenoptic2.translators(5.2e-3, m) == pytest.approx((c, d), abs=1e-9)


def test_a_lenslet_of_silica_has_the_focal_length_that_its_height_gives():
    radius = thin_lens.sag_radius(1.184e-6, 150e-6)
    assert radius - math.sqrt(radius**2 - 75e-6**2) == pytest.approx(1.184e-6, rel=1e-6)
    assert thin_lens.plano_convex_focal_length(radius, 1.457) == pytest.approx(5.2e-3, rel=1e-3)
    with pytest.raises(GeometryError, match="index is 1 but a lens in air needs more"):
        thin_lens.plano_convex_focal_length(radius, 1.0)
    with pytest.raises(GeometryError, match="rises by half of that at most"):
        thin_lens.sag_radius(1e-4, 1e-4)


def test_points_a_coherence_width_apart_are_a_first_zero_apart():
    """The lamp's disc has the degree 2 J1(v)/v, whose first zero is 0.61 λ/NA."""
    import lumigraph as lg

    width = illumination.coherence_width(630e-9, 0.01)
    assert lg.ExtendedSource.disc(0.01).degree(0.0, width, 630e-9) == pytest.approx(0, abs=1e-4)
    lamp = illumination.koehler(10e-3, 27e-3, 240e-3, 120e-3)
    assert lamp.source_image == pytest.approx(10e-3 * 240 / 27)
