"""`lumigraph tolerance`: tables of cameras and of tolerances, in one line that goes on after a kill."""

import csv
import json
import os
import signal
import subprocess
import sys
import time

import pytest

import lumigraph as lg
from lumigraph.cli import main

CAMERA = "thesis-plenoptic-2-m050"
GIVEN = ["-t", "separation=±0.05 mm", "-t", "lenslets.pitch=+-0.1 um uniform"]


def table(path):
    with path.open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_the_tables_are_what_the_library_finds(tmp_path, capsys):
    out, page = tmp_path / "t.csv", tmp_path / "t.html"
    said = [
        "tolerance",
        CAMERA,
        *GIVEN,
        "-n",
        "20",
        "--seed",
        "2",
        "--measure",
        "depth error,lateral resolution",
    ]
    assert main([*said, "-o", str(out), "--workers", "1", "--report", str(page), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    camera = lg.FocusedPlenopticCamera.from_catalogue(CAMERA)
    given = {"separation": "±0.05 mm", "lenslets.pitch": "±0.1 um uniform"}
    found = lg.tolerance.study(camera, given, draws=20, seed=2, measure=["depth error", "lateral resolution"])
    rows = table(out)
    assert [row["camera"] for row in rows[:3]] == [
        "as described", "separation + one deviation", "separation - one deviation",
    ]  # fmt: skip
    assert [float(row["depth error [m]"]) for row in rows[5:]] == found["depth error"].sample.tolist()
    costs = table(tmp_path / "t-tolerances.csv")
    assert [row["tolerance"] for row in costs] == ["separation", "lenslets.pitch"] * 2
    assert float(costs[0]["share"]) == found["depth error"].shares[0]
    assert told["depth error, deviation"] == found["depth error"].deviation
    assert told["tolerances"][0]["sensitivity"] == found.rows()[0]["sensitivity"]
    assert "deviation if halved" in page.read_text(encoding="utf-8")


def test_a_part_says_how_it_stands_and_the_last_one_what_follows(here, tmp_path, capsys):
    said = ["tolerance", CAMERA, *GIVEN, "-n", "8", "-o", str(tmp_path / "t.csv"), "--workers", "1"]
    assert main([*said, "--part", "1/2"]) == 0
    assert "6 of 13 frames are done; the last part reports" in capsys.readouterr().out
    assert main([*said, "--part", "2/2"]) == 0
    assert "8 cameras drawn with 2 tolerances" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["-t", "separation"], "must be like 'separation=±0.05 mm'"),
        (["-t", "separation=±1 mm", "-t", "separation=±2 mm"], "names separation twice"),
        (["-t", "separation=1 mm"], "must be like '±0.05 mm'"),
        ([*GIVEN, "--measure", "depth"], "Did you mean 'depth error'"),
        ([*GIVEN, "-n", "1"], "draws is 1 but must be a whole number of at least 2"),
        ([*GIVEN, "--seed", "-1"], "seed is -1"),
        ([], "there are no tolerances"),
    ],
)
def test_what_is_wrong_is_told_before_any_work(tmp_path, capsys, words, told):
    assert main(["tolerance", CAMERA, *words, "-o", str(tmp_path / "t.csv")]) == 1
    assert told in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


@pytest.mark.long  # 1,000 cameras, killed twice: half a minute
@pytest.mark.skipif(sys.platform == "win32", reason="processes are killed by signals")
def test_a_thousand_cameras_killed_twice_are_the_same(tmp_path):
    def line(name):
        words = [*GIVEN, "-n", "1000", "--workers", "2", "-o", str(tmp_path / name)]
        return [sys.executable, "-m", "lumigraph", "tolerance", CAMERA, *words]

    ledger, kills = tmp_path / "killed.csv.ledger", 0
    for share in (100, 600):
        started = subprocess.Popen(line("killed.csv"), start_new_session=True)
        while started.poll() is None and len(list(ledger.glob("done/*.json"))) < share:
            time.sleep(0.02)
        if started.poll() is None:
            os.killpg(started.pid, signal.SIGKILL)
            kills += 1
        started.wait()
    assert kills == 2
    assert not lg.cluster.status(tmp_path / "killed.csv").is_whole
    for name in ("killed.csv", "whole.csv"):
        assert subprocess.run(line(name), check=False).returncode == 0
    for name in ("{}.csv", "{}-tolerances.csv"):
        pair = [(tmp_path / name.format(each)).read_bytes() for each in ("killed", "whole")]
        assert pair[0] == pair[1]
    assert len(table(tmp_path / "killed.csv")) == 1005
