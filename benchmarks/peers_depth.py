"""Disparity of the HCI scene *antinous*: lumigraph beside plenpy, both in CPU seconds of one thread.

9 x 9 views of 512² in colour, and the true disparity of the middle view; the whole picture counts. plenpy
(GPL) is run as a black box, in a virtual environment of its own in build/, made by
`python -m venv` and pip; where that cannot be had, or the scene is not there (LUMIGRAPH_DATA), its rows are
left out.

    python -m benchmarks.peers_depth
"""

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

import lumigraph as lg

DATA = Path(os.environ.get("LUMIGRAPH_DATA") or Path(__file__).parents[2] / "shared" / "data")
SCENE = DATA / "hci_antinous"
HOME = Path(__file__).parents[1] / "build" / "peers-plenpy"
PEER = """
import sys, time, warnings
warnings.simplefilter("ignore")
import numpy as np
from plenpy.lightfields import LightField
views = LightField(np.load(sys.argv[1]))
start = time.process_time()
found, _ = views.get_disparity("structure_tensor", fusion_method=sys.argv[3], vmin=-3.5, vmax=3.5)
print("seconds", time.process_time() - start)
np.save(sys.argv[2], found)
"""
ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")


def peer() -> Path | None:
    """Python of an environment with plenpy; None where it cannot be made."""
    python = HOME / "bin" / "python"
    try:
        if not python.exists():
            subprocess.run([sys.executable, "-m", "venv", str(HOME)], check=True, timeout=300)
        if subprocess.run([str(python), "-c", "import plenpy"], capture_output=True, timeout=120).returncode:
            words = [str(python), "-m", "pip", "install", "-q", "plenpy==0.9.2", "scipy<1.14"]
            subprocess.run(words, check=True, timeout=900, capture_output=True)
    except (OSError, subprocess.SubprocessError):
        return None
    return python


def told(method: str, seconds: float, found: np.ndarray, truth: np.ndarray) -> dict[str, Any]:
    error = np.abs(found - truth)
    return {
        "method": method,
        "CPU s": round(seconds, 1),
        "median px": round(float(np.median(error)), 4),
        "mean px": round(float(error.mean()), 4),
        "off by > 0.07 px": f"{100 * (error > 0.07).mean():.1f} %",
    }


def run() -> list[dict[str, Any]]:
    """Rows of the table; none without the scene."""
    if not SCENE.is_dir():
        return []
    views, truth = lg.open(SCENE), lg.open(SCENE / "gt_disp_lowres.pfm").data
    start = time.process_time()
    found = lg.depth.epi(views)
    rows = [told("lumigraph epi", time.process_time() - start, found.values, truth)]
    if (python := peer()) is None:
        return rows
    with tempfile.TemporaryDirectory() as folder:
        given, got = Path(folder) / "views.npy", Path(folder) / "found.npy"
        # Their first two axes are cameras from the top left, as in the files: ours are turned.
        np.save(given, np.asarray(views.data)[::-1, ::-1].astype(np.float32) / 255)
        for fusion in ("weighted_average", "tv_l1"):
            words = [str(python), "-c", PEER, str(given), str(got), fusion]
            try:
                out = subprocess.run(
                    words,
                    capture_output=True,
                    text=True,
                    timeout=900,
                    check=True,
                    env=os.environ | ONE_THREAD,
                ).stdout
            except (OSError, subprocess.SubprocessError):
                continue
            theirs = np.load(got).squeeze()
            sign = min((1, -1), key=lambda s: float(np.median(np.abs(s * theirs - truth))))
            seconds = float(out.split("seconds")[1].split()[0])
            rows.append(told(f"plenpy structure tensor, {fusion}", seconds, sign * theirs, truth))
    return rows


def show(rows: Sequence[dict[str, Any]]) -> None:
    """Print rows as a table."""
    from rich.console import Console
    from rich.table import Table

    if not rows:
        print("skipped: the scene is not there. Set LUMIGRAPH_DATA to a folder that holds hci_antinous.")
        return
    table = Table(*rows[0])
    for row in rows:
        table.add_row(*(str(value) for value in row.values()))
    Console().print(table)


if __name__ == "__main__":
    show(run())
