"""Aberrations of a camera from a raw image of a flat scene: residual, pulls, time over plain deconvolution's.

python -m benchmarks.adaptive_picture [lenslets [seeds]]: a camera 1.0, f/21 lenslets of 120 um, its main lens
matched to them, 16 x 16 lenslets or as many as given. Scenes are random, half a lenslet to one and a half
fine, and go on beyond the array. Raw images come from `camera.operator_on`, at another accuracy and with more
samples than the estimate's, of an array that ends, with Poisson noise. Noll's terms 4 to 11 are drawn at
random with so many waves rms in all. Plain deconvolution is an operator of as many samples at 1e-2 and 20
steps of Richardson and Lucy. CPU seconds, each from an empty cache folder.
"""

import os
import sys
import tempfile
import time
from collections.abc import Callable

import numpy as np

import lumigraph as lg
from lumigraph.core.cache import SHARED
from lumigraph.core.grid import Grid
from lumigraph.deconvolution import Exposure
from lumigraph.studies.adaptive import estimate, start
from lumigraph.studies.adaptive.checked import bent

CAMERA = lg.PlenopticCamera(
    wavelength="600 nm",
    object_distance="400 mm",
    main_lens={"focal_length": "200 mm"},
    lenslets={"pitch": "120 um", "count": (16, 16), "focal_length": "2.5 mm"},
    sensor={"pixel_pitch": "8 um"},
)
TERMS = tuple(range(4, 12))
EXPOSURE = Exposure(background=0.01, gain=1.0)
FINE = 14
"""Samples of the scene along a lenslet."""
BEYOND = 2
"""Lenslets that it goes on to each side."""
CASES = ((0.0, 100.0, 0.0), (0.3, 100.0, 0.0), (0.5, 100.0, 3e-3), (1.0, 100.0, 0.0))
"""Waves rms, electrons in a pixel, depth [m]."""


def spent(work: Callable) -> tuple:
    """Result and CPU seconds, with nothing kept from before."""
    before = os.environ.get("LUMIGRAPH_CACHE")
    with tempfile.TemporaryDirectory() as folder:
        os.environ["LUMIGRAPH_CACHE"] = folder
        SHARED.empty()
        began = time.process_time()
        found = work(), time.process_time() - began
    os.environ.pop("LUMIGRAPH_CACHE")
    if before is not None:
        os.environ["LUMIGRAPH_CACHE"] = before
    return found


def scene(size: float, seed: int, fine: float | None = None) -> Callable[[Grid], np.ndarray]:
    """Something flat, on any grid: a sum of waves, cut off where it is dark; as fine as given [lenslets]."""
    rng = np.random.default_rng(seed)
    finest = (rng.uniform(0.5, 1.5) if fine is None else fine) * size
    waves, phases = rng.normal(size=(300, 2)) / (2 * np.pi * finest) * 2, rng.uniform(size=300)

    def on(grid: Grid) -> np.ndarray:
        total = np.zeros(grid.shape)
        for (fy, fx), phase in zip(waves, phases, strict=True):
            turn = fy * grid.y[:, None] + fx * grid.x
            total += np.cos(2 * np.pi * (turn + phase))
        return np.maximum(total / np.sqrt(150) + 0.7, 0.02).astype(np.float32)

    return on


def exposed(
    camera: lg.PlenopticCamera,
    c: np.ndarray,
    seed: int,
    electrons: float,
    dz: float,
    fine: float | None = None,
) -> tuple[np.ndarray, Callable[[Grid], np.ndarray]]:
    """A raw image through these terms, and what it shows."""
    inner, shown = camera.operator_grid(FINE), scene(camera.lenslet_size, seed, fine)
    ny, nx = (n + 2 * BEYOND * FINE for n in inner.shape)
    grid = Grid((ny, nx), inner.pitch, inner.center)
    through = bent(camera, TERMS, c)
    light, _ = spent(lambda: through.operator_on(grid, (dz,), accuracy=5e-3).forward(shown(grid)[None]))
    light = np.maximum(light, 0)
    light *= electrons / light.mean()
    return np.random.default_rng(seed).poisson(light + 0.01).astype(np.float32), shown


