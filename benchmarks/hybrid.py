"""A plain picture beside a light field, at equal photons: `python -m benchmarks.hybrid`.

A near plane, in focus, carries fine slanted lines; a far one is lit by smooth spots. Each camera alone lacks
something: the light field has one sample for each lenslet in its focused plane, the plain picture does not
tell the planes apart. Charts are simulated on samples of 4.3 µm to 1e-3; operators have their own and 1e-2.
"""

import time
from collections.abc import Sequence

import numpy as np
from scipy.ndimage import gaussian_filter, map_coordinates

import lumigraph as lg
from benchmarks.scanned import CAMERA, CHART, SIZE, lines
from lumigraph.deconvolution import RichardsonLucy
from lumigraph.units import mm, um

PLAIN = lg.SingleLensCamera(
    wavelength=CAMERA.wavelength,
    object_distance=CAMERA.object_distance,
    main_lens={"focal_length": 100 * mm, "diameter": 8 * mm},
    sensor={"pixel_pitch": 10 * um, "shape": (71, 93), "full_well": 1e5, "bits": 16, "read_noise": 2},
)
CAMERAS = {"light field": (CAMERA,), "plain picture": (PLAIN,), "both": (CAMERA, PLAIN)}
DEPTHS = (0.0, 10 * mm)
FREQUENCIES = (0.25, 0.5, 0.75, 1.0, 1.5, 2.0)
PHOTONS = 4500.0
SAMPLES = 12
ITERATIONS = 60
WHAT = ("amplitude of lines", "likeness of spots")


def spots(rng: np.random.Generator) -> np.ndarray:
    """Smooth light (y, x) on `CHART`, 0 to 1, with spots as large as two lenslets."""
    found = gaussian_filter(rng.random(CHART.shape), SIZE / CHART.pitch[0])
    return ((found - found.min()) / np.ptp(found)).astype(np.float32)


def seen(
    cameras: Sequence[lg.PlenopticCamera | lg.SingleLensCamera],
    planes: Sequence[np.ndarray],
    rng: np.random.Generator,
) -> list[lg.RawImage]:
    """A raw image by each camera, of `PHOTONS` in all."""
    scene = lg.Scene([lg.Slice(plane, CHART, dz) for plane, dz in zip(planes, DEPTHS, strict=True)])
    raws = []
    for camera in cameras:
        light = np.maximum(lg.simulate(camera, scene).data, 0)
        raws.append(camera.sensor.expose(light, photons=PHOTONS / len(cameras), rng=rng))
    return raws


def middle(grid: lg.Grid) -> np.ndarray:
    """Samples (y, x) far from the border."""
    return (np.abs(grid.y)[:, None] < 2 * SIZE) & (np.abs(grid.x) < 3 * SIZE)


def there(true: np.ndarray, grid: lg.Grid) -> np.ndarray:
    """What of `CHART` stands on the middle of a grid."""
    axes = [(v - c[0]) / p for v, c, p in zip((grid.y, grid.x), (CHART.y, CHART.x), CHART.pitch, strict=True)]
    return map_coordinates(true, np.meshgrid(*axes, indexing="ij"), order=1)[middle(grid)]


def judged(volume: np.ndarray, grid: lg.Grid, true: Sequence[np.ndarray], frequency: float) -> list[float]:
    """Amplitude of the lines over the true one, and correlation of the spots with the true ones.

    How much even light is in which plane is left out: it looks the same from every depth.
    """
    near, far = (np.asarray(plane)[middle(grid)] for plane in volume)
    truths = [there(plane, grid) for plane in true]
    scale = sum(plane.mean() for plane in truths) / (near.mean() + far.mean())  # in whatever it was counted
    phase = lines(grid, frequency)[0][middle(grid)]
    waves = np.stack([np.ones_like(phase), np.cos(phase), np.sin(phase)])
    _, amplitude, _ = np.linalg.lstsq(waves.T, near * scale, rcond=None)[0]
    return [float(amplitude) / 0.5, float(np.corrcoef(far, truths[1])[0, 1])]


def show() -> None:
    """Print a table for each of the cameras."""
    print(f"{'periods to a lenslet':34s}" + "".join(f"{f:7.2f}" for f in FREQUENCIES))
    for name, cameras in CAMERAS.items():
        began, rng, found = time.process_time(), np.random.default_rng(0), []
        operator = lg.joint_operator(cameras, DEPTHS, SAMPLES, accuracy=1e-2)
        assert operator.object_grid is not None
        for frequency in FREQUENCIES:
            true = lines(CHART, frequency)[1], spots(rng)
            raws, method = seen(cameras, true, rng), RichardsonLucy(accelerated=True)
            volume = lg.deconvolve(raws, operator, ITERATIONS, method=method).data
            found.append(judged(volume, operator.object_grid, true, frequency))
        for what, values in zip(WHAT, np.transpose(found), strict=True):
            print(f"{name:14s}{what:20s}" + "".join(f"{c:7.2f}" for c in values), flush=True)
        print(f"{name}: {time.process_time() - began:.0f} CPU s")


if __name__ == "__main__":
    show()
