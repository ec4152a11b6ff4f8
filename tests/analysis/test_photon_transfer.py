"""Photon transfer gives back the sensor that made the images."""

import math
from dataclasses import replace

import numpy as np
import pytest

from lumigraph.analysis import photon_transfer
from lumigraph.errors import CalibrationError, SamplingWarning
from lumigraph.sensor import Sensor

SENSOR = Sensor(
    (400, 400), 5e-6, full_well=12000, read_noise=7.0, bits=12, quantum_efficiency=0.6,
    dark_current=500.0, exposure_time=0.02, black_level=120, prnu=0.015, dsnu=6.0,
)  # fmt: skip
TIMES = (0.02, 2.0, 4.0)


def pair(sensor, light, rng):
    """Two exposures of an even light that fills this part of the well."""
    even = np.full(sensor.shape, light)
    return [sensor.expose(even, reference=1, fill=1, rng=rng) for _ in range(2)]


@pytest.fixture(scope="module")
def found():
    rng = np.random.default_rng(4)
    flats = [pair(SENSOR, light, rng) for light in (0.05, 0.15, 0.3, 0.45, 0.6, 0.8, 0.95, 1.1)]
    darks = [pair(replace(SENSOR, exposure_time=t), 0.0, rng) for t in TIMES]
    return photon_transfer(flats, darks, exposure_times=TIMES)


def test_gain_noise_dark_signal_and_full_well_come_back_within_two_percent(found):
    """As other ways would not: images not paired (PRNU in the variance) give a gain a sixth too small."""
    assert found.gain == pytest.approx(SENSOR.gain, rel=0.005)
    assert found.read_noise == pytest.approx(SENSOR.read_noise, rel=0.02)
    assert found.dark_noise == pytest.approx(SENSOR.dark_noise, rel=0.01)
    assert found.dark_signal == pytest.approx(120 + 10 / SENSOR.gain, rel=0.001)
    assert found.dark_current == pytest.approx(500, rel=0.01)
    assert found.black_level == pytest.approx(120, rel=0.001)
    assert found.full_well == pytest.approx(12000 - SENSOR.dark_signal, rel=0.005)


def test_fixed_patterns_come_back(found):
    assert found.prnu == pytest.approx(0.015, rel=0.02)
    assert found.dsnu == pytest.approx(6.0, rel=0.03)


def test_only_flats_below_seven_tenths_of_saturation_are_fitted(found):
    assert found.fitted.tolist() == [True] * 5 + [False] * 3


def test_the_error_of_the_gain_is_what_repeated_measurements_spread():
    sensor, gains, errors = replace(SENSOR, shape=(50, 50)), [], []
    for seed in range(60):
        rng = np.random.default_rng(seed)
        one = photon_transfer([pair(sensor, x, rng) for x in (0.2, 0.5)], [pair(sensor, 0.0, rng)])
        gains.append(one.gain)
        errors.append(one.gain_error)
    assert np.std(gains) == pytest.approx(np.mean(errors), rel=0.3)  # 60 of them: 3 / sqrt(120)
    assert np.mean(gains) == pytest.approx(sensor.gain, rel=4 * np.mean(errors) / sensor.gain / math.sqrt(60))


def test_uneven_light_makes_the_gain_less_sure():
    """Ten parts dark, one bright: taken as even, errors would be said 3 times too small."""
    sensor, gains, errors = Sensor((40, 110), 5e-6, read_noise=2.0, black_level=80), [], []
    light = np.where(np.arange(110) % 11 == 0, 0.6, 0.003) * np.ones((40, 1))
    for seed in range(40):
        rng = np.random.default_rng(seed)
        flats = [sensor.expose(light, photons=9000, rng=rng) for _ in range(2)]
        darks = [sensor.expose(0 * light, photons=9000, rng=rng) for _ in range(2)]
        measured = photon_transfer([flats], [darks])
        gains.append(measured.gain)
        errors.append(measured.gain_error)
    assert np.std(gains) == pytest.approx(np.mean(errors), rel=0.35)


def test_quantisation_is_no_noise_of_the_sensor(rng):
    """It would be 4 % of this one's."""
    quiet = replace(SENSOR, read_noise=3.0, dark_current=0.0)
    found = photon_transfer([pair(quiet, x, rng) for x in (0.2, 0.4, 0.6)], [pair(quiet, 0.0, rng)])
    assert found.dark_noise == pytest.approx(3.0, rel=0.015)
    assert found.dark_noise_error == pytest.approx(0.006, rel=0.5)


