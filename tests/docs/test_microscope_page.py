"""The page about microscopes and its example run as a reader would run them."""

import re
import runpy
from pathlib import Path

import pytest

import lumigraph as lg

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "microscope.md").read_text(encoding="utf-8")


def test_the_page_finds_its_beads():
    names: dict = {}
    for code in re.findall(r"```python\n(.*?)```", PAGE, re.S):
        exec(compile(code, "docs/microscope.md", "exec"), names)
    volume = names["volume"]
    for z, y, x in ((1, 10, 8), (3, 13, 16)):
        assert volume[z, y, x] == volume[z].max()
        assert volume[z, y, x] > 20 * volume[2].max()


def test_the_microscope_file_of_the_page_is_read(tmp_path):
    (code,) = re.findall(r"```toml\n(.*?)```", PAGE, re.S)
    (tmp_path / "scope.toml").write_text(code)
    assert lg.load_camera(tmp_path / "scope.toml").magnification == pytest.approx(60.0)


def test_the_example_finds_its_vesicle(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    runpy.run_path(str(ROOT / "examples" / "microscope.py"), run_name="__main__")
    assert float(capsys.readouterr().out.split()[-1]) > 0.7
    assert (tmp_path / "vesicle.png").stat().st_size > 1000
