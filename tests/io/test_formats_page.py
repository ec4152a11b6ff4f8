"""docs/reference/formats.md, docs/how-to/camera-files.md and examples/files.py say what is true."""

import re
import runpy
from pathlib import Path

import numpy as np

import lumigraph as lg
import lumigraph.io as io

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "reference" / "formats.md").read_text()
PROGRAM = (ROOT / "docs" / "how-to" / "camera-files.md").read_text()


def test_the_page_lists_the_table_of_formats():
    rows = {}
    for line in PAGE.splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if len(cells) == 5 and not cells[0].startswith(("format", "---")):
            ends, reads, writes, options = (tuple(re.findall(r"`([^`]+)`", cell)) for cell in cells[1:])
            rows[ends or ("/",)] = (set(reads), set(writes), {option.rstrip("=") for option in options})
    assert rows == {row.endings: (set(row.reads), set(row.writes), set(row.options)) for row in io.FORMATS}


def test_the_program_of_the_page_runs(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (code,) = re.findall(r"^```python\n(.*?)^```", PROGRAM, re.M | re.S)
    exec(compile(code, "docs/how-to/camera-files.md", "exec"), {})
    assert "5 pages of 20 x 30" in capsys.readouterr().out


def test_the_example_writes_every_kind_of_file(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    runpy.run_path(str(ROOT / "examples" / "files.py"), run_name="__main__")
    assert "as in the folder: True" in capsys.readouterr().out
    stack = lg.open("focus.ome.tiff")
    # The square moves by 2 px per view, 100 px to a camera spacing: sharp at α' = 0.98.
    edges = [np.abs(np.diff(picture[45, 30:90, 0])).max() for picture in stack]
    assert abs(stack.positions[int(np.argmax(edges))] - 0.98) < 0.006
    assert len(lg.open("points.ply")) == 90 * 120
    assert Path("focus.gif").stat().st_size > 10_000
