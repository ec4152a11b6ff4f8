"""Depth of rendered scenes: errors, what confidence says about them, and CPU seconds.

*antinous* has 9 x 9 views of 512² in colour and its true disparity. *cotton* and *kitchen* have stars of 33
views (a row, a column, two diagonals), and as reference the estimate of a learned method: of *cotton* within
1 % of the truth; of *kitchen* by an older one, all but a border of 11 px. Each is also measured on the 9
views at the ends and the middle of the star. Scenes that are not there (LUMIGRAPH_DATA) are left out.

    python -m benchmarks.depth [scene ...]
"""

import os
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

import lumigraph as lg

DATA = Path(os.environ.get("LUMIGRAPH_DATA") or Path(__file__).parents[2] / "shared" / "data")
BAD = 0.07  # px: the benchmark's usual limit


def antinous() -> tuple[lg.LightField, np.ndarray]:
    """Light field and true disparity (y, x)."""
    folder = DATA / "hci_antinous"
    return lg.open(folder), lg.open(folder / "gt_disp_lowres.pfm").data


def star(name: str, count: int = 33) -> tuple[lg.LightField, np.ndarray]:
    """Light field of 33 or 9 views of a star, black where there is none, and a learned estimate (y, x)."""
    folder = DATA / "hci_star" / name
    data = np.zeros((9, 9, 512, 512, 3), np.uint8)
    for path in sorted(folder.glob("*_Cam*.png")):
        v, u = divmod(int(path.stem[-3:]), 9)
        if count == 33 or (v % 4 == 0 and u % 4 == 0):
            data[8 - v, 8 - u] = np.asarray(Image.open(path))  # the files count cameras from the top left
    grids = lg.Grid((9, 9), 1.0), lg.Grid((512, 512), 1.0)
    return lg.LightField(data, *grids, 10.0), _reference(next(folder.glob("*.pfm")))


def _reference(path: Path) -> np.ndarray:
    """Estimate (512, 512), NaN on the border that it leaves out."""
    known = lg.open(path).data
    border = (512 - len(known)) // 2
    return np.pad(known, border, constant_values=np.nan)


SCENES: dict[str, Callable[[], tuple[lg.LightField, np.ndarray]]] = {
    "antinous": antinous,
    "cotton, 33 views": lambda: star("cotton"),
    "cotton, 9 views": lambda: star("cotton", 9),
    "kitchen, 33 views": lambda: star("kitchen"),
    "kitchen, 9 views": lambda: star("kitchen", 9),
    "rosemary, 33 views": lambda: star("rosemary"),
    "rosemary, 9 views": lambda: star("rosemary", 9),
}


def measured(name: str, views: lg.LightField, truth: np.ndarray) -> dict[str, Any]:
    """A row of the table."""
    start = time.process_time()
    found = lg.depth.epi(views)
    seconds = time.process_time() - start
    known = np.isfinite(truth)
    error, trust = np.abs(found.values - truth)[known], np.asarray(found.confidence)[known]
    surer = error[np.argsort(-trust, kind="stable")[: error.size // 2]]
    return {
        "scene": name,
        "CPU s": f"{seconds:.1f}",
        "off by > 0.07 px": f"{100 * (error > BAD).mean():.1f} %",
        "mean px": f"{error.mean():.3f}",
        "median px": f"{np.median(error):.4f}",
        "corr. of confidence and error": f"{np.corrcoef(trust, error)[0, 1]:.2f}",
        "surer half off by > 0.07 px": f"{100 * (surer > BAD).mean():.1f} %",
        "its mean px": f"{surer.mean():.3f}",
    }


def run(names: Sequence[str] = ()) -> list[dict[str, Any]]:
    """Rows of the table, of the scenes whose names begin with one of these; none without data."""
    return [measured(name, *SCENES[name]()) for name in there() if name.startswith(tuple(names) or "")]


def there() -> list[str]:
    """Names of the scenes whose data are there."""
    folders = {"antinous": "hci_antinous"}
    return [n for n in SCENES if (DATA / folders.get(n, f"hci_star/{n.split(',')[0]}")).is_dir()]


def show(rows: Sequence[dict[str, Any]]) -> None:
    """Print rows as a table."""
    from rich.console import Console
    from rich.table import Table

    if not rows:
        print("skipped: no scene is there. Set LUMIGRAPH_DATA to a folder that holds hci_antinous.")
        return
    table = Table(*rows[0])
    for row in rows:
        table.add_row(*row.values())
    Console(width=130).print(table)


if __name__ == "__main__":
    show(run(sys.argv[1:]))
