"""Time, commands and sharpness of the first picture that `lumigraph process` makes of real raw images.

`python -m benchmarks.first_picture [letters raytrix vesicle]` needs the real data (LUMIGRAPH_DATA). For each
raw image: the command and the words that a newcomer types until the folder is complete, CPU seconds of the
first run and of a second one, which keeps what stands, the files that are missing, and the sharpness of
all-in-focus.png beside that of a picture by hand (refocus or render with options chosen by eye, deconvolve).
Then the wall time until the viewer has sent its page for `lumigraph FILE`. Uses the `lumigraph` of this
Python: in an environment of the wheel it measures that. Takes three minutes.
"""

import os
import re
import resource
import subprocess
import sys
import tempfile
import time
import urllib.request
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import lumigraph as lg

DATA = Path(os.environ.get("LUMIGRAPH_DATA") or Path(__file__).parents[2] / "shared" / "data")
FILES = (
    "all-in-focus.png",
    "depth.png",
    "depth.tiff",
    "refocus.gif",
    "page.html",
    "calibration.toml",
    "notes.md",
)
COMMAND = (sys.executable, "-c", "import sys; from lumigraph.cli import main; sys.exit(main())")


@dataclass(frozen=True)
class Case:
    """A raw image, what is given beside it, how it is done by hand, and its limit [CPU s]."""

    raw: str
    given: tuple[str, ...]
    by_hand: tuple[str, ...]
    limit: float


CASES = {
    "letters": Case(
        "letters_plenoptic1/letters_ULF_M1.png",
        (
            "--white", "letters_plenoptic1/letters_ULF_M1_white.png",
            "--dark", "letters_plenoptic1/letters_ULF_M1_dark.png",
        ),
        ("refocus", "RAW", "GIVEN", "--alpha", "0.96", "--oversample", "8", "-o", "OUT.png"),
        30.0,
    ),
    "raytrix": Case(
        "raytrix_r42_multifocus/sc2_klein.png", (),
        (
            "render", "RAW", "--calibration", "raytrix_r42_multifocus/sc2_klein.xml", "--depth", "auto",
            "-o", "OUT.png",
        ),
        30.0,
    ),
    "vesicle": Case(
        "lfm_guv/Lightfield_GUVExperim1.tif",
        (
            "--white", "lfm_guv/Radiometry_GUVExperim1.tif", "--dark", "lfm_guv/DarkFrame_GUVExperim1.tif",
            "--camera", "lfm-guv",
        ),
        ("deconvolve", "RAW", "GIVEN", "--depth", "-1 um,0 um,1 um", "--iterations", "10", "-o", "OUT.tiff"),
        90.0,
    ),
}  # fmt: skip


def run(words: tuple[str, ...], folder: Path) -> float:
    """CPU seconds of a command."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([*COMMAND, *words], cwd=folder, check=True, stdout=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def real(words: tuple[str, ...]) -> tuple[str, ...]:
    """Words with the paths of the real data."""
    return tuple(str(DATA / word) if "/" in word else word for word in words)


def sharpness(picture: np.ndarray) -> float:
    """Steepest edges of a picture: the 99th percentile of its slope [1/px], over its range.

    The range is that between the 1st and the 99th percentile, so that brightness does not count.
    """
    grey = np.asarray(picture, float)
    grey = grey.mean(-1) if grey.ndim == 3 else grey
    low, high = np.quantile(grey, (0.01, 0.99))
    slope = np.hypot(*np.gradient(np.clip((grey - low) / (high - low), 0, 1)))
    return float(np.quantile(slope, 0.99))


def picture_of(path: Path) -> np.ndarray:
    """Picture of a file; of a volume the brightest samples along z."""
    found = lg.open(path)
    data = np.asarray(found.data)
    return data.max(0) if isinstance(found, lg.Volume) else data


def served(path: Path) -> float:
    """Seconds of wall time until `lumigraph FILE` has sent its page."""
    began = time.monotonic()
    with subprocess.Popen([*COMMAND, str(path), "--no-open"], stdout=subprocess.PIPE, text=True) as server:
        try:
            assert server.stdout is not None
            address = next(line for line in server.stdout if line.startswith("http")).strip()
            page = urllib.request.urlopen(address, timeout=60).read()
        finally:
            server.terminate()
    if b"lumigraph" not in page:
        raise RuntimeError(f"the page at {re.sub('token=.*', '', address)} is not lumigraph's")
    return time.monotonic() - began


def measured(name: str, folder: Path) -> dict[str, object]:
    """What a newcomer meets."""
    case = CASES[name]
    raw, given, out = str(DATA / case.raw), real(case.given), folder / name
    words = ("process", raw, *given, "-o", str(out))
    first, second = run(words, folder), run(words, folder)
    hand = folder / f"{name}-by-hand{'.tiff' if name == 'vesicle' else '.png'}"
    known = {"RAW": (raw,), "GIVEN": given, "OUT.png": (str(hand),), "OUT.tiff": (str(hand),)}
    run(tuple(w for word in case.by_hand for w in known.get(word, real((word,)))), folder)
    ours, best = (sharpness(picture_of(path)) for path in (out / "all-in-focus.png", hand))
    shown = out / ("volume.ome.tif" if name == "vesicle" else "all-in-focus.png")
    return {
        "raw image": name, "commands": 1, "words": 1 + len(words), "CPU s": first, "limit": case.limit,
        "again": second, "missing": [file for file in FILES if not (out / file).is_file()],
        "sharpness": ours, "by hand": best, "viewer s": served(shown),
    }  # fmt: skip


def main() -> None:
    """Print a row for each raw image; exit code 1 where a limit is missed."""
    names, failed = sys.argv[1:] or list(CASES), False
    with tempfile.TemporaryDirectory() as folder:
        for name in names:
            row = measured(name, Path(folder))
            failed |= row["CPU s"] > row["limit"] or bool(row["missing"])  # type: ignore[operator]
            shown = (f"{what} {v:.3g}" if isinstance(v, float) else f"{what} {v}" for what, v in row.items())
            print(", ".join(shown), flush=True)
    sys.exit(failed)


if __name__ == "__main__":
    main()