def likeness(camera: lg.PlenopticCamera, raw: np.ndarray, dz: float, samples: int, shown: Callable) -> float:
    """Correlation with the scene, of what is deconvolved with a camera, inside its outermost two lenslets."""
    operator = camera.operator((dz,), samples, accuracy=1e-2)
    found = np.asarray(lg.deconvolve(raw, operator, iterations=20, exposure=EXPOSURE))[0]
    inside = slice(2 * samples, -2 * samples)
    truth = shown(camera.operator_grid(samples))
    return float(np.corrcoef(found[inside, inside].ravel(), truth[inside, inside].ravel())[0, 1])


def drawn(waves: float, seed: int) -> np.ndarray:
    """Coefficients of `TERMS`."""
    c = np.random.default_rng(seed + 100).normal(size=len(TERMS))
    return c * waves / np.linalg.norm(c)


def case(
    camera: lg.PlenopticCamera, given: tuple[float, float, float], seed: int, compared: bool
) -> np.ndarray:
    """Print a line; pulls."""
    (waves, electrons, dz), c = given, drawn(given[0], seed)
    raw, shown = exposed(camera, c, seed, electrons, dz)
    asked = {"exposure": EXPOSURE, "object": "picture"}
    found, seconds = spent(lambda: estimate(raw, camera, (dz,), (1, 2, 3, *TERMS), **asked))
    off = found.values.ravel() - c
    pulls = off / found.deviations.ravel()
    told = (np.linalg.norm(one) for one in (off, found.deviations))
    line = (
        f"{waves:g} waves, {electrons:g} electrons, {dz * 1e3:g} mm, seed {seed}: "
        "{:.4f} waves left ({:.4f} expected), ".format(*told)
        + f"pulls {np.sqrt(np.mean(pulls**2)):.2f} rms, {np.abs(pulls).max():.1f} at most, "
        f"deviance {found.deviance[0]:.3f} to {found.deviance[1]:.3f}, pearson {found.pearson:.3f}, "
        f"{found.steps} steps, {seconds:.0f} CPU s"
    )
    if not dz:
        slopes = np.array(list(start(raw, camera, TERMS).coefficients.values()))
        line += f", slopes alone {np.linalg.norm(slopes - c):.3f}"
    if compared:
        samples = round(found.volume.data.shape[-1] / camera.lenslets.count[1])
        plain, usual = spent(lambda: likeness(camera, raw, dz, samples, shown))
        with_it = spent(lambda: likeness(found.instrument, raw, dz, samples, shown))
        true = spent(lambda: likeness(bent(camera, TERMS, c), raw, dz, samples, shown))
        line += (
            f", likeness {plain:.3f} without, {with_it[0]:.3f} with, {true[0]:.3f} with the true one; plain "
            f"{usual:.0f} CPU s, {with_it[1]:.0f} through aberrations"
        )
    print(line, flush=True)
    return pulls


def main(count: int, seeds: int) -> None:
    """Print a line for each case and seed, and pulls of all that have aberrations."""
    camera = CAMERA.replace(lenslets={"count": (count, count)})
    pulls = {given: [case(camera, given, seed, seed == 0) for seed in range(seeds)] for given in CASES}
    for (waves, electrons, dz), some in pulls.items():
        inside = np.mean(np.abs(some) < 1.96)
        told = f"{np.sqrt(np.mean(np.square(some))):.2f} rms, {inside:.0%} inside 95 %"
        print(f"{waves:g} waves, {electrons:g} electrons, {dz * 1e3:g} mm: pulls {told}")


if __name__ == "__main__":
    main(*(int(one) for one in sys.argv[1:3]) if len(sys.argv) > 2 else (16, 4))
