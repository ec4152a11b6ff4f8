"""What is out of place on a bench."""

import math
from importlib import import_module

import numpy as np
import pytest

import lumigraph as lg
from lumigraph.calibration import calibrate
from lumigraph.cli import main
from lumigraph.errors import CalibrationError
from lumigraph.metrology.twin import CAUSES, BenchModel, Twin, corrected, twin

LENSLETS = {"pitch": "150 um", "focal_length": "10 mm", "count": (41, 41)}


@pytest.fixture(scope="module")
def camera():
    return lg.PlenopticCamera(
        wavelength=550e-9, object_distance="240 mm",
        main_lens={"focal_length": "120 mm", "diameter": "3.2 mm"},
        lenslets=LENSLETS, sensor={"pixel_pitch": "8 um", "black_level": 64},
    )  # fmt: skip


@pytest.fixture(scope="module")
def bench(camera):
    return BenchModel(camera)


@pytest.fixture(scope="module")
def small(camera):
    """The bench with fewer lenslets, whose lattice is found sooner."""
    return BenchModel(camera.replace(lenslets={"count": (17, 17)}))


SLOPES = np.zeros((10, 7))
"""Derivatives of the small one, as far as rays tell them, per m of height and so on: they spare 14 images."""
SLOPES[[0, 3, 8], 0] = 84, 84, 1450
SLOPES[6, 1] = SLOPES[7, 2] = 0.9
SLOPES[4, 3] = SLOPES[5, 4] = 1.3e5
SLOPES[[1, 2], 5] = -19.5, 19.5
SLOPES[8, 6] = 14.8


def out_of_place(rng):
    """±0.3 mm, ±1 degree, ±30 um, ±5 mrad and ±5 % at once."""
    tilt, shift = np.radians(rng.uniform(-1, 1, 2)), rng.uniform(-30e-6, 30e-6, 2)
    return np.array(
        [rng.uniform(-0.3e-3, 0.3e-3), *tilt, *shift, rng.uniform(-5e-3, 5e-3), rng.uniform(-0.05, 0.05)]
    )


def test_lenslets_of_a_leaning_array_stand_where_rays_through_the_stop_meet_the_sensor(bench, camera):
    """Each lenslet's place in space by turning the plane, then a line from the middle of the stop."""
    height, ty, tx = 0.2e-3, math.radians(0.8), math.radians(-0.5)
    seen = calibrate(bench.white([height, ty, tx, 0, 0, 0, 0]))
    L, b, pixel = camera.separation - height, camera.lenslet_distance + height, camera.sensor.pixel_pitch
    turn, axis = math.hypot(ty, tx), np.array([ty, tx]) / math.hypot(ty, tx)
    middle = np.array(camera.sensor.shape) // 2
    flat = 150e-6 * np.stack(np.meshgrid(np.arange(-17, 18), np.arange(-17, 18), indexing="ij"), -1).reshape(
        -1, 2
    )
    along = flat @ axis
    across = flat + np.outer(along * (math.cos(turn) - 1), axis)
    rise = along * math.sin(turn)
    exact = middle + across * ((L + b) / (L - rise))[:, None] / pixel
    off = [np.hypot(*(seen.centers - one).T).min() for one in exact]
    assert max(off) < 0.03


@pytest.mark.long  # 12 s: eighteen white images
def test_a_bench_that_is_all_out_of_place_is_found_in_one_picture(bench, camera):
    rng = np.random.default_rng(4)
    for _ in range(3):
        true = out_of_place(rng)
        light = bench.white(true)
        raw, dark = (camera.sensor.expose(one, reference=light.max(), rng=rng) for one in (light, 0 * light))
        found = twin([raw], bench, dark=dark, pitch_error=1e-5)
        off = np.abs(found.values - true)
        assert off[0] < 10e-6
        assert off[1:3].max() < math.radians(0.02)
        assert off[6] < 5e-3
        assert (off < 4 * found.errors).all()
        assert found.blur[0] == pytest.approx(1, abs=0.01)
        assert not found.notes


@pytest.mark.long  # 8 s: the same
def test_a_bench_in_its_place_has_no_instructions(bench, camera):
    rng = np.random.default_rng(5)
    light = bench.white(np.zeros(7))
    raw, dark = (camera.sensor.expose(one, reference=light.max(), rng=rng) for one in (light, 0 * light))
    assert twin([raw], bench, dark=dark, pitch_error=1e-5).instructions() == ()


def told(**values):
    found = np.array([values.get(cause, 0.0) for cause in CAUSES])
    return Twin(found, np.diag([1e-12] * 7), (1.0, 0.01), 0.5, ())


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"height": 0.12e-3}, "lower the array by 0.120 ± 0.002 mm, towards the sensor"),
        ({"height": -0.12e-3}, "raise the array by 0.120 ± 0.002 mm, away from the sensor"),
        ({"tilt_y": 1e-3}, "its side at the bottom of the raw image towards the sensor"),
        ({"tilt_x": -1e-3}, "side at the left"),
        ({"shift_x": 10e-6}, "shift the array by 10.0 ± 2.0 µm, left in the raw image"),
        ({"turn": 1e-3}, "turn the array by 1.000 ± 0.002 mrad anticlockwise"),
        ({"aperture": -0.02}, "open the stop by 2.00 ± 0.00 % of its diameter"),
    ],
)  # fmt: skip
def test_instructions_undo_what_is_out_of_place(values, said):
    (line,) = told(**values).instructions()
    assert said in line


