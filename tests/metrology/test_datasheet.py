"""Data sheets of cameras, from files and from camera files."""

import json
import tomllib
from dataclasses import replace

import numpy as np
import pytest

import lumigraph as lg
from calibration_drawing import white as drawn_white
from lumigraph.calibration import calibrate
from lumigraph.cli import main
from lumigraph.core.depth_map import DepthMap
from lumigraph.core.raw import RawImage
from lumigraph.core.result import Quantity
from lumigraph.errors import CalibrationError, FormatError, GeometryError
from lumigraph.instruments import load_camera
from lumigraph.metrology.boards.places import places, residual
from lumigraph.metrology.datasheet import stability, steady
from lumigraph.metrology.datasheet.charts import check_camera
from lumigraph.metrology.datasheet.exposures import DrawnExposures, FileExposures, mean_image
from lumigraph.metrology.datasheet.lights import usual_depths, usual_exposures
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
    rng = np.random.default_rng(5)
    return lg.metrology.simulate_charts(camera, [0.0], name="small", rng=rng, exposures=3)


@pytest.fixture(scope="module")
def light():
    """Of a white image of 20 x 22 lenslets."""
    return drawn_white(lg.Lattice.square(15.3, 0.004, origin=(8, 8)), (306, 340), fill=0.85)[0]


def exposed(light, count, reference=1.0):
    """White images with the noise of 2 electrons per count."""
    sensor = lg.Sensor(light.shape, 5e-6, full_well=8000, bits=12, black_level=95)
    return DrawnExposures(light, sensor, reference, 0.8, tuple(range(count)))


@pytest.fixture(scope="module")
def drawn(light):
    """Two white images and one dark."""
    return lg.metrology.Charts("drawn", exposed(light, 2)[:], exposed(0 * light, 1)[:])


@pytest.fixture(scope="module")
def sheet(charts):
    return lg.metrology.datasheet(charts)


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
    lg.metrology.save_charts(charts, tmp_path)
    again = lg.metrology.datasheet(lg.metrology.read_charts(tmp_path))
    told = {q.name: q for q in again.quantities()}
    assert set(told) == {q.name for q in sheet.quantities()}
    for q in sheet.quantities():
        assert np.allclose(told[q.name].value, q.value, rtol=1e-6), q.name


def test_a_white_image_alone_tells_the_lattice_and_why_the_rest_is_missing(drawn):
    sheet = lg.metrology.datasheet(replace(drawn, whites=drawn.whites[:1]))
    found = {one.quantity.name: one for one in sheet.entries}
    assert found["pitch_px"].value == pytest.approx(15.3, abs=2e-3)
    assert found["micro_image_width_px"].value == pytest.approx(0.85 * 15.3, rel=0.02)
    assert found["snr_of_pixels"].value is None
    assert "two of the same light" in found["snr_of_pixels"].how
    assert "one pair and two are needed" in found["gain"].how
    assert found["refocus_range"].value is None


@SIMULATES
def test_a_scene_is_shown_and_its_depth_is_in_metres_of_a_camera_file(sheet, charts, tmp_path, capsys):
    scene = charts.boards[0].textures[0]
    lg.metrology.save_charts(replace(charts, boards=(), flats=(), scenes=(scene,)), tmp_path / "a")
    assert main(["datasheet", str(tmp_path / "a"), "-o", str(tmp_path / "a.html"), "--json"]) == 0
    rows = {row["name"]: row for row in json.loads(capsys.readouterr().out)["entries"]}
    assert rows["depth_noise_of_scene_1_in_metres"]["unit"] == "m"
    low, high = rows["depths_of_scene_1"]["value"]
    assert -5e-3 < low < sheet.planes[0]["depth"].value < high < 5e-3  # of 200 mm
    assert rows["best_mtf50_middle"]["how"] == "not measured: there is no picture of a chart"
    page = (tmp_path / "a.html").read_text()
    assert "Scene 1, in focus at its median depth." in page
    assert "best MTF50 middle" in page
    assert 'width="287"' in page  # 41 lenslets, 7 px each


