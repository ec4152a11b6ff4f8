"""Verbs take a camera, its file or its name in the catalogue; `simulate` takes an array where a scene is."""

import numpy as np
import pytest

import lumigraph as lg
from lumigraph.core import upper_floors

FILE = """
kind = "single-lens"
wavelength = "550 nm"
object_distance = "200 mm"
[main_lens]
focal_length = "50 mm"
diameter = "5 mm"
[sensor]
pixel_pitch = "20 um"
shape = [8, 10]
"""


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "camera.toml"
    path.write_text(FILE)
    return path


def test_a_camera_is_itself_its_file_or_its_name(file):
    camera = lg.load_camera("thesis-plenoptic-1")
    assert upper_floors.camera(camera) is camera
    assert upper_floors.camera("thesis-plenoptic-1") == camera
    assert upper_floors.camera(file) == upper_floors.camera(str(file)) == lg.load_camera(file)
    with pytest.raises(lg.FormatError, match="Did you mean 'thesis-plenoptic-1'"):
        lg.design("thesis-plenoptc-1")


def test_a_raw_image_is_simulated_by_the_file_of_a_camera_of_an_array(file, rng):
    picture = rng.random((40, 50))
    found = lg.simulate(file, picture)
    camera = lg.load_camera(file)
    scene = lg.targets.photo(camera.scene_grid, picture)
    np.testing.assert_array_equal(found.data, lg.simulate(camera, scene).data)


def test_raw_images_are_prepared_and_bounds_found_by_name(file):
    camera = lg.load_camera("thesis-plenoptic-1")
    raw = np.ones(camera.sensor.shape, np.float32)
    assert lg.prepare(raw, camera="thesis-plenoptic-1").notes == lg.prepare(raw, camera=camera).notes
    found = lg.information.bounds(file, [1e-3], places=1, checked=False)
    other = lg.information.bounds(lg.load_camera(file), [1e-3], places=1, checked=False)
    np.testing.assert_array_equal(found.deviations, other.deviations)
