"""Contrast by frequency of one light field and of scans at equal photons: `python -m benchmarks.scanned`.

Charts of slanted lines are simulated on samples of 4.3 µm to 1e-3; operators have samples of 8.3 µm and 1e-2.
"""

import time
from collections.abc import Sequence

import numpy as np

import lumigraph as lg
from lumigraph.deconvolution import RichardsonLucy, Stop
from lumigraph.units import mm, nm, um

CAMERA = lg.PlenopticCamera(
    wavelength=550 * nm,
    object_distance=200 * mm,
    main_lens={"focal_length": 100 * mm},
    lenslets={"pitch": 100 * um, "focal_length": 2.5 * mm, "count": (7, 9)},
    sensor={"pixel_pitch": 10 * um, "full_well": 1e5, "bits": 16, "read_noise": 2},
)
SIZE = 100 * um  # of a lenslet in the object: the main lens images 1:1
CHART = lg.Grid((220, 260), (4.3 * um, 4.3 * um))
FREQUENCIES = (0.25, 0.4, 0.5, 0.6, 0.75, 0.9, 1.1, 1.3)
PHOTONS = 4500.0
SAMPLES = 12
SLANT = 0.17


def lines(grid: lg.Grid, frequency: float) -> tuple[np.ndarray, np.ndarray]:
    """Phase and intensity of lines of so many periods to a lenslet, slanted so that all places occur."""
    phase = 2 * np.pi * frequency / SIZE * (grid.x + SLANT * grid.y[:, None])
    return phase, (0.5 + 0.5 * np.cos(phase)).astype(np.float32)


def contrast(found: np.ndarray, grid: lg.Grid, frequency: float) -> float:
    """Of the lines themselves in the middle: what has another phase or frequency does not count."""
    phase, _ = lines(grid, frequency)
    inner = (np.abs(grid.y)[:, None] < 2 * SIZE) & (np.abs(grid.x) < 3 * SIZE)
    waves = np.stack([np.ones_like(phase), np.cos(phase), np.sin(phase)])[:, inner]
    level, amplitude, _ = np.linalg.lstsq(waves.T, np.asarray(found)[inner], rcond=None)[0]
    return float(amplitude / level)


def seen(frequency: float, shifts: np.ndarray, rng: np.random.Generator) -> list[lg.RawImage]:
    """Raw images of lines that were moved by shifts (k, 2) [m], of `PHOTONS` in all."""
    picture, raws = lines(CHART, frequency)[1], []
    for shift in shifts:
        there = lg.Grid(CHART.shape, CHART.pitch, (float(shift[0]), float(shift[1])))
        light = np.maximum(lg.simulate(CAMERA, lg.Scene([lg.Slice(picture, there)])).data, 0)
        raws.append(CAMERA.sensor.expose(light, photons=PHOTONS / len(shifts), rng=rng))
    return raws


def contrasts(steps: int, frequencies: Sequence[float], iterations: int, seed: int = 0) -> list[float]:
    """Of each frequency, found from a scan of steps × steps raw images."""
    shifts, rng = lg.scan(steps, SIZE), np.random.default_rng(seed)
    operator = lg.joint_operator(CAMERA, None, SAMPLES, shifts=shifts, accuracy=1e-2)
    method, found = RichardsonLucy(accelerated=True), []
    for frequency in frequencies:
        raws = seen(frequency, shifts, rng)
        picture = lg.deconvolve(raws, operator, Stop(iterations, deviance=1), method=method)
        assert operator.object_grid is not None
        found.append(contrast(picture.data, operator.object_grid, frequency))
    return found


def show() -> None:
    """Print a table."""
    print("periods to a lenslet  " + "".join(f"{f:7.2f}" for f in FREQUENCIES))
    for steps in (1, 2, 3):
        began = time.process_time()
        found = contrasts(steps, FREQUENCIES, 40)
        told = "".join(f"{c:7.2f}" for c in found)
        print(f"{steps} x {steps} raw images      {told}   {time.process_time() - began:.0f} CPU s")


if __name__ == "__main__":
    show()
