"""Data sheets of cameras, from files and from camera files."""

import json
import tomllib
from dataclasses import replace

import numpy as np
import pytest

import lumigraph as lg
from calibration_drawing import white as drawn_white
from lumigraph.cli import main
from lumigraph.errors import FormatError, GeometryError
from lumigraph.metric import planes
from lumigraph.metric.charts import check_camera, usual_depths
from lumigraph.samples.files import camera_file

SIMULATES = pytest.mark.long  # 5 s: a camera's operator


@pytest.fixture(scope="module")
def camera():
    text = camera_file("plenoptic").replace("[71, 71]", "[41, 41]")
    return lg.PlenopticCamera.from_table(tomllib.loads(text)).replace(
        sensor={"pixel_pitch": "8 um", "black_level": 64}
    )


@pytest.fixture(scope="module")
def charts(camera):
    return lg.metric.simulate_charts(camera, [0.0], name="small", rng=np.random.default_rng(5))


@pytest.fixture(scope="module")
def drawn():
    """Two white images and one dark of 20 x 22 lenslets, with the noise of 2 electrons per count."""
    lattice, rng = lg.Lattice.square(15.3, 0.004, origin=(8, 8)), np.random.default_rng(2)
    light = drawn_white(lattice, (306, 340), fill=0.85)[0]
    sensor = lg.Sensor(light.shape, 5e-6, full_well=8000, bits=12, black_level=95)
    whites = tuple(sensor.expose(light, fill=0.8, rng=rng) for _ in range(2))
    return lg.metric.Charts("drawn", whites, (sensor.expose(0 * light, rng=rng),))


@pytest.fixture(scope="module")
def sheet(charts):
    return lg.metric.datasheet(charts)


@SIMULATES
@pytest.mark.parametrize(
    ("name", "true"),
    [("gain", 10000 / (4095 - 64)), ("dark_noise", 5.0), ("dark_signal", 64.0), ("rotation", 0.0)],
)
def test_what_is_known_of_the_camera_lies_in_its_interval(sheet, name, true):
    low, high = sheet[name].interval
    half = (high - low) / 2
    assert low - half < true < high + half  # 4 standard deviations: 2 would fail once in 20


@SIMULATES
def test_the_lattice_and_the_scale_are_the_cameras(sheet, camera):
    assert sheet["pitch_px"].value == pytest.approx(
        camera.lattice.pitch / 8e-6 * (1 + 3.6e-3 / 0.2), rel=1e-4
    )
    assert sheet["sample_on_chart"].value == pytest.approx(1e-4, rel=0.005)


@SIMULATES
def test_half_contrast_is_that_of_a_lenslet_and_the_main_lens(sheet, camera):
    """A picture in focus has the MTF of a lenslet's width, times that of the main lens."""
    f = np.linspace(0, 1e4, 2001)  # on the lenslets [1/m], as large as on the chart
    cut = camera.pupil_diameter / (camera.wavelength * camera.separation)
    x = np.clip(f / cut, 0, 1)
    lens = 2 / np.pi * (np.arccos(x) - x * np.sqrt(1 - x**2))
    mtf = np.abs(np.sinc(f * 1e-4)) * lens
    half = f[np.argmax(mtf < 0.5)]
    assert sheet["best_mtf50_middle"].value == pytest.approx(half, rel=0.06)


@SIMULATES
def test_files_tell_what_the_pictures_told(sheet, charts, tmp_path):
    lg.metric.save_charts(charts, tmp_path)
    again = lg.metric.datasheet(lg.metric.read_charts(tmp_path))
    told = {q.name: q for q in again.quantities()}
    assert set(told) == {q.name for q in sheet.quantities()}
    for q in sheet.quantities():
        assert np.allclose(told[q.name].value, q.value, rtol=1e-6), q.name


def test_a_white_image_alone_tells_the_lattice_and_why_the_rest_is_missing(drawn):
    sheet = lg.metric.datasheet(replace(drawn, whites=drawn.whites[:1]))
    found = {one.quantity.name: one for one in sheet.entries}
    assert found["pitch_px"].value == pytest.approx(15.3, abs=2e-3)
    assert found["micro_image_width_px"].value == pytest.approx(0.85 * 15.3, rel=0.02)
    assert found["snr_of_pixels"].value is None
    assert "two of the same light" in found["snr_of_pixels"].how
    assert "one pair and two are needed" in found["gain"].how
    assert found["refocus_range"].value is None


