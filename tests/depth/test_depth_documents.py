"""The page about depth and its example run, and say what is true."""

import re
import runpy
from pathlib import Path

import numpy as np
import pytest

import lumigraph as lg

ROOT = Path(__file__).parents[2]


def test_the_page_about_depth_runs():
    (block,) = re.findall(r"```python\n(.*?)```", (ROOT / "docs/how-to/depth.md").read_text(), re.S)
    names = {}
    exec(block, names)
    assert np.median(names["found"].values) == pytest.approx(0.4, abs=0.005)
    assert len(names["mesh"].faces) > 1000


def test_the_example_finds_the_square_where_it_stands(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    runpy.run_path(str(ROOT / "examples/depth_of_a_scene.py"), run_name="__main__")
    told = capsys.readouterr().out
    # d = 0.8 lenslets of 0.1 mm per view of 1 mm: α' = 0.92, z = 1/(1/120 - 0.92/240) = 222.2 mm.
    assert "the square stands 17.8 mm before" in told
    assert len(lg.open(tmp_path / "points.ply")) > 4500
    assert lg.open(tmp_path / "disparity.pfm").shape == (72, 80)
