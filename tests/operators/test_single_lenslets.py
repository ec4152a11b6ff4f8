"""Lenslets of cameras with places and focal lengths of their own: images, and derivatives by each."""

from dataclasses import replace

import numpy as np
import pytest
from tests.operators.test_part_each import direct, off

import lumigraph as lg
from cameras import focused
from lumigraph.core.lattice_offsets import LatticeOffsets
from lumigraph.elements import LensletArray
from lumigraph.elements.scatter import Scatter, SingleLenslet
from lumigraph.errors import CalibrationError, FormatError, GeometryError
from lumigraph.scene import Points, Scene
from lumigraph.units import mm, um

POINT = Points(np.array([[20 * um, -30 * um, 1 * mm]]), np.ones(1))
PITCH, FILL = 100 * um, 0.8
SINGLE = {
    6: {"offset_y": 9 * um, "offset_x": -4 * um},
    7: {"focal_change": 0.1, "offset_x": 7 * um},
    10: {"decentre_y": 15 * um},
    11: {"decentre_x": -20 * um, "focal_change": -0.1, "offset_y": 5 * um},
}
KEYS = {
    **{("single", number, key): step for number, key, step in (
        (6, "offset_y", 1e-9), (6, "offset_x", 1e-9), (6, "focal_change", 1e-6), (6, "decentre_x", 1e-9),
        (7, "focal_change", 1e-6), (7, "offset_x", 1e-9), (11, "offset_y", 1e-9), (11, "decentre_x", 1e-9),
        (14, "focal_change", 1e-6), (15, "offset_y", 1e-9),
    )},
    **{(key,): step for key, step in (
        ("pitch", 1e-10), ("focal_length", 5e-9), ("fill_factor", 1e-6), ("magnification", 1e-6),
    )},
}  # fmt: skip


def camera(single=SINGLE, **lenslets):
    plain = focused(**{"fill_factor": FILL, "single": single, **lenslets})
    return plain.replace(main_lens={"diameter": 1.9 * mm}, sensor={"shape": (73, 73)})


def everywhere(**own):
    return dict.fromkeys(range(1, 17), own)


def moved(key, by):
    """The camera with one number that is so much larger."""
    plain = camera()
    if key[0] != "single":
        value = getattr(plain.lenslets, key[0])
        return camera(**{key[0]: (value[0] if isinstance(value, tuple) else value) + by})
    _, number, name = key
    own = SINGLE.get(number, {})
    return camera(SINGLE | {number: own | {name: own.get(name, 0.0) + by}})


def pair(key, times=1.0):
    return moved(key, -times * KEYS[key]), moved(key, times * KEYS[key])


def image(one, accuracy=1e-3):
    return one.part_images([], accuracy=accuracy).forward(POINT)


def test_lenslets_all_alike_longer_are_an_array_of_that_focal_length():
    plain = camera({})
    longer = plain.replace(
        lenslets={"focal_length": plain.lenslets.focal_length[0] * 1.04},
        built={"separation": plain.separation, "lenslet_distance": plain.lenslet_distance},
    )
    assert off(image(camera(everywhere(focal_change=0.04))), image(longer)) < 2e-5
    assert off(image(plain), image(longer)) > 2e-3


@pytest.mark.parametrize("rotation", [0.0, 0.1])
def test_lenslets_all_aside_by_as_much_are_an_array_that_is_moved(rotation):
    ways = {"offset_y": 8 * um, "offset_x": -6 * um}
    whole = image(camera({}, offset=(8 * um, -6 * um), rotation=rotation))
    assert off(image(camera(everywhere(**ways), rotation=rotation)), whole) < 5e-5
    assert off(image(camera({}, rotation=rotation)), whole) > 0.1


def test_vertices_all_aside_by_as_much_are_lenslets_before_which_light_is_turned():
    """An array whose lenslets are moved back, apertures and all, has its apertures where they were."""
    there = camera(everywhere(offset_y=9 * um, decentre_y=-9 * um))
    back = camera(everywhere(decentre_y=-9 * um), offset=(9 * um, 0.0))
    assert off(image(there), image(back)) < 5e-5
    assert off(image(camera(everywhere(offset_y=9 * um))), image(back)) > 0.1


