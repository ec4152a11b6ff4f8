"""Data sets of drawn scenes: the same seed draws the same, the truth is what the raw image shows."""

import runpy
from pathlib import Path

import numpy as np
import pytest
import zarr

import lumigraph as lg
from cameras import focused
from lumigraph.cli import main
from lumigraph.samples.dataset import Draws
from lumigraph.samples.drawn import LAYOUTS

DEPTHS = ["--depth", "-6 mm:6 mm:6 mm"]


@pytest.fixture(scope="module")
def camera(tmp_path_factory):
    path = tmp_path_factory.mktemp("camera") / "camera.toml"
    path.write_text(focused().to_toml())
    return path


@pytest.fixture(scope="module")
def made(camera, tmp_path_factory):
    out = tmp_path_factory.mktemp("made") / "train.zarr"
    said = ["dataset", str(camera), "-n", "4", *DEPTHS, "-o", str(out), "--volume", "--workers", "1"]
    assert main([*said, "--vary", "lenslets.focal_length=5.2 mm, 5.3 mm", "--seed", "3"]) == 0
    return out


def test_a_raw_image_is_what_the_camera_sees_of_the_truth(made):
    group, camera = zarr.open_group(str(made), mode="r"), focused()
    rows = group["parameters"][:]
    assert rows[:, 0].tolist() == [0, 1, 0, 1]
    for number in (0, 1):
        taken = camera.replace(lenslets={"focal_length": ("5.2 mm", "5.3 mm")[number]})
        light = taken.operator((-6e-3, 0.0, 6e-3), accuracy=1e-2).forward(group["intensity"][number])
        _, _, texture, fill, electrons = rows[number]
        assert texture in (0, 1, 2)
        raw, sensor = group["raw"][number].astype(float), taken.sensor
        expected = light * electrons * (sensor.levels - sensor.black_level) / sensor.full_well
        noise = np.sqrt(np.maximum(light, 0) * electrons + sensor.read_noise**2)
        noise *= (sensor.levels - sensor.black_level) / sensor.full_well
        off = (raw - sensor.black_level - expected) / np.hypot(noise, 0.3)
        assert 0.9 < off.std() < 1.1  # photon and read noise, and nothing else
        assert abs(off.mean()) < 0.05
        assert expected.max() == pytest.approx(fill * (sensor.levels - sensor.black_level), rel=0.02)


@pytest.mark.long  # another set is made
def test_cameras_drawn_within_tolerances_take_turns(here, camera, tmp_path):
    out = tmp_path / "t.zarr"
    said = ["dataset", str(camera), "-n", "3", *DEPTHS, "-o", str(out), "--volume", "--workers", "1"]
    said += [
        "-t",
        "separation=±1 mm",
        "-t",
        "lenslet_distance=±5 mm uniform",
        "--cameras",
        "2",
        "--seed",
        "7",
    ]
    assert main(said) == 0
    given = {"separation": "±1 mm", "lenslet_distance": "±5 mm uniform"}
    takers = lg.tolerance.cameras(focused(), given, 2, seed=7)
    group = zarr.open_group(str(out), mode="r")
    assert group["parameters"][:, 0].tolist() == [0, 1, 0]
    for number, taken in enumerate((*takers, takers[0])):
        spread = []
        for other in (taken, focused()):
            light = other.operator((-6e-3, 0.0, 6e-3), accuracy=1e-2).forward(group["intensity"][number])
            expected = light * group["parameters"][number][4] * 4095 / taken.sensor.full_well
            noise = np.sqrt(np.maximum(light, 0) * group["parameters"][number][4] + 25) * 4095 / 1e4
            spread.append(((group["raw"][number] - expected) / np.hypot(noise, 0.3)).std())
        assert 0.9 < spread[0] < 1.1
        assert spread[1] > 1.5
    card = out.with_name("t.zarr.md").read_text()
    assert card.count("[built]") == 2


def test_depth_and_picture_agree_with_the_planes(made):
    group = zarr.open_group(str(made), mode="r")
    depth, planes = group["depth"][:], group["intensity"][:]
    np.testing.assert_array_equal(group["picture"][:], planes.sum(1))
    assert ((planes > 0).sum(1) == 1).all()  # each place stands at one depth
    np.testing.assert_allclose(depth, np.array([-6e-3, 0, 6e-3])[np.argmax(planes, 1)], rtol=1e-6)
    assert len(np.unique(depth)) > 1


