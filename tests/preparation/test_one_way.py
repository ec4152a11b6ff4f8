"""What each way in does with a raw image that has an offset, vignetting and a colour mosaic."""

from dataclasses import replace

import numpy as np
import pytest

import lumigraph as lg
from data_folder import real
from lumigraph import viewer
from lumigraph.calibration import calibrate
from lumigraph.cli.origin import RawOptions
from lumigraph.core.stack import Stack
from lumigraph.deconvolution import Exposure
from lumigraph.errors import CalibrationError, FormatError, SamplingWarning
from lumigraph.preparation import Reason
from lumigraph.preparation.given import read_pages

PITCH, OFFSET = 12.4, 50.0


@pytest.fixture
def bench(tmp_path):
    """raw, white, dark; the same behind an RGGB mosaic; a maker's lattice two pixels off."""
    y, x = np.mgrid[:200, :220].astype(float)
    dy, dx = lg.Lattice.square(PITCH, 0, (100, 110)).offset(y, x)
    even = 4000 * np.exp(-((np.hypot(dy, dx) / 5.3) ** 6)) * (1 - 0.3 * (y / 200 - 0.5) ** 2)
    scene = 0.5 + 0.3 * np.sin(y / 40) * np.sin(x / 30)
    for name, light in (("white", even), ("raw", even * scene), ("dark", 0 * even)):
        data = (light + OFFSET).astype(np.float32)
        lg.save(lg.RawImage(data), tmp_path / f"{name}.tiff")
        lg.save(lg.RawImage(data, bayer="RGGB"), tmp_path / f"{name}-bayer.zarr")
    return tmp_path


def expected(shape=(200, 220)):
    y, x = np.indices(shape)
    return 0.5 + 0.3 * np.sin(y / 40) * np.sin(x / 30)


@pytest.mark.parametrize("kind", ["", "-bayer"])
def test_python_verbs_and_viewer_see_the_same_picture(kind, bench):
    ending = "zarr" if kind else "tiff"
    raw, white, dark = (bench / f"{name}{kind}.{ending}" for name in ("raw", "white", "dark"))
    ready = lg.prepare(lg.open(raw), white=lg.open(white), dark=lg.open(dark))
    verb = RawOptions(white=white, dark=dark).prepared(lg.open(raw))
    shown = viewer.open_exhibit(raw, viewer.Origin(white=white, dark=dark))
    np.testing.assert_array_equal(verb.data, ready.data)
    np.testing.assert_array_equal(shown.raw.data, ready.data)
    np.testing.assert_array_equal(shown.views.data, lg.decode(ready).data)
    assert ready.data.shape == ((200, 220, 3) if kind else (200, 220))
    centres = np.rint(ready.calibration.centers_within((20, 180), (20, 200))).astype(int)
    y, x = centres.T
    seen = ready.data[y, x].reshape(len(y), -1).mean(-1) / expected()[y, x]
    np.testing.assert_allclose(seen, 4000 / ((3200 + OFFSET) if kind else 1), rtol=0.12)


def test_a_deconvolution_takes_dark_and_white_into_its_model_and_leaves_the_raw_image(bench):
    raw, white, dark = (lg.open(bench / f"{name}.tiff") for name in ("raw", "white", "dark"))
    ready = lg.prepare(raw, white=white, dark=dark, divide=False)
    np.testing.assert_array_equal(ready.data, raw.data)
    exposure = Exposure.of(ready)
    assert np.all(exposure.background == OFFSET)
    assert 0.6 < exposure.response.min() < exposure.response.max() == 1
    assert ready.calibration.lattice.pitch == pytest.approx(PITCH, abs=0.01)


def test_a_calibration_that_does_not_fit_is_refused_by_each(bench):
    raw = lg.open(bench / "raw.tiff")
    found = calibrate(lg.open(bench / "white.tiff"))
    lattice = replace(found.lattice, basis=tuple((1.1 * y, 1.1 * x) for y, x in found.lattice.basis))
    wrong = replace(found, lattice=lattice, residual_px=0.0)
    lg.save(wrong, bench / "wrong.toml")
    with pytest.raises(CalibrationError, match="slip by"):
        RawOptions(calibration=bench / "wrong.toml").prepared(raw)
    with pytest.raises(CalibrationError, match="slip by"):
        viewer.open_exhibit(bench / "raw.tiff", viewer.Origin(calibration=bench / "wrong.toml"))
    for verb in (lg.prepare, lg.decode, lg.depth.correlation):
        with pytest.raises(CalibrationError, match="slip by"):
            verb(raw, wrong)


def test_each_pixel_and_lenslet_that_does_not_count_has_its_reason(bench):
    raw, white, dark = (np.array(lg.open(bench / f"{name}.tiff").data) for name in ("raw", "white", "dark"))
    full = np.minimum(raw, 1000).astype(np.uint16)
    full[60:90, 60:90] = 1023
    full[-20:] = 0
    dark[100, 110] += 500
    white[130:170, 130:170] = OFFSET
    ready = lg.prepare(lg.RawImage(full, bit_depth=10), white=white, dark=dark)
    for place, reason in (
        ((75, 75), Reason.SATURATED), ((190, 20), Reason.DEAD), ((100, 110), Reason.DEAD),
        ((150, 150), Reason.DARK), ((100, 0), Reason.OUTSIDE), ((100, 122), Reason.GOOD),
    ):  # fmt: skip
        assert ready.reasons[place] == reason, place
    verdict = dict(zip(map(tuple, ready.lenslets.indices), ready.lenslets.reasons, strict=True))
    for place, reason in (((75, 75), Reason.SATURATED), ((195, 110), Reason.DEAD), ((150, 150), Reason.DARK)):
        i, j = ready.calibration.index(*map(np.array, place))
        assert verdict[int(i), int(j)] == reason, place
    assert any(note.startswith("saturated: 900 of 44000 pixels") for note in ready.notes)
    views = lg.decode(ready)
    assert not views.valid.all(), "dark and dead lenslets are left out"
    assert views.valid.mean() > 0.7


