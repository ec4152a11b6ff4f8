"""Lenslets that differ from each other: each by its own quadrature, against direct sums on a fine grid."""

from dataclasses import replace

import numpy as np
import pytest

import lumigraph as lg
from cameras import focused
from lumigraph.elements import LensletArray, form
from lumigraph.elements.scatter import Scatter
from lumigraph.errors import GeometryError
from lumigraph.instruments import Built
from lumigraph.operators.lenslets.points import points_image
from lumigraph.operators.sampling.resampling import averaged
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


def of_glass():
    plain = focused()
    return plain.replace(lenslets=plain.lenslets.model_copy(update={"index": 1.5}))


def off(found, expected):
    """Relative rms difference but for the brightness."""
    share = np.sum(found * expected) / np.sum(expected * expected)
    return np.linalg.norm(found - share * expected) / np.linalg.norm(found)


@pytest.mark.parametrize(
    "built",
    [
        Built(focal_length_scatter=0.05),
        Built(decentre_scatter=3e-6),
        Built(tilt_scatter=1e-3),
        Built(form_scatter=60e-9, seed=2),
        WHOLE,
    ],
)
def test_a_point_is_what_a_direct_sum_over_these_lenslets_gives(built):
    camera = of_glass().replace(built=built)
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


def test_form_and_tilt_are_the_path_that_is_stated():
    """Written out, lenslet by lenslet, without the tables of the product: Legendre's polynomials by hand."""
    scatter = Scatter(turn=1e-3, form=50e-9, seed=8)
    grid, pitch = lg.Grid((40, 40), (5e-6, 5e-6), (0.0, 0.0)), 100e-6
    alike = LensletArray(lg.Lattice.square(pitch), 5e-3, edge="hard").transmission(grid, 600e-9)
    found = LensletArray(lg.Lattice.square(pitch), 5e-3, edge="hard", scatter=scatter)
    path = np.angle(found.transmission(grid, 600e-9) / alike) * 600e-9 / (2 * np.pi)
    polynomials = (
        lambda x: 1.0, lambda x: x, lambda x: (3 * x**2 - 1) / 2,
        lambda x: (5 * x**3 - 3 * x) / 2, lambda x: (35 * x**4 - 30 * x**2 + 3) / 8,
    )  # fmt: skip
    for k, n in ((3, 7), (20, 20), (31, 25)):
        i, j = (np.floor(at / pitch + 0.5) for at in (grid.y[k], grid.x[n]))
        (warp_y, warp_x, terms), half = scatter.warp(np.array(i), np.array(j)), pitch / 2
        y, x = grid.y[k] - i * pitch, grid.x[n] - j * pitch
        v, u, expected = y / half, x / half, warp_y * y + warp_x * x
        astigmatism = (polynomials[2](v) - polynomials[2](u)) * np.sqrt(5 / 2)
        expected += terms[0] * astigmatism
        others = [
            (a, d - a) for d in (2, 3, 4) for a in range(d, -1, -1) if (a, d - a) not in ((2, 0), (0, 2))
        ]
        for size, (a, b) in zip(terms[1:], others, strict=True):
            expected += (
                size * np.sqrt((2 * a + 1) * (2 * b + 1)) * float(polynomials[a](v) * polynomials[b](u))
            )
        assert path[k, n] == pytest.approx(expected, abs=1e-13)


def test_forms_have_the_rms_that_is_asked_for_and_neither_focus_nor_tilt():
    i, j = np.meshgrid(np.arange(60), np.arange(60), indexing="ij")
    terms = Scatter(form=50e-9, seed=1).warp(i, j).terms.reshape(-1, len(form.TERMS))
    at = (np.arange(200) + 0.5) / 100 - 1
    paths = np.array([form.path(one, at, at) for one in terms[:50]])
    rms = np.sqrt(np.sum(terms**2, -1).mean())
    assert rms == pytest.approx(50e-9, rel=0.02)
    assert np.sqrt((paths**2).mean()) == pytest.approx(np.sqrt(np.sum(terms[:50] ** 2, -1).mean()), rel=1e-3)
    for shape in (at, at[:, None], at**2 + at[:, None] ** 2 - 2 / 3):
        assert np.abs((paths * shape).mean((1, 2))).max() < 1e-3 * 50e-9


def test_a_tilted_sphere_turns_light_by_its_index_less_one():
    """Rays through a spherical cap tilted about its vertex, by Snell's law, beside (n - 1) θ."""
    n, radius, tilt, half = 1.5, 2.5e-3, 4e-3, 20e-6
    centre = -radius * np.array([np.sin(tilt), np.cos(tilt)])  # (y, z) of the sphere; its vertex at (0, 0)
    y = np.linspace(-half, half, 41)
    z = centre[1] + np.sqrt(radius**2 - (y - centre[0]) ** 2)
    normal = np.stack([y - centre[0], z - centre[1]], -1) / radius
    inward = np.array([0.0, 1.0])  # from the substrate, along the axis
    cos = normal @ inward
    bent = n * inward + (np.sqrt(1 - n**2 * (1 - cos**2)) - n * cos)[:, None] * normal
    slope = bent[:, 0] / bent[:, 1]
    turned, focus = np.polynomial.polynomial.polyfit(y, slope, 1)
    assert turned == pytest.approx((1 - n) * tilt, rel=2e-4)  # (half / radius)² of it is spherical aberration
    assert focus == pytest.approx(-(n - 1) / radius, rel=1e-3)


def test_tilts_need_an_index(tmp_path):
    with pytest.raises(
        GeometryError, match=r"index n is not known. Add it under \[lenslets\], such as index = 1.46"
    ):
        focused().replace(built={"tilt_scatter": 1e-3})
    with pytest.raises(GeometryError, match=r"index is 0.9 but must be above 1"):
        focused().replace(lenslets={**focused().lenslets.model_dump(), "index": 0.9})
    camera = of_glass().replace(built={"tilt_scatter": 1e-3, "form_scatter": 2e-8})
    assert camera.scatter == Scatter(turn=0.5e-3, form=2e-8)
    path = tmp_path / "camera.toml"
    path.write_text(camera.to_toml())
    assert type(camera).from_toml(path) == camera


def test_a_turned_array_turns_the_decentres():
    grid, basis = (
        lg.Grid.square(61, 5e-6),
        {
            "fill_factor": 0.9,
            "scatter": Scatter(decentre=10e-6, seed=3, turn=1e-3, form=50e-9),
        },
    )
    straight = LensletArray(lg.Lattice.square(100e-6), 5e-3, **basis).transmission(grid, 600e-9)
    turned = LensletArray(lg.Lattice.square(100e-6, np.pi / 2), 5e-3, **basis).transmission(grid, 600e-9)
    np.testing.assert_allclose(turned, np.rot90(straight, -1), atol=1e-9)