def test_a_white_image_in_the_place_of_the_dark_one_is_refused(light, drawn):
    with pytest.raises(CalibrationError, match="no brighter than the dark image"):
        lg.metrology.datasheet(replace(drawn, darks=exposed(1.1 * light, 1)[:]))


def test_snr_is_that_of_the_electrons(drawn):
    """0.8 of a full well of 8000 is 6400 electrons: 80, less what darker pixels have."""
    found = lg.metrology.datasheet(drawn)["snr_of_pixels"]
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
        ((-0.00231432, 0.0112081), "px/view", None, "-0.00231 to 0.0112 px/view"),
        (None, "px", None, "not measured"),
    ],
)
def test_values_have_the_digits_of_their_intervals(value, unit, interval, shown):
    entry = lg.metrology.SheetEntry("", Quantity("a", value, unit, interval), "")
    assert entry.text == shown


def test_noise_of_depth_is_that_of_the_places_and_its_interval_holds_it():
    """Gaussian noise, one place in fifty astray and a slope: 200 planes of 23 x 25 places."""
    rng, found = np.random.default_rng(3), []
    for _ in range(200):
        values = rng.normal(7.0, 0.1, (23, 25))
        values[rng.random(values.shape) < 0.02] = 9.0
        found.append(steady.scatter([values]))
    noise = np.array([one for one, _ in found])
    assert noise.mean() == pytest.approx(0.1, rel=0.01)
    assert noise.std() < 0.0035  # 0.003 of 575 places; of the median deviation it is 0.005
    inside = [low <= 0.1 <= high for _, (low, high) in found]
    assert 0.9 <= np.mean(inside) <= 0.99


def noisy(rng, count, fixed=0.1, noise=0.05):
    """Maps of one plane whose places are off alike in each, and by noise."""
    alike = rng.normal(3.0, fixed, (30, 30))
    return [
        DepthMap(alike + rng.normal(0, noise, alike.shape), np.ones_like(alike), "patch")
        for _ in range(count)
    ]


def test_noise_of_several_exposures_is_that_of_one():
    """Of their mean it would be 0.1 and a bit."""
    value, noise = steady.steady(noisy(np.random.default_rng(1), 12), "patch", "px")
    assert noise.value == pytest.approx(np.hypot(0.1, 0.05), rel=0.03)
    low, high = noise.quantity.interval
    assert low < np.hypot(0.1, 0.05) < high
    assert value.value == pytest.approx(3.0, abs=0.02)  # 576 places of 0.1, medians of 16 parts


def test_sets_of_exposures_differ_by_what_the_sheet_says():
    """Of 120 pairs of sets of six, in 95 of 100 cases; one set alone says nothing."""
    rng = np.random.default_rng(2)
    alike, within = noisy(rng, 1, noise=0.0)[0].values, {"patch": [], "patch_noise": []}
    for _ in range(120):
        maps = [alike + rng.normal(0, 0.05, alike.shape) for _ in range(12)]
        sets = [DepthMap(one, np.ones_like(one), "patch") for one in maps]
        for one, other in zip(
            *(steady.steady(part, "patch", "px") for part in (sets[:6], sets[6:])), strict=True
        ):
            within[one.quantity.name].append(abs(one.value - other.value) < one.repeats)
    assert 0.9 < np.mean(within["patch"]) < 0.99
    assert 0.9 < np.mean(within["patch_noise"]) < 0.99
    alone = steady.steady(sets[:1], "patch", "px")[1]
    assert alone.repeats is None
    assert "its repeatability is unknown" in alone.how


def test_the_sheet_says_how_many_exposures_two_per_cent_take():
    said = steady._repeats(5.0, 16, "%")
    assert said == "16 exposures, two such sets differ by 5 % at most (100 exposures: 2 %)"
    assert "(" not in steady._repeats(1.9, 16, "%")


def test_pieces_of_the_field_that_some_exposure_does_not_know_count_in_none():
    maps = noisy(np.random.default_rng(4), 3)
    values = np.array(maps[1].values)
    values[:10, :10] = np.nan
    told = steady.steady([maps[0], DepthMap(values, np.ones_like(values), "patch"), maps[2]], "patch", "px")[
        0
    ]
    assert "mean of 15 parts of the field" in told.how


