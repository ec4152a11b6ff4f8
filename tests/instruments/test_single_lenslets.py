"""Lenslets that differ from the others: what a file says of them, where they stand, what is refused."""

import tomllib

import numpy as np
import pytest

import lumigraph as lg
from lumigraph.errors import FormatError, GeometryError
from lumigraph.instruments.varied import changed

SINGLE = {2: {"focal_change": 0.03, "offset_y": "-20 um"}, 6: {"offset_x": 31e-6}}


@pytest.fixture
def scope():
    return lg.load_camera("lfm-fourier").replace(lenslets={"single": SINGLE})


def test_a_file_gives_the_same_lenslets_back(scope):
    assert type(scope).from_table(tomllib.loads(scope.to_toml()), "file") == scope
    assert '[lenslets.single.2]\nfocal_change = 0.03\noffset_y = "-20 um"' in scope.to_toml()
    assert "[lenslets.single]\n" not in scope.to_toml()


def test_equal_arrays_have_one_hash_as_frozen_parts_do(scope):
    again = lg.load_camera("lfm-fourier").replace(lenslets={"single": SINGLE})
    assert (scope.lenslets, hash(scope.lenslets)) == (again.lenslets, hash(again.lenslets))


def test_each_stands_where_its_number_and_offset_say(scope):
    centers, focal_lengths = scope.lenslets.each()
    assert centers[1] == pytest.approx([-1.27e-3, 0.0], abs=1e-12)
    assert centers[5] == pytest.approx([0.0, 1.281e-3], abs=1e-12)
    assert focal_lengths == pytest.approx([25e-3, 25.75e-3] + 7 * [25e-3])
    pixels = centers / 6.5e-6 + np.array(scope.sensor.shape) // 2
    assert scope.calibration.centers == pytest.approx(pixels)


def test_a_longer_focal_length_is_in_focus_farther_away_and_the_description_says_where(scope):
    depth = (1 / 25e-3 - 1 / 25.75e-3) * (75e-3 / 20) ** 2
    assert scope.in_focus == pytest.approx([0.0, depth] + 7 * [0.0])
    rows = {row.name: row.value for row in scope.quantities()}
    assert rows["lenslet 2 is in focus at"] == pytest.approx(depth)
    seen = [lg.information.bounds(scope, [dz], places=1).deviations[0, 0, 2] for dz in (depth, -depth)]
    assert seen[0] < seen[1]


def test_a_key_of_several_lenslets_gives_all_of_them_the_value(scope):
    other = changed(scope, {"lenslets.single.2,4, 8.focal_change": 0.01})
    assert {n: one.focal_change for n, one in other.lenslets.single.items()} == {
        2: 0.01,
        4: 0.01,
        6: 0.0,
        8: 0.01,
    }
    assert other.lenslets.single[2].offset_y == -20e-6


def test_a_number_is_a_place_in_a_list():
    camera = lg.load_camera("multi-focus-hex")
    other = changed(camera, {"lenslets.focal_length.1": "0.6 mm"})
    assert other.lenslets.focal_length[1] == 0.6e-3
    with pytest.raises(FormatError, match="3 is none of the values 0 to 2"):
        changed(camera, {"lenslets.focal_length.3": "0.6 mm"})


def test_a_list_that_the_file_leaves_out_begins_as_the_camera_has_it():
    camera = lg.load_camera("thesis-plenoptic-2-m050")
    other = changed(camera, {"built.array_tilt.0": "2 mrad", "built.sensor_tilt.0,1": "-1 mrad"})
    assert other.built.array_tilt == (0.002, 0.0)
    assert other.built.sensor_tilt == (-0.001, -0.001)
    assert changed(other, {"built.array_tilt.1": "1 mrad"}).built.array_tilt == (0.002, 0.001)
    with pytest.raises(FormatError, match="2 is none of the values 0 to 1"):
        changed(camera, {"built.array_tilt.2": "2 mrad"})


@pytest.mark.parametrize(
    ("lenslets", "said"),
    [
        ({"single": {12: {}}}, "single has lenslet 12, but there are 9"),
        ({"single": {0: {}}}, "0 is no number of a lenslet"),
        ({"single": {"x": {}}}, "'x' is no number of a lenslet"),
        ({"single": 3}, "is not a table"),
        ({"single": {2: {"focal_change": -0.6}}}, r"single.2.focal_change: -0.6 is beyond ±0.5"),
        ({"single": {2: {"focal_chang": 0.1}}}, "Did you mean 'lenslets.single.2.focal_change'"),
        ({"single": {2: {"offset_y": "20 um"}}}, "stand 1230 µm from each other but are 1250 µm wide"),
    ],
)
def test_what_cannot_be_is_refused(lenslets, said):
    with pytest.raises((FormatError, GeometryError), match=said):
        lg.load_camera("lfm-fourier").replace(lenslets=lenslets)


@pytest.mark.parametrize(
    ("name", "single", "said"),
    [
        ("lfm-guv", {}, "not '1.0'"),
        ("multi-focus-hex", {}, "these are round"),
        ("lfm-fourier", {"decentre_y": "1 um"}, "Move the whole lenslet by offset_y"),
    ],
)
def test_other_instruments_have_no_single_lenslets(name, single, said):
    with pytest.raises(GeometryError, match=said):
        lg.load_camera(name).replace(lenslets={"single": {1: single}})


def test_views_of_lenslets_that_left_the_lattice_are_cut_around_them():
    scope = lg.load_camera("lfm-fourier").replace(sensor={"shape": (901, 901)})
    plain, index = scope.calibration, scope.calibration.indices[:1]
    moved = scope.replace(lenslets={"single": {1: {"offset_y": "-40 um"}}}).calibration
    way = -40e-6 * scope.relay_magnification / scope.sensor.pixel_pitch
    assert moved.position(index) - plain.position(index) == pytest.approx(np.array([[way, 0.0]]))


def test_a_sensor_holds_the_images_of_lenslets_that_left_the_lattice():
    """One row, of which two lenslets stand a pitch above and below it: their images were cut off."""
    single = {1: {"offset_y": "-1.4 mm"}, 3: {"offset_y": "1.4 mm"}}
    row = {"count": (1, 3), "pitch": "1.2 mm", "single": single}
    scope = lg.load_camera("lfm-fourier").replace(lenslets=row)
    assert len(scope.calibration.centers) == 3
    assert scope.point_image(0.0, 0.0, 0.0).sum() == pytest.approx(
        scope.replace(sensor={"shape": (901, 901)}).point_image(0.0, 0.0, 0.0).sum(), rel=1e-3
    )
