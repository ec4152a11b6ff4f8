import numpy as np
import pytest

from lumigraph.calibration import devignette
from lumigraph.core.arrays import to_numpy
from lumigraph.core.raw import RawImage
from lumigraph.errors import CalibrationError


@pytest.fixture
def white(rng):
    return 50 + 150 * rng.random((24, 30))


def test_scene_times_white_gives_the_scene(white, rng):
    scene = rng.random((24, 30))
    got = devignette(RawImage(scene * white, 5e-6), white)
    scale = np.percentile(white, 99)
    np.testing.assert_allclose(got.data, scene * scale, rtol=1e-6)
    assert got.data.dtype == np.float32
    assert got.pixel_pitch == 5e-6


def test_gaps_are_not_blown_up(white):
    white[5] = 0.001
    got = devignette(np.full((24, 30), 10.0), white, floor=0.2).data
    assert np.isfinite(got).all()
    np.testing.assert_allclose(got[5], 10 / 0.2, rtol=1e-6)


def test_dark_is_taken_off_both(white, rng):
    scene, dark = rng.random((24, 30)), np.full((24, 30), 12.0)
    got = devignette(scene * white + dark, white + dark, dark=dark).data
    np.testing.assert_allclose(got, devignette(scene * white, white).data, rtol=1e-4)


def test_colours_of_colour_and_bayer_pictures_stay(white):
    tint = np.array([1.0, 0.5, 0.25])
    got = devignette(np.full((24, 30, 3), 8.0) * white[..., None], white[..., None] * tint).data
    scale = np.percentile(white, 99)
    np.testing.assert_allclose(got, np.broadcast_to(8 * scale, got.shape), rtol=1e-5)
    bayer = white.copy()
    bayer[::2, ::2] *= 0.3
    raw = RawImage(8 * white, bayer="RGGB")
    ratio = devignette(raw, RawImage(bayer, bayer="RGGB")).data
    assert ratio[::2, ::2].std() / ratio[::2, ::2].mean() < 1e-5
    assert devignette(raw, bayer).bayer == "RGGB"
    grey_white = devignette(np.ones((24, 30, 3)), white).data
    assert grey_white.shape == (24, 30, 3)


def test_array_library_is_kept_and_inputs_untouched(xp, white):
    raw = xp.asarray((white * 2).astype(np.float32))
    before = to_numpy(raw).copy()
    got = devignette(RawImage(raw), white).data
    assert type(got) is type(raw)
    assert str(got.dtype).endswith("float32")
    np.testing.assert_allclose(to_numpy(got), 2 * np.percentile(white, 99), rtol=1e-5)
    np.testing.assert_array_equal(to_numpy(raw), before)


def test_bad_input_is_refused(white):
    with pytest.raises(
        CalibrationError, match=r"white image has shape \(24, 30\) but the raw image \(20, 30\)"
    ):
        devignette(np.ones((20, 30)), white)
    with pytest.raises(CalibrationError, match="white image has no light: its 99th percentile is 0"):
        devignette(np.ones((24, 30)), np.zeros((24, 30)))
    with pytest.raises(CalibrationError, match="floor is 2 but must be between 0 and 1"):
        devignette(np.ones((24, 30)), white, floor=2)
    white[0, 0] = np.nan
    with pytest.raises(CalibrationError, match="the white image has 1 NaN"):
        devignette(np.ones((24, 30)), white)