@pytest.fixture(scope="module")
def of_few_and_many(light, drawn):
    """Sheets of two and of eight white images."""
    return [lg.metrology.datasheet(replace(drawn, whites=exposed(light, count))) for count in (2, 8)]


def test_the_residual_of_several_white_images_holds_no_noise(light, drawn, of_few_and_many):
    """Discs drawn on pixels are 2.3e-3 px off the lattice without noise, 4e-3 px with that of one image."""
    clean, _ = residual([places(light, calibrate(RawImage(light)))])
    alone = lg.metrology.datasheet(replace(drawn, whites=drawn.whites[:1]))["residual_px"]
    many = of_few_and_many[1]["residual_px"]
    assert many.interval[0] < clean < many.interval[1]
    assert many.interval[1] < alone.interval[0]


def test_the_sheet_says_whether_noise_is_in_the_residual(drawn, of_few_and_many):
    alone = lg.metrology.datasheet(replace(drawn, whites=drawn.whites[:1]))
    how = [
        next(one.how for one in sheet.entries if one.quantity.name == "residual_px")
        for sheet in (alone, *of_few_and_many)
    ]
    assert how[0] == "rms of what phases are off the lattice; noise is in it"
    assert (
        how[1]
        == how[2]
        == ("rms of what phases are off the lattice; noise, by two halves of the exposures, is not in it")
    )


@pytest.mark.parametrize("name", ["snr_of_pixels", "snr_of_picture"])
def test_noise_of_pixels_is_that_of_all_pairs(of_few_and_many, name):
    """The interval of four pairs is half as wide."""
    few, many = (sheet[name] for sheet in of_few_and_many)
    assert np.ptp(many.interval) == pytest.approx(np.ptp(few.interval) / 2, rel=0.1)
    assert few.interval[0] < many.value < few.interval[1]


def test_exposures_are_drawn_alike_and_their_mean_is_that_of_all():
    light = np.full((40, 50), 0.5)
    many = DrawnExposures(light, lg.Sensor(light.shape, 5e-6, full_well=8000), 1.0, 0.8, tuple(range(20)))
    assert len(many) == 20
    assert np.array_equal(many[3].data, many[3].data)
    assert not np.array_equal(many[3].data, many[4].data)
    assert [one.data.sum() for one in many[-2:]] == [many[18].data.sum(), many[19].data.sum()]
    mean = np.asarray(mean_image(many).data, float)
    assert mean.std() == pytest.approx(np.asarray(many[0].data, float).std() / np.sqrt(20), rel=0.1)
    assert mean_image(many[:1]).data is not None


def test_exposures_of_several_sizes_have_no_mean():
    sizes = [RawImage(np.ones(shape, np.uint8)) for shape in ((20, 30), (20, 31))]
    with pytest.raises(FormatError, match="20 x 30 and 20 x 31 px"):
        mean_image(sizes)
    with pytest.raises(FormatError, match="no exposure"):
        mean_image([])


def test_a_folder_holds_several_exposures_of_a_chart(tmp_path, drawn):
    seen = lg.metrology.ChartExposures(drawn.whites, drawn.darks, 5e-3)
    lg.metrology.save_charts(replace(drawn, boards=(seen,)), tmp_path)
    read = lg.metrology.read_charts(tmp_path).boards[0]
    assert isinstance(read.boards, FileExposures)
    assert [len(read.boards), len(read.textures), read.depth] == [2, 1, 5e-3]
    assert np.array_equal(read.boards[1].data, drawn.whites[1].data)
    text = (tmp_path / "charts.toml").read_text()
    assert 'board = ["board-1-1.tiff", "board-1-2.tiff"]' in text
    (tmp_path / "charts.toml").write_text(text.replace('["texture-1-1.tiff"]', '"texture-1-1.tiff"'))
    assert len(lg.metrology.read_charts(tmp_path).boards[0].textures) == 1


@pytest.mark.parametrize(("side", "count"), [(800, 16), (3157, 4), (9000, 2)])
def test_large_sensors_are_exposed_less_often(camera, side, count):
    assert usual_exposures(camera.replace(sensor={"shape": (side, side)})) == count