def test_the_same_seed_draws_the_same_whoever_makes_it(made, camera, tmp_path):
    texts = tuple(focused().replace(lenslets={"focal_length": f}).to_toml() for f in ("5.2 mm", "5.3 mm"))
    work = Draws(texts, (-6e-3, 0.0, 6e-3), LAYOUTS[:2], seed=3)
    group = zarr.open_group(str(made), mode="r")
    for name, array in work(2).items():
        np.testing.assert_array_equal(array, group[name][2])
    other = Draws(texts, (-6e-3, 0.0, 6e-3), LAYOUTS[:2], seed=4)
    assert (other(2)["raw"] != group["raw"][2]).any()


def test_the_card_says_what_it_is_and_the_line_makes_it_again(made):
    card = made.with_name("train.zarr.md").read_text()
    assert "| `raw` | 4 x" in card
    assert "-6 mm, 0 mm, 6 mm" in card
    assert "--seed 3" in card
    assert card.count('kind = "focused-plenoptic"') == 2
    assert lg.cluster.status(made).is_whole


def test_beads_and_photographs(here, camera, tmp_path):
    out = tmp_path / "beads.zarr"
    said = ["dataset", str(camera), *DEPTHS, "--workers", "1"]
    assert main([*said, "-n", "1", "--layout", "beads", "-o", str(out)]) == 0
    assert sorted(zarr.open_group(str(out), mode="r").array_keys()) == ["parameters", "picture", "raw"]
    ramp = np.tile(np.linspace(0, 60000, 80).astype(np.uint16), (60, 1))
    lg.save(lg.RawImage(ramp, 1e-6), tmp_path / "photo.png")
    text = focused().to_toml()
    work = Draws((text,), (-6e-3, 0.0, 6e-3), ("slanted",), (str(tmp_path / "photo.png"),))
    picture = next(s["picture"] for s in map(work, range(99)) if s["parameters"][2] == 3)
    assert np.abs(np.diff(picture.mean(0))).sum() == pytest.approx(0.95, rel=0.02)  # a ramp, either way
    assert picture.std(0).max() < 1e-3


@pytest.mark.parametrize(
    ("said", "why"),
    [
        (["-n", "0"], "--count is 0"),
        (["-n", "1", "--seed", "-1"], "--seed is -1"),
        (["-n", "1", "--layout", "beads", "--layout", "slanted"], "two data sets"),
        (["-n", "1", "--photographs", "none*.jpg"], "no file matches"),
        (["-n", "1", "-t", "separation=±1 mm"], "--cameras is 0 but must be above 0"),
        (["-n", "1", "--accuracy", "-1"], "accuracy is -1 but must lie between 1e-05 and 0.01"),
        (["-n", "1", "--accuracy", "nan"], "accuracy is nan"),
        (["-n", "1", "--cameras", "2"], "there are no tolerances"),
        (["-n", "1", "--cameras", "-1"], "--cameras is -1"),
        (["-n", "1", "--cameras", "9", "-t", "lenslets.rotation=±30 deg"], "a data set has one shape"),
    ],
)
def test_what_cannot_be_is_refused(said, why, camera, tmp_path, capsys):
    assert main(["dataset", str(camera), *DEPTHS, *said, "-o", str(tmp_path / "t.zarr")]) == 1
    assert why in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_accuracies_that_no_microscope_has_are_refused(tmp_path, capsys):
    words = ["dataset", "lfm-guv", "-n", "1", "--depth", "0 um", "--accuracy", "0.2"]
    assert main([*words, "-o", str(tmp_path / "t.zarr")]) == 1
    assert "accuracy is 0.2 but must be from 1e-5 to 0.1" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_pytorch_reads_it(made, capsys):
    pytest.importorskip("torch", reason="PyTorch is not installed (make torch)")
    example = runpy.run_path(str(Path(__file__).parents[2] / "examples" / "learn_depth.py"))
    example["main"](str(made))
    assert "depth -0.006 to" in capsys.readouterr().out
