import math
from dataclasses import replace

import numpy as np
import pytest

from lumigraph.core.grid import Grid
from lumigraph.errors import FormatError, GeometryError, LumigraphError
from lumigraph.sensor import Sensor, mosaic

SENSOR = Sensor((200, 300), 5e-6, full_well=20000, read_noise=12.0, bits=14)


@pytest.mark.parametrize("level", [0.05, 0.3, 0.7])
def test_noise_follows_the_photon_transfer_curve(rng, level):
    # Variance = photons + read noise² + 1/12 of a level: Janesick, Photon Transfer, 2007.
    raw = SENSOR.expose(np.full(SENSOR.shape, level), reference=1.0, fill=1.0, rng=rng)
    electrons = raw.data.astype(float) * SENSOR.full_well / SENSOR.levels
    expected = level * 20000
    variance = expected + 12.0**2 + (SENSOR.full_well / SENSOR.levels) ** 2 / 12
    # 60,000 pixels: the mean to 5σ/245, the variance to 5 sqrt(2/60000) = 3 %.
    assert electrons.mean() == pytest.approx(expected, abs=5 * math.sqrt(variance / 60000))
    assert electrons.var() == pytest.approx(variance, rel=0.03)


def test_a_black_level_keeps_the_noise_of_dark_pixels(rng):
    """Mean and variance in the dark as the model says; clipped at 0 they are .8 and 1.5, not 0 and 4.3."""
    sensor = replace(SENSOR, bits=12, full_well=10000, read_noise=5.0)
    expected = (5.0 / sensor.gain) ** 2 + 1 / 12
    clipped = sensor.expose(np.zeros(sensor.shape), rng=rng).data
    assert (clipped.mean(), clipped.var()) == (pytest.approx(0.8, abs=0.02), pytest.approx(1.47, abs=0.05))
    dark = replace(sensor, black_level=64).expose(np.zeros(sensor.shape), rng=rng).data
    assert dark.mean() == pytest.approx(64, abs=5 * math.sqrt(expected / dark.size))
    assert dark.var() == pytest.approx((5.0 / (10000 / (4095 - 64))) ** 2 + 1 / 12, rel=0.03)


def test_photons_become_electrons_by_the_quantum_efficiency_and_dark_current_adds(rng):
    sensor = replace(SENSOR, quantum_efficiency=0.6, dark_current=200.0, exposure_time=0.5, black_level=32)
    raw = sensor.expose(np.full(sensor.shape, 2.0), photons=2500, rng=rng)
    electrons = (raw.data - 32.0) * sensor.gain
    variance = 0.6 * 5000 + 100 + 12.0**2 + sensor.gain**2 / 12
    assert electrons.mean() == pytest.approx(0.6 * 5000 + 100, abs=5 * math.sqrt(variance / 60000))
    assert electrons.var() == pytest.approx(variance, rel=0.03)
    known = {
        name: raw.metadata[name] for name in ("photons_per_intensity", "dark_signal", "black_level", "gain")
    }
    expected = {"photons_per_intensity": 2500, "dark_signal": 100, "black_level": 32, "gain": sensor.gain}
    assert known == pytest.approx(expected)


def test_fixed_patterns_stay_from_exposure_to_exposure_and_differ_between_sensors(rng):
    """The covariance of two exposures: (PRNU mean)² + DSNU², PRNU alone of it in proportion to light."""
    sensor = replace(SENSOR, prnu=0.02, dsnu=30.0, black_level=200)
    for light in (0.0, 0.5):
        pair = [
            sensor.expose(np.full(sensor.shape, light), reference=1, fill=1, rng=rng).data for _ in range(2)
        ]
        found = np.cov(*(each.ravel() * sensor.gain for each in pair))[0, 1]
        assert found == pytest.approx((0.02 * light * 20000) ** 2 + 30.0**2, rel=0.05)
    other = replace(sensor, pattern_seed=1).expose(np.full(sensor.shape, 0.5), reference=1, fill=1).data
    own = sensor.expose(np.full(sensor.shape, 0.5), reference=1, fill=1).data
    assert abs(np.corrcoef(own.ravel(), other.ravel())[0, 1]) < 0.02


def test_what_is_left_out_changes_no_exposure():
    """The numbers of a sensor without the newer fields, as they were before those came."""
    light = np.array([[0.0, 0.25, 0.5], [0.75, 1.0, 0.1]])
    raw = Sensor((2, 3), 5e-6).expose(light, rng=np.random.default_rng(3))
    assert raw.data.tolist() == [[0, 888, 1868], [2710, 3681, 376]]


def test_without_random_numbers_an_exposure_is_rounded_only():
    light = np.linspace(0, 1, 60000).reshape(SENSOR.shape)
    raw = SENSOR.expose(light, reference=1.0, fill=1.0)
    np.testing.assert_array_equal(raw.data, np.rint(light * (2**14 - 1)))
    assert (raw.data.dtype, raw.bit_depth, raw.pixel_pitch) == (np.uint16, 14, 5e-6)
    assert raw.metadata["electrons_per_intensity"] == 20000


