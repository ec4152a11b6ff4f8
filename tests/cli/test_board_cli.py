"""`lumigraph board`."""

import json

import numpy as np
import pytest

import lumigraph as lg
from lumigraph import metrology
from lumigraph.cli import main
from metrology.scenes import BOARD, corners

KNOWN = ["--focal-length", "50 mm", "--pixel-pitch", "5.5 um", "--shape", "3068", "4080"]


@pytest.fixture
def table(tmp_path):
    lg.metrology.save_corners(corners(np.random.default_rng(2), frames=4), tmp_path / "corners.csv")
    return tmp_path / "corners.csv"


def test_a_table_of_corners_gives_a_camera_with_intervals(table, capsys) -> None:
    made = table.with_name("camera.json")
    board = ["--board", f"{BOARD.shape[1]} x {BOARD.shape[0]} corners, 10 mm"]
    assert main(["board", str(table), *board, *KNOWN, "-o", str(made), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    low, high = found["lenslet_distance_interval"]
    assert low < 0.42e-3 < high
    assert lg.metrology.load(made).camera.focal_length == found["focal_length"]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (KNOWN, "give --board"),
        (["--board", "7 x 5, 10 mm"], "give --focal-length, --pixel-pitch, --shape"),
        (["--board", "seven", *KNOWN], "must be written as '9 x 5 corners, 10 mm'"),
    ],
)
def test_what_is_missing_is_named(table, capsys, words, said) -> None:
    assert main(["board", str(table), *words]) == 1
    assert said in capsys.readouterr().err


@pytest.fixture
def few_distances(monkeypatch):
    """Plans that choose among a third of the distances."""
    monkeypatch.setattr("lumigraph.metrology.boards.planning._DISTANCES", 8)


def test_a_plan_for_a_camera_1_knows_what_is_lit_and_says_what_stays_unknown(
    few_distances, monkeypatch, capsys
) -> None:
    asked, plan = [], metrology.plan

    def noted(camera, calibration, *given, **options):
        asked.append(calibration)
        return plan(camera, calibration, *given, **options)

    monkeypatch.setattr(metrology, "plan", noted)
    words = [
        "board",
        "plan",
        "--camera",
        "thesis-plenoptic-1",
        "--board",
        "4 x 3 corners, 3 mm",
        "--pictures",
        "3",
    ]
    assert main(words) == 0
    camera = lg.load_camera("thesis-plenoptic-1")
    lit = camera.pupil_diameter * camera.lenslet_distance / camera.separation
    assert asked[0].fill == pytest.approx(min(lit / camera.micro_image_pitch, 1), rel=1e-6)
    said = capsys.readouterr().out
    assert said.count(" mm  ") >= 3
    assert "f, and with it L and distances, stays as well known as it is beforehand" in said
    assert main([*words, "--focal-length-error", "40 mm"]) == 0
    assert "stays as well known" not in capsys.readouterr().out


def test_a_plan_says_which_pictures_to_take(few_distances, capsys) -> None:
    words = [
        "board",
        "plan",
        "--camera",
        "multi-focus-hex",
        "--board",
        "5 x 4 corners, 0.5 mm",
        "--pictures",
        "3",
    ]
    assert main(words) == 0
    printed = capsys.readouterr().out.splitlines()
    assert printed[0].split()[:2] == ["picture", "distance"]
    assert len(printed) == 6
    assert printed[4].startswith(
        "note: known to 1%, in 95 of 100 cases: no length; with all 3 pictures: f ± 3.8 %, L ± 4 %, b ± "
    )
    assert ", distances ± " in printed[4]
    assert printed[5].startswith("note: f, and with it L")
    assert main([*words[:2], *words[4:]]) == 1
    assert "a plan needs --camera" in capsys.readouterr().err


def test_squares_that_are_not_as_wide_as_said_are_refused_by_what_is_known_of_b(table, capsys) -> None:
    words = ["board", str(table), *KNOWN, "--board", "7 x 5 corners, 12 mm", "--lenslet-distance", "0.42 mm"]
    assert main([*words, "--lenslet-distance-error", "0.008 mm"]) == 1
    assert "mm, 12 mm given. Measure the board and give its spacing" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--lenslet-distance-error", "0.01 mm"], "needs --lenslet-distance, or --camera"),
        (
            ["--lenslet-pitch", "127 um"],
            "give --micro-image-pitch, in pixels: the lenslets' pitch is compared",
        ),
        (["--lenslet-pitch-error", "0.01 um"], "give --lenslet-pitch, or --camera: the lenslets' pitch"),
    ],
)
def test_half_of_what_is_known_of_the_array_is_refused(table, capsys, words, said) -> None:
    assert main(["board", str(table), *KNOWN, "--board", "7 x 5 corners, 10 mm", *words]) == 1
    assert said in capsys.readouterr().err
