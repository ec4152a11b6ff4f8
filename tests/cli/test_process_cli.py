"""`lumigraph process`, and `lumigraph.process`: everything from a raw image by one call."""

import json
import warnings

import numpy as np
import pytest

import lumigraph as lg
from data_folder import real
from lumigraph.core.progress import silent
from lumigraph.processing.notes import mattering
from lumigraph.processing.recognise import recognise
from lumigraph.processing.steps import Step, Steps

FILES = {
    "all-in-focus.png", "calibration.toml", "depth.png", "depth.tiff", "notes.md", "page.html",
    "process.json", "refocus.gif", "views.zarr",
}  # fmt: skip


def names(folder):
    return {path.name for path in folder.iterdir()}


@pytest.fixture
def made(bench, lumigraph):
    result = lumigraph("process", "raw.tiff", "--white", "white.tiff", "-o", "out")
    assert result.code == 0, result.err
    return bench / "out", result


def test_a_raw_image_and_its_white_image_give_a_folder(made):
    folder, result = made
    assert names(folder) == FILES
    assert "kind: plenoptic 1.0, since neighbouring micro-images share no sharp details" in result.out
    assert "lattice: from the white image, since" in result.out
    assert "a minute and 1 GB" in result.err  # before it begins
    assert lg.open(folder / "calibration.toml").lattice.pitch == pytest.approx(11.5, abs=0.02)
    views = lg.open(folder / "views.zarr")
    assert lg.open(folder / "all-in-focus.png").shape == lg.refocus(views, 1.0).shape
    assert lg.open(folder / "depth.tiff").data.shape == views.lenslets.shape
    notes = (folder / "notes.md").read_text()
    assert "8 samples per lenslet" in notes
    assert "left out: 0" not in notes


def test_a_second_run_keeps_what_stands_and_makes_what_is_missing(made, bench, lumigraph):
    folder, _ = made
    stamps = {path: path.stat().st_mtime_ns for path in folder.iterdir() if path.suffix != ".json"}
    words = "process", "raw.tiff", "--white", "white.tiff", "-o", "out"
    again = lumigraph(*words)
    assert "kept from before: calibration, views, depth, all-in-focus, film, page" in again.out
    assert {path: path.stat().st_mtime_ns for path in stamps} == stamps
    (folder / "refocus.gif").unlink()
    values = json.loads(lumigraph(*words, "--json").out)
    assert values["kept"] == ["calibration", "views", "depth", "all-in-focus", "page"]
    assert (folder / "refocus.gif").is_file()