def test_a_camera_file_that_contradicts_the_picture_is_told_with_both_pitches(bench):
    scope = lg.LightFieldMicroscope.from_catalogue("lfm-guv")
    lengths = {"pixel_pitch": f"{scope.lenslets.pitch / PITCH * 1.02 * 1e6} um"}
    scope = scope.replace(sensor=lengths)
    raw, white, dark = (lg.open(bench / f"{name}.tiff") for name in ("raw", "white", "dark"))
    with pytest.warns(SamplingWarning, match=r"12\.40\d px.*12\.157 px .* a relay of 1\.02 instead of 1\."):
        ready = lg.prepare(raw, white=white, dark=dark, camera=scope)
    assert ready.calibration.pixel_pitch == scope.sensor.pixel_pitch
    agreeing = scope.replace(relay_magnification=1.02)
    assert any(
        "they agree" in note for note in lg.prepare(raw, white=white, dark=dark, camera=agreeing).notes
    )


def test_a_raw_image_alone_says_what_it_implies_about_the_camera_file(bench):
    scope = lg.LightFieldMicroscope.from_catalogue("lfm-guv")
    raw = lg.open(bench / "raw.tiff")

    def seen(stretch):
        pixel = f"{scope.lenslets.pitch / PITCH * stretch * 1e6} um"
        return scope.replace(sensor={"pixel_pitch": pixel, "shape": raw.shape})

    notes = lg.prepare(raw, camera=seen(1.0)).notes
    assert any("a pitch of 12.399" in note and "they agree" in note for note in notes)
    with pytest.warns(SamplingWarning, match=r"every 12\.399.*This would be a relay of 1\.02 instead of 1\."):
        ready = lg.prepare(raw, camera=seen(1.02))
    assert any("The camera's lattice is used" in note for note in ready.notes)
    with pytest.raises(
        CalibrationError, match=r"every 12\.399.*This would be a relay of 1\.08 instead of 1\."
    ):
        lg.prepare(raw, camera=seen(1.08))


@pytest.mark.parametrize(
    ("pages", "numbers"), [("1", [1]), ("1:3", [1, 2, 3]), ("1-3", [1, 2, 3]), ("all", [0, 1, 2, 3])]
)
def test_pages_of_a_stack_are_named_one_by_one_or_as_a_range(pages, numbers, tmp_path):
    frames = np.arange(4, dtype=np.uint16)[:, None, None] * np.ones((20, 30), np.uint16)
    lg.save(Stack(frames), tmp_path / "film.tif")
    found = read_pages(tmp_path / "film.tif", pages)
    assert [int(np.max(raw.data)) for raw in found.values()] == list(found) == numbers
    for wrong in ("-1", "3-1", "2-4", "1-2-3", "a"):
        with pytest.raises(FormatError, match=r"has pages 0 to 3\. Give one, some as '0:3'"):
            read_pages(tmp_path / "film.tif", wrong)


@pytest.mark.long  # calibrates and decodes real pictures
@pytest.mark.parametrize(
    ("folder", "name"),
    [
        ("lfm_mouse_brain", "LF_img_train_0.tif"),
        ("lfm_worm", "20131219WORM2_small_full_neg_X1_N15_cropped_uncompressed.tif"),
        ("letters_plenoptic1", "letters_ULF_M1.png"),
    ],
)
def test_pictures_of_a_raw_image_calibrated_alone_have_no_seams(folder, name):
    """Lenslets were left out for standing off the lattice: 8 and 20 % of the picture differed by over 2 %."""
    raw = lg.open(real(folder, name))
    views = lg.decode(raw, calibrate(raw))
    valid, bare = (lg.refocus(v, 1.02, oversample=1) for v in (views, replace(views, valid=None)))
    assert (np.abs(valid - bare) / np.maximum(bare, 0.02 * np.percentile(bare, 99))).max() < 0.02


def test_how_many_lenslets_are_left_out_is_always_said(bench):
    white, dark = lg.open(bench / "white.tiff"), lg.open(bench / "dark.tiff")
    ready = lg.prepare(lg.open(bench / "raw.tiff"), white=white, dark=dark)
    whole = ready.calibration
    assert f"left out: 0 of {len(ready.lenslets.reasons)} lenslets" in ready.notes
    ready = lg.prepare(lg.open(bench / "raw.tiff"), replace(whole, missing=np.array([[0, 0], [2, 1]])))
    assert f"left out: 2 of {len(ready.lenslets.reasons)} lenslets" in ready.notes
    assert ready.calibration.misses(np.array([[0, 0], [1, 2], [2, 1]])).tolist() == [True, False, True]


def test_a_raw_image_of_true_and_false_is_one_of_1_and_0(bench):
    """Its range was the difference of two truths, which NumPy refuses."""
    white = lg.open(bench / "white.tiff")
    bright = lg.open(bench / "raw.tiff").data > white.data.mean()
    views = [lg.decode(lg.prepare(one, calibrate(white))).data for one in (bright, bright.astype(np.uint8))]
    np.testing.assert_array_equal(*views)
