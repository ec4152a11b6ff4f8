"""A search for the least error of reconstructed scenes finds it, keeps to its scenes, and reports them."""

import numpy as np
import pytest

import lumigraph as lg
from lumigraph.cli import main
from lumigraph.core.picture import png
from lumigraph.errors import FormatError, GeometryError
from lumigraph.information import Light, Scenes, reconstruction_error
from lumigraph.information.points import collected
from lumigraph.optimisation import Goal

UM = 1e-6
VARY = {"main_lens.diameter": "1 mm:8 mm:4"}


def plain():
    return lg.SingleLensCamera(
        wavelength="600 nm", object_distance="120 mm",
        main_lens={"focal_length": "60 mm", "diameter": "2 mm"},
        sensor={"pixel_pitch": 6 * UM, "shape": (161, 161)},
    )  # fmt: skip


def goal(**changes):
    given = {"name": "picture error", "depths": (-3e-3, -1e-3, 1e-3, 3e-3), "scenes": Scenes(12 * UM, 16)}
    return Goal(**(given | {"light": Light(200)} | changes))


@pytest.mark.filterwarnings("ignore:half-way between the depths")
def test_a_stop_between_too_little_light_and_too_little_depth_is_found(tmp_path):
    """Light grows with the stop's area, blur with its width: neither end of the range is best."""
    output = tmp_path / "best.toml"
    found = lg.optimise(plain(), VARY, goal(), evaluations=8, output=output)
    assert not found.active
    assert found.gain(found.start) > 0.05
    light = Light(200 * collected(found.camera) / collected(plain()))
    again = reconstruction_error(found.camera, goal().depths, goal().scenes, light)
    assert found.best["picture error"] == pytest.approx(again.value, rel=1e-9)
    assert found.checked["best"].over_depths == pytest.approx(again.errors)
    assert found.checked["best"].between < found.best["picture error"]  # the ends are left out
    resumed = lg.optimise(plain(), VARY, goal(), evaluations=8, output=output)
    assert resumed.rows == found.rows
    with pytest.raises(FormatError):
        lg.optimise(plain(), VARY, goal(scenes=Scenes(13 * UM, 16)), evaluations=8, output=output)


def test_scenes_are_what_the_first_camera_resolves_unless_others_are_given():
    ready = goal(scenes=None).ready(plain())
    assert ready.scenes == Scenes(600e-9 * 0.12 / 2e-3 / 2)
    assert goal().ready(plain()) == goal()
    assert Goal("depth").ready(plain()) == Goal("depth")


def test_a_front_of_error_and_light():
    found = lg.optimise(
        plain(), {"main_lens.diameter": "1 mm, 3 mm, 8 mm"}, goal(), against="largest f-number", search="grid"
    )
    assert {"picture error", "f-number"} <= found.front[0].keys()
    assert len(found.front) > 1


def test_nonsense_is_refused_before_any_camera():
    with pytest.raises(GeometryError, match="needs depths"):
        lg.optimise(plain(), VARY, "picture error")
    with pytest.raises(GeometryError, match="wide but the field of view is"):
        lg.optimise(plain(), VARY, goal(scenes=Scenes(1e-3)))
    for name in ("picture error", "volume error"):
        with pytest.raises(GeometryError, match="error of scenes are of cameras with lenslets"):
            lg.optimise(plain(), VARY, goal(name=name), search="gradient")


def test_gradients_lead_to_a_better_camera_with_lenslets():
    start = lg.FocusedPlenopticCamera(
        wavelength="633 nm", object_distance="120 mm",
        main_lens={"focal_length": "60 mm", "diameter": "1 mm"},
        lenslets={"pitch": "200 um", "focal_length": "5.2 mm", "count": (9, 9), "magnification": 0.5},
        sensor={"pixel_pitch": "15 um"},
    )  # fmt: skip
    vary = {"lenslets.magnification": "0.3:0.6:1", "lenslets.focal_length": "5 mm:6 mm:1"}
    aim = goal(depths=(-3e-3,), scenes=Scenes(70 * UM, 8), light=Light(500))
    found = lg.optimise(start, vary, aim, search="gradient", evaluations=4)
    assert found.best["picture error"] < 0.995 * min(
        found.start["picture error"], found.swept["picture error"]
    )


