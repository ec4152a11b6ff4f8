"""Twenty refocused planes of the HCI scene *antinous*: lumigraph beside PlenoptiCam, in CPU seconds.

9 x 9 views of 512² in colour, one thread. lumigraph shifts each view by fractions of a pixel, PlenoptiCam by
whole ones, which is less work. PlenoptiCam (GPL) is run as a black box, in a virtual environment of its own
in build/, made by `python -m venv` and pip; where that cannot be had, or the scene is not there
(LUMIGRAPH_DATA), its row is left out.

    python -m benchmarks.peers_refocus
"""

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

import lumigraph as lg

DATA = Path(os.environ.get("LUMIGRAPH_DATA") or Path(__file__).parents[2] / "shared" / "data")
SCENE = DATA / "hci_antinous"
HOME = Path(__file__).parents[1] / "build" / "peers-plenopticam"
PLANES = 20
PEER = """
import sys, time, warnings
warnings.simplefilter("ignore")
import numpy as np
from plenopticam.cfg import PlenopticamConfig
from plenopticam.lfp_refocuser.lfp_shiftandsum import LfpShiftAndSum
views, planes = np.load(sys.argv[1]), int(sys.argv[2])
cfg = PlenopticamConfig()
cfg.default_values()
cfg.params[cfg.ran_refo] = [-planes // 2, planes // 2]
cfg.params[cfg.ptc_leng] = len(views)
cfg.params[cfg.opt_refi] = False
cfg.params[cfg.opt_prnt] = False
tool = LfpShiftAndSum(vp_img_arr=views, cfg=cfg)
start = time.process_time()
tool.refo_from_vp()
print("seconds", time.process_time() - start, "planes", len(tool._refo_stack))
"""
ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
NEEDED = (
    "numpy<2", "scipy<1.14", "imageio", "pillow", "requests", "docutils", "color-matcher",
    "color-space-converter", "scikit-image", "typing_extensions",
)  # fmt: skip
ALONE = ("plenopticam==0.9.3", "colour-science==0.4.4", "colour-demosaicing==0.2.5", "depthy", "ddt")
"""Without what they ask for, which cannot be had together."""


def peer() -> Path | None:
    """Python of an environment with PlenoptiCam; None where it cannot be made."""
    python = HOME / "bin" / "python"
    imports = "import plenopticam.lfp_refocuser.lfp_shiftandsum"
    try:
        if not python.exists():
            subprocess.run([sys.executable, "-m", "venv", str(HOME)], check=True, timeout=300)
        if subprocess.run([str(python), "-c", imports], capture_output=True, timeout=120).returncode:
            pip = [str(python), "-m", "pip", "install", "-q"]
            for words in (
                [*NEEDED],
                ["--no-deps", *ALONE],
            ):
                subprocess.run([*pip, *words], check=True, timeout=900, capture_output=True)
    except (OSError, subprocess.SubprocessError):
        return None
    return python


def run() -> list[dict[str, Any]]:
    """Rows of the table; none without the scene."""
    if not SCENE.is_dir():
        return []
    views: Any = lg.open(SCENE)
    start = time.process_time()
    planes = lg.refocus_stack(views, np.linspace(0.9, 1.1, PLANES), oversample=1)
    rows = [_row("lumigraph, cubic shifts", time.process_time() - start, len(planes))]
    if (python := peer()) is None:
        return rows
    with tempfile.TemporaryDirectory() as folder:
        given = Path(folder) / "views.npy"
        np.save(given, np.asarray(views.data).astype(float))
        done = subprocess.run(
            [str(python), "-c", PEER, str(given), str(PLANES)],
            capture_output=True, text=True, env={**os.environ, **ONE_THREAD}, cwd=folder, timeout=900,
        )  # fmt: skip
    words = done.stdout.split()
    if done.returncode or "seconds" not in words:
        return rows
    at = words.index("seconds")
    return [*rows, _row("PlenoptiCam, whole pixels", float(words[at + 1]), int(words[at + 3]))]


def _row(method: str, seconds: float, planes: int) -> dict[str, Any]:
    return {"method": method, "planes": planes, "CPU s": round(seconds, 2)}


if __name__ == "__main__":
    for row in run():
        print("  ".join(f"{key}: {value}" for key, value in row.items()))
