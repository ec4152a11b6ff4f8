"""Every verb that computes writes the same kind of page: figures, numbers, the command, versions."""

import json
import re

import numpy as np
import pytest

import lumigraph as lg
from lumigraph.cli import main
from viewer_pages import two_planes


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    lg.save(two_planes(), tmp_path / "views.zarr")
    camera = lg.load_camera("thesis-plenoptic-1").replace(lenslets={"count": (9, 9)})
    (tmp_path / "camera.toml").write_text(camera.to_toml())
    lg.save(camera.calibration, tmp_path / "calibration.toml")
    lg.save(lg.RawImage(np.ones(camera.sensor.shape)), tmp_path / "raw.tiff")
    return tmp_path


@pytest.mark.parametrize(
    ("command", "figures"),
    [
        ("design camera.toml", 1),
        ("simulate camera.toml --point '0 mm, 0 mm' -o point.tiff", 3),
        ("decode raw.tiff --calibration calibration.toml -o out.zarr", 4),
        ("refocus views.zarr --alphas 0.9:1.1:x3 -o stack.tiff", 3),
        ("render views.zarr --all-in-focus --alphas 0.9:1.1:x3 -o sharp.png", 2),
        ("depth views.zarr --method focus -o depth.tiff", 3),
    ],
)
def test_a_verb_writes_its_page(folder, capsys, command, figures):
    import shlex

    words = [*shlex.split(command), "--report", "page.html"]
    assert main([*words, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["report"] == "page.html"
    page = (folder / "page.html").read_text("utf-8")
    assert page.count("<figure") == figures
    assert "How it was made" in page
    told = re.search(r"<pre>(lumigraph .*)</pre>", page)[1]
    assert told.startswith(f"lumigraph {words[0]} {words[1]}")
    assert told.endswith("--report page.html --json")
    assert "prefers-color-scheme: dark" in page
    assert not re.search(r"https?://", page)


def test_a_report_that_cannot_be_written_is_refused_first(folder, capsys):
    assert (
        main(["refocus", "views.zarr", "--alpha", "1", "-o", "x.png", "--report", "camera.toml/x.html"]) == 1
    )
    assert "camera.toml is a file, not a folder" in capsys.readouterr().err
    assert not (folder / "x.png").exists()
    assert main(["design", "camera.toml", "--report", "page.pdf"]) == 1
    assert main(["design", "camera.toml", "--no-open"]) == 1
    assert "Give --web too" in capsys.readouterr().err