def test_another_raw_image_is_made_anew_with_the_lattice_that_stands(made, bench, lumigraph):
    raw = lg.open(bench / "raw.tiff")
    lg.save(lg.RawImage(raw.data // 2, bit_depth=12), bench / "raw.tiff")
    again = lumigraph("process", "raw.tiff", "--white", "white.tiff", "-o", "out")
    assert "kept from before: calibration\n" in again.out


def test_files_that_somebody_changed_are_not_lost(made, bench, lumigraph):
    folder, _ = made
    text = (folder / "notes.md").read_text()
    (folder / "notes.md").write_text(text + "my own line\n")
    result = lumigraph("process", "raw.tiff", "--white", "white.tiff", "-o", "out")
    assert result.code == 1
    assert "notes.md was changed since. Move it away, or give another folder." in result.err
    assert (folder / "notes.md").read_text().endswith("my own line\n")


def test_a_folder_of_other_things_is_refused(bench, lumigraph):
    (bench / "mine").mkdir()
    (bench / "mine" / "thesis.txt").write_text("years of work")
    result = lumigraph("process", "raw.tiff", "--white", "white.tiff", "-o", "mine")
    assert "mine holds other things. Give a new one." in result.err


def test_views_need_no_calibration(tmp_path):
    data = np.random.default_rng(1).random((3, 3, 40, 45))
    views = lg.LightField(data, lg.Grid.square(3, 1.0), lg.Grid((40, 45), (1.0, 1.0)), 10.0)
    found = lg.process(views, folder=tmp_path / "out")
    assert found.kind == "views"
    assert names(tmp_path / "out") == FILES - {"calibration.toml", "views.zarr"}
    assert lg.open(tmp_path / "out" / "all-in-focus.png").shape == lg.refocus(views, 1.0).shape


def test_a_camera_without_lenslets_is_refused(bench, lumigraph):
    result = lumigraph("process", "raw.tiff", "--white", "white.tiff", "--camera", "thesis-2f", "-o", "out")
    assert "has no lenslets. Use 'lumigraph deconvolve'." in result.err


def test_the_kind_follows_from_the_camera_the_lattice_or_the_micro_images(bench):
    raw, calibration = lg.open(bench / "raw.tiff"), lg.calibrate(lg.open(bench / "white.tiff"))
    for name, kind in (
        ("lfm-guv", "microscope"),
        ("thesis-plenoptic-1", "plenoptic 1.0"),
        ("thesis-plenoptic-2-m050", "plenoptic 2.0"),
    ):
        found, guess = recognise(raw, calibration, lg.load_camera(name))
        assert (found, guess.value) == (kind, kind)
        assert "the camera file describes a" in guess.reason
    assert recognise(raw, calibration)[0] == "plenoptic 1.0"


def test_warnings_of_a_step_stay_with_it_and_others_are_not_swallowed(tmp_path):
    def make(folder, progress):
        warnings.warn("seen to slip by half a pitch", lg.SamplingWarning, stacklevel=2)
        warnings.warn("another library", UserWarning, stacklevel=2)
        (folder / "a.txt").write_text("a")

    step = Step("a", ("a.txt",), make, "source")
    with pytest.warns(UserWarning, match="another library") as seen:
        assert Steps(tmp_path).run(step, silent)
    assert len(seen) == 1
    again = Steps(tmp_path)
    assert not again.run(step, silent)
    assert again.notes(step) == ["seen to slip by half a pitch"]


def test_notes_that_all_is_well_are_left_out():
    told = (
        "dark: 5 of 900 pixels, 0 lenslets",
        "dark: 5 of 900 pixels, 2 lenslets",
        "the lattice slips by 0.40 of a pitch",
    )
    assert mattering((*told, told[1])) == told[1:]


@pytest.mark.long  # 18 s: patches of three kinds
def test_a_multi_focus_camera_is_recognised_and_rendered_with_the_calibration_beside_it(tmp_path):
    found = lg.process(real("raytrix_r42_multifocus", "sc2_klein.png"), folder=tmp_path / "out")
    assert found.kind == "multi-focus plenoptic 2.0"
    assert [guess.what for guess in found.guesses] == ["kind", "calibration", "lattice"]
    assert any("(+2.2, +2.9) px" in note for note in found.notes)
    # The lattice that is kept is the moved one: a second run would see the maker's in the wrong place.
    first = lg.open(tmp_path / "out" / "calibration.toml")
    assert not first.by_maker
    picture = np.asarray(lg.open(tmp_path / "out" / "all-in-focus.png").data, float)
    assert picture.shape == (113, 162, 3)


def test_small_views_are_shown_larger_and_the_number_is_said(lumigraph, tmp_path):
    picture = np.random.default_rng(3).random((64, 79))
    data = np.stack([[picture[v : v + 60, u : u + 75] for u in range(5)] for v in range(5)])
    views = lg.LightField(data, lg.Grid.square(5, 0.1), lg.Grid((60, 75), (1.0, 1.0)), 10.0)
    lg.save(views, tmp_path / "views.zarr")
    fine = lumigraph("refocus", "views.zarr", "--alpha", "1.02", "-o", "fine.png")
    assert "alpha 1.02: 237 x 297 px, 4 samples per lenslet\n" in fine.out
    plain = lumigraph("refocus", "views.zarr", "--alpha", "1.02", "--oversample", "1", "-o", "plain.png")
    assert "60 x 75 px\n" in plain.out
    assert lumigraph("depth", "views.zarr", "-o", "depth.png").code == 0
    for name in ("fine.png", "depth.png"):
        assert lg.open(tmp_path / name).shape == (237, 297)
