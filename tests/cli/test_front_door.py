"""What a newcomer types first: a wrong verb, completion, the list of cameras."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import lumigraph as lg
from lumigraph.cli import app, console
from lumigraph.cli.options import COMMAND


def test_a_wrong_verb_names_all_verbs_and_the_nearest(lumigraph):
    result = lumigraph("depht", "views.zarr")
    assert result.code == app.USAGE
    assert "there is no verb 'depht'. Did you mean 'depth'? The verbs are process, view," in result.err
    assert result.err.rstrip().endswith("catalogue, reproduce; try 'lumigraph --help'.")


def test_a_question_ends_with_its_mark(lumigraph):
    assert "Did you mean --plot? Try 'lumigraph design --help'." in lumigraph("design", "x", "--plt", "y").err


@pytest.mark.parametrize(
    ("words", "needs"),
    [
        (("decode", "raw.png"), "decode needs --output (-o). Try 'lumigraph decode --help'."),
        (("decode", "raw.png", "-o"), "-o needs a value."),
        (("design", "thesis-2f", "--plot"), "--plot needs a value."),
        (("measure",), "measure needs WHAT: edge or point or noise or sensor."),
        (("refocus",), "refocus needs VIEWS."),
    ],
)
def test_what_a_command_lacks_is_named(lumigraph, words, needs):
    result = lumigraph(*words)
    assert result.code == app.USAGE
    assert needs in result.err


def test_the_folder_of_a_missing_file_is_written_out(lumigraph, tmp_path):
    assert f"the folder is {tmp_path.resolve()}." in lumigraph("calibrate", "no.tiff", "-o", "c.toml").err


def test_messages_name_options_where_the_verb_has_them(monkeypatch):
    token = COMMAND.set(("calibrate", "white.png"))
    try:
        assert app._optional("or pass pitch= and layout=.") == "or pass --pitch and --layout."
        assert app._optional("pass pitch=14.2.") == "pass --pitch 14.2."
        assert app._optional("α'=1, accuracy=1e-3") == "α'=1, accuracy=1e-3"
        COMMAND.set(("simulate", "camera.toml"))
        assert app._optional("Give spectrum=Spectrum.rgb() for") == "Give --colours rgb for"
    finally:
        COMMAND.reset(token)


def test_a_file_of_another_kind_is_called_what_people_call_it(lumigraph, tmp_path):
    views = lg.LightField(np.ones((2, 2, 4, 4)), lg.Grid((2, 2), 1e-3), lg.Grid((4, 4), 1e-4), 0.1)
    lg.save(views, tmp_path / "views.zarr")
    result = lumigraph("calibrate", "views.zarr", "-o", "calibration.toml")
    assert "holds a light field where a" in result.err


def test_the_drawing_of_a_design_is_reported(lumigraph):
    assert lumigraph("design", "thesis-2f", "--plot", "rays.svg").out.endswith("written rays.svg\n")
    assert json.loads(lumigraph("design", "thesis-2f", "--plot", "r.svg", "--json").out)["output"] == "r.svg"


def test_the_catalogue_lists_every_camera_with_its_figures(lumigraph):
    lines = lumigraph("catalogue").out.splitlines()
    assert [line.split()[0] for line in lines[1:]] == lg.catalogue()
    assert "NA 1.2" in next(line for line in lines if line.startswith("lfm-guv "))
    values = json.loads(lumigraph("catalogue", "--json").out)
    assert list(values) == lg.catalogue()
    assert values["thesis-2f"]["f-number"] == pytest.approx(63.2)


def test_progress_without_a_terminal_is_a_line_now_and_then(capsys, monkeypatch):
    clock = iter([0.0, 5.0, 12.0, 13.0, 25.0, 30.0])
    monkeypatch.setattr(console.time, "monotonic", lambda: next(clock))
    with console.progress("simulate") as moved:
        for fraction in (0.1, 0.2, 0.3, 0.5, 1.0):
            moved(fraction)
    lines = capsys.readouterr().err.splitlines()
    assert lines == ["lumigraph: simulate: 20% after 12 s", "lumigraph: simulate: 50% after 25 s"]


def test_completion_is_installed_for_the_shell(tmp_path):
    command = [Path(sys.executable).with_name("lumigraph"), "--install-completion"]
    environment = {**os.environ, "HOME": str(tmp_path), "SHELL": "/bin/bash"}
    run = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    script = next(path for path in tmp_path.rglob("lumigraph") if path.is_file()).read_text()
    assert "deconvolve" in script
    assert "--overlay" in script
