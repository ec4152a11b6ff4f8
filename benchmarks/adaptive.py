"""Aberrations found from the light field of beads: residual, and time over plain deconvolution's.

python -m benchmarks.adaptive [waves rms]: 20x/0.5, lenslets of 125 um and f/20, 11 x 11 of them, six beads
off the grid from 8 to 17 um out of focus, Noll's terms 5 to 16 drawn at random with so many waves rms in all,
Poisson noise over a background of one electron. Raw images come from `point_image`, which propagates on a
grid, at another accuracy and sampling than the estimate's. Plain deconvolution is an operator of the same
planes and samples at 1e-2 and 20 steps of Richardson and Lucy, both from an empty cache folder, by the clock.
"""

import os
import sys
import tempfile
import time
from collections.abc import Callable

import numpy as np

import lumigraph as lg
from lumigraph.core.cache import SHARED
from lumigraph.deconvolution import Exposure
from lumigraph.studies.adaptive import estimate

UNIT = 14.6  # photons on the sensor of a point of intensity 1
DEPTHS = tuple(np.arange(-24e-6, 25e-6, 6e-6))
TERMS = tuple(range(5, 17))
BEADS = 1e-6 * np.array(
    [[-7.49, 12.69, -7.87], [-13.05, -10.46, 10.01], [12.17, 4.97, 16.69],
     [-19.26, 6.22, 14.11], [4.09, -10.56, 13.6], [14.58, -19.24, 13.02]]
)  # fmt: skip
SCOPE = lg.LightFieldMicroscope.model_validate(
    {
        "wavelength": "525 nm",
        "objective": {"magnification": 20.0, "numerical_aperture": 0.5, "model": "scalar"},
        "lenslets": {"pitch": "125 um", "focal_length": "2.5 mm", "count": (11, 11)},
        "sensor": {"pixel_pitch": "6.5 um", "shape": (211, 211)},
    }
)
EXPOSURE = Exposure(background=1.0, gain=1.0)


def timed(work: Callable) -> tuple:
    """Result and seconds by the clock, with nothing on disk."""
    with tempfile.TemporaryDirectory() as folder:
        os.environ["LUMIGRAPH_CACHE"] = folder
        began = time.perf_counter()
        return work(), time.perf_counter() - began


def plain(raw: np.ndarray) -> np.ndarray:
    """Of the aberrated raw image, by a microscope without aberrations."""
    operator = SCOPE.operator(DEPTHS, 3, accuracy=1e-2)
    return lg.deconvolve(raw, operator, iterations=20, exposure=EXPOSURE)


def noisy(light: np.ndarray, photons: float) -> np.ndarray:
    """An exposure."""
    return np.random.default_rng(1).poisson(light * photons / UNIT + 1).astype(np.float32)


def bent(scope: lg.LightFieldMicroscope, c: np.ndarray) -> lg.LightFieldMicroscope:
    """The microscope with these terms."""
    return scope.replace(objective={"aberrations": {j: float(w) for j, w in zip(TERMS, c, strict=True) if w}})


def main(waves: float) -> None:
    """Print a line for each number of photons."""
    c = np.random.default_rng(7).normal(size=len(TERMS))
    c *= waves / np.linalg.norm(c)
    true = bent(SCOPE, c)
    images = [true.point_image(*place, accuracy=1e-2) for place in BEADS]
    for photons in (2e3, 2e4, 2e5):
        raw = noisy(np.sum(images, axis=0), photons)
        SHARED.empty()
        _, usual = timed(lambda raw=raw: plain(raw))
        SHARED.empty()
        found, spent = timed(lambda raw=raw: estimate(raw, SCOPE, DEPTHS, TERMS, exposure=EXPOSURE))
        off = np.linalg.norm(found.values[0, 0] - c)
        expected = np.linalg.norm(found.deviations)
        print(
            f"{waves:g} waves, {photons:g} photons: residual {off:.4f} waves rms (expected {expected:.4f}), "
            f"{len(found.beads.intensities)} beads, steps {found.steps}, deviance {found.deviance[0]:.3f} to "
            f"{found.deviance[1]:.3f}, {spent:.0f} s by the clock, {spent / usual:.1f} times plain's",
            flush=True,
        )


if __name__ == "__main__":
    main(float(sys.argv[1]) if len(sys.argv) > 1 else 1.0)
