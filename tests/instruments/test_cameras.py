"""Cameras: what is computed from a description, against rays and the thesis' tables."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lumigraph.core.field import Field
from lumigraph.elements import LensletArray
from lumigraph.errors import GeometryError
from lumigraph.instruments import (
    FocusedPlenopticCamera,
    Lenslets,
    MainLens,
    Pixels,
    PlenopticCamera,
    SingleLensCamera,
    load_camera,
)
from lumigraph.studies.thesis.figures.periodic import LinedCamera
from lumigraph.units import mm, nm, um


def plenoptic(**changes):
    values = {
        "wavelength": 633 * nm,
        "object_distance": 240 * mm,
        "main_lens": MainLens(focal_length=120 * mm),
        "lenslets": Lenslets(pitch=150 * um, focal_length=10 * mm, count=(7, 7)),
        "sensor": Pixels(pixel_pitch=5 * um),
    }
    return PlenopticCamera(**{**values, **changes})


def focused(magnification=0.5, count=(7, 7), **changes):
    values = {
        "wavelength": "633 nm",
        "object_distance": "120 mm",
        "main_lens": {"focal_length": "60 mm"},
        "lenslets": {
            "pitch": "150 um",
            "focal_length": "5.2 mm",
            "count": count,
            "magnification": magnification,
        },
        "sensor": {"pixel_pitch": 1.6667 * um},
    }
    return FocusedPlenopticCamera(**{**values, **changes})


def single(**changes):
    values = {
        "wavelength": "633 nm",
        "object_distance": "316 mm",
        "main_lens": {"focal_length": "158 mm", "diameter": "5 mm"},
        "sensor": {"pixel_pitch": "5 um", "shape": (160, 120)},
    }
    return SingleLensCamera(**{**values, **changes})


def test_the_camera_of_table_4_1():
    camera = load_camera("thesis-plenoptic-1")
    assert camera.pupil_diameter == pytest.approx(3.6e-3, rel=1e-12)
    assert camera.micro_image_pitch == pytest.approx(156.25e-6, rel=1e-12)
    assert camera.separation == camera.image_distance == pytest.approx(0.24)
    factors = [camera.alpha(dz) for dz in (-0.05, -0.025, 0.025, 0.05)]
    assert factors == pytest.approx([0.7368, 0.8837, 1.0943, 1.1724], abs=1e-4)


@pytest.mark.parametrize(
    ("name", "a", "b", "diameter"),
    [("m050", 15.6, 7.8, 2.308), ("m030", 22.533, 6.76, 2.663), ("m025", 26.0, 6.5, 2.769)],
)
def test_the_cameras_of_table_5_2(name, a, b, diameter):
    camera = load_camera(f"thesis-plenoptic-2-{name}")
    found = camera.relay_distance, camera.lenslet_distance, camera.pupil_diameter
    assert np.multiply(found, 1e3) == pytest.approx([a, b, diameter], abs=1e-3)
    assert camera.separation == pytest.approx(0.12 + a * 1e-3, abs=1e-6)


def test_both_ways_to_match_the_main_lens():
    views, full = focused(), focused(matching="full")
    assert views.pupil_diameter == pytest.approx(120e-3 * 150e-6 / 7.8e-3)
    assert full.micro_image_width == pytest.approx(150e-6)
    given_ = focused(main_lens={"focal_length": "60 mm", "diameter": "1 mm"})
    assert given_.pupil_diameter == 1e-3


def test_a_galilean_camera_has_its_lenslets_before_the_image():
    camera = focused(-0.25)
    assert camera.relay_distance < 0 < camera.lenslet_distance < 5.2e-3
    assert camera.separation == pytest.approx(camera.image_distance + camera.relay_distance)
    assert camera.patch < 0


@given(st.sampled_from([0.5, 0.3, -0.25]), st.floats(-0.02, 0.3))
def test_patches_follow_the_magnification_of_each_depth(m, dz):
    camera = focused(m)
    z2 = camera.image_distance if dz == 0 else 0.06 * (0.12 + dz) / (0.06 + dz)
    relay = camera.separation - z2
    if abs(relay) < 1e-6:
        return
    assert camera.magnification_at(dz) == pytest.approx(camera.lenslet_distance / relay, rel=1e-6)
    expected = camera.magnification_at(dz) * 150e-6 * z2 / camera.separation / (1.6667e-6)
    assert camera.patch_at(dz) == pytest.approx(expected, rel=1e-9)


def test_the_patch_of_the_focused_plane():
    # The thesis' P m would be 45 px.
    assert focused().patch == focused().patch_at(0.0) == pytest.approx(39.82, abs=0.01)


def test_tiles_of_a_grating_meet_at_the_patch_by_waves():
    """By waves forward from lines; at 0.1 periods a lenslet rays have 1, one lenslet alone 1.106."""
    camera, dz = focused(0.5).replace(lenslets={"shape": "round"}), 10e-3
    lined = LinedCamera.of(camera, dz)
    n, reach = lined.samples, lined.spreads.shape[-1] // lined.samples
    rows = round(lined.patch / 2)
    spreads = lined.spreads[:, n // 2 - rows : n // 2 + rows + 1].sum(1).reshape(lined.classes, reach, n)
    places = (np.arange(lined.classes) - lined.classes // 2) / lined.classes
    x = places[:, None] - (np.arange(reach) - reach // 2)
    for turns, about in ((0.1, 1.165), (0.4, 1.053)):
        seen = np.einsum("kjs,kj->s", spreads, np.exp(2j * np.pi * turns * x))
        phases = np.abs(np.unwrap(np.angle(seen[n // 2 :])))
        expected = 2 * np.interp(np.pi * turns, phases[:15], np.arange(15)) / lined.patch
        frequency = turns / (camera.lenslets.pitch * camera.defocused(dz) / camera.separation)
        found = camera.patch_at(dz, frequency) / camera.patch_at(dz)
        assert found == pytest.approx(expected, abs=4e-3)
        assert found == pytest.approx(about, abs=5e-3)


def test_a_patch_by_waves_refuses_what_it_cannot_know():
    with pytest.raises(GeometryError, match=r"frequency is 2e\+05 /m but the camera does not resolve that"):
        focused().patch_at(0.0, 2e5)
    with pytest.raises(GeometryError, match="needs an ideal main lens"):
        focused().replace(main_lens={"aberrations": {4: 0.1}}).patch_at(0.0, 1e3)
    with pytest.raises(GeometryError, match="frequency is -1 /m"):
        focused().patch_at(0.0, -1.0)


@pytest.mark.parametrize(("count", "nearest"), [((7, 7), 0.0), ((6, 6), 75e-6)])
def test_odd_counts_have_a_lenslet_on_the_axis_and_even_ones_straddle_it(count, nearest):
    lenslets = Lenslets(pitch=150 * um, focal_length=5 * mm, count=count)
    centers = lenslets.lattice().position(lenslets.indices())
    assert len(centers) == math.prod(count)
    assert np.abs(centers).min(axis=0) == pytest.approx(nearest, abs=1e-12)
    assert centers.mean(axis=0) == pytest.approx(0, abs=1e-12)


@pytest.mark.parametrize(
    ("count", "total"), [((5, 6), 3 * 6 + 2 * 5), ((5, 7), 3 * 7 + 2 * 6), ((4, 6), 24), ((4, 7), 28)]
)
def test_rows_of_a_hexagonal_array(count, total):
    lenslets = Lenslets(pitch=150 * um, focal_length=5 * mm, count=count, layout="hex", rotation=0.01)
    assert len(lenslets.indices()) == total


@pytest.mark.parametrize("rotation", [0.0, 0.02])
@pytest.mark.parametrize("count", [(5, 6), (4, 6), (5, 5)])
def test_the_corners_of_hexagonal_lenslets_lie_within_their_reach_and_touch_it(count, rotation):
    """Corners at p/√3 from each centre: the reach holds them all, with less than .3 of a pitch to spare."""
    pitch = 100 * um
    lenslets = Lenslets(pitch=pitch, focal_length=1 * mm, count=count, layout="hex", rotation=rotation)
    centers = lenslets.lattice().position(lenslets.indices())
    angles = np.pi / 6 + np.pi / 3 * np.arange(6) + rotation
    corners = centers[:, None] + pitch / np.sqrt(3) * np.stack([np.sin(angles), np.cos(angles)], -1)
    farthest = np.abs(corners).max((0, 1))
    assert (farthest <= np.array(lenslets.reach) * (1 + 1e-9)).all(), (farthest, lenslets.reach)
    assert (np.array(lenslets.reach) - farthest < 0.3 * pitch).all(), (farthest, lenslets.reach)


@pytest.mark.parametrize("layout", ["square", "hex"])
@pytest.mark.parametrize("count", [(5, 6), (4, 5)])
@pytest.mark.parametrize("offset", [(0.0, 0.0), (20e-6, -30e-6)])
def test_calibration_and_simulation_agree_on_which_lenslets_exist(layout, count, offset):
    lenslets = {"count": count, "layout": layout, "rotation": 0.02, "offset": offset}
    camera = focused().replace(lenslets=lenslets)
    array = camera.relay_train().elements[0]
    assert isinstance(array, LensletArray)
    everywhere = camera.lattice.indices((-0.6e-3, 0.6e-3), (-0.6e-3, 0.6e-3))
    exist = {tuple(map(int, pair)) for pair in camera.lenslets.indices()}
    assert len(camera.calibration.indices) == len(exist)
    for pair in everywhere:
        y, x = camera.lattice.position(pair)
        field = Field(np.ones((1, 1), complex), _dot(y, x), 633e-9)
        lit = abs(array(field).data[0, 0]) > 0.5
        assert lit == (tuple(map(int, pair)) in exist), (pair, y, x)


def _dot(y, x):
    from lumigraph.core.grid import Grid

    return Grid((1, 1), (1e-6, 1e-6), (float(y), float(x)))


def test_micro_image_centres_lie_on_the_chief_rays():
    camera = focused().replace(lenslets={"offset": (10e-6, -25e-6)})
    calibration = camera.calibration
    spread = 1 + camera.lenslet_distance / camera.separation
    ny, nx = camera.sensor.shape
    for (i, j), (row, column) in zip(calibration.indices, calibration.centers, strict=True):
        y, x = camera.lattice.position(np.array([-i, -j])) * spread
        # The raw image is turned by 180 degrees.
        assert (row - ny // 2) * 1.6667e-6 == pytest.approx(-y, abs=1e-12)
        assert (column - nx // 2) * 1.6667e-6 == pytest.approx(-x, abs=1e-12)
    assert (calibration.separation, calibration.lenslet_distance, calibration.pixel_pitch) == (
        camera.separation,
        camera.lenslet_distance,
        camera.pixels.pixel_pitch,
    )
    assert calibration.lattice.pitch * 1.6667e-6 == pytest.approx(camera.micro_image_pitch, rel=1e-9)


def test_a_sensor_without_a_shape_holds_all_micro_images():
    camera = focused(count=(7, 9))
    needed = np.array([7, 9]) * camera.micro_image_pitch / camera.pixels.pixel_pitch
    assert (np.array(camera.sensor.shape) - needed >= -1e-6).all()
    assert (np.array(camera.sensor.shape) - needed <= 2).all()
    assert all(n % 2 for n in camera.sensor.shape)


def test_a_given_shape_is_kept_and_crops_the_calibration():
    camera = focused(sensor={"pixel_pitch": "1.6667 um", "shape": (300, 400)})
    assert camera.sensor.shape == (300, 400)
    assert len(camera.calibration.indices) == 3 * 5


CAMERAS = {
    "plenoptic": plenoptic,
    "keplerian": focused,
    "galilean": lambda: focused(-0.25, matching="full"),
    "even": lambda: focused(0.3, (6, 5)),
    "single": single,
    "wide": lambda: load_camera("thesis-plenoptic-1"),
    "hex": lambda: load_camera("multi-focus-hex"),
}


@pytest.mark.parametrize("name", CAMERAS)
def test_grids_obey_their_rules_and_cover_their_planes(name):
    camera = CAMERAS[name]()
    D, f, wavelength = camera.pupil_diameter, camera.main_lens.focal_length, camera.wavelength
    dx = camera.pupil_grid.pitch[0]
    assert dx == camera.image_grid.pitch[0]
    assert 2 * dx <= wavelength * f / D
    assert min(camera.pupil_grid.size) > D
    sensor = np.multiply(camera.sensor.shape, camera.sensor.pixel_pitch)
    assert (np.array(camera.image_grid.size) > sensor).all()
    object_pitch, z1 = camera.object_grid.pitch[0], camera.object_distance
    assert object_pitch * 1.2 <= wavelength * z1 / (2 * D) * (1 + 1e-12)
    reach = max(camera.object_grid.size) / 2 + D / 2
    assert object_pitch <= wavelength * z1 / (2 * reach)
    if camera.lattice is None:
        assert 4 * dx <= wavelength * camera.f_number * (1 + 1e-12)
        return
    pitch, b = camera.lenslets.pitch, camera.lenslet_distance
    assert camera.lenslet_grid.pitch[0] == dx
    assert round(pitch / dx) == pytest.approx(pitch / dx, rel=1e-12)
    assert round(pitch / dx) % 2 == 1
    assert 2 * dx <= wavelength * min(camera.lenslets.focal_length) / pitch
    assert 4 * dx <= wavelength * b / pitch
    assert (np.array(camera.lenslet_grid.size) > 2 * np.array(camera.lenslets.reach)).all()
    samples = pitch * z1 / camera.separation / object_pitch
    assert round(samples) == pytest.approx(samples, rel=1e-9)
    if camera.lenslets.layout == "square":
        assert camera.object_grid.shape == tuple(n * round(samples) for n in camera.lenslets.count)


def _image_of_a_point(camera, row, column):
    grid = camera.object_grid
    data = np.zeros(grid.shape, np.complex64)
    iy, ix = int(row * grid.shape[0]), int(column * grid.shape[1])
    data[iy, ix] = 1
    return grid.y[iy], grid.x[ix], camera.train()(Field(data, grid, camera.wavelength))


def test_a_single_lens_images_a_point_inverted_at_its_magnification():
    camera = single(object_distance="237 mm")
    y, x, field = _image_of_a_point(camera, 0.3, 0.6)
    peak = np.unravel_index(field.intensity.argmax(), field.grid.shape)
    assert camera.magnification == pytest.approx(2.0)
    assert field.grid == camera.image_grid
    assert field.grid.y[peak[0]] == pytest.approx(-2 * y, abs=field.grid.pitch[0])
    assert field.grid.x[peak[1]] == pytest.approx(-2 * x, abs=field.grid.pitch[1])


def test_a_point_in_focus_lights_its_own_lenslet():
    camera = plenoptic()
    data = np.zeros(camera.object_grid.shape, np.complex64)
    data[tuple(n // 2 for n in data.shape)] = 1
    planes = list(camera.train().planes(Field(data, camera.object_grid, camera.wavelength)))
    behind_main_lens, at_lenslets = planes[2], planes[3]
    grid = at_lenslets.grid
    inside = (np.abs(grid.y)[:, None] <= 75e-6) & (np.abs(grid.x) <= 75e-6)
    own = at_lenslets.intensity[inside].sum() * grid.pitch[0] ** 2
    # The Airy pattern's light in a square of one pitch; 3.0 mm instead of 3.6 mm would leave 0.87.
    assert float(own / behind_main_lens.power) == pytest.approx(0.904, abs=0.01)


@pytest.mark.parametrize("m", [0.5, -0.25])
def test_each_lenslet_shows_a_point_where_rays_say(m):
    """s = c (1 + m) - m X behind lenslet c, for the image X of a point."""
    camera = focused(m, (9, 9), matching="full")
    y, x, field = _image_of_a_point(camera, 0.5, 0.55)
    X = -x * camera.image_distance / camera.object_distance
    peak = np.unravel_index(field.intensity.argmax(), field.grid.shape)
    s = field.grid.x[peak[1]]
    centers = camera.lattice.centers((0, 0), (-0.7e-3, 0.7e-3))[:, 1]
    expected = centers * (1 + m) - m * X
    assert y == pytest.approx(0, abs=camera.object_grid.pitch[0])
    assert np.abs(expected - s).min() < 1.01 * field.grid.pitch[1]


def test_trains_are_parts_of_each_other():
    camera = focused()
    whole, image, relay = (
        camera.train().elements,
        camera.image_train().elements,
        camera.relay_train().elements,
    )
    assert whole[1:] == image
    assert image[-2:] == relay
    assert camera.train(0.13).elements[0].distance == 0.13
    assert single().relay_train() is None
    assert single().lattice is single().lenslet_grid is single().lenslet_distance is None


def test_aberrations_spread_the_point_and_keep_the_stop():
    perfect = single()
    aberrated = perfect.replace(main_lens={"aberrations": {5: 0.25}})
    _, _, sharp = _image_of_a_point(perfect, 0.5, 0.5)
    _, _, blurred = _image_of_a_point(aberrated, 0.5, 0.5)
    strehl = float(blurred.intensity.max() / sharp.intensity.max())
    # exp(-(2π 0.25)²) = 0.085 is Maréchal's estimate; astigmatism of that size leaves a little more or less.
    assert 0.02 < strehl < 0.3
    through = [camera.lens_train()(_even(camera)).power for camera in (perfect, aberrated)]
    # A second grey edge would take 1e-3 of the light.
    assert through[0] == pytest.approx(through[1], rel=1e-4)


def _even(camera):
    return Field(np.ones(camera.pupil_grid.shape, np.complex64), camera.pupil_grid, camera.wavelength)


def test_cameras_cannot_be_changed_but_replaced():
    camera = focused()
    with pytest.raises(Exception, match="frozen"):
        camera.wavelength = 5e-7
    other = camera.replace(object_distance="130 mm", lenslets={"magnification": 0.3})
    assert (other.object_distance, other.lenslet_magnification) == (0.13, 0.3)
    assert other.lenslets.pitch == camera.lenslets.pitch
    assert camera.replace() == camera
    assert camera.replace(sensor=Pixels(pixel_pitch=3e-6)).pixels.pixel_pitch == 3e-6
