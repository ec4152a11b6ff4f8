"""Aberrations that change over the field, found from the light field of beads: 4 x 4 regions.

python -m benchmarks.adaptive_field [photons]: 20x/0.5, lenslets of 125 um and f/20, 16 x 16 of them, 16 beads
off the grid, one in each region, up to 12 um out of focus. Noll's terms 5 to 16 have 1 wave rms in all in the
field's middle and drift linearly, by 0.25 waves rms in all over the field along y and along x. Raw images
come from `point_image`, bead by bead with the aberrations at its place, at another accuracy than the
estimate's. Residuals are of the regions' middles; a plain deconvolution of the same raw image is timed.
"""

import sys
import time

import numpy as np

from benchmarks.adaptive import EXPOSURE, SCOPE, TERMS, UNIT, bent, timed
from lumigraph.deconvolution import deconvolve
from lumigraph.studies.adaptive import estimate

LENSLETS, REGIONS = 16, (4, 4)
BIG = SCOPE.replace(
    lenslets={"count": (LENSLETS, LENSLETS)}, sensor={"shape": (round(LENSLETS * 19.23),) * 2}
)
DEPTHS = tuple(np.arange(-18e-6, 19e-6, 6e-6))
FIELD = LENSLETS * 125e-6 / 20
DRIFT = 0.25


def beads(rng: np.random.Generator) -> np.ndarray:
    """Places (n, 3), one in each region."""
    side, found = FIELD / REGIONS[0], []
    for region in np.ndindex(*REGIONS):
        place = (np.array(region) + rng.uniform(0.3, 0.7, 2)) * side - FIELD / 2
        found.append([*place, rng.uniform(4e-6, 12e-6) * rng.choice([-1, 1])])
    return np.array(found)


def field(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Coefficients in the middle (terms,), and their slopes along y and x over the field (2, terms)."""
    c = rng.normal(size=len(TERMS))
    c /= np.linalg.norm(c)
    slopes = rng.normal(size=(2, len(TERMS)))
    return c, DRIFT * slopes / np.linalg.norm(slopes, axis=1, keepdims=True)


def at(told: tuple[np.ndarray, np.ndarray], place: np.ndarray) -> np.ndarray:
    """Coefficients at a place (y, x)."""
    return told[0] + place / FIELD @ told[1]


def main(photons: float) -> None:
    """Print what is found."""
    rng = np.random.default_rng(11)
    told, places = field(rng), beads(rng)
    began = time.process_time()
    light = sum(bent(BIG, at(told, p[:2])).point_image(*p, accuracy=2e-2) for p in places)
    raw = rng.poisson(np.asarray(light) * photons / UNIT + 1).astype(np.float32)
    print(f"simulated in {time.process_time() - began:.0f} CPU s", flush=True)
    plain, spent = timed(
        lambda: deconvolve(raw, BIG.operator(DEPTHS, 5, accuracy=3e-2), 30, exposure=EXPOSURE)
    )
    print(f"plain deconvolution, {plain.shape}, 30 iterations: {spent:.1f} s by the clock", flush=True)
    found, took = timed(lambda: estimate(raw, BIG, DEPTHS, TERMS, regions=REGIONS, exposure=EXPOSURE))
    y, x = np.meshgrid(*found.nodes, indexing="ij")
    true = np.array(
        [[at(told, np.array(p)) for p in zip(*row, strict=True)] for row in zip(y, x, strict=True)]
    )
    off = np.linalg.norm(found.values - true, axis=-1)
    print(
        f"{photons:g} photons: {len(found.beads.intensities)} of {len(places)} beads, residual of regions "
        f"{np.sqrt(np.mean(off**2)):.4f} waves rms, at most {off.max():.4f} (expected "
        f"{np.sqrt(np.mean((found.deviations**2).sum(-1))):.4f}), pearson {found.pearson:.3f}, steps "
        f"{found.steps}, {took:.0f} s by the clock, {took / spent:.0f} times plain",
        flush=True,
    )


if __name__ == "__main__":
    main(float(sys.argv[1]) if len(sys.argv) > 1 else 2e4)
