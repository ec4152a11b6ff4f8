"""`lumigraph wavefront`: terms with deviations, a map, a camera file, and refusals in one line."""

import json

import numpy as np
import pytest
import tifffile
from tests.studies.adaptive.test_sense import CAMERA, exposed

import lumigraph as lg
from lumigraph.cli.wavefront import _place


@pytest.fixture
def star(tmp_path):
    (tmp_path / "camera.toml").write_text(CAMERA.to_toml())
    tifffile.imwrite(tmp_path / "star.tif", exposed((4, 8), [0.1, -0.07], 3e4))
    return tmp_path


def test_a_stars_wavefront_becomes_a_table_a_map_and_a_camera_file(lumigraph, star):
    words = ("star.tif", "--camera", "camera.toml", "--background", "0.01", "--terms", "1,4,8")
    found = lumigraph("wavefront", *words, "--json", "--report", "page.html", "-o", "bent.toml")
    assert found.code == 0, found.err
    told = json.loads(found.out)
    assert told["terms"]["4"]["waves"] == pytest.approx(0.1, abs=5e-3)
    assert told["terms"]["8"]["waves"] == pytest.approx(-0.07, abs=5e-3)
    assert 1e-4 < told["terms"]["8"]["deviation"] < 3e-3
    assert told["untold"] == {"1": "a piston changes no image"}
    assert told["electrons"] == pytest.approx(3e4, rel=0.02)
    bent = lg.load_camera(star / "bent.toml").main_lens.aberrations
    assert bent == pytest.approx({int(j): one["waves"] for j, one in told["terms"].items()})
    page = (star / "page.html").read_text()
    assert all(words in page for words in ("coma along x", "Over the pupil", "a piston changes no image"))


def test_a_scenes_wavefront_is_by_the_shifts_of_views(lumigraph, tmp_path):
    """Views that are alike have no shifts: what is told is what lenslets spill, which is taken away."""
    camera = CAMERA.replace(lenslets={"count": (12, 12)}, sensor={"shape": None})
    (tmp_path / "camera.toml").write_text(camera.to_toml())
    period = camera.calibration.lattice.pitch
    lenslets = [np.rint((np.arange(n) - n / 2) / period - 0.5).astype(int) + 6 for n in camera.sensor.shape]
    texture = np.random.default_rng(0).uniform(0.5, 1, (14, 14))
    raw = texture[np.ix_(*(np.clip(one, 0, 13) for one in lenslets))].astype(np.float32)
    tifffile.imwrite(tmp_path / "scene.tif", raw)
    words = ("scene.tif", "--camera", "camera.toml", "--object", "scene", "--terms", "4,6,11")
    found = lumigraph("wavefront", *words)
    assert found.code == 0, found.err
    assert "by the shifts of views" in found.out
    values = json.loads(lumigraph("wavefront", *words, "--json").out)["terms"]
    assert -0.06 < values["4"]["waves"] < -0.01
    assert abs(values["6"]["waves"]) < 0.005


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("--terms coma", "Noll indices from 1 to 66"),
        ("--place 1um", "must be y, x and z"),
        ("--object scene --region 0:9,0:9", "are of a star"),
        ("--calibration c.json", "is of scenes"),
        ("-o bent.json", "wrong extension"),
        ("--object scene --terms 2", "explains 1 to 3"),
        ("--page all", "Give one --page"),
    ],
)
def test_what_has_no_wavefront_is_refused_in_a_line(lumigraph, star, words, message):
    tifffile.imwrite(star / "film.tif", np.ones((2, *CAMERA.sensor.shape), np.float32))
    raw = "film.tif" if "page" in words else "star.tif"
    found = lumigraph("wavefront", raw, "--camera", "camera.toml", *words.split())
    assert found.code != 0
    assert message in found.err
    assert found.err.strip().count("\n") == 0


def test_a_place_is_three_lengths():
    assert _place("1 um, -2 um, 3 mm") == pytest.approx((1e-6, -2e-6, 3e-3))