@pytest.mark.parametrize("single", [SINGLE, *({number: own} for number, own in SINGLE.items())])
def test_a_point_is_what_a_direct_sum_over_these_lenslets_gives(single):
    """2e-3 off are edges on the sum's grid: so are lenslets that are alike."""
    one, plain = camera(single), image(camera({}))
    raw = np.asarray(lg.simulate(one, Scene([POINT])).data, float)
    true = direct(one, POINT)
    assert off(raw, true * np.sum(raw * true) / np.sum(true**2)) < 2.5e-3
    assert off(image(one), plain) > 5e-3


def test_planes_in_coherent_light_agree_with_points():
    grid, picture = lg.Grid.square(9, 10 * um), np.zeros((9, 9))
    picture[6, 1] = 1.0
    flat = lg.simulate(camera(), Scene([lg.Slice(picture, grid, 1 * mm)]), lg.Coherent())
    flat, true = np.asarray(flat.data, float), image(camera())
    assert off(flat / flat.sum(), true / true.sum()) < 5e-3


@pytest.mark.parametrize("key", KEYS, ids=lambda key: ".".join(map(str, key)))
def test_derivatives_are_central_differences_of_images(key):
    images = camera().part_images([pair(key)])
    low, high = (one.part_images([]).forward(POINT) for one in pair(key, 2))
    assert off(2 * images.derivative(POINT, np.ones(1)), high - low) < 2e-7


def test_the_gradient_is_the_derivatives_transpose(rng):
    images = camera().part_images([pair(key) for key in KEYS])
    weights, change = rng.standard_normal(images.shape), rng.standard_normal(len(KEYS))
    whole = np.sum(weights * images.derivative(POINT, change))
    assert images.gradient(POINT, weights) @ change == pytest.approx(whole, rel=1e-11)


def test_an_array_that_is_turned_turns_the_ways_of_its_lenslets():
    """A quarter turn: lenslets stand where others stood, and ways are of the picture, not of the array."""
    plain = LensletArray(lg.Lattice.square(PITCH), 5 * mm, fill_factor=FILL)
    own = SingleLenslet((1, 0), 0.1, (9 * um, -4 * um), (3 * um, 5 * um))
    there = replace(plain, scatter=Scatter(own=(own,)))
    turned = replace(plain, lattice=lg.Lattice.square(PITCH, np.pi / 2), scatter=Scatter(own=(own,)))
    grid = lg.Grid.square(201, 1.5 * um)
    found, expected = (one.transmission(grid, 600e-9) for one in (turned, there))
    assert np.abs(np.rot90(found) - expected).max() < 1e-12
    assert np.abs(np.rot90(found, -1) - expected).max() > 0.5


def test_apertures_that_touch_leave_no_gap_between_them():
    """Their border lies amid a sample, of which each covers half."""
    own = SingleLenslet((0, 0), aside=(0.0, 10 * um)), SingleLenslet((0, 1), aside=(0.0, -10 * um))
    array = LensletArray(lg.Lattice.square(PITCH), 5 * mm, fill_factor=FILL, scatter=Scatter(own=own))
    line = np.abs(array.transmission(lg.Grid((1, 25), (4 * um, 4 * um), (0.0, 50 * um)), 600e-9))[0]
    assert line == pytest.approx(1, abs=1e-12)


def test_patches_are_placed_around_vertices(rng):
    """Of a main image that is a ramp: each lenslet shows its part of it, turned, around its own centre."""
    none, size, pitch = np.zeros((0, 2)), 4.0, 10.0
    plain = lg.Calibration(lg.Lattice.square(pitch, origin=(5, 5)), (60, 60), none, none, 0.0)
    indices = plain.indices_within((0, 59), (0, 59))
    aside = replace(plain, aside=LatticeOffsets(indices, rng.uniform(-0.8, 0.8, indices.shape)))
    for one, flat in ((aside, True), (plain, False)):
        y, x = np.mgrid[:60, :60]
        center = one.position(np.stack(aside.index(y, x), -1))
        raw = center[..., 1] - (x - center[..., 1]) * pitch / size
        shown = np.asarray(lg.render(raw, aside, size, interpolation="linear"))
        bends = np.abs(np.diff(shown, 2, axis=1))
        assert (bends.max() < 1e-9) == flat


