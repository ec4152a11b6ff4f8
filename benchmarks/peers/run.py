"""One snapshot of the 2f system by lumigraph, and by other libraries in an environment of their own.

    python benchmarks/peers/run.py [--environment FOLDER]

makes the environment by ``python -m venv`` where it is missing (build/peers), installs each library by plain
pip, skips what does not install or run, and prints the milliseconds of a snapshot, wall and user processor
time, beside full transforms in SciPy in the same run, and how far the intensity is from theirs, relative rms
in the middle half: a library that neither limits the band nor pads aliases. lumigraph runs in the interpreter
that runs this script.
"""

import argparse
import os
import subprocess
import sys
import venv
from pathlib import Path

HERE = Path(__file__).parent
LIBRARIES = {
    "scipy": (),
    "hcipy": (),
    "prysm": ("setuptools<81",),  # it imports pkg_resources
    "torchoptics": (),
    "lumenairy": (),
}
"""What each library needs beside itself."""
LONGEST_INSTALL = 900
"""Seconds until an installation is given up."""
LONGEST_RUN = 600
"""Seconds until a library's snapshots are given up."""


def python_of(environment: Path) -> Path:
    """The environment's python, made first where it is missing."""
    python = environment / ("Scripts/python.exe" if sys.platform == "win32" else "bin/python")
    if not python.exists():
        venv.create(environment, with_pip=True)
    return python


def installed(python: Path, library: str) -> bool:
    """Whether a library can be imported, after pip has tried."""
    if subprocess.run([python, "-c", f"import {library}"], capture_output=True).returncode == 0:
        return True
    words = [
        python,
        "-m",
        "pip",
        "install",
        "--quiet",
        "--disable-pip-version-check",
        library,
        *LIBRARIES[library],
    ]
    try:
        return subprocess.run(words, capture_output=True, timeout=LONGEST_INSTALL).returncode == 0
    except subprocess.TimeoutExpired:
        return False


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--environment", type=Path, default=HERE.parents[1] / "build" / "peers")
    parser.add_argument("--count", type=int, default=5, help="snapshots of each library")
    options = parser.parse_args()
    python = python_of(options.environment)
    paths = {"PYTHONPATH": str(HERE.parents[1])}  # where lumigraph's own snapshot is
    for library in ("lumigraph", *LIBRARIES):
        ours = library == "lumigraph"
        if not ours and not installed(python, library):
            print(f"{library:12} does not install here")
            continue
        words = [sys.executable if ours else python, HERE / "snapshots.py", library, str(options.count)]
        environment = os.environ | (paths if ours else {})
        try:
            done = subprocess.run(words, capture_output=True, text=True, timeout=LONGEST_RUN, env=environment)
        except subprocess.TimeoutExpired:
            print(f"{library:12} takes more than {LONGEST_RUN} s")
            continue
        failed = (done.stderr.strip().splitlines() or ["failed"])[-1]
        print(done.stdout.strip() if done.returncode == 0 else f"{library:12} {failed[:90]}", flush=True)


if __name__ == "__main__":
    main()