def test_the_brightest_pixel_fills_nine_tenths_of_a_well_unless_told():
    light = np.random.default_rng(1).random(SENSOR.shape) * 7
    assert SENSOR.expose(light).data.max() == round(0.9 * (2**14 - 1))
    assert SENSOR.expose(np.zeros(SENSOR.shape)).data.max() == 0


def test_overexposure_clips_at_the_highest_number():
    raw = Sensor((1, 3), 5e-6, bits=8).expose(np.array([[0.5, 1.0, 2.0]]), reference=1.0, fill=1.2)
    assert raw.data.dtype == np.uint8
    assert raw.data.tolist() == [[153, 255, 255]]


def test_colour_light_and_other_libraries_are_read_out(xp):
    raw = Sensor((2, 4), 5e-6).expose(xp.asarray(np.ones((2, 4, 3), np.float32)))
    assert isinstance(raw.data, np.ndarray)
    assert raw.data.shape == (2, 4, 3)


def test_the_same_seed_gives_the_same_raw_image():
    light = np.full(SENSOR.shape, 0.5)
    first, second, third = (SENSOR.expose(light, rng=np.random.default_rng(s)).data for s in (7, 7, 8))
    assert (first == second).all()
    assert (first != third).any()


def test_the_grid_is_that_of_the_pixels():
    assert Sensor((3, 4), 5e-6).grid == Grid((3, 4), 5e-6)


@pytest.mark.parametrize(
    ("light", "error", "message"),
    [
        (
            np.ones((4, 4)),
            GeometryError,
            r"intensity has shape \(4, 4\) but the sensor has \(200, 300\) pixels",
        ),
        (np.full((200, 300), np.nan), LumigraphError, "intensity has 60000 NaN or infinite values"),
        (np.full((200, 300), -0.1), LumigraphError, r"intensity goes down to -0\.1 but light is at least 0"),
    ],
)
def test_light_that_cannot_be_is_refused(light, error, message):
    with pytest.raises(error, match=message):
        SENSOR.expose(light)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"shape": (0, 4)}, "both numbers must be at least 1"),
        ({"pixel_pitch": -1e-6}, "pixel_pitch is -1e-06 m but must be above 0 m"),
        ({"full_well": 0}, "full_well is 0 electrons but must be above 0 electrons"),
        ({"read_noise": -1}, "read_noise is -1 electrons but must be at least 0"),
        ({"quantum_efficiency": 1.2}, "quantum_efficiency is 1.2 but must be above 0 and at most 1"),
        ({"dark_current": -1}, "dark_current is -1 electrons per second but must be at least 0"),
        ({"exposure_time": math.nan}, "exposure_time is nan but must be a finite number"),
        ({"black_level": 255, "bits": 8}, "black_level is 255 but the highest number of 8 bits is 255"),
        ({"pattern_seed": -1}, "pattern_seed is -1 but must be a whole number of at least 0"),
        ({"bits": 17}, "bits is 17 but must be a whole number from 1 to 16"),
        ({"bits": 8.0}, "bits is 8.0 but must be a whole number"),
    ],
)
def test_impossible_sensors_are_refused(changes, message):
    with pytest.raises(GeometryError, match=message):
        Sensor(**({"shape": (4, 4), "pixel_pitch": 5e-6} | changes))


def test_exposures_need_a_reference_and_a_fill_above_zero():
    with pytest.raises(GeometryError, match="reference is 0 but must be above 0"):
        SENSOR.expose(np.ones(SENSOR.shape), reference=0.0)
    with pytest.raises(GeometryError, match="fill is -1 but must be above 0"):
        SENSOR.expose(np.ones(SENSOR.shape), fill=-1.0)
    with pytest.raises(GeometryError, match="photons 100 and reference 2 both set the scale"):
        SENSOR.expose(np.ones(SENSOR.shape), photons=100, reference=2)


@pytest.mark.parametrize("pattern", ["RGGB", "GRBG", "GBRG", "BGGR"])
def test_each_pixel_behind_a_bayer_filter_sees_its_colour(xp, pattern):
    image = xp.asarray(np.random.default_rng(2).random((5, 6, 3), np.float32))
    seen = mosaic(image, pattern)
    assert seen.shape == (5, 6)
    assert seen.dtype == image.dtype
    for y in range(5):
        for x in range(6):
            assert float(seen[y, x]) == float(image[y, x, "RGB".index(pattern[2 * (y % 2) + x % 2])])


def test_mosaics_of_other_shapes_and_patterns_are_refused():
    with pytest.raises(GeometryError, match=r"a colour image has shape \(y, x, 3\), not \(4, 4\)"):
        mosaic(np.ones((4, 4)))
    with pytest.raises(FormatError, match="pattern is 'RGB' but must be one of RGGB"):
        mosaic(np.ones((4, 4, 3)), "RGB")
