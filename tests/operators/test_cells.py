"""Cells of a lenslet array: they tile it, hold its lattice, and are sampled finely enough."""

import math
from functools import partial

import numpy as np
import pytest

import cameras
from lumigraph.core.lattice import Lattice
from lumigraph.elements import RectangularAperture, Train
from lumigraph.errors import GeometryError, SamplingError
from lumigraph.instruments import SingleLensCamera
from lumigraph.operators.sampling import cells
from lumigraph.operators.sampling.cells import Cells
from lumigraph.operators.sampling.sampling_rules import SamplingRules
from lumigraph.units import mm, nm, um

focused = partial(cameras.focused, count=(5, 4))


def of(camera):
    return cells.cells_of(camera.optics(), cells.lenslet_array(camera.optics()), SamplingRules(1e-3))


def test_samples_stand_evenly_inside_their_cells():
    found = Cells((2.0, 3.0), (-4.0, 1.0), (3, 2), (4, 6), (5, 7))
    grid = found.grid(found.points, 1.0, (0, 1))
    np.testing.assert_allclose(grid.y, -4 + (np.arange(12) + 0.5) * 2 / 4)
    np.testing.assert_allclose(grid.x, 1 - 3 + (np.arange(24) + 0.5) * 3 / 6)
    turned = found.grid(found.samples, -2.0, (0, 0))
    assert turned.center[0] == pytest.approx(-2 * (-4 + (15 // 2 + 0.5) * 2 / 5))
    np.testing.assert_allclose(turned.pitch, (2 * 2 / 5, 2 * 3 / 7))


@pytest.mark.parametrize(
    ("lenslets", "size"),
    [
        ({}, (100 * um, 100 * um)),
        ({"layout": "hex"}, (math.sqrt(3) * 100 * um, 100 * um)),
        (
            {"layout": "hex", "focal_length": (5 * mm, 5.2 * mm, 5.4 * mm)},
            (math.sqrt(3) * 100 * um, 300 * um),
        ),
    ],
)
def test_a_cell_repeats_the_lattice_with_its_kinds(lenslets, size):
    camera = focused(**lenslets)
    found, lattice = of(camera), cells.lenslet_array(camera.optics()).lattice
    np.testing.assert_allclose(found.size, size)
    pairs = lattice.indices((-300 * um, 300 * um), (-400 * um, 400 * um))
    kinds = lattice.kind(pairs[:, 0], pairs[:, 1])
    for step in ((size[0], 0), (0, size[1])):
        moved = np.stack(lattice.index(*(lattice.position(pairs) + step).T), axis=-1)
        np.testing.assert_allclose(lattice.position(moved), lattice.position(pairs) + step, atol=1e-12)
        np.testing.assert_array_equal(lattice.kind(moved[:, 0], moved[:, 1]), kinds)


@pytest.mark.parametrize(
    "lenslets", [{}, {"count": (4, 6)}, {"offset": (20 * um, -30 * um)}, {"layout": "hex"}]
)
def test_cells_cover_the_array(lenslets):
    camera = focused(**lenslets)
    found, extent = of(camera), cells.lenslet_array(camera.optics()).extent
    for edge, size, n, whole in zip(found.edge, found.size, found.count, extent, strict=True):
        assert edge <= -whole / 2 + size / 2 + 1e-9
        assert edge + n * size >= whole / 2 - size / 2 - 1e-9


HEX = {"layout": "hex", "focal_length": (5 * mm, 5.2 * mm, 5.4 * mm), "offset": (13 * um, -20 * um)}


@pytest.mark.parametrize("lenslets", [{"layout": "hex"}, HEX, HEX | {"count": (4, 7), "rotation": 0.02}])
def test_each_lenslet_of_a_hexagonal_array_stands_amid_a_brick_of_its_kind(lenslets):
    camera = focused(**lenslets).optics()
    array = cells.lenslet_array(camera)
    found, (tall, wide) = cells.bricks_of(camera, array, SamplingRules(1e-3)), array.extent
    assert all(n % 2 == 0 for n in (found.points[1], found.samples[1]))
    pairs = array.lattice.indices((-tall / 2, tall / 2), (-wide / 2, wide / 2))
    kinds, seen = array.lattice.kind(pairs[:, 0], pairs[:, 1]), set()
    for (y, x), kind in zip(array.lattice.position(pairs), kinds, strict=True):
        row = (y - found.edge[0]) / found.size[0] - 0.5
        column = (x - found.edge[1]) / found.size[1] - 0.5 - round(row) % 2 / 2
        assert abs(row - round(row)) + abs(column - round(column)) < 1e-6
        i, j = round(row) + found.ring[0], round(column) + found.ring[1]
        odd = round(row) % 2
        assert i in found.rows(found.ring[0], found.ring[0] + found.count[0], odd)
        assert j in found.columns(found.ring[1], found.ring[1] + found.count[1], odd, int(kind) % found.kinds)
        seen.add((i, j))
    assert len(seen) == len(pairs)
    for kind in range(found.kinds):
        i, j = array.lattice.index(*(np.array(c) for c in found.middle(kind)))
        assert array.lattice.kind(i, j) % found.kinds == kind
        np.testing.assert_allclose(array.lattice.position(np.array([i, j])), found.middle(kind), atol=1e-12)


def test_points_hold_what_the_main_lens_resolves():
    """λL/(2D), half again as close; an even number of them."""
    camera = focused()
    found = of(camera)
    finest = camera.wavelength * camera.separation / camera.pupil_diameter / 2 / 1.5
    assert found.size[0] / found.points[0] <= finest < found.size[0] / (found.points[0] - 2)
    assert found.points[0] % 2 == 0


def test_the_ring_is_as_wide_as_light_reaches_and_the_sensor_sees():
    """One cell beside micro-images that abut; more where they overlap, but none that no pixel sees."""
    camera = focused()
    assert of(camera).ring == (1, 1)
    assert of(camera.replace(sensor={"pixel_pitch": 6 * um, "shape": (400, 100)})).ring == (2, 1)
    wide = camera.replace(main_lens={"focal_length": 60 * mm, "diameter": 8 * mm})
    assert cells.spill(camera.optics()) == 0
    width = 8 * mm * camera.lenslet_distance / camera.separation
    assert cells.spill(wide.optics()) == pytest.approx((width - 1.25 * camera.lenslets.pitch) / 2)
    assert of(wide).ring == (2, 2)  # its sensor is as large as what geometry asks for
    assert of(wide.replace(sensor={"pixel_pitch": 6 * um, "shape": (400, 400)})).ring == (4, 4)


def test_the_telecentric_image_is_nearer():
    """b L/(L + b): the lens formula of a lens of focal length L."""
    camera = focused()
    b = camera.lenslet_distance
    assert 1 / cells.telecentric_distance(camera.optics()) == pytest.approx(1 / b + 1 / camera.separation)


def test_a_blur_is_that_of_geometry():
    """At z + dz the image is at v; rays from the pupil meet the lenslets at D/2 |v - L|/v."""
    camera, distance = focused(), 125 * mm
    v = 1 / (1 / (60 * mm) - 1 / distance)
    expected = camera.pupil_diameter / 2 * abs(v - camera.separation) / v
    assert cells.blur(camera.optics(), distance) == pytest.approx(expected)


def test_an_aberrated_lens_blurs_as_its_rays_do():
    """Defocus as a Zernike term is defocus: c sqrt(3) (2ρ² - 1) takes the place of π r² (1/z' - 1/z)/λ."""
    camera, further = focused(), 130 * mm
    waves = camera.pupil_diameter**2 / 8 * (1 / further - 1 / camera.object_distance)
    waves /= 2 * math.sqrt(3) * camera.wavelength
    aberrated = camera.replace(main_lens={"focal_length": 60 * mm, "aberrations": {4: waves}})
    expected = cells.blur(camera.optics(), further)
    assert cells.blur(aberrated.optics(), camera.object_distance) == pytest.approx(expected, rel=1e-3)


def test_a_lens_that_may_not_be_round_is_refused_before_turned_lenslets(monkeypatch):
    camera = focused(rotation=0.1)
    train = Train((*camera.lens_train().elements, RectangularAperture((1 * mm, 2 * mm))))
    monkeypatch.setattr(type(camera), "lens_train", lambda _: train)
    with pytest.raises(GeometryError, match=r"RectangularAperture, which may not be round.* 0\.1 rad"):
        cells.lens(camera.optics())


@pytest.mark.parametrize("lattice", [Lattice.square(2.0, 0.3, (0.4, -0.7)), Lattice.hex(2.0, -0.2)])
def test_a_straightened_lattice_has_its_rows_along_x(lattice):
    found = cells.straight(lattice)
    sin, cos = math.sin(lattice.rotation), math.cos(lattice.rotation)
    y, x = lattice.position(np.array([[1, 2], [-3, 1], [0, 0]])).T
    np.testing.assert_allclose(
        found.position(np.array([[1, 2], [-3, 1], [0, 0]])),
        np.stack([y * cos - x * sin, y * sin + x * cos], 1),
        atol=1e-12,
    )
    assert found.rotation == pytest.approx(0, abs=1e-12)


def test_more_accuracy_asks_for_more_of_everything():
    coarse, fine = SamplingRules(1e-2), SamplingRules(1e-4)
    for name, more in (("neighbours", (1.0,)), ("border", (1.0,)), ("corner", ())):
        assert getattr(fine, name)(3.0, *more) > getattr(coarse, name)(3.0, *more)
        assert getattr(fine, name)(3.0, *more) > getattr(fine, name)(9.0, *more), "wide: less goes aside"
    assert fine.samples(3.0, 1.0) > coarse.samples(3.0, 1.0)
    for name in ("neighbours", "border", "samples"):
        assert getattr(fine, name)(3.0, 4.0) > getattr(fine, name)(3.0, 2.0), "more lenslets are lit"
    assert fine.reach(1.0, 1.0) > coarse.reach(1.0, 1.0)
    assert fine.near(1.0, 1.0) > coarse.near(1.0, 1.0)
    assert fine.rank < coarse.rank


@pytest.mark.parametrize("accuracy", [0.02, 9e-6, float("nan")])
def test_an_accuracy_out_of_range_is_refused(accuracy):
    with pytest.raises(SamplingError, match="accuracy"):
        SamplingRules(accuracy)


def test_a_camera_without_lenslets_is_refused():
    camera = SingleLensCamera(
        wavelength=633 * nm,
        object_distance=120 * mm,
        main_lens={"focal_length": 60 * mm, "diameter": 3 * mm},
        sensor={"pixel_pitch": 6 * um, "shape": (20, 20)},
    )
    with pytest.raises(GeometryError, match="the camera has no lenslets"):
        cells.lenslet_array(camera.optics())
