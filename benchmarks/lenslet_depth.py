"""What depth of plenoptic 2.0 pictures costs: `lg.depth.correlation`, then `lg.depth.dense`, CPU seconds.

A drawn picture: hexagonal lattice of three kinds, turned by 3 mrad, micro-images of 34.9 px, a bent textured
surface of patches of 4 to 11 px, noise of 2 %.

    python -m benchmarks.lenslet_depth --height 3068 --width 4080
"""

import argparse
import time

import numpy as np

import lumigraph as lg
from lumigraph.core.calibration import Calibration
from lumigraph.core.lattice import Lattice

PITCH = 34.86
_WAVES, _LONGEST = 8, 0.35  # of the texture; [rad/px] on the plane of the lattice


def picture(shape: tuple[int, int], seed: int = 1) -> tuple[np.ndarray, Calibration]:
    """A raw image (y, x) and its calibration."""
    lattice = Lattice.hex(PITCH, 0.003, (PITCH / 2, PITCH / 2), kinds=3)
    rng = np.random.default_rng(seed)
    y, x = np.meshgrid(*(np.arange(n, dtype=float) for n in shape), indexing="ij", sparse=True)
    i, j = lattice.index(y, x)
    center = lattice.position(np.stack([i, j], -1))
    share = center[..., 0] / shape[0], center[..., 1] / shape[1]
    patch = PITCH * (0.18 + 0.12 * share[1] + 0.05 * np.sin(6 * share[0]))
    place = [
        middle - (a - middle) * PITCH / patch for a, middle in ((y, center[..., 0]), (x, center[..., 1]))
    ]
    waves = np.concatenate([rng.uniform(-_LONGEST, _LONGEST, (2, _WAVES)), rng.uniform(0, 6.28, (1, _WAVES))])
    paint = sum((np.cos(a * place[0] + b * place[1] + c) for a, b, c in waves.T), np.zeros(shape))
    sharp = np.array([1, 0.5, 0.2])[lattice.kind(i, j)]
    raw = 1 + 0.9 * sharp * paint / np.sqrt(_WAVES) + 0.02 * rng.standard_normal(shape)
    return raw.astype(np.float32), Calibration(lattice, shape, np.zeros((0, 2), int), np.zeros((0, 2)), 0.0)


def show(shape: tuple[int, int]) -> None:
    """Measure both, one after the other."""
    raw, calibration = picture(shape)
    start = time.process_time()
    lenslets = lg.depth.correlation(raw, calibration)
    middle = time.process_time()
    found = lg.depth.dense(raw, calibration, lenslets)
    end = time.process_time()
    print(f"{shape[0]} x {shape[1]} px, {lenslets.shape} lenslets, {found.shape} samples")
    print(f"correlation {middle - start:.1f} CPU s, dense {end - middle:.1f} CPU s")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--height", type=int, default=3068)
    parser.add_argument("--width", type=int, default=4080)
    asked = parser.parse_args()
    show((asked.height, asked.width))
