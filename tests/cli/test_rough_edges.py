"""Outputs onto inputs, closed and full outputs, Ctrl-C while it starts, and lines without end."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import lumigraph as lg

PROGRAM = "import sys; from lumigraph.cli import main; sys.exit(main())"


@pytest.fixture
def views(tmp_path):
    data = np.random.default_rng(0).random((3, 3, 12, 13)).astype(np.float32)
    field = lg.LightField(data, lg.Grid((3, 3), 1e-3), lg.Grid((12, 13), 1e-4), 0.01)
    for name in ("v.zarr", "v"):
        lg.save(field, tmp_path / name)
    return data


@pytest.mark.parametrize(
    "words",
    [
        ("refocus", "v.zarr", "--alpha", "1", "-o", "v.zarr"),
        ("refocus", "v.zarr", "--alpha", "1", "-o", "./link/../v.zarr"),
        ("refocus", "v.zarr", "--alpha", "1", "--output=linked.zarr"),
        ("refocus", "inside.zarr/v.zarr", "--alpha", "1", "-o", "inside.zarr"),
        ("refocus", "v.zarr", "--alpha", "1", "-o", "p.png", "--report", "v.zarr"),
    ],
)
def test_an_output_that_would_destroy_an_input_is_refused(lumigraph, tmp_path, views, words):
    """`refocus v.zarr --alpha 1 -o v.zarr` did so without a word."""
    (tmp_path / "link").mkdir()
    (tmp_path / "linked.zarr").symlink_to(tmp_path / "v.zarr")
    (tmp_path / "inside.zarr").mkdir()
    (tmp_path / "inside.zarr" / "zarr.json").write_text("{}")
    (tmp_path / "v.zarr").rename(tmp_path / "inside.zarr" / "v.zarr") if "inside" in words[1] else None
    result = lumigraph(*words)
    assert result.code == 1
    assert "would destroy" in result.err
    np.testing.assert_array_equal(lg.open(tmp_path / words[1]).data, views)


def test_an_output_beside_its_input_is_written(lumigraph, views):
    assert lumigraph("refocus", "v.zarr", "--alpha", "1", "-o", "w.zarr").code == 0
    assert lumigraph("refocus", "v.zarr", "--alpha", "1", "-o", "w.zarr").code == 0


def test_a_picture_inside_the_output_folder_is_not_written_over(lumigraph, tmp_path, views):
    (tmp_path / "out").mkdir()
    inside = tmp_path / "out" / "refocused-000-alpha-1.0000.png"
    lg.save(np.zeros((4, 4), np.uint8), inside)
    before = inside.read_bytes()
    words = ("refocus", "v.zarr", "--alpha", "1", "--alpha", "1.1", "-o", "out")
    named = lumigraph(*words, "--report", "r.html", "--camera", str(inside))
    assert named.code == 1
    assert "refocused-000-alpha-1.0000.png would destroy" in named.err
    assert inside.read_bytes() == before
    assert lumigraph(*words).code == 0


def run(words, redirection):
    line = f'exec "$0" -c "{PROGRAM}" {words} {redirection}'
    return subprocess.run(["sh", "-c", line, sys.executable], capture_output=True, text=True, timeout=60)


@pytest.mark.parametrize(
    ("redirection", "code", "said"),
    [(">&-", 0, ""), ("2>&-", 0, ""), (">/dev/full", 1, "No space left on device"), ("| true", 0, "")],
)
def test_a_closed_or_full_output_is_told_in_one_line(redirection, code, said):
    result = run("--version", redirection)
    assert result.returncode == code, result
    assert len(result.stderr.splitlines()) == bool(said)
    assert said in result.stderr
    assert "unexpected" not in result.stderr


def test_where_outputs_are_closed_no_file_takes_their_numbers():
    """Libraries print into number 2, whatever it is."""
    words = "import os; from lumigraph.cli import main; main(['--version']); f = open(os.devnull); "
    line = f'exec "$0" -c "{words}os._exit(f.fileno())" <&- >&- 2>&-'
    assert subprocess.run(["sh", "-c", line, sys.executable], timeout=60).returncode > 2


def test_no_line_on_standard_error_is_longer_than_400_characters(lumigraph):
    for words in (
        ("decode", "x" * 100_000, "-o", "v.zarr"),
        ("simulate", "--" + "y" * 100_000),
        ("z" * 9999,),
    ):
        result = lumigraph(*words)
        assert result.code in (1, 2)
        assert len(result.err) <= 401
        assert result.err.count("\n") == 1


def test_an_interruption_while_the_program_starts_is_quiet():
    for delay in (0.1, 0.2, 0.3):
        process = subprocess.Popen(
            [sys.executable, "-c", f"import lumigraph.cli, os; os.write(1, b'.'); {PROGRAM}", "--help"],
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        )  # fmt: skip
        assert process.stdout is not None
        os.read(process.stdout.fileno(), 1)
        time.sleep(delay / 3)
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=60)
        assert "Traceback" not in err
        assert process.returncode in (0, 130, -signal.SIGINT)


def test_nothing_slow_is_imported_before_an_interruption_is_quiet():
    place = Path(lg.__path__[0]).parent
    code = f"import sys; sys.path.append({str(place)!r}); import lumigraph.cli; print(*sys.modules)"
    words = [sys.executable, "-I", "-S", "-c", code]  # without `site`, which may import anything
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    assert not {"typing", "collections", "enum", "re", "signal", "contextlib"} & set(done.stdout.split())


def test_an_exact_pitch_is_kept_by_calibrate(lumigraph, tmp_path):
    """A rectified picture of 19 px was measured as 19.014 px even with --pitch 19."""
    y, x = np.mgrid[:96, :115]
    white = (np.cos(np.pi * (y - 47) / 19.02) * np.cos(np.pi * (x - 57) / 19.02)) ** 2
    lg.save(lg.RawImage(np.uint8(200 * white)), tmp_path / "white.png")
    result = lumigraph("calibrate", "white.png", "--pitch", "19 px", "--exact", "-o", "c.toml")
    assert (result.code, lg.open(tmp_path / "c.toml").lattice.pitch) == (0, 19)
    result = lumigraph("calibrate", "white.png", "--exact", "-o", "c.toml")
    assert result.code == 1
    assert "--pitch 19" in result.err
    result = lumigraph("calibrate", "white.png", "--pitch", "19 um", "-o", "c.toml")
    assert result.code == 2
    assert "--pitch: '19 um' must be a number of pixels, such as 15 or '15 px'" in result.err
