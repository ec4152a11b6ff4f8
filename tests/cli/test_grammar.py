"""One grammar for all verbs: ranges, names of options, and whose outputs are replaced."""

import numpy as np
import pytest

import lumigraph.io as io
from lumigraph.cli.options import RENAMED, lengths, planes
from lumigraph.errors import FormatError


def test_lengths_are_one_several_or_a_range():
    assert lengths("--depth", "5 mm") == [5e-3]
    assert lengths("--depth", ["5 um, -1 um", "0:2 um:x3"]) == [5e-6, -1e-6, 0.0, 1e-6, 2e-6]
    assert planes("--depth", ["5 um, -1 um", "0:2 um:x3"]) == (-1e-6, 0.0, 1e-6, 2e-6, 5e-6)
    assert planes("--depth", "-20 um:20 um:500 nm")[40] == 0.0
    with pytest.raises(FormatError, match="write its least depth first"):
        planes("--depth", "2 um:-2 um:-1 um")
    with pytest.raises(FormatError, match="twice"):
        planes("--depth", ["0 um", "-1 um:1 um:1 um"])


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (
            ("refocus", "views.zarr", "--alphas", "0.9:1.1:9", "-o", "o.tiff"),
            "Write '0.9:1.1:x9' for a count, or '0.9:1.1:9.0' for a step.",
        ),
        (
            ("sweep", "thesis-2f", "--vary", "main_lens.focal_length=4 mm:6 mm:9", "-o", "t.csv"),
            "Write '4 mm:6 mm:x9' for a count, or '4 mm:6 mm:9 mm' for a step.",
        ),
        (
            ("render", "raw.tiff", "--patches", "8:12:4", "-o", "o.tiff"),
            "Write '8:12:x4' for a count, or '8:12:4.0' for a step.",
        ),
    ],
)
def test_a_range_of_the_old_form_is_refused_with_the_new_one(lumigraph, bench, words, said):
    result = lumigraph(*words)
    assert result.code == 1
    assert said in result.err


@pytest.mark.parametrize(
    ("words", "new"),
    [
        (("deconvolve", "a.tif", "--camera", "lfm-guv", "--z", "0 um", "-o", "o.tif"), "--depth"),
        (("deconvolve", "a.tif", "--camera", "lfm-guv", "--z=0 um", "-o", "o.tif"), "--depth"),
        (("dataset", "thesis-plenoptic-1", "-n", "1", "--z", "0 mm", "-o", "o.zarr"), "--depth"),
        (("information", "lfm-guv", "--depths", "0 um"), "--depth"),
        (("depth", "views.zarr", "--lowest", "0.2", "-o", "o.ply"), "--min-confidence"),
        (("depth", "views.zarr", "--between", "1:2", "-o", "o.pfm"), "--range"),
        (("measure", "sensor", "a.tif", "b.tif", "--highest", "4095"), "--full-scale"),
        (("measure", "edge", "a.tif", "--pitch", "5 um"), "--pixel-pitch"),
        (("render", "views.zarr", "--path", "circle", "--still", "1", "-o", "o.gif"), "--pivot"),
        (("render", "raw.tif", "--finer", "2", "--smoothness", "1", "-o", "o.tif"), "--smooth"),
        (("refocus", "views.zarr", "--alpha", "1", "--shape", "ring", "-o", "o.png"), "--aperture-shape"),
        (("board", "raw.tif", "--views"), "--in-views"),
        (("convert", "a.json", "--views", "9", "-o", "o.json"), "--directions"),
    ],
)
def test_an_option_of_another_name_now_is_refused_with_that_name(lumigraph, words, new):
    result = lumigraph(*words)
    old = next(word.partition("=")[0] for word in words if word.partition("=")[0] in RENAMED)
    assert result.code == 2
    assert f"{old} is now called {new}. Did you mean {new}?" in result.err


def test_an_output_of_another_command_is_kept_unless_it_may_be_overwritten(lumigraph, bench):
    first = ("calibrate", "white.tiff", "-o", "new/folder/c.toml")
    assert lumigraph(*first).code == 0
    before = (bench / "new/folder/c.toml").read_bytes()
    assert lumigraph(*first, "--pixel-pitch", "5 um").code == 0  # the same verb of the same inputs
    assert (bench / "new/folder/c.toml").read_bytes() != before
    other = ("calibrate", "raw.tiff", "-o", "new/folder/c.toml")
    result = lumigraph(*other)
    assert result.code == 1
    assert "was written by another command, 'lumigraph calibrate" in result.err
    assert "add --overwrite" in result.err
    assert "another command" not in lumigraph(*other, "--overwrite").err


def test_a_jpeg_is_written_and_said_to_lose_detail(lumigraph, bench):
    words = ("decode", "raw.tiff", "--white", "white.tiff", "-o", "views.zarr")
    assert lumigraph(*words).code == 0
    result = lumigraph("refocus", "views.zarr", "--alpha", "1", "-o", "picture.jpg")
    assert result.code == 0
    assert "picture.jpg will be a JPEG, which loses detail" in result.err
    assert lumigraph("refocus", "views.zarr", "--alpha", "1", "-o", "picture.png").code == 0
    lossy, exact = (io.open(bench / f"picture.{end}").data for end in ("jpg", "png"))
    assert lossy.dtype == np.uint8
    assert np.abs(lossy / 255 - exact / 65535).max() < 0.02
