"""A real raw image of a mouse brain, deconvolved: its frame, beside the inside, and another program's stack.

The sample is of napari-LF, without a white image: the lattice is found on the raw image. The frame, the
outermost lenslet on all sides, takes the light that comes from beside the picture; it should be no brighter
than the inside. The other stack (LUMIGRAPH_DATA/lfm_mouse_brain) has the same planes in the opposite order
(its z points the other way: in its own order planes out of focus are not alike), and three samples for each
lenslet, too; it is moved to where the two stacks are most alike.

    python -m benchmarks.volumes [--planes 63] [--iterations 15]
"""

import argparse
import os
import tempfile
import time
from pathlib import Path

import numpy as np

import lumigraph as lg
from lumigraph.cli import main as lumigraph

DATA = Path(os.environ.get("LUMIGRAPH_DATA") or Path(__file__).parents[2] / "shared" / "data")
FOLDER = DATA / "lfm_mouse_brain"
PLANES, STEP, SAMPLES = 63, 0.9, 3  # of the other stack: how many, um, and samples along a lenslet
CAMERA = """kind = "light-field-microscope"
wavelength = "593 nm"
[objective]
magnification = 40.0
numerical_aperture = 0.9
immersion_index = 1.0
tube_lens = "165 mm"
[lenslets]
pitch = "112 um"
focal_length = "2.5 mm"
count = [39, 39]
[sensor]
pixel_pitch = "3.39 um"
shape = [1287, 1287]
"""


def volume(numbers: np.ndarray, iterations: int, folder: Path) -> np.ndarray:
    """Planes (z, y, x) of the other stack's numbers, by the command line."""
    (folder / "brain.toml").write_text(CAMERA)
    raw, lattice, found = FOLDER / "LF_img_train_0.tif", folder / "lattice.toml", folder / "volume.h5"
    depths = ",".join(f"{STEP * (k - PLANES // 2):g} um" for k in numbers)
    for words in (
        ["calibrate", str(raw), "-o", str(lattice)],
        ["deconvolve", str(raw), "--camera", str(folder / "brain.toml"), "--calibration", str(lattice),
         f"--z={depths}", "--samples", str(SAMPLES), "--iterations", str(iterations), "-o", str(found)],
    ):  # fmt: skip
        if lumigraph(words):
            raise SystemExit(f"{words[0]} failed")
    return np.asarray(lg.open(found).data)


def frame(plane: np.ndarray) -> float:
    """Mean of the outermost lenslets over that of the others."""
    inside = plane[SAMPLES:-SAMPLES, SAMPLES:-SAMPLES]
    around = (plane.sum() - inside.sum()) / (plane.size - inside.size)
    return float(around / inside.mean())


def shift(ours: np.ndarray, other: np.ndarray) -> tuple[int, int]:
    """First row and column of ours where the other stack's begin, by the sums of both stacks."""
    a, b = ours.sum(0), other.sum(0)
    places = [
        (y, x) for y in range(0, a.shape[0] - b.shape[0] + 1) for x in range(a.shape[1] - b.shape[1] + 1)
    ]
    return max(places, key=lambda at: alike(a[at[0] :, at[1] :][: b.shape[0], : b.shape[1]], b))


def alike(one: np.ndarray, other: np.ndarray) -> float:
    """Correlation of two planes, without their outermost lenslets."""
    inside = (slice(SAMPLES, -SAMPLES),) * 2
    return float(np.corrcoef(one[inside].ravel(), other[inside].ravel())[0, 1])


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--planes", type=int, default=PLANES)
    parser.add_argument("--iterations", type=int, default=15)
    given = parser.parse_args()
    numbers = np.unique(np.linspace(0, PLANES - 1, given.planes).round().astype(int))
    start = time.process_time()
    with tempfile.TemporaryDirectory() as folder:
        ours = volume(numbers, given.iterations, Path(folder))
    cpu = time.process_time() - start
    other = np.asarray(lg.open(FOLDER / "deconv_train_0_15it.tif").data)[::-1]
    unturned, other = other[::-1][numbers], other[numbers]
    frames = [frame(plane) for plane in ours]
    print(f"{len(numbers)} planes {ours.shape}, {given.iterations} iterations, {cpu:.0f} CPU s")
    print(f"frame over inside {min(frames):.2f} to {max(frames):.2f}")
    for order, stack in (("opposite", other), ("its own", unturned)):
        y, x = shift(ours, stack)
        cut = ours[:, y : y + stack.shape[1], x : x + stack.shape[2]]
        same = [alike(*pair) for pair in zip(cut, stack, strict=True)]
        print(f"the other's in {order} order, at ({y}, {x}): correlation {min(same):.2f} to {max(same):.2f}, "
              f"median {np.median(same):.2f}")  # fmt: skip


if __name__ == "__main__":
    main()
