"""Images of points by rays: against solid angles, the way of one ray, and waves of short wavelength."""

import numpy as np
import pytest

from lumigraph.elements.objective import Objective
from lumigraph.operators.microscope.building import SampledLenslets, microscope_operator
from lumigraph.operators.microscope.cell import CellSampling, Lenslet
from lumigraph.operators.microscope.kernels import slice_kernel

RAYS = Objective(500e-9, 1.2, 1.35, "rays")
LENSLET = Lenslet(104e-6, 2.4375e-3, 2.4375e-3, 60.0, 104e-6)
SAMPLING = CellSampling(3, 16, 1 / 16)


def image_of(operator, index):
    """Cells (rows, columns) and pixels (N, N) of a point's image."""
    rows, columns = operator.cells
    return operator.psf(index).reshape(rows, 16, columns, 16).transpose(0, 2, 1, 3)


def test_an_even_object_shows_the_solid_angle_of_each_pixel():
    # dΩ = q dq dφ / (n² cos θ) of a source that shines evenly in all directions.
    operator = microscope_operator([RAYS], LENSLET, SampledLenslets((9, 9), SAMPLING), (2e-6,), accuracy=1e-2)
    even = operator.forward(np.ones(operator.shape[1], np.float32))[64:80, 64:80]
    part = ((np.arange(16) - 7.5) / 7.5) ** 2
    sine = (part[:, None] + part) ** 0.5 * 1.2 / 1.35
    inside = part[:, None] + part < 0.85**2
    expected = 1 / np.sqrt(1 - sine[inside] ** 2)
    # Pixels average over their width, which the centres do not: 0.7 % more where 1/cos θ bends most.
    np.testing.assert_allclose(even[inside] / even[7, 7], expected / expected.min(), rtol=7e-3)
    assert (even[part[:, None] + part > 1.2**2] == 0).all()


@pytest.mark.parametrize("dz", [-6e-6, 9e-6])
def test_a_pixel_sees_a_point_through_the_lenslet_on_its_ray(dz):
    operator = microscope_operator([RAYS], LENSLET, SampledLenslets((15, 15), SAMPLING), (dz,), accuracy=1e-2)
    image = image_of(operator, (0, 22, 22))  # on the middle lenslet's axis
    for pixel in (2, 4, 11, 13):
        sine = (pixel - 7.5) / 7.5 * 1.2 / 1.35
        move = dz * sine / np.sqrt(1 - sine**2 - (0.5 / 7.5 * 1.2 / 1.35) ** 2) * 60 / 104e-6
        seen = image[:, 7, pixel, 7]
        # A point fills a third of a lenslet, and a pixel a range of directions.
        assert seen @ np.arange(-7, 8) / seen.sum() == pytest.approx(move, abs=0.25)


def test_rays_are_waves_of_short_wavelength():
    scalar, lenslet = Objective(200e-9, 0.5), Lenslet(125e-6, 2.4e-3, 2.4e-3, 20.0, 125e-6)
    layout = SampledLenslets((5, 5), CellSampling(3, 8, 1 / 8))
    found = [
        microscope_operator([one], lenslet, layout, (9e-6,), accuracy=2e-2).forward(cube(15))
        for one in (scalar, Objective(200e-9, 0.5, model="rays"))
    ]
    assert np.corrcoef(found[0].ravel(), found[1].ravel())[0, 1] > 0.97
    assert found[1].sum() == pytest.approx(found[0].sum(), rel=0.01)


def cube(n):
    volume = np.zeros((1, n, n), np.float32)
    volume[0, 5:8, 6:11] = 1
    return volume


def test_the_adjoint_is_the_transpose_and_slow_lenslets_reach_into_their_neighbours(rng):
    slow = Lenslet(104e-6, 3.5e-3, 3.5e-3, 60.0, 104e-6)
    operator = microscope_operator([RAYS], slow, SampledLenslets((7, 7), SAMPLING), (0.0, 3e-6))
    x, y = rng.random(operator.shape[1]), rng.random(operator.shape[0])
    assert np.vdot(operator.forward(x), y) == pytest.approx(np.vdot(x, operator.adjoint(y)), rel=1e-5)
    light = image_of(operator, (0, 10, 10)).sum((2, 3))
    assert light[3, 3] < 0.75 * light.sum()
    assert light[3, 2] == pytest.approx(light[3, 4])
    assert light[3, 2] > 0.05 * light.sum()


def test_a_closed_part_of_a_lenslet_takes_its_light():
    half = Lenslet(104e-6, 2.4375e-3, 2.4375e-3, 60.0, 104e-6 * 0.6)
    whole, open_part = (slice_kernel([RAYS], one, SAMPLING, 5e-6).blocks.sum() for one in (LENSLET, half))
    assert open_part / whole == pytest.approx(0.36, abs=0.02)
