"""Settings of napari-LF beside a raw image: the microscope, and its white and dark images."""

import json

import numpy as np
import pytest

import lumigraph as lg
from lumigraph.processing.inputs import read

KNOWN = {
    "ulens_pitch": 100.0, "pixel_size": 6.5, "ulens_focal_length": 2500.0, "ulens_focal_distance": 2500.0,
    "objective_magnification": 60, "objective_na": 1.2, "tubelens_focal_length": 200.0,
    "center_wavelength": 593.0, "medium_index": 1.35,
    "radiometry_frame_file": "white.tif", "dark_frame_file": "../dark.tif",
}  # fmt: skip


@pytest.fixture
def folder(tmp_path):
    folder = tmp_path / "sample"
    folder.mkdir()
    for name, level in (("sample/raw", 3.0), ("sample/white", 5.0), ("dark", 1.0)):
        lg.save(lg.RawImage(np.full((436, 436), level, np.float32)), tmp_path / f"{name}.tif")
    return folder


def settings(folder, name="raw.tif", **changes):
    known = {key: value for key, value in {**KNOWN, **changes}.items() if value is not None}
    text = json.dumps({"calibrate": known, "deconvolve": {"input_file": name}})
    (folder / "metadata.txt").write_text(text)


def test_a_microscope_that_napari_lf_knows_needs_no_camera_file(folder):
    settings(folder)
    found = read(folder / "raw.tif")
    catalogue = lg.load_camera("lfm-guv")
    assert [guess.what for guess in found.guesses] == ["camera", "white image"]
    assert float(found.white.data.max()) == 5
    assert found.dark is None  # a file of another folder is not read
    assert found.camera.lenslets == catalogue.lenslets
    for depth in (-5e-6, 3e-6):
        assert found.camera.refocus_factor(depth, 2.5e-3) == catalogue.refocus_factor(depth, 2.5e-3)
    settings(folder, ulens_focal_distance=2400.0)
    assert read(folder / "raw.tif").camera.sensor_distance == pytest.approx(2.4e-3)


def test_what_is_given_goes_before_what_lies_beside(folder):
    settings(folder)
    given = read(folder / "raw.tif", camera="lfm-worm", white=np.ones((436, 436)))
    assert given.camera == lg.load_camera("lfm-worm")
    assert given.guesses == ()
    assert read(folder / "raw.tif", white=np.ones((436, 436))).white.data.max() == 1


def test_settings_of_other_images_and_other_files_are_left_alone(folder):
    for name in ("other.tif", None):
        settings(folder, name)
        assert read(folder / "raw.tif").camera is None
    for text in ("[1]", "no JSON", '{"calibrate": 3}'):
        (folder / "metadata.txt").write_text(text)
        assert read(folder / "raw.tif").camera is None


@pytest.mark.parametrize(
    "changes", [{"objective_na": None}, {"objective_na": "much"}, {"ulens_pitch": 0}, {"pixel_size": -6.5}]
)
def test_settings_that_describe_no_microscope_are_refused(folder, changes):
    settings(folder, **changes)
    with pytest.raises(lg.FormatError, match=r"metadata\.txt names raw\.tif but describes no microscope"):
        read(folder / "raw.tif")