def test_ways_in_the_file_are_along_y_and_x_however_the_array_is_turned():
    parts = camera(rotation=0.1).lenslets
    array = camera(rotation=0.1).lenslet_array()
    for number, own in parts.single.items():
        index = parts.indices()[number - 1]
        (mine,) = [one for one in array.scatter.own if one.index == tuple(index)]
        (down, across), (sin, cos) = mine.vertex, (np.sin(0.1), np.cos(0.1))
        # As `LensletArray` turns ways along columns and rows into (y, x).
        assert (down * cos + across * sin, across * cos - down * sin) == pytest.approx(own.vertex)


def test_micro_images_stand_where_vertices_do():
    plain, one = camera({}).calibration, camera()
    moved = one.calibration
    scale = -(1 + one.lenslet_distance / one.separation) / one.sensor.pixel_pitch
    there = np.array([own.vertex for own in one.lenslets.single.values()])
    index = -one.lenslets.indices()[np.array(list(one.lenslets.single)) - 1]
    assert moved.position(index) - plain.position(index) == pytest.approx(scale * there)
    assert moved.position(moved.indices) == pytest.approx(moved.centers)
    assert moved.transposed().position(index[:, ::-1]) == pytest.approx(moved.position(index)[:, ::-1])
    with pytest.raises(CalibrationError, match=r"needs lenslets on a lattice, but micro-images of 4 stand"):
        moved.require_regular("depth")


def test_a_calibration_with_lenslets_aside_comes_back_from_its_file(tmp_path):
    known = camera().calibration
    lg.save(known, tmp_path / "known.toml")
    found = lg.open(tmp_path / "known.toml")
    assert found.position(known.indices) == pytest.approx(known.position(known.indices))


def test_a_camera_file_holds_single_lenslets(tmp_path):
    one = camera()
    (tmp_path / "camera.toml").write_text(one.to_toml())
    assert lg.load_camera(tmp_path / "camera.toml") == one
    rows = one.describe().as_dict()
    assert rows["lenslet 7 focal length"] == pytest.approx(1.1 * one.lenslets.focal_length[0])
    vertex = rows["lenslet 11 vertex y"], rows["lenslet 11 vertex x"]
    assert vertex == pytest.approx((5 * um, -20 * um))


def test_fewer_lenslets_keep_those_that_differ():
    parts = camera(count=(8, 8), single={1: {"focal_change": 0.2}, 28: {"focal_change": 0.1}}).lenslets
    fewer = parts.model_copy(update=parts.amid((3, 4)))
    assert fewer.count == (4, 4)
    assert fewer.single == {6: parts.single[28]}
    assert np.array_equal(fewer.indices()[5], parts.indices()[27])


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"single": {17: {"focal_change": 0.1}}}, "single has lenslet 17, but there are 16"),
        (
            {"single": {2: {"offset_y": 11 * um}}},
            "lenslet 2's offset is 11 µm but the cell has room for 10 µm",
        ),
        ({"single": {2: {"decentre_x": 41 * um}}}, "decentre is 41 µm but the aperture has room for 40 µm"),
        ({"single": {2: {"offset_y": 9 * um}, 6: {"offset_y": -11 * um}}}, "room for 10 µm"),
        (
            {"layout": "hex", "single": {2: {"focal_change": 0.1}}},
            "single lenslets differ from square ones, but these are hex",
        ),
        ({"shape": "round"}, "single lenslets differ from square ones, but these are round"),
    ],
)
def test_what_cannot_be_is_refused(given, told):
    with pytest.raises((GeometryError, FormatError), match=told):
        camera(**given)


def test_other_operators_are_refused():
    with pytest.raises(GeometryError, match="single out of"):
        camera().operator()
    with pytest.raises(GeometryError, match='model = "paraxial"'):
        lg.simulate(camera().replace(model="exact"), Scene([POINT]))
    with pytest.raises(GeometryError, match=r"lenslet \(1, 0\) has a focal_change of -1 but must be above"):
        Scatter(own=(SingleLenslet((1, 0), -1.0),))
    far = Scatter(own=(SingleLenslet((1, 0), 0.0, (11 * um, 0.0)),))
    with pytest.raises(GeometryError, match=r"lenslet \(1, 0\) stands 11 µm beside its place but has 10 µm"):
        LensletArray(lg.Lattice.square(PITCH), 5 * mm, fill_factor=FILL, scatter=far)
