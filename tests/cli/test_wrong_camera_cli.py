"""Verbs for plenoptic cameras, given a microscope or a camera without lenslets."""

import numpy as np
import pytest

import lumigraph.io as io
from lumigraph.core.lattice import Lattice
from lumigraph.core.raw import RawImage

SCOPE = """
kind = "light-field-microscope"
wavelength = "550 nm"
[objective]
magnification = 20
numerical_aperture = 0.4
[lenslets]
pitch = "100 um"
focal_length = "2 mm"
count = [19, 19]
[sensor]
pixel_pitch = "8 um"
shape = [200, 220]
"""
LENS = """
kind = "single-lens"
wavelength = "550 nm"
object_distance = "100 mm"
[main_lens]
focal_length = "50 mm"
diameter = "3 mm"
[sensor]
pixel_pitch = "4 um"
shape = [200, 220]
"""


FOCUSED = """
kind = "focused-plenoptic"
wavelength = "550 nm"
object_distance = "120 mm"
[main_lens]
focal_length = "60 mm"
[lenslets]
pitch = "98.0192991366 um"
focal_length = "2 mm"
count = [15, 15]
magnification = 0.3
[sensor]
pixel_pitch = "8 um"
shape = [200, 220]
"""


@pytest.fixture
def microscope(lumigraph, tmp_path):
    """A white and a raw image of micro-images 12.5 px apart, 5 px from where scope.toml has them."""
    y, x = np.mgrid[:200, :220].astype(float)
    dy, dx = Lattice.square(12.5, 0, (105, 110)).offset(y, x)
    white = 1 + 199 * np.exp(-((np.hypot(dy, dx) / 5.3) ** 6))
    io.save(RawImage(white.astype(np.float32)), tmp_path / "white.tiff")
    io.save(RawImage((white * (2 + np.sin(y / 30))).astype(np.float32)), tmp_path / "raw.tiff")
    (tmp_path / "scope.toml").write_text(SCOPE)
    (tmp_path / "lens.toml").write_text(LENS)
    return lumigraph


def test_a_microscopes_white_image_tells_where_its_lenslets_are(microscope, tmp_path):
    words = ("--white", "white.tiff", "--camera", "scope.toml")
    found = microscope("decode", "raw.tiff", *words, "-o", "views.zarr")
    assert (found.code, found.err) == (0, "")  # no word of a shift: the camera's lattice is not taken
    found = microscope("calibrate", "white.tiff", "--camera", "scope.toml", "-o", "a.toml")
    assert found.code == 0, found.err
    assert io.open(tmp_path / "a.toml").pixel_pitch == pytest.approx(8e-6)
    found = microscope("depth", "raw.tiff", *words, "-o", "map.pfm")
    assert found.code == 0, found.err
    assert found.out.startswith("depth of")


VERBS = {
    "calibrate": ("calibrate", "white.tiff", "-o", "a.toml"),
    "decode": ("decode", "raw.tiff", "--white", "white.tiff", "-o", "views.zarr"),
    "refocus": ("refocus", "raw.tiff", "--white", "white.tiff", "--alpha", 1, "-o", "a.png"),
    "depth": ("depth", "raw.tiff", "--white", "white.tiff", "-o", "a.pfm"),
    "view": ("view", "raw.tiff", "--white", "white.tiff", "--export", "a.html"),
    "deconvolve": ("deconvolve", "raw.tiff", "--white", "white.tiff", "--iterations", 1, "-o", "a.tiff"),
    "render": ("render", "raw.tiff", "--white", "white.tiff", "-o", "a.png"),
}


@pytest.mark.filterwarnings("always")
@pytest.mark.parametrize("verb", VERBS)
def test_every_verb_says_in_one_line_what_the_picture_implies_about_the_camera_file(
    verb, microscope, tmp_path
):
    table = SCOPE if verb != "render" else FOCUSED
    (tmp_path / "agrees.toml").write_text(table)
    (tmp_path / "differs.toml").write_text(table.replace('"8 um"', '"8.16 um"'))
    said = microscope(*VERBS[verb], "--camera", "agrees.toml")
    assert said.code == 0, said.err
    assert "by the camera file" not in said.out + said.err  # where they agree nothing is said
    said = microscope(*VERBS[verb], "--camera", "differs.toml", "--overwrite")
    assert said.code == 0, said.err
    implied = "a relay of 1.02 instead of 1" if verb != "render" else "pixels of 8 µm instead of 8.16 µm"
    told = f"by the camera file it has 12.255 px (square): {implied}. The picture's lattice is used"
    assert (said.out + said.err).count(told) == 1


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (
            ("calibrate", "white.tiff", "--camera", "scope.toml", "--explain", "-o", "a.toml"),
            "scope.toml is a light-field-microscope: --explain is for plenoptic cameras",
        ),
        (
            ("depth", "raw.tiff", "--camera", "scope.toml", "--correct", "-o", "a.pfm"),
            "Give --camera FILE of a plenoptic camera 1.0",
        ),
        (
            ("decode", "raw.tiff", "--camera", "lens.toml", "-o", "a.zarr"),
            "single-lens, which has no lenslets",
        ),
        (("render", "raw.tiff", "--camera", "lens.toml", "--patch", 4, "-o", "a.png"), "has no lenslets"),
    ],
)
def test_what_a_camera_cannot_do_is_refused_in_a_line(microscope, words, message):
    refused = microscope(*words)
    assert (refused.code, refused.out, refused.err.count("\n")) == (1, "", 1)
    assert message in refused.err
