"""Lattices drawn pixel by pixel from their definition, and real white images."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import calibration_drawing
from calibration_drawing import sampled
from data_folder import real
from lumigraph import io
from lumigraph.calibration import calibrate
from lumigraph.calibration.devignette import grey
from lumigraph.core.lattice import Lattice
from lumigraph.core.raw import RawImage
from lumigraph.errors import CalibrationError


def errors(calibration, lattice):
    """Largest error of a pitch and of a centre anywhere on the picture [px]."""
    found = calibration.lattice
    pitch = max(abs(a - b) for a, b in zip(found.pitches, lattice.pitches, strict=True))
    ny, nx = calibration.shape
    centers = found.centers((0, ny - 1), (0, nx - 1))
    return pitch, float(np.hypot(*lattice.offset(*centers.T)).max())


@settings(max_examples=6, deadline=None, derandomize=True)
@given(
    layout=st.sampled_from(["square", "hex"]),
    pitch=st.floats(5.5, 24),
    rotation=st.floats(-0.08, 0.08),
    y=st.floats(0, 1),
    x=st.floats(0, 1),
    fill=st.floats(0.45, 0.92),
)
def test_any_lattice_of_round_micro_images_is_found(layout, pitch, rotation, y, x, fill):
    lattice = getattr(Lattice, layout)(pitch, rotation, (y * pitch, x * pitch))
    shape = max(90, round(8.3 * pitch)), max(110, round(9.1 * pitch))
    calibration = calibrate(sampled(lattice, shape, fill=fill))
    pitch_error, centre_error = errors(calibration, lattice)
    # The tolerances. Whole-pixel centres would miss both by a factor of five.
    assert calibration.lattice.layout == layout
    assert pitch_error < 0.02
    assert centre_error < 0.1
    assert abs(calibration.lattice.rotation - rotation) < 2e-3


@pytest.mark.parametrize(
    ("form", "fill"), [("square", 0.95), ("square", 0.8), ("rings", 0.95), ("round", 0.3)]
)
def test_touching_ringed_and_small_micro_images(form, fill):
    lattice = Lattice.square(31.37, -0.02, (11.3, 17.8))
    calibration = calibrate(sampled(lattice, (300, 330), form, fill))
    pitch_error, centre_error = errors(calibration, lattice)
    assert pitch_error < 0.02
    assert centre_error < 0.1


def test_turned_hexagonal_lattice_with_rows_along_y():
    lattice = Lattice.hex(17.3, math.pi / 6 - 0.01, (40, 40))
    calibration = calibrate(sampled(lattice, (200, 220)))
    assert calibration.lattice.layout == "hex"
    assert errors(calibration, lattice)[1] < 0.1


def test_largest_pitch_with_few_lenslets():
    lattice = Lattice.square(200.6, 0.03, (110, 120))
    pitch_error, centre_error = errors(calibrate(calibration_drawing.white(lattice, (650, 700))[0]), lattice)
    assert pitch_error < 0.02
    assert centre_error < 0.1


def test_vignetting_noise_and_dust_stay_out(rng):
    lattice = Lattice.square(21.4, 0.01, (9.6, 13.1))
    white = sampled(lattice, (420, 460))
    y, x = np.linspace(-1, 1, 420)[:, None], np.linspace(-1, 1, 460)[None, :]
    white = white * (1 - 0.3 * (y**2 + x**2)) + 0.02 * rng.standard_normal(white.shape)
    white[200:212, 230:260] = 0
    white[50:60, 70:75] = 2
    calibration = calibrate(np.clip(np.rint(white * 200), 0, 255).astype(np.uint8))
    pitch_error, centre_error = errors(calibration, lattice)
    assert pitch_error < 0.02
    assert centre_error < 0.1
    assert calibration.residual_px < 0.1


def test_gaps_that_cannot_be_followed_leave_no_residual(tmp_path, rng):
    """A picture whose lattice is known by all its gaps together alone: nothing was measured."""
    raw = io.open(real("raytrix_r42_multifocus", "sc2_klein.png"))
    found = calibrate(raw)
    assert not found.measured
    assert math.isnan(found.residual_px)
    assert "residual    not measured" in found.report()
    io.save(found, tmp_path / "found.toml")
    assert "residual_px = nan  # not measured" in (tmp_path / "found.toml").read_text()
    back = io.open(tmp_path / "found.toml")
    assert math.isnan(back.residual_px)
    assert back.lattice == found.lattice


def test_two_pitches_and_shear_are_kept():
    lattice = Lattice(((-0.03, 15.39), (15.43, 0.2)), (7, 8))
    calibration = calibrate(sampled(lattice, (300, 310), fill=0.8))
    found = np.array(calibration.lattice.basis)
    np.testing.assert_allclose(found, lattice.basis, atol=5e-3)


def test_report_numbers_and_index_zero_in_the_middle():
    calibration = calibrate(sampled(Lattice.square(20.0, 0, (5, 5)), (200, 260)))
    assert np.hypot(*(np.array(calibration.lattice.origin) - (100, 130))) <= 20 / math.sqrt(2)
    assert calibration.residual_px == pytest.approx(math.sqrt((calibration.residuals**2).sum(1).mean()))
    assert len(calibration.centers) >= 9 * 12
    assert len(np.unique(calibration.indices, axis=0)) == len(calibration.indices)


def test_same_picture_same_result_whatever_its_type(rng):
    white = np.rint(
        sampled(Lattice.hex(12.6, 0.02, (5, 5)), (120, 130)) * 200 + rng.uniform(0, 9, (120, 130))
    )
    first, again = calibrate(white), calibrate(white)
    assert first.lattice == again.lattice
    assert calibrate(white.astype(np.uint8)).lattice == first.lattice


def test_colour_and_bayer_pictures_are_scaled_to_grey():
    white = sampled(Lattice.square(14.2, 0.01, (6, 6)), (180, 200))
    colour = white[..., None] * np.array([1.0, 0.5, 0.3])
    bayer = white.copy()
    bayer[::2, ::2] *= 0.3
    bayer[1::2, 1::2] *= 0.5
    for picture in (RawImage(colour), RawImage(bayer, bayer="RGGB")):
        pitch_error, centre_error = errors(calibrate(picture), Lattice.square(14.2, 0.01, (6, 6)))
        assert pitch_error < 0.02
        assert centre_error < 0.1
    np.testing.assert_allclose(grey(RawImage(bayer, bayer="RGGB")).mean(), 1, rtol=1e-3)


def test_geometry_is_kept():
    white = RawImage(sampled(Lattice.square(12.0, 0, (5, 5)), (100, 100)), pixel_pitch=5e-6)
    calibration = calibrate(white, separation=0.4, lenslet_distance=0.02)
    assert (calibration.pixel_pitch, calibration.separation, calibration.lenslet_distance) == (
        5e-6,
        0.4,
        0.02,
    )
    assert calibrate(white, pixel_pitch=6e-6).pixel_pitch == 6e-6


def test_pitch_and_layout_override():
    white = sampled(Lattice.hex(16.0, 0, (5, 5)), (150, 160))
    assert calibrate(white, layout="hex", pitch=16.5).lattice.pitch == pytest.approx(16, abs=0.02)


def test_real_plenoptic_1_white_image():
    from PIL import Image

    white = np.asarray(Image.open(real("letters_plenoptic1", "letters_ULF_M1_white.png")))
    calibration = calibrate(white, pixel_pitch=6.45e-6)
    # Two independent fits gave 48.234 px on both axes and 2.25 mrad; the thread of the picture is that good.
    np.testing.assert_allclose(calibration.lattice.pitches, 48.234, atol=0.01)
    assert calibration.lattice.rotation == pytest.approx(2.25e-3, abs=1.5e-4)
    assert calibration.residual_px < 0.12
    assert calibration.lattice.layout == "square"


def test_real_light_field_microscope_white_image():
    import tifffile

    white = tifffile.imread(real("lfm_guv", "Radiometry_GUVExperim1.tif"))
    calibration = calibrate(white)
    np.testing.assert_allclose(calibration.lattice.pitches, (15.412, 15.390), atol=0.005)
    assert calibration.lattice.rotation == pytest.approx(-2e-3, abs=2e-4)
    assert calibration.residual_px < 0.06
    assert len(calibration.missing) < 10


@pytest.mark.parametrize("layout", ["square", "hex"])
@pytest.mark.parametrize("pitch", [5.5, 6.5, 11.0])
def test_whole_pixels_do_not_make_a_lattice_coarser(layout, pitch):
    """Without noise the picture repeats exactly after whole pixels only: 5.5 px was found as 11."""
    calibration = calibrate(sampled(getattr(Lattice, layout)(pitch), (100, 120), fill=0.45))
    assert calibration.lattice.layout == layout
    assert calibration.lattice.pitch == pytest.approx(pitch, abs=0.01)


@pytest.mark.parametrize("steps", [(11.2, 0.6), (10.2, 0.6), (10.3, 0.1)])
def test_whole_pixels_of_a_turned_lattice_do_not_make_it_coarser(steps):
    """Squares stand on the same part of a pixel after 5 or 10 cells: 10.22 px was found as 22.86."""
    lattice = Lattice.square(math.hypot(*steps), math.atan2(*steps[::-1]), (5, 6))
    calibration = calibrate(sampled(lattice, (300, 320), "square", 0.77))
    pitch_error, centre_error = errors(calibration, lattice)
    assert pitch_error < 0.01
    assert centre_error < 0.1


def test_touching_discs_of_one_kind_are_not_three_kinds(rng):
    white = calibration_drawing.white(Lattice.hex(21.3, 0.01), (330, 350), fill=1.0, noise=0.05, rng=rng)[0]
    calibration = calibrate(white)
    assert calibration.lattice.kinds == 1
    assert calibration.lattice.pitch == pytest.approx(21.3, abs=0.01)


@pytest.mark.parametrize("fill", [1.06, 1.1, 1.25])
@pytest.mark.parametrize(("layout", "pitch"), [("hex", 21.3), ("hex", 9.7), ("square", 14.6)])
def test_overlapping_discs_have_their_centres_where_it_is_dark(layout, pitch, fill, rng):
    """Beyond 1.056 pitches (hex; square: 1.22) the brightest places are between the micro-images."""
    lattice = getattr(Lattice, layout)(pitch, 0.01, (5, 6))
    white = calibration_drawing.white(lattice, (250, 270), fill=fill, noise=0.02, rng=rng)[0]
    calibration = calibrate(white)
    pitch_error, centre_error = errors(calibration, lattice)
    # The brightest places are 0.58 (square: 0.71) of a pitch from the centres.
    assert pitch_error < 0.01
    assert centre_error < 0.1
    assert calibration.residual_px < 0.05
    if layout == "hex" or fill > 1.2:
        assert calibration.fill == pytest.approx(fill, abs=0.03)
        assert "micro-images overlap" in calibration.notes[0]


@pytest.mark.parametrize("layout", ["square", "hex"])
@pytest.mark.parametrize("form", ["square", "rings"])
def test_other_forms_are_not_taken_for_overlapping_discs(layout, form):
    lattice = getattr(Lattice, layout)(21.3, 0.01, (5, 6))
    calibration = calibrate(sampled(lattice, (300, 330), form, 0.85))
    assert errors(calibration, lattice)[1] < 0.1
    assert calibration.notes == ()


def test_several_white_images_are_averaged(rng):
    white = sampled(Lattice.square(12.3, 0.01), (120, 130))
    several = [white + 0.5 * rng.standard_normal(white.shape) for _ in range(4)]
    assert calibrate(several).residual_px < calibrate(several[0]).residual_px
    with pytest.raises(CalibrationError, match=r"white images have \(120, 130\) and \(60, 130\) pixels"):
        calibrate([white, white[:60]])
    with pytest.raises(CalibrationError, match="list of white images is empty"):
        calibrate([])