@pytest.fixture
def line(tmp_path):
    (tmp_path / "plain.toml").write_text(plain().to_toml())
    return [
        "optimise", str(tmp_path / "plain.toml"), "--vary", "main_lens.diameter=2 mm, 3 mm",
        "--depths", "-3 mm:3 mm:2 mm", "--photons", "200", "-o", str(tmp_path / "best.toml"),
    ]  # fmt: skip


def test_the_command_takes_pictures_and_says_what_scenes_it_judged(line, tmp_path, capsys):
    drawn = Scenes(12 * UM, 64, 0.2).drawn(np.random.default_rng(3))
    for k, one in enumerate((drawn, drawn.T)):
        (tmp_path / f"{k}.png").write_bytes(png((np.clip(one / 2, 0, 1) * 255).astype(np.uint8)))
    names = [str(tmp_path / f"{k}.png") for k in (0, 1)]
    words = [
        "--goal",
        "picture error",
        "--scene-samples",
        "16",
        "--scenes",
        *names,
        "--scene-pitch",
        "12 um",
        "--report",
        str(tmp_path / "r.html"),
        "--trials",
        "8",
    ]
    assert main([*line, *words]) == 0
    said = capsys.readouterr().out
    assert "picture error: 0." in said
    assert "scenes are 16 x 16 samples 12 µm apart, with 1" in said
    assert "their pictures' power" in said
    assert "as given: reconstructions of drawn scenes err by 0." in said
    assert "best: reconstructions of drawn scenes err by 0." in said
    assert "half-way between the depths the best picture error is" in said
    assert "picture error" in (tmp_path / "r.html").read_text()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--goal", "picture error", "--scenes", "nowhere.png"], "nowhere.png"),
        (["--goal", "picture error", "--scene-pitch", "12"], "--scene-pitch"),
        (["--goal", "picture error", "--scene-pitch", "nan um"], "pitch"),
        (["--goal", "volume error", "--scene-samples", "1000"], "samples of scenes are 1000"),
        (["--goal", "picture error", "--trials", "1"], "trials are 1"),
        (["--goal", "picture error", "--trials", "-1"], "trials"),
        (["--goal", "largest f-number", "--trials", "8"], "trials are of depth, lateral"),
        (["--goal", "depth", "--scene-samples", "16"], "--scene-samples are for the goals 'picture error'"),
    ],
)
def test_nonsense_on_the_line_is_refused_in_one_line(line, words, said, capsys):
    assert main([*line, *words]) != 0
    error = capsys.readouterr().err.strip()
    assert said in error
    assert error.count("\n") == 0


@pytest.mark.filterwarnings("ignore:half-way between the depths")
def test_drawn_scenes_are_reconstructed_before_and_after_as_well_as_expected():
    found = lg.optimise(plain(), {"main_lens.diameter": "4 mm"}, goal(), trials=12)
    assert found.tried.keys() == {"start", "best"}
    for which, values in (("start", found.start), ("best", found.best)):
        one = found.tried[which]
        assert one.bound == values["picture error"]
        assert one.reached == pytest.approx(one.bound, abs=3 * one.error + 0.02 * one.bound)
        assert 0 < one.error < 0.05 * one.reached
    scenes = [one.pictures[0] for one in found.tried.values()]
    assert np.array_equal(*scenes)


def test_fits_to_drawn_points_stand_beside_their_bound():
    given = Goal("depth", depths=(10e-6,), light=Light(5000), places=1)
    found = lg.optimise("lfm-fourier", {"fourier_lens": "70 mm"}, given, trials=60)
    assert len(found.tried) == 2
    for one in found.tried.values():
        assert one.bound == pytest.approx(one.reached, abs=3 * one.error)
        assert one.error == pytest.approx(one.reached / np.sqrt(2 * 60), rel=0.4)