def test_snr_is_that_of_the_electrons(drawn):
    """0.8 of a full well of 8000 is 6400 electrons: 80, less what darker pixels have."""
    found = lg.metric.datasheet(drawn)["snr_of_pixels"]
    assert found.value == pytest.approx(80, rel=0.03)


@pytest.mark.parametrize(
    ("value", "unit", "interval", "shown"),
    [
        (48.231234, "px", (48.2196, 48.2428), "48.231 px (48.220 to 48.243)"),
        (2.0412e-4, "m", (1.9912e-4, 2.0912e-4), "204.1 µm (199.1 to 209.1)"),
        (12345.6, "1/m", (12000.0, 12691.2), "12.35 lp/mm (12.00 to 12.69)"),
        (-0.00012, "1", (-0.0013, 0.00106), "-0.0001 (-0.0013 to 0.0011)"),
        (8123.4, "electrons", (6000.0, 10246.8), "8100 electrons (6000 to 10200)"),
        (3.0, "px", (3.0, 3.0), "3.000000 px (3.000000 to 3.000000)"),
        (0.51234567, "%", None, "0.51235 %"),
        (None, "px", None, "not measured"),
    ],
)
def test_values_have_the_digits_of_their_intervals(value, unit, interval, shown):
    entry = lg.metric.Entry("", lg.metric.sheet.Quantity("a", value, unit, interval), "")
    assert entry.text == shown


def test_noise_of_depth_is_that_of_the_places_and_its_interval_holds_it():
    """Gaussian noise, one place in fifty astray and a slope: 200 planes of 23 x 25 places."""
    rng, found = np.random.default_rng(3), []
    for _ in range(200):
        values = rng.normal(7.0, 0.1, (23, 25))
        values[rng.random(values.shape) < 0.02] = 9.0
        found.append(planes._scatter(values))
    noise = np.array([one for one, _ in found])
    assert noise.mean() == pytest.approx(0.1, rel=0.01)
    assert noise.std() < 0.0035  # 0.003 of 575 places; of the median deviation it is 0.005
    inside = [low <= 0.1 <= high for _, (low, high) in found]
    assert 0.9 <= np.mean(inside) <= 0.99


def test_two_cameras_stand_side_by_side(drawn, tmp_path, capsys):
    lg.metric.save_charts(drawn, tmp_path / "a")
    lg.metric.save_charts(replace(drawn, whites=drawn.whites[:1]), tmp_path / "b")
    page = tmp_path / "both.html"
    assert main(["datasheet", str(tmp_path / "a"), str(tmp_path / "b"), "-o", str(page), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    pitches = [row["value"] for row in found["entries"] if row["name"] == "pitch_px"]
    assert len(pitches) == 2
    assert pitches[0] == pytest.approx(pitches[1], rel=1e-3)
    text = page.read_text()
    assert text.index(">a<") < text.index(">b<") < text.index("micro-images on the white image")
    assert "<td>not measured</td>" in text
    assert "<td>-</td>" not in text
    assert "a: two white images, pixels above half of the bright ones" in text  # how, where it differs
    assert "b: not measured: there is one white image" in text


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("black = []", "the key 'black'"),
        ('white = "w.tiff"', "must be a list"),
        ("white = [3]", "names 3, which is no file"),
        ('white = []\ncharts = [{depth = "5 mm"}]', "must be board"),
        ("white = []", "has no white image"),
        ('white = []\nspacing = "5"', "unit"),
    ],
)
def test_a_wrong_list_of_charts_is_refused(tmp_path, text, said):
    (tmp_path / "charts.toml").write_text(text)
    with pytest.raises(FormatError, match=said):
        lg.metric.read_charts(tmp_path)


def test_a_folder_without_white_images_is_refused(tmp_path):
    with pytest.raises(FormatError, match="nor a picture with 'white' in its name among 0 pictures"):
        lg.metric.read_charts(tmp_path)
    with pytest.raises(FormatError, match="is no folder"):
        lg.metric.read_charts(tmp_path / "none")


def test_only_plenoptic_cameras_have_a_sheet():
    with pytest.raises(GeometryError, match="has no data sheet yet"):
        check_camera(lg.LightFieldMicroscope.from_catalogue("lfm-guv"))


@pytest.mark.parametrize(
    "name", ["thesis-plenoptic-1", "thesis-plenoptic-2-m030", "galilean", "multi-focus-hex"]
)
def test_charts_stand_on_either_side_of_the_focus(name):
    depths = usual_depths(check_camera(lg.metric.charts.load_camera(name)))
    assert min(depths) < 0 < max(depths)
    assert 0.0 in depths