def test_simulated_charts_have_one_exposure_or_more(camera):
    with pytest.raises(GeometryError, match="exposures is 0 but must be a whole number of at least 1"):
        lg.metrology.simulate_charts(camera, [0.0], exposures=0)


def test_two_cameras_stand_side_by_side(drawn, tmp_path, capsys):
    lg.metrology.save_charts(drawn, tmp_path / "a")
    lg.metrology.save_charts(replace(drawn, whites=drawn.whites[:1]), tmp_path / "b")
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
        ("white = []\ncharts = [{board = []}]", "has no picture of a board"),
        ("white = []", "has no white image"),
        ('white = []\nspacing = "5"', "unit"),
    ],
)
def test_a_wrong_list_of_charts_is_refused(tmp_path, text, said):
    (tmp_path / "charts.toml").write_text(text)
    with pytest.raises(FormatError, match=said):
        lg.metrology.read_charts(tmp_path)


def test_a_folder_without_white_images_is_refused(tmp_path):
    with pytest.raises(FormatError, match="nor a picture with 'white' in its name among 0 pictures"):
        lg.metrology.read_charts(tmp_path)
    with pytest.raises(FormatError, match="is no folder"):
        lg.metrology.read_charts(tmp_path / "none")


def test_only_plenoptic_cameras_have_a_sheet():
    with pytest.raises(GeometryError, match="has no data sheet yet"):
        check_camera(lg.LightFieldMicroscope.from_catalogue("lfm-guv"))


@pytest.mark.parametrize(
    "name", ["thesis-plenoptic-1", "thesis-plenoptic-2-m030", "galilean", "multi-focus-hex"]
)
def test_charts_stand_on_either_side_of_the_focus(name):
    depths = usual_depths(check_camera(load_camera(name)))
    assert min(depths) < 0 < max(depths)
    assert 0.0 in depths


def test_dated_white_images_show_the_drift_a_day(tmp_path):
    """Drawn white images move by 0.02 and -0.01 px a day, turn, grow and fade."""
    rng = np.random.default_rng(4)
    for day in range(6):
        pitch, turn = 15.3 * (1 + 20e-6 * day), 0.004 + 3e-5 * day
        # Of the lenslet in the middle: it is there that the offset is measured.
        row = pitch * np.array([np.sin(turn), np.cos(turn)])
        middle = np.array([153.0 + 0.02 * day, 168.3 - 0.01 * day])
        origin = middle - 9 * np.array([row[1], -row[0]]) - 10 * row
        image = drawn_white(lg.Lattice.square(pitch, turn, origin=tuple(origin)), (306, 340), fill=0.85)[0]
        noisy = 2000 * (1 - 0.004 * day) * image + rng.normal(0, 3, image.shape)
        raw = RawImage(np.clip(noisy, 0, 4095).astype(np.uint16), 5e-6)
        lg.save(raw, tmp_path / f"white-2024-03-{day + 1:02d}.tiff")
    sheet = lg.metrology.datasheet(lg.metrology.read_charts(tmp_path))
    found = {e.quantity.name: e.quantity for e in sheet.entries if e.section == "Stability"}
    truth = {"drift_y": 0.02, "drift_x": -0.01, "drift_of_pitch": 20, "drift_of_rotation": 0.03}
    for name, value in truth.items():
        low, high = found[name].interval
        assert low - 0.03 * abs(value) <= value <= high + 0.03 * abs(value)
        assert high - low < 0.5 * abs(value)
    assert found["drift_of_light"].value == pytest.approx(-0.4, abs=0.02)


def test_two_dates_are_too_few_for_a_drift(light):
    first, second = stability.date_in("white-2024-03-01.png"), stability.date_in("white_20240302T0930.png")
    lattice = calibrate(RawImage(light, 5e-6))
    entries = stability.stability([RawImage(light, 5e-6)] * 2, lattice, [first, second])
    assert all(one.value is None and "2 dates, but a drift needs 3" in one.how for one in entries)
    assert len(entries) == 5
    assert stability.stability([RawImage(light, 5e-6)] * 2, lattice) == []
