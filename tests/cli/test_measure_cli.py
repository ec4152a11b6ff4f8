"""`lumigraph measure`: each kind gives the numbers that made the picture."""

import json

import numpy as np
import pytest

import lumigraph as lg
from lumigraph.sensor import Sensor

SENSOR = Sensor((150, 160), 5e-6, full_well=9000, read_noise=8.0, bits=12, black_level=100, prnu=0.02)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def saved(name, data, **known):
    lg.save(lg.RawImage(np.asarray(data), **known), name)
    return name


def exposed(name, light, rng):
    lg.save(SENSOR.expose(np.full(SENSOR.shape, light), reference=1, fill=1, rng=rng), name)
    return name


def found(result):
    assert result.code == 0, result.err
    return json.loads(result.out)


def test_an_edge_of_one_pixel_has_the_mtf_of_a_pixel(lumigraph, folder):
    """Half contrast at 0.603 cycles per pixel, where the sinc is a half."""
    y, x = np.mgrid[:90, :110] - 40.0
    saved("edge.tiff", np.clip(x - 0.1 * y + 0.5, 0, 1).astype(np.float32), pixel_pitch=4e-6)
    values = found(lumigraph("measure", "edge", "edge.tiff", "--region", "0:80, 10:80", "--json"))
    assert values == found(lumigraph("measure", "edge", "edge.tiff", "--region", "0-79:10-79", "--json"))
    assert values["mtf50"] == pytest.approx(0.603 / 4e-6, rel=0.02)
    assert values["angle"] == pytest.approx(np.degrees(np.arctan(0.1)), abs=0.05)
    other = found(lumigraph("measure", "edge", "edge.tiff", "--pixel-pitch", "8 um", "--json"))
    assert other["mtf50"] == pytest.approx(0.603 / 8e-6, rel=0.02)


def test_a_gaussian_point_has_its_widths(lumigraph, folder):
    y, x = np.mgrid[:61, :61] - 30.0
    saved("point.tiff", (7 + 900 * np.exp(-(x**2) / 18 - (y**2) / 32)).astype(np.float32))
    values = found(lumigraph("measure", "point", "point.tiff", "--json"))
    assert values["width_x"] == pytest.approx(2.3548 * 3, rel=0.01)
    assert values["width_y"] == pytest.approx(2.3548 * 4, rel=0.01)
    assert values["mtf50"] == pytest.approx(0.18739 / 3, rel=0.01)  # sqrt(ln 2 / 2) / π over σ
    assert values["background"] == pytest.approx(7, abs=0.1)


def test_two_even_pictures_part_noise_in_time_from_the_fixed_pattern(lumigraph, folder):
    rng = np.random.default_rng(2)
    names = [exposed(f"{k}.tiff", 0.5, rng) for k in "ab"]
    values = found(lumigraph("measure", "noise", *names, "--json"))
    counts = 4500 / SENSOR.gain
    assert values["fixed_pattern"] == pytest.approx(0.02 * counts, rel=0.05)
    assert values["noise_in_time"] == pytest.approx(np.sqrt(4500 + 64) / SENSOR.gain, rel=0.03)
    assert values["snr"] == pytest.approx(
        (counts + 100) / np.hypot(0.02 * counts, np.sqrt(4564) / SENSOR.gain), rel=0.03
    )


def test_a_sensor_comes_back_with_its_intervals_and_a_report(lumigraph, folder):
    rng = np.random.default_rng(3)
    flats = [exposed(f"{k}{n}.tiff", light, rng) for k, light in enumerate((0.2, 0.5, 1.1)) for n in "ab"]
    darks = [word for n in "ab" for word in ("--dark", exposed(f"dark{n}.tiff", 0.0, rng))]
    values = found(lumigraph("measure", "sensor", *flats, *darks, "--json", "--report", "page.html"))
    low, high = values["gain_interval"]
    assert low < SENSOR.gain < high
    assert high - low < 0.06 * SENSOR.gain
    assert values["dark_noise"] == pytest.approx(8, rel=0.03)
    assert values["full_well"] == pytest.approx(9000, rel=0.03)
    page = (folder / "page.html").read_text()
    assert "photon-transfer curve" in page
    assert "electrons/count" in page


def test_what_cannot_be_measured_is_refused_in_one_line(lumigraph, folder):
    saved("even.tiff", np.full((40, 40), 5.0, np.float32))
    for words, message in [
        (("edge", "even.tiff"), "there is no edge"),
        (("edge", "even.tiff", "even.tiff"), "measure edge takes one picture, not 2 pictures"),
        (("edge", "even.tiff", "--region", "3:99, 0:9"), "is not inside the picture of 40 x 40 px"),
        (("edge", "even.tiff", "--region", "all"), "must be 'y0:y1, x0:x1'"),
        (("edge", "even.tiff", "--dark", "even.tiff"), "are for 'sensor', not for 'edge'"),
        (("sensor", "even.tiff", "even.tiff"), "there are 0 --dark. Give two"),
        (("noise", "none.tiff"), "none.tiff"),
    ]:
        result = lumigraph("measure", *words)
        assert result.code != 0
        assert message in result.err
        assert len(result.err.strip().splitlines()) == 1