def test_what_is_not_sure_is_not_told():
    assert told(height=2.5e-6).instructions() == ()


def test_an_array_far_from_its_place_is_no_instruction(small, monkeypatch):
    """Pitch and width of a camera whose lenslets stand 2 mm closer: the file is wrong, not the bench."""
    monkeypatch.setattr(import_module("lumigraph.metrology.twin"), "_ROUNDS", 1)
    light = small.white([-2e-3, 0, 0, 0, 0, 0, 0])
    monkeypatch.setitem(small.__dict__, "slopes", SLOPES)
    found = twin([lg.RawImage(light)], small)
    assert found["height"] == pytest.approx(-2e-3, rel=0.1)
    assert any("have no instructions" in note for note in found.notes)
    assert not any("raise" in line or "lower" in line or "stop" in line for line in found.instructions())


def test_lenslets_of_another_pitch_are_no_instruction_unless_the_pitch_is_said_to_be_known(
    small, monkeypatch
):
    """0.04 % of pitch look like 0.1 mm of height, and like 1 % of the stop."""
    monkeypatch.setattr(import_module("lumigraph.metrology.twin"), "_ROUNDS", 1)
    monkeypatch.setitem(small.__dict__, "slopes", SLOPES)
    camera = small.camera
    pitch = {"lenslets": {"pitch": 150e-6 * (1 + 4e-4)}, "sensor": {"shape": camera.sensor.shape}}
    other = BenchModel(camera.replace(**pitch, main_lens={"diameter": camera.pupil_diameter}))
    white = [lg.RawImage(other.white(np.zeros(7)))]
    found, claimed = twin(white, small), twin(white, small, pitch_error=1e-5)
    assert found["height"] == pytest.approx(4e-4 * camera.separation, rel=0.4)
    assert found.instructions() == ()
    assert found.errors[0] == pytest.approx(3e-4 * camera.separation, rel=0.1)
    assert any(
        "known to 0.03%, so the height is known to ± 0.137 mm and the stop" in one for one in found.notes
    )
    assert claimed["height"] > 2.5 * claimed.errors[0]
    assert not any("known to 0.03%" in one for one in claimed.notes)


def test_the_corrected_file_of_a_camera_2_0_has_the_benches_distances():
    camera = lg.FocusedPlenopticCamera.from_catalogue("thesis-plenoptic-2-m030")
    fixed, left = corrected(camera, told(height=0.1e-3, aperture=0.03, shift_y=10e-6))
    assert fixed.lenslet_distance == pytest.approx(camera.lenslet_distance + 0.1e-3, rel=1e-9)
    assert fixed.separation == pytest.approx(camera.separation - 0.1e-3, rel=1e-9)
    assert fixed.pupil_diameter == pytest.approx(1.03 * camera.pupil_diameter)
    move = np.array(fixed.calibration.lattice.origin) - camera.calibration.lattice.origin
    assert move[0] > 0
    assert move[1] == pytest.approx(0, abs=1e-9)
    assert not left


def test_what_a_camera_file_cannot_hold_is_told(camera):
    _, left = corrected(camera, told(height=0.1e-3, tilt_x=1e-2))
    assert len(left) == 2


def test_another_camera_is_refused(small):
    with pytest.raises(CalibrationError, match="20 x 20 pixels but the camera file"):
        twin([lg.RawImage(np.ones((20, 20)))], small)
    camera = small.camera
    other = BenchModel(
        camera.replace(lenslets={"pitch": "160 um", "count": (16, 16)}, sensor={"shape": camera.sensor.shape})
    )
    with pytest.raises(CalibrationError, match="this is another camera"):
        twin([lg.RawImage(other.white(np.zeros(7)))], small)


def test_the_verb_needs_pictures_or_a_folder(capsys):
    assert main(["twin", "--camera", "thesis-plenoptic-1"]) == 1
    assert "give white images, or --watch FOLDER" in capsys.readouterr().err


def test_only_pictures_that_come_after_the_start_are_taken_once_written(tmp_path, monkeypatch):
    from lumigraph.cli import twin as verb

    monkeypatch.setattr(verb, "_SETTLED", 0.0)
    monkeypatch.setattr(verb, "_PAUSE", 0.01)
    (tmp_path / "old.tiff").write_bytes(b"")
    arriving = verb._arriving(tmp_path)
    monkeypatch.setattr(verb.time, "sleep", lambda _: (tmp_path / "new.tiff").write_bytes(b"1"))
    (tmp_path / "notes.txt").write_text("")
    assert next(arriving).name == "new.tiff"
