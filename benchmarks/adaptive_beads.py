"""Whether aberrations found with beads are as far off as their deviations say, and how wide beads are found.

python -m benchmarks.adaptive_beads [draws [first]]: a 20x/0.5 microscope with 7 x 7 lenslets, three beads in
random places, 3 to 12 um out of focus; by turns points, and balls 1 and 2.4 um wide that shine evenly, of
some 180 points each; 2e3 to 2e5 photons a bead, Noll's terms 5 to 8 and 11 with 0 to 0.5 waves rms in all.
Raw images are of an accuracy of 1e-2. A line for each draw; then pulls, and the part of the coefficients that
is inside 95 % intervals.
"""

import math
import sys
import time
import warnings
from typing import NamedTuple

import numpy as np

import lumigraph as lg
from benchmarks.adaptive import SCOPE, UNIT
from benchmarks.adaptive_pulls import summary
from lumigraph.deconvolution import Exposure
from lumigraph.studies.adaptive import estimate

SEEN = SCOPE.replace(lenslets={"count": (7, 7)}, sensor={"shape": (135, 135)})
TERMS = (5, 6, 7, 8, 11)
DEPTHS = (-12e-6, -6e-6, 0.0, 6e-6, 12e-6)
EXPOSURE = Exposure(background=1.0, gain=1.0)
WIDTHS = (0.0, 1e-6, 2.4e-6)
APART, ASIDE = 15e-6, 14e-6
"""Distance between beads at least, and from the axis along y and x at most [m]."""


class Draw(NamedTuple):
    """What is before the microscope, and what it does."""

    width: float
    photons: float
    c: np.ndarray
    beads: np.ndarray


def drawn(number: int) -> Draw:
    """The one of this number."""
    rng = np.random.default_rng(number)
    direction = rng.normal(size=len(TERMS))
    c = direction / np.linalg.norm(direction) * rng.uniform(0, 0.5)
    photons, beads = float(2e3 * 100 ** rng.uniform()), np.zeros((0, 3))
    while len(beads) < 3:
        place = np.append(rng.uniform(-ASIDE, ASIDE, 2), rng.choice([-1, 1]) * rng.uniform(3e-6, 12e-6))
        if (np.linalg.norm(beads[:, :2] - place[:2], axis=1) > APART).all():
            beads = np.vstack([beads, place])
    return Draw(WIDTHS[number % 3], photons, c, beads)


def ball(width: float) -> np.ndarray:
    """Points (k, 3) of a cubic lattice in a ball, with its variance along each axis."""
    if not width:
        return np.zeros((1, 3))
    at = np.stack(np.meshgrid(*[np.arange(-4, 5) / 7] * 3, indexing="ij"), -1).reshape(-1, 3)
    inside = at[np.linalg.norm(at, axis=1) <= 0.5]
    return inside * width / math.sqrt(20 * np.mean(inside**2))


def exposed(draw: Draw, number: int) -> np.ndarray:
    """A raw image."""
    images = SEEN.pupil_images(TERMS, farthest=15e-6, accuracy=1e-2)
    places = (draw.beads[:, None] + ball(draw.width)).reshape(-1, 3)
    light = images.forward(lg.Points(places, np.full(len(places), 3 / len(places))), draw.c)
    return np.random.default_rng(number).poisson(light * draw.photons / UNIT + 1).astype(np.float32)


def case(number: int) -> tuple[str, np.ndarray]:
    """Print a line; what it is one of, and pulls."""
    draw = drawn(number)
    raw, began = exposed(draw, number), time.process_time()
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always", lg.SamplingWarning)
        found = estimate(raw, SEEN, DEPTHS, TERMS, exposure=EXPOSURE)
    off, said = found.values.ravel() - draw.c, found.deviations.ravel()
    pulls = off / said
    wide, unsure = 1e6 * found.bead_width, 1e6 * found.bead_width_deviation
    print(
        f"{number}: {draw.width * 1e6:g} um wide, {draw.photons:.0f} photons, "
        f"{np.linalg.norm(draw.c):.2f} waves: {np.linalg.norm(off):.4f} left, "
        f"{np.linalg.norm(said):.4f} said, pulls {np.sqrt(np.mean(pulls**2)):.2f} rms, "
        f"{np.abs(pulls).max():.1f} at most, {len(found.beads.intensities)} beads, "
        f"{wide:.2f} ± {unsure:.2f} um, pearson {found.pearson:.3f} ± {found.pearson_deviation:.3f}"
        f"{', warned of' if warned else ''}, {time.process_time() - began:.0f} CPU s",
        flush=True,
    )
    return f"{draw.width * 1e6:g} um", pulls


if __name__ == "__main__":
    given = [int(one) for one in sys.argv[1:3]]
    count, first = given[0] if given else 12, given[1] if len(given) > 1 else 0
    summary(case(number) for number in range(first, first + count))
