"""Lattices drawn pixel by pixel from their definition, and real white images."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import calibration_drawing
import lumigraph as lg
from data_folder import real
from lumigraph import io
from lumigraph.calibration import calibrate, fitting
from lumigraph.calibration.centres import Spots
from lumigraph.calibration.devignette import grey
from lumigraph.core.calibration import Calibration
from lumigraph.core.lattice import Lattice
from lumigraph.core.raw import RawImage
from lumigraph.core.warp import Warp
from lumigraph.errors import CalibrationError


def drawn(lattice, shape, form="round", fill=0.9, over=4):
    """White image: area fraction of each pixel inside micro-images, from over² points a pixel."""
    inside = np.zeros(shape)
    cos, sin = math.cos(lattice.rotation), math.sin(lattice.rotation)
    steps = (np.arange(over) - (over - 1) / 2) / over
    radius = fill * lattice.pitch / 2
    for a in steps:
        for b in steps:
            dy, dx = lattice.offset(np.arange(shape[0])[:, None] + a, np.arange(shape[1])[None, :] + b)
            if form == "round":
                inside += np.hypot(dy, dx) < radius
            elif form == "square":
                inside += np.maximum(np.abs(dy * cos - dx * sin), np.abs(dx * cos + dy * sin)) < radius
            else:
                r = np.hypot(dy, dx) / lattice.pitch
                inside += (1 + np.cos(2 * np.pi * r * 5)) * (r < fill / 2)  # bright ring at the edge
    return inside / over**2


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
    calibration = calibrate(drawn(lattice, shape, fill=fill))
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
    calibration = calibrate(drawn(lattice, (300, 330), form, fill))
    pitch_error, centre_error = errors(calibration, lattice)
    assert pitch_error < 0.02
    assert centre_error < 0.1


def test_turned_hexagonal_lattice_with_rows_along_y():
    lattice = Lattice.hex(17.3, math.pi / 6 - 0.01, (40, 40))
    calibration = calibrate(drawn(lattice, (200, 220)))
    assert calibration.lattice.layout == "hex"
    assert errors(calibration, lattice)[1] < 0.1


def test_largest_pitch_with_few_lenslets():
    lattice = Lattice.square(200.6, 0.03, (110, 120))
    pitch_error, centre_error = errors(calibrate(calibration_drawing.white(lattice, (650, 700))[0]), lattice)
    assert pitch_error < 0.02
    assert centre_error < 0.1


def test_vignetting_noise_and_dust_stay_out(rng):
    lattice = Lattice.square(21.4, 0.01, (9.6, 13.1))
    white = drawn(lattice, (420, 460))
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
    calibration = calibrate(drawn(lattice, (300, 310), fill=0.8))
    found = np.array(calibration.lattice.basis)
    np.testing.assert_allclose(found, lattice.basis, atol=5e-3)


def test_report_numbers_and_index_zero_in_the_middle():
    calibration = calibrate(drawn(Lattice.square(20.0, 0, (5, 5)), (200, 260)))
    assert np.hypot(*(np.array(calibration.lattice.origin) - (100, 130))) <= 20 / math.sqrt(2)
    assert calibration.residual_px == pytest.approx(math.sqrt((calibration.residuals**2).sum(1).mean()))
    assert len(calibration.centers) >= 9 * 12
    assert len(np.unique(calibration.indices, axis=0)) == len(calibration.indices)


def test_same_picture_same_result_whatever_its_type(rng):
    white = np.rint(drawn(Lattice.hex(12.6, 0.02, (5, 5)), (120, 130)) * 200 + rng.uniform(0, 9, (120, 130)))
    first, again = calibrate(white), calibrate(white)
    assert first.lattice == again.lattice
    assert calibrate(white.astype(np.uint8)).lattice == first.lattice


def test_colour_and_bayer_pictures_are_scaled_to_grey():
    white = drawn(Lattice.square(14.2, 0.01, (6, 6)), (180, 200))
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
    white = RawImage(drawn(Lattice.square(12.0, 0, (5, 5)), (100, 100)), pixel_pitch=5e-6)
    calibration = calibrate(white, separation=0.4, lenslet_distance=0.02)
    assert (calibration.pixel_pitch, calibration.separation, calibration.lenslet_distance) == (
        5e-6,
        0.4,
        0.02,
    )
    assert calibrate(white, pixel_pitch=6e-6).pixel_pitch == 6e-6


def test_pitch_and_layout_override():
    white = drawn(Lattice.hex(16.0, 0, (5, 5)), (150, 160))
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
    calibration = calibrate(drawn(getattr(Lattice, layout)(pitch), (100, 120), fill=0.45))
    assert calibration.lattice.layout == layout
    assert calibration.lattice.pitch == pytest.approx(pitch, abs=0.01)


@pytest.mark.parametrize("steps", [(11.2, 0.6), (10.2, 0.6), (10.3, 0.1)])
def test_whole_pixels_of_a_turned_lattice_do_not_make_it_coarser(steps):
    """Squares stand on the same part of a pixel after 5 or 10 cells: 10.22 px was found as 22.86."""
    lattice = Lattice.square(math.hypot(*steps), math.atan2(*steps[::-1]), (5, 6))
    calibration = calibrate(drawn(lattice, (300, 320), "square", 0.77))
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
    calibration = calibrate(drawn(lattice, (300, 330), form, 0.85))
    assert errors(calibration, lattice)[1] < 0.1
    assert calibration.notes == ()


PITCHES = (7.0, 8.4, 10.5, 13.3, 17.25, 21.7, 27.1, 34.865, 45.5, 58.2, 74.9, 91.0)


def truth(layout, pitch, seed=0):
    """The white image of a rotated, tilted camera with 20 dB of noise and 1 % dead lenslets; its centres."""
    rng = np.random.default_rng((seed, int(pitch * 100)))
    shape = (max(250, int(7.3 * pitch)), max(270, int(8.1 * pitch)))
    lattice = getattr(Lattice, layout)(
        pitch, math.radians(rng.uniform(-2, 2)), tuple(rng.uniform(0, pitch, 2))
    )
    warp = Warp(tuple((n - 1) / 2 for n in shape), tuple(rng.uniform(-2e-5, 2e-5, 2)))
    options = {"fill": rng.uniform(0.75, 0.95), "warp": warp, "dead": 0.01, "noise": 0.1, "rng": rng}
    return calibration_drawing.white(lattice, shape, **options)


def check_truth(layout, pitch, seed=0):
    white, true = truth(layout, pitch, seed)
    found = calibrate(white)
    indices = np.stack(found.index(*true.T), -1)
    assert found.lattice.layout == layout
    assert len(np.unique(indices, axis=0)) == len(true)
    assert np.sqrt(((found.position(indices) - true) ** 2).sum(1).mean()) < 0.05


@pytest.mark.parametrize(("layout", "pitch"), [("square", 7.0), ("hex", 13.3), ("square", 34.865)])
def test_centres_are_true_on_noisy_tilted_pictures_with_dead_lenslets(layout, pitch):
    check_truth(layout, pitch)


@pytest.mark.long
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("pitch", PITCHES)
@pytest.mark.parametrize("layout", ["square", "hex"])
def test_centres_are_true_at_all_pitches(layout, pitch, seed):
    check_truth(layout, pitch, seed)


def test_a_tilt_is_fitted_although_micro_images_at_the_border_stand_inwards(rng):
    """By less than a tilt moves them: they are outliers of the fit with it, not of the one without."""
    middle = (391.0, 391.0)
    lattice, warp = Lattice.square(31.25, origin=middle), Warp(middle, (1.9e-6, 0.0))
    indices = np.stack(np.meshgrid(*2 * [np.arange(-12, 13)], indexing="ij"), -1).reshape(-1, 2)
    inwards = np.select([np.abs(indices) == 12, np.abs(indices) == 11], [0.06, 0.03])
    centers = warp.applied(lattice.position(indices)) - np.sign(indices) * inwards
    centers += rng.normal(0, 0.003, centers.shape)
    none = np.zeros((0, 2), int)
    model = Calibration(lattice, (783, 783), none, none.astype(float), 0.0)
    found = fitting.fit(Spots(indices, centers, np.ones(len(indices))), model)
    assert found.warp is not None
    assert found.warp.tilt == pytest.approx(warp.tilt, abs=5e-8)
    assert len(found.spots.indices) == len(indices)


@pytest.mark.long
@pytest.mark.parametrize(
    "built", [{"sensor_tilt": ("95 mrad", "0 mrad")}, {"array_tilt": ("0 mrad", "80 mrad")}]
)
def test_a_camera_that_leans_is_calibrated_by_its_own_white_image(built):
    """Micro-images of simulated light stand where the fit says, to 0.05 px; a straight lattice is off."""
    camera = lg.PlenopticCamera.from_catalogue("thesis-plenoptic-1")
    camera = camera.replace(lenslets={"count": (25, 25)}, built=built)
    found, rays = (
        lg.calibrate(lg.simulate(camera, lg.targets.white(), lg.Incoherent(1e-2))),
        camera.calibration,
    )

    def off(model):
        at = np.stack(model.index(*rays.centers.T), -1)
        return float(np.hypot(*(model.position(at) - rays.centers).T).max())

    assert off(found) < 0.05
    assert off(replace(found, warp=None)) > 0.2


def test_a_tilt_and_a_radial_distortion_are_fitted():
    warp = Warp((149.5, 159.5), (1.5e-4, -8e-5), 2e-7)
    white, true = calibration_drawing.white(Lattice.square(14.7, 0.01), (300, 320), fill=0.8, warp=warp)
    found = calibrate(white)
    assert found.warp is not None
    np.testing.assert_allclose(found.warp.tilt, warp.tilt, atol=1e-5)
    assert found.warp.radial == pytest.approx(warp.radial, rel=0.1)
    indices = np.stack(found.index(*true.T), -1)
    assert np.hypot(*(found.position(indices) - true).T).max() < 0.05


def test_several_white_images_are_averaged(rng):
    white = drawn(Lattice.square(12.3, 0.01), (120, 130))
    several = [white + 0.5 * rng.standard_normal(white.shape) for _ in range(4)]
    assert calibrate(several).residual_px < calibrate(several[0]).residual_px
    with pytest.raises(CalibrationError, match=r"white images have \(120, 130\) and \(60, 130\) pixels"):
        calibrate([white, white[:60]])
    with pytest.raises(CalibrationError, match="list of white images is empty"):
        calibrate([])


def test_a_rotation_that_is_not_there_is_refused():
    white = drawn(Lattice.square(16.0, 0.05), (150, 160))
    assert calibrate(white, rotation=0.06).lattice.rotation == pytest.approx(0.05, abs=1e-3)
    with pytest.raises(CalibrationError, match=r"no lattice of rotation 20\.00 deg"):
        calibrate(white, rotation=math.radians(20))


def two_lattices():
    return drawn(Lattice.square(14.2), (200, 200), fill=0.5) + drawn(
        Lattice.square(20.1, 0.3), (200, 200), fill=0.4
    )


def with_nan():
    white = drawn(Lattice.square(10.0), (60, 60))
    white[3, 4] = np.nan
    return white


@pytest.mark.parametrize(
    ("white", "options", "match"),
    [
        (with_nan, {}, r"1 NaN or infinite values of 3600, the first at index \(3, 4\)"),
        (lambda: np.ones((1, 1)), {}, r"1 x 1 pixels but 3 x 3 lenslets need at least 12 x 12"),
        (lambda: np.full((50, 50), 7.0), {}, r"flat: all its values lie between 7 and 7"),
        (
            lambda: np.random.default_rng(1).random((120, 120)),
            {},
            r"shows no lattice(: its autocorrelation returns to 0\.\d+| for certain: the likeliest)",
        ),
        (
            lambda: drawn(Lattice.square(40.0, 0, (20, 20)), (90, 300)),
            {},
            r"2\.\d x 7\.\d lenslets of pitch 4\d",
        ),
        (two_lattices, {}, r"pitches|one direction|no lattice|micro-images"),
        (
            lambda: np.tile(np.sin(np.arange(120) / 3), (120, 1)),
            {},
            r"repeats every 1\d\.\d px in one direction|no lattice for certain: the likeliest.*scores 0",
        ),
        (
            lambda: drawn(Lattice.square(20.1), (200, 200)),
            {"pitch": 30},
            r"no lattice of pitch 30 px: it has a square lattice of pitch 20\.\d+ px.*pass pitch=20",
        ),
        (
            lambda: drawn(Lattice.square(20.1), (200, 200)),
            {"pitch": 40},
            r"no lattice of pitch 40 px: it has a square lattice of pitch 20\.\d+ px",
        ),
        (lambda: drawn(Lattice.square(20.1), (200, 200)), {"pitch": 2}, r"pitch is 2 px but .* below 4 px"),
        (
            lambda: drawn(Lattice.square(20.1), (200, 200)),
            {"pitch": -2},
            r"pitch is -2 px but must be above 0",
        ),
        (
            lambda: drawn(Lattice.square(20.1), (200, 200)),
            {"layout": "round"},
            r"layout is 'round' but must be",
        ),
        (
            lambda: drawn(Lattice.square(20.1), (200, 200)),
            {"layout": "hex"},
            r"no lattice of layout 'hex': it has a square lattice",
        ),
        (
            lambda: drawn(Lattice(((0, 12.0), (20.0, 0))), (200, 200), fill=0.8),
            {},
            r"shows 2 pitches \(1\d\.\d, 12\.\d px\) 90 deg apart",
        ),
    ],
)
def test_pictures_without_one_lattice_are_refused(white, options, match):
    with pytest.raises(CalibrationError, match=match):
        calibrate(white(), **options)


def test_a_lenslet_is_missing_for_its_darkness_not_for_its_place():
    """One dead, one half covered by dust, which moves its centre by more than four standard deviations."""
    lattice = Lattice.square(15.0, 0.01, (7.0, 7.0))
    white = drawn(lattice, (180, 200))
    y, x = np.mgrid[:180, :200]
    i, j = lattice.index(y, x)
    white[(i == 4) & (j == 5)] = 0
    _, dx = lattice.offset(y, x)
    white[(i == 7) & (j == 6) & (dx > -2)] *= 0.4
    found = calibrate(white)
    dead, dusty = (found.lattice.index(*lattice.position(np.array(at)))[:2] for at in ((4, 5), (7, 6)))
    assert found.missing.tolist() == [list(map(int, dead))]
    assert list(map(int, dusty)) not in found.indices.tolist()  # it is not fitted


def test_dark_places_of_a_scene_are_no_missing_lenslets(rng):
    """Half of the scene is dark; one lenslet is dead in the bright half."""
    lattice = Lattice.square(16.0, 0.0, (8.0, 8.0))
    raw = drawn(lattice, (320, 320), fill=0.85)
    y, x = np.mgrid[:320, :320]
    scene = np.where(x < 150, 0.01, 1.0) * (1 + 0.5 * np.sin(x / 7.3) * np.sin(y / 9.1))
    i, j = lattice.index(y, x)
    raw = raw * scene * ~((i == 9) & (j == 14)) + 0.01 + 0.001 * rng.standard_normal(raw.shape)
    found = calibrate(raw)
    dead = lattice.position(np.array([9, 14]))
    np.testing.assert_allclose(found.position(found.missing), [dead], atol=0.5)
    assert "missing     1 lenslets" in found.report()


def test_saturated_micro_images_are_counted():
    white = drawn(Lattice.square(15.0, 0.0, (7.0, 7.0)), (150, 150))
    found = calibrate(RawImage(np.uint8(255 * white), bit_depth=8))
    assert not len(found.missing)
    assert any("100 of 100 micro-images are saturated" in note for note in found.notes)