def test_without_saturation_or_exposure_times_what_they_tell_is_left_out(rng):
    found = photon_transfer([pair(SENSOR, 0.4, rng)], [pair(SENSOR, 0.0, rng)])
    assert (found.full_well, found.read_noise, found.dark_current, found.black_level) == (None,) * 4
    assert found.gain == pytest.approx(SENSOR.gain, rel=0.02)


def test_bare_arrays_saturate_where_told(rng):
    arrays = [[each.data for each in pair(SENSOR, light, rng)] for light in (0.3, 0.5, 1.2)]
    dark = [each.data for each in pair(SENSOR, 0.0, rng)]
    assert photon_transfer(arrays, [dark], full_scale=4095).full_well == pytest.approx(11990, rel=0.02)


def test_dark_noise_finer_than_the_numbers_warns(rng):
    coarse = replace(SENSOR, bits=8, black_level=10, read_noise=4.0, dsnu=0.0)
    with pytest.warns(SamplingWarning, match=r"the variance in the dark is 0\.\d+ counts², below 0\.24"):
        photon_transfer([pair(coarse, 0.5, rng)], [pair(coarse, 0.0, rng)])


def test_images_that_measure_no_sensor_are_refused(rng):
    dark, flat = pair(SENSOR, 0.0, rng), pair(SENSOR, 0.5, rng)
    clipped = pair(replace(SENSOR, black_level=0, dark_current=0, dsnu=0), 0.0, rng)
    for flats, darks, message in [
        ([], [dark], "there are 0 pairs of flats and 1 of darks"),
        ([flat[:1]], [dark], "a pair of images has 1 of them"),
        ([[flat[0].data, np.ones((3, 3))]], [dark], r"shapes \(400, 400\) and \(3, 3\)"),
        ([flat], [clipped], r"0\.\d+ of the dark pixels read 0: .* Raise the black level by 10 counts"),
        ([pair(SENSOR, 1.5, rng)], [dark], r"no flat lies between the dark signal of 123\.\d and 70%"),
        ([dark], [flat], "no flat lies between"),
    ]:
        with pytest.raises(CalibrationError, match=message):
            photon_transfer(flats, darks)
    even = [np.full((9, 9), 900.0) for _ in range(2)]
    with pytest.raises(CalibrationError, match="the variance does not grow with the mean"):
        photon_transfer([even], [[each.data for each in dark]])
    with pytest.raises(
        CalibrationError, match="there are 2 exposure times, 1 of them different, for 1 pairs"
    ):
        photon_transfer([flat], [dark], exposure_times=[1.0, 1.0])


def test_a_dark_pair_errs_in_noise_and_gain_alike():
    """Dim flats: both grow with the dark variance. Errors added as independent ones would be a third less."""
    sensor, light, found = (
        Sensor((60, 60), 5e-6, read_noise=12.0, black_level=100),
        np.full((60, 60), 0.05),
        [],
    )
    for seed in range(80):
        rng = np.random.default_rng(seed)
        flats = [[sensor.expose(light, photons=4000, rng=rng) for _ in range(2)] for _ in range(9)]
        found.append(photon_transfer(flats, [pair(sensor, 0.0, rng)]))
    spread = np.std([one.dark_noise for one in found])
    assert spread == pytest.approx(np.mean([one.dark_noise_error for one in found]), rel=0.24)


def test_what_rounding_does_to_a_fine_noise_is_in_its_error():
    """Numbers half a noise apart, black level on a number: 1/12 is not what rounding adds to the variance."""
    off, errors = [], []
    for seed in range(8):
        sensor = Sensor((300, 300), 5e-6, full_well=10000, read_noise=1.35, black_level=100)
        rng = np.random.default_rng(seed)
        one = photon_transfer([pair(sensor, x, rng) for x in (0.2, 0.5)], [pair(sensor, 0.0, rng)])
        off.append(one.dark_noise - sensor.dark_noise)
        errors.append(one.dark_noise_error)
    assert np.sqrt(np.mean(np.square(off))) < 1.6 * np.mean(errors)
    assert np.sqrt(np.mean(np.square(off))) > 0.5 * np.mean(errors)
