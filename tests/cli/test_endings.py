"""How commands end: by success, failure, Ctrl-C, or a reader that leaves."""

import os
import signal
import subprocess
import sys
import time
import warnings

import numpy as np
import pytest

import lumigraph.io as io
from lumigraph.cli import console
from lumigraph.core.raw import RawImage
from lumigraph.errors import SamplingWarning
from lumigraph.simulation import Interrupted

PROGRAM = [sys.executable, "-c", "import sys; from lumigraph.cli import main; sys.exit(main())"]


def test_an_output_is_overwritten_by_a_success_only(lumigraph, bench):
    assert lumigraph("calibrate", "white.tiff", "-o", "c.toml").code == 0
    before = (bench / "c.toml").read_bytes()
    assert lumigraph("calibrate", "raw.tiff", "-o", "c.toml", "--pitch", "40", "--overwrite").code == 1
    assert (bench / "c.toml").read_bytes() == before
    assert lumigraph("calibrate", "white.tiff", "-o", "c.toml", "--pixel-pitch", "5 um").code == 0
    assert (bench / "c.toml").read_bytes() != before


def test_debug_shows_the_traceback_and_the_line(lumigraph, bench):
    result = lumigraph("calibrate", "none.tiff", "-o", "c.toml", "--debug")
    assert result.code == 1
    assert "Traceback" in result.err
    assert result.err.splitlines()[-1].startswith("lumigraph: error: none.tiff does not exist")


@pytest.mark.parametrize(
    ("failure", "code", "line"),
    [
        (KeyboardInterrupt(), 130, "lumigraph: interrupted; no output was written."),
        (MemoryError(), 1, "lumigraph: error: not enough memory."),
        (RuntimeError("two\nlines"), 1, "lumigraph: error: unexpected RuntimeError: two lines. Run it again"),
        (
            OSError(28, "No space left on device", "a.png"),
            1,
            "lumigraph: error: a.png: No space left on device.",
        ),
    ],
)
def test_whatever_goes_wrong_is_one_line(lumigraph, bench, monkeypatch, failure, code, line):
    def fail(*_, **__):
        raise failure

    monkeypatch.setattr("lumigraph.calibration.calibrate", fail)
    result = lumigraph("calibrate", "white.tiff", "-o", "c.toml")
    assert result.code == code
    assert result.err.startswith(line)
    assert result.err.count("\n") == 1
    assert not (bench / "c.toml").exists()


def test_warnings_are_one_line_each(lumigraph, bench, monkeypatch):
    def suspicious(*_, **__):
        warnings.warn("two\n  lines", SamplingWarning, stacklevel=2)
        return io.open(bench / "raw.tiff")

    monkeypatch.setattr("lumigraph.simulation.simulate", suspicious)
    with warnings.catch_warnings():
        warnings.simplefilter("default")
        result = lumigraph("simulate", "camera.toml", "--scene", "white", "-o", "a.tiff")
    assert (result.code, result.err) == (0, "lumigraph: warning: two lines\n")


def test_ctrl_c_ends_with_130_and_one_line(bench):
    words = ["simulate", "thesis-plenoptic-1", "--scene", "photo", "--coherence", "snapshots"]
    words += ["--count", "100000", "-o", "raw.tiff"]
    program = [*PROGRAM[:2], PROGRAM[2].replace("sys.exit", "print(flush=True); sys.exit")]
    pipe = subprocess.PIPE
    process = subprocess.Popen([*program, *words], stdout=pipe, stderr=pipe, text=True, cwd=bench)
    assert process.stdout is not None
    process.stdout.readline()  # main is about to start
    time.sleep(1.5)
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=30)
    assert process.returncode == 130
    assert err in (
        "lumigraph: interrupted; no output was written.\n",
        "lumigraph: interrupted; what was finished is in raw.partial.tiff.\n",
    )
    assert not any(path.name.startswith(".raw") for path in bench.iterdir())


def test_ctrl_c_that_python_drops_stops_the_work_at_its_next_step(monkeypatch):
    dropped = []
    monkeypatch.setattr(sys, "unraisablehook", dropped.append)

    class Dropping:
        def __del__(self):
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(0.01)

    with console.interrupts(), console.progress("work") as tell:
        tell(0.1)
        Dropping()
        assert not dropped  # nor does Python complain of it
        with pytest.raises(KeyboardInterrupt):
            tell(0.2)
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_ctrl_c_keeps_the_shots_that_are_finished(lumigraph, bench, monkeypatch):
    partial = io.open(bench / "raw.tiff")

    def interrupted(*_, **__):
        raise Interrupted(RawImage(partial.data, metadata={"shots": 3}))

    before = (bench / "raw.tiff").read_bytes()
    monkeypatch.setattr("lumigraph.simulation.simulate", interrupted)
    result = lumigraph("simulate", "camera.toml", "--scene", "photo", "-o", "raw.tiff")
    assert result.code == 130
    assert result.err == "lumigraph: interrupted; what was finished is in raw.partial.tiff.\n"
    np.testing.assert_array_equal(io.open(bench / "raw.partial.tiff").data, partial.data)
    assert (bench / "raw.tiff").read_bytes() == before


def test_a_reader_that_leaves_early_is_no_error(bench):
    command = f"{' '.join(PROGRAM[:2])} '{PROGRAM[2]}' design camera.toml | true; exit ${{PIPESTATUS[0]}}"
    done = subprocess.run(["bash", "-c", command], capture_output=True, text=True, cwd=bench)
    assert (done.returncode, done.stderr) == (0, "")


def test_the_progress_bar_is_for_terminals(monkeypatch):
    import pty

    primary, secondary = pty.openpty()
    code = (
        "from lumigraph.cli.console import progress\n"
        "with progress('simulate') as p: p(0.5)\n"
        "from lumigraph.core.progress import Stage\n"
        "with progress('demo') as p: p(Stage(0.5, 'white image'))\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], stderr=secondary, stdout=subprocess.PIPE, check=True,
        env={**os.environ, "TERM": "xterm", "COLUMNS": "80"},
    )  # fmt: skip
    os.close(secondary)
    shown = os.read(primary, 100_000).decode()
    assert done.stdout == b""
    assert "simulate" in shown
    assert "demo: white image" in shown
