"""A search for the least error of reconstructed scenes finds it, keeps to its scenes, and reports them."""

import re

import numpy as np
import pytest

import lumigraph as lg
from lumigraph.cli import main
from lumigraph.core.picture import png
from lumigraph.errors import FormatError, GeometryError, SamplingWarning
from lumigraph.studies.information import Light, Scenes, reconstruction_error
from lumigraph.studies.information.points import collected
from lumigraph.studies.optimisation import Goal
from lumigraph.studies.optimisation.tried import DrawnErrors

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


@pytest.mark.filterwarnings("ignore:half-way between the depths")
@pytest.mark.long  # 13 s
def test_gradients_lead_to_a_better_camera_without_lenslets():
    vary = {"main_lens.diameter": "1 mm:8 mm:1", "main_lens.aberrations.4": "-0.5:0.5:1"}
    found = lg.optimise(plain(), vary, goal(), search="gradient", evaluations=8)
    assert found.best["picture error"] < 0.99 * found.swept["picture error"]


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
        "--held-out",
        *names,
    ]
    assert main([*line, *words]) == 0
    said = capsys.readouterr().out
    assert re.search(r"picture error: 0\.\d{3} as given", said)
    assert "scenes are 16 x 16 samples 12 µm apart, with 1" in said
    assert "their pictures' power" in said
    assert "as given: reconstructions of drawn scenes err by 0." in said
    assert "best: reconstructions of drawn scenes err by 0." in said
    assert "as given: 16 held-out scenes err by 0." in said
    assert "% ±" in said
    assert "half-way between the depths the best picture error is" in said
    report = (tmp_path / "r.html").read_text()
    assert "picture error" in report
    assert 0 < report.index("<figure") < report.index("error of held-out scenes, rms")


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
        (["--goal", "picture error", "--held-out", "nowhere.png"], "nowhere.png"),
        (["--goal", "depth", "--held-out", "{picture}"], "held-out pictures are for picture error"),
        (["--goal", "depth", "--scene-samples", "16"], "--scene-samples are for the goals 'picture error'"),
    ],
)
def test_nonsense_on_the_line_is_refused_in_one_line(line, words, said, capsys, tmp_path):
    (tmp_path / "some.png").write_bytes(png(np.full((40, 40), 100, np.uint8)))
    words = [word.format(picture=tmp_path / "some.png") for word in words]
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


def held_out(contrast=0.3, samples=40):
    """Pictures of the search's kind, that it has not seen."""
    rng = np.random.default_rng(5)
    return [np.maximum(Scenes(12 * UM, samples, contrast).drawn(rng), 0) for _ in range(2)]


@pytest.mark.filterwarnings("ignore:half-way between the depths")
def test_held_out_scenes_are_reconstructed_as_well_as_expected_and_better_before_the_best():
    found = lg.optimise(plain(), {"main_lens.diameter": "3 mm, 4 mm"}, goal(), held_out=held_out())
    start, swept, best = (found.held_out[which] for which in ("start", "swept", "best"))
    assert swept is best
    assert len(best.squares) == 2 * 2 * 2
    gain, error = best.gain(start)
    assert gain == pytest.approx(1 - best.reached / start.reached)
    assert gain == pytest.approx(found.gain(found.start), abs=3 * error)
    assert 0 < error < 0.03
    first = held_out()[0][:16, :16]
    for one in (best, start):
        np.testing.assert_allclose(one.pictures[0], first / first.mean())


def test_a_best_that_is_no_better_on_held_out_scenes_is_warned_of():
    """A stop wider by half a thousandth changes nothing that 8 scenes can tell."""
    vary = {"main_lens.diameter": "2.001 mm"}
    with pytest.warns(
        SamplingWarning, match=r"camera as given reconstructs held-out scenes within .* chance"
    ):
        lg.optimise(plain(), vary, goal(depths=(1e-3,)), held_out=held_out())


def test_the_error_of_a_gain_is_that_of_the_differences():
    rng = np.random.default_rng(2)
    common, own = rng.normal(1, 0.2, (2000, 400)), rng.normal(0, 0.02, (2, 2000, 400))
    gains, errors = [], []
    for shared, (here, there) in zip(common, own.swapaxes(0, 1), strict=True):
        both = [0.81 * (shared + here), shared + there]
        one, other = (DrawnErrors(reached=np.sqrt(each.mean()), squares=each) for each in both)
        gain, error = one.gain(other)
        gains.append(gain)
        errors.append(error)
    assert np.mean(gains) == pytest.approx(0.1, abs=1e-3)
    assert np.mean(errors) == pytest.approx(np.std(gains), rel=0.07)


def test_squares_of_pictures_stand_side_by_side_and_evenly_over_all():
    scenes = Scenes(12 * UM, 8)
    pictures = [np.full((16, 24), 1.0 + k) + np.arange(24) for k in range(2)]
    pictures[0][:8, :8] = 0
    found = scenes.squares(pictures, 100)
    assert len(found) == 11
    assert all(one.shape == (8, 8) and one.mean() == pytest.approx(1) for one in found)
    assert len(scenes.squares(pictures, 4)) == 4
    np.testing.assert_array_equal(scenes.squares(pictures, 4)[0], found[0])
    np.testing.assert_array_equal(scenes.squares(pictures, 4)[-1], found[-1])
    with pytest.raises(FormatError, match="no pictures of scenes"):
        scenes.squares([], 4)


def test_fits_to_drawn_points_stand_beside_their_bound():
    given = Goal("depth", depths=(10e-6,), light=Light(5000), places=1)
    found = lg.optimise("lfm-fourier", {"fourier_lens": "70 mm"}, given, trials=60)
    assert len(found.tried) == 2
    for one in found.tried.values():
        assert one.bound == pytest.approx(one.reached, abs=3 * one.error)
        assert one.error == pytest.approx(one.reached / np.sqrt(2 * 60), rel=0.4)
