"""Lenslets that differ from each other: each by its own quadrature, against direct sums on a fine grid."""

from dataclasses import replace

import numpy as np
import pytest

import lumigraph as lg
from cameras import focused
from lumigraph.elements import LensletArray, Scatter
from lumigraph.errors import GeometryError
from lumigraph.instruments import Built
from lumigraph.operators.points import points_image
from lumigraph.operators.resampling import averaged
from lumigraph.scene import Diffuser, Scene

POINT = lg.Points(np.array([[20e-6, -30e-6, 1e-3]]), np.ones(1))
WHOLE = Built(focal_length_scatter=0.05, decentre_scatter=3e-6, missing=0.2, seed=4)


def direct(camera, point):
    """Fresnel sums over stop, lenslet plane and image, on grids on which borders fall between samples."""
    ((y, x, dz),) = point.positions
    stop = lg.Grid.square(400, 5e-6)
    plane = lg.Grid((500, 500), (1e-6, 1e-6), (0.5e-6, 0.5e-6))
    image = lg.Grid.square(480, 1.5e-6)

    def carried(light, source, goal, distance):
        k = np.pi / (camera.wavelength * distance)
        down, across = (
            np.exp(1j * k * np.subtract.outer(b, a) ** 2) for a, b in ((source.y, goal.y), (source.x, goal.x))
        )
        return down @ light @ across.T

    k = np.pi / (camera.wavelength * (camera.object_distance + dz))
    light = lg.Field(
        np.exp(1j * k * ((stop.y[:, None] - y) ** 2 + (stop.x - x) ** 2)), stop, camera.wavelength
    )
    light = carried(camera.lens_train()(light).data, stop, plane, camera.separation)
    light = light * camera.lenslet_array().transmission(plane, camera.wavelength)
    seen = np.abs(carried(light, plane, image, camera.lenslet_distance)) ** 2
    return averaged(image, camera.sensor.grid).forward(seen.astype(np.float32))


def off(found, expected):
    """Relative rms difference but for the brightness."""
    share = np.sum(found * expected) / np.sum(expected * expected)
    return np.linalg.norm(found - share * expected) / np.linalg.norm(found)


@pytest.mark.parametrize("built", [Built(focal_length_scatter=0.05), Built(decentre_scatter=3e-6), WHOLE])
def test_a_point_is_what_a_direct_sum_over_these_lenslets_gives(built):
    camera = focused().replace(built=built)
    raw = lg.simulate(camera, Scene([POINT]))
    assert off(np.asarray(raw.data), direct(camera, POINT)) < 5e-4  # 1.7e-4 for alike ones
    assert off(np.asarray(raw.data), direct(focused(), POINT)) > 0.01


def test_without_differences_it_is_the_usual_image():
    plain = focused().optics()
    each = replace(plain, array=replace(plain.array, scatter=Scatter()))
    usual = points_image(plain, POINT, 1e-3)
    assert np.linalg.norm(points_image(each, POINT, 1e-3) - usual) < 1e-6 * np.linalg.norm(usual)


def test_coherent_planes_agree_with_points():
    """A slice with one lit sample is a point."""
    camera = focused().replace(built=WHOLE)
    grid = lg.Grid.square(9, 10e-6)
    picture = np.zeros((9, 9))
    picture[6, 1] = 1.0
    scene = Scene([lg.Slice(picture, grid, 1e-3)])
    flat = lg.simulate(camera, scene, lg.Coherent())
    assert off(np.asarray(flat.data), np.asarray(lg.simulate(camera, Scene([POINT])).data)) < 2e-3


def test_operators_and_white_images_are_refused():
    camera = focused().replace(built=WHOLE)
    with pytest.raises(GeometryError, match="lenslets that differ from each other have no operator"):
        camera.operator()
    with pytest.raises(GeometryError, match="Simulate points"):
        lg.simulate(camera, Scene([Diffuser(1.0)]))
    with pytest.raises(GeometryError, match='model = "paraxial"'):
        lg.simulate(camera.replace(model="exact"), Scene([POINT]))
    with pytest.raises(GeometryError, match=r"missing is 2 but must be from 0 to 0\.99"):
        camera.replace(built={"missing": 2.0})


def test_a_lenslet_has_its_errors_whichever_others_are_asked_for():
    scatter = Scatter(0.02, 2e-6, 0.1, seed=1)
    i, j = np.meshgrid(np.arange(-100, 100), np.arange(-100, 100), indexing="ij")
    factor, down, across, there = scatter.of(i, j)
    assert factor.std() == pytest.approx(0.02, rel=0.02)
    assert down.std() == pytest.approx(2e-6, rel=0.02)
    assert there.mean() == pytest.approx(0.9, abs=0.005)
    for one, other in ((factor, down), (down, across), (factor[1:], factor[:-1]), (factor, there)):
        assert abs(np.corrcoef(one.ravel(), other.ravel())[0, 1]) < 0.02
    alone = scatter.of(np.array([3]), np.array([-7]))
    assert [each[0] for each in alone] == [each[103, 93] for each in (factor, down, across, there)]


def test_a_turned_array_turns_the_decentres():
    grid, basis = lg.Grid.square(61, 5e-6), {"fill_factor": 0.9, "scatter": Scatter(decentre=10e-6, seed=3)}
    straight = LensletArray(lg.Lattice.square(100e-6), 5e-3, **basis).transmission(grid, 600e-9)
    turned = LensletArray(lg.Lattice.square(100e-6, np.pi / 2), 5e-3, **basis).transmission(grid, 600e-9)
    np.testing.assert_allclose(turned, np.rot90(straight, -1), atol=1e-9)
