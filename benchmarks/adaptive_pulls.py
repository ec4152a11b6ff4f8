"""Whether aberrations found with a picture are as far off as their deviations say.

python -m benchmarks.adaptive_pulls [draws [first]]: by turns two cameras 1.0 (f/21 lenslets of 80 to 120 um,
12 x 12 of them, in focus or 3 mm out of it) and a 20x/0.5 microscope with 7 x 7 lenslets, drawn at random;
scenes 0.1 to 1.5 lenslets fine, 50 to 1000 electrons a pixel, Noll's terms 4 to 8 with 0 to 0.5 waves rms in
all. Every other microscope sees points on a lattice, 5 to 9 along a lenslet, finer than a picture holds. Raw
images are those of `adaptive_picture`, and of `LightFieldMicroscope.operator`. A line for each draw; then
pulls, and the part of the coefficients that is inside 95 % intervals.
"""

import sys
import time
import warnings
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

import lumigraph as lg
from benchmarks import adaptive_picture
from benchmarks.adaptive import SCOPE
from benchmarks.adaptive_picture import CAMERA
from lumigraph.deconvolution import Exposure
from lumigraph.studies.adaptive import estimate
from lumigraph.studies.adaptive.checked import bent

TERMS = (4, 5, 6, 7, 8)
EXPOSURE = Exposure(background=0.01, gain=1.0)
DENSE = 20
"""Samples along a microscope's lenslet that show what is between them: it has 12 periods λ/(2 NA)."""
EXPLAINED = 1.1
"""Pearson up to which a picture explains a raw image."""


class Draw(NamedTuple):
    """What is before an instrument, and what it does."""

    fine: float
    electrons: float
    c: np.ndarray
    dz: float
    pitch: float
    points: int


def drawn(number: int) -> Draw:
    """The one of this number."""
    rng = np.random.default_rng(number)
    direction = rng.normal(size=len(TERMS))
    return Draw(
        float(0.1 * 15 ** rng.uniform()),
        float(50 * 20 ** rng.uniform()),
        direction / np.linalg.norm(direction) * rng.uniform(0, 0.5),
        float(rng.choice([0.0, 3e-3])),
        float(rng.uniform(80e-6, 120e-6)),
        int(rng.integers(5, 10)) if number % 6 == 5 else DENSE,
    )


def before_camera(draw: Draw, number: int) -> tuple[lg.PlenopticCamera, np.ndarray]:
    """A camera and its raw image."""
    lenslets = {"pitch": draw.pitch, "focal_length": draw.pitch * 20.83, "count": (12, 12)}
    camera = CAMERA.replace(lenslets=lenslets)
    given = camera, terms_of(draw.c), number, draw.electrons, draw.dz, draw.fine
    return camera, adaptive_picture.exposed(*given)[0]


def terms_of(c: np.ndarray) -> np.ndarray:
    """Coefficients of the terms of `adaptive_picture`."""
    return np.append(c, np.zeros(len(adaptive_picture.TERMS) - len(c)))


def before_microscope(draw: Draw, number: int) -> tuple[lg.LightFieldMicroscope, np.ndarray]:
    """A microscope and its raw image."""
    scope = SCOPE.replace(lenslets={"count": (7, 7)}, sensor={"shape": (135, 135)})
    through = bent(scope, TERMS, draw.c)
    operator = through.operator((0.0,), draw.points, accuracy=1e-2).widened(0.02)[0]
    shown = adaptive_picture.scene(scope.lenslet_size, number, draw.fine)(operator.object_grid)
    light = np.maximum(operator.forward(shown[None]), 0)
    light *= draw.electrons / light.mean()
    return scope, np.random.default_rng(number).poisson(light + 0.01).astype(np.float32)


def case(number: int) -> tuple[str, np.ndarray]:
    """Print a line; what it is one of, and pulls."""
    draw, began = drawn(number), time.process_time()
    ofs = number % 3 == 2
    instrument, raw = (before_microscope if ofs else before_camera)(draw, number)
    dz = 0.0 if ofs else draw.dz
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always", lg.SamplingWarning)
        found = estimate(raw, instrument, (dz,), TERMS, exposure=EXPOSURE, object="picture")
    off, said = found.values.ravel() - draw.c, found.deviations.ravel()
    pulls = off / said
    what = (
        f"microscope, {draw.points} points" if ofs else f"camera, {draw.pitch * 1e6:.0f} um, {dz * 1e3:g} mm"
    )
    print(
        f"{number}: {what}, {draw.fine:.2f} fine, {draw.electrons:.0f} electrons, "
        f"{np.linalg.norm(draw.c):.2f} waves: "
        f"{np.linalg.norm(off):.4f} left, {np.linalg.norm(said):.4f} said, "
        f"pulls {np.sqrt(np.mean(pulls**2)):.2f} rms, {np.abs(pulls).max():.1f} at most, pearson "
        f"{found.pearson:.3f} ± {found.pearson_deviation:.3f}{', warned of' if warned else ''}, "
        f"{time.process_time() - began:.0f} CPU s",
        flush=True,
    )
    explained = "explained" if found.pearson < EXPLAINED else "not explained"
    return f"{'microscopes' if ofs else 'cameras'}, {explained}", pulls


def summary(cases: Iterable[tuple[str, np.ndarray]]) -> None:
    """Print what all pulls of a kind say."""
    kinds: dict[str, list[np.ndarray]] = {}
    for kind, pulls in cases:
        kinds.setdefault(kind, []).append(pulls)
    kinds["all"] = [one for some in kinds.values() for one in some]
    for kind, some in kinds.items():
        pulls = np.concatenate(some)
        inside = np.mean(np.abs(pulls) < 1.96)
        print(
            f"{kind}: {len(some)} draws, pulls {np.sqrt(np.mean(pulls**2)):.2f} rms, {inside:.0%} of "
            f"{len(pulls)} inside 95 %"
        )


if __name__ == "__main__":
    given = [int(one) for one in sys.argv[1:3]]
    count, first = given[0] if given else 12, given[1] if len(given) > 1 else 0
    summary(case(number) for number in range(first, first + count))
