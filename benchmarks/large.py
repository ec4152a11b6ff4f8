"""A picture of 100 megapixels by the command line: processor time and memory of each verb.

White, dark and raw image are drawn: a lattice turned by 0.229 deg, vignetting, noise; two textured planes
side by side, the left one farther than the focused plane, the right one nearer. Pictures are refocused on 20
planes.

    python -m benchmarks.large [--size 10000] [--pitch 15.3] [--layout square] [--bayer]
"""

import argparse
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

import lumigraph as lg
from benchmarks.calibration import Case

PLANES = 20
MOVES = -0.06, 0.06  # by how many lenslets a plane moves for each px of a micro-image, left and right
_BLOCK, _OFFSET = 250, 1500


def drawn(case: Case, folder: Path, bayer: str | None) -> None:
    """Writes white.tiff, dark.tiff and raw.tiff (Zarr if of a colour mosaic) into a folder."""
    white, lattice = case.drawn(), case.lattice
    raw, x = np.empty_like(white), np.arange(case.size, dtype=float)[None]
    for first in range(0, case.size, _BLOCK):
        rows = slice(first, min(first + _BLOCK, case.size))
        y = np.arange(rows.start, rows.stop, dtype=float)[:, None]
        dy, dx = lattice.offset(y, x)
        move = np.where(x - dx < case.size / 2, *MOVES) * case.pitch
        light = texture((y - dy + move * dy) / case.pitch, (x - dx + move * dx) / case.pitch)
        raw[rows] = np.clip((white[rows] - float(_OFFSET)) * light + _OFFSET, 0, 65535)
    dark = (_OFFSET + np.random.default_rng(0).integers(-30, 30, white.shape, np.int16)).astype(np.uint16)
    for name, data in (("white", white), ("dark", dark), ("raw", raw)):
        lg.save(lg.RawImage(data, bayer=bayer), folder / f"{name}.{'zarr' if bayer else 'tiff'}")


def texture(y: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Light (y, x) at places in lenslets, 0.1 to 0.9."""
    return 0.5 + 0.2 * np.sin(1.1 * y + np.sin(x / 9)) + 0.2 * np.sin(1.3 * x + np.sin(y / 7) + y / 3)


def run(words: list[str], folder: Path) -> tuple[float, float]:
    """CPU seconds and GB of a command of lumigraph."""
    child = subprocess.Popen(
        [sys.executable, "-m", "lumigraph", *words], cwd=folder, stdout=subprocess.DEVNULL
    )
    _, status, used = os.wait4(child.pid, 0)
    child.returncode = os.waitstatus_to_exitcode(status)
    if child.returncode:
        raise SystemExit(f"{words[0]} failed")
    return used.ru_utime + used.ru_stime, used.ru_maxrss * 1024 / 1e9


def sharpest(folder: Path) -> tuple[int, int]:
    """Numbers of the planes of the stack on which its left and its right half are sharpest."""
    stack = np.asarray(lg.open(folder / "stack.tiff").data)
    slopes = np.abs(np.diff(stack.reshape(*stack.shape[:3], -1).mean(-1), axis=2))
    third = slopes.shape[2] // 3
    return int(slopes[..., :third].mean((1, 2)).argmax()), int(slopes[..., -third:].mean((1, 2)).argmax())


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--size", type=int, default=10000)
    parser.add_argument("--pitch", type=float, default=15.3)
    parser.add_argument("--layout", choices=("square", "hex"), default="square")
    parser.add_argument("--bayer", action="store_true")
    given = parser.parse_args()
    case = Case(0, given.size, given.pitch, given.layout, 0.229, False, 0.95, 0.01, 0.0, 0, 0.3)
    with tempfile.TemporaryDirectory() as name:
        folder, ending = Path(name), "zarr" if given.bayer else "tiff"
        drawn(case, folder, "RGGB" if given.bayer else None)
        raw, white, dark = (f"{name}.{ending}" for name in ("raw", "white", "dark"))
        known = ["--calibration", "white.toml", "--white", white, "--dark", dark]
        for words in (
            ["calibrate", white, "-o", "white.toml"],
            ["decode", raw, *known, "-o", "views.zarr"],
            ["refocus", "views.zarr", "--alphas", f"0.94:1.06:{PLANES}", "-o", "stack.tiff"],
        ):
            cpu, memory = run(words, folder)
            print(f"{words[0]:10} {cpu:5.0f} CPU s, {memory:.1f} GB", flush=True)
        print("sharpest: plane {} on the left, {} on the right".format(*sharpest(folder)))


if __name__ == "__main__":
    main()
