"""Widths of beads that are deconvolved with the aberrations found, beside those without aberrations.

python -m benchmarks.adaptive_widths [waves rms [where [steps]]]: the beads of `benchmarks.adaptive`, 2·10⁴
photons each, on the nearest samples of the volume, or "between" them, where they are there. Four volumes by
60 or as many steps of Richardson and Lucy with momentum: of a raw image without aberrations; of the aberrated
one by the microscope as described, by what `estimate` made of it, and by the true one. A bead's width is the
full one at half of its highest sample, along lines through it, across (mean of y and x) and along the axis.
"""

import sys

import numpy as np

import lumigraph as lg
from benchmarks.adaptive import BEADS, DEPTHS, EXPOSURE, SCOPE, TERMS, bent, noisy
from lumigraph.core.grid import Grid
from lumigraph.deconvolution import RichardsonLucy
from lumigraph.studies.adaptive import estimate

PLANES = tuple(np.arange(-14e-6, 23e-6, 2e-6))
SAMPLES, ITERATIONS, PHOTONS = 5, 60, 2e4
METHOD = RichardsonLucy(accelerated=True)
NEAR = 6.0  # um: as far a bead's highest sample is looked for


def width(line: np.ndarray, top: int, step: float) -> float:
    """Full one at half the height of the sample `top`, linear between samples."""
    ends = []
    for side in (line[top::-1], line[top:]):
        below = np.flatnonzero(side < line[top] / 2)
        if not len(below):
            return np.nan
        k = below[0]
        ends.append(k - 1 + (side[k - 1] - line[top] / 2) / (side[k - 1] - side[k]))
    return sum(ends) * step


def widths(volume: np.ndarray, axes: tuple[np.ndarray, ...], beads: np.ndarray) -> np.ndarray:
    """Across and along the axis of each bead, how far its top is across and along it (beads, 4) [um]."""
    found = []
    for y, x, z in beads:
        away = [np.abs(axis - at) < 1e-6 * NEAR for axis, at in zip(axes, (z, y, x), strict=True)]
        part = np.zeros(volume.shape)
        part[np.ix_(*away)] = volume[np.ix_(*away)]
        top = np.unravel_index(int(part.argmax()), part.shape)
        own = []
        for k, axis in enumerate(axes):
            line = volume[tuple(slice(None) if n == k else top[n] for n in range(3))]
            own.append(1e6 * width(line, int(top[k]), float(axis[1] - axis[0])))
        off = np.array([axis[n] for axis, n in zip(axes, top, strict=True)]) - (z, y, x)
        found.append([np.mean(own[1:]), own[0], 1e6 * np.hypot(*off[1:]), 1e6 * abs(off[0])])
    return np.array(found)


def on_samples(grid: Grid) -> np.ndarray:
    """The beads, each moved to the nearest sample of the volume."""
    axes = grid.y, grid.x, np.array(PLANES)
    return np.stack(
        [axis[np.abs(axis[:, None] - at).argmin(0)] for axis, at in zip(axes, BEADS.T, strict=True)], 1
    )


def main(waves: float, where: str = "on", steps: int = ITERATIONS) -> None:
    """Print a line for each volume."""
    c = np.random.default_rng(7).normal(size=len(TERMS))
    c *= waves / np.linalg.norm(c)
    true, usual = bent(SCOPE, c), None
    operator = SCOPE.operator(PLANES, SAMPLES, accuracy=1e-2)
    beads = BEADS if where == "between" else on_samples(operator.object_grid)
    axes = np.array(PLANES), operator.object_grid.y, operator.object_grid.x
    plain, aberrated = (
        noisy(np.sum([scope.point_image(*place, accuracy=1e-2) for place in beads], axis=0), PHOTONS)
        for scope in (SCOPE, true)
    )
    found = estimate(aberrated, SCOPE, DEPTHS, TERMS, exposure=EXPOSURE)
    for name, raw, scope in (
        ("no aberrations", plain, SCOPE), ("as described", aberrated, SCOPE),
        ("as estimated", aberrated, found.instrument), ("the true ones", aberrated, true),
    ):  # fmt: skip
        told: list[float] = []
        volume = lg.deconvolve(
            raw, scope.operator(PLANES, SAMPLES, accuracy=1e-2), steps, method=METHOD, exposure=EXPOSURE,
            progress=lambda step, told=told: told.append(step.deviance),
        )  # fmt: skip
        seen = widths(np.asarray(volume), axes, beads)
        usual = seen if usual is None else usual
        print(
            f"{name:15} across {np.round(seen[:, 0], 2)} um, along {np.round(seen[:, 1], 1)} um, "
            f"over those without: {np.round(seen[:, 0] / usual[:, 0], 2)} and "
            f"{np.round(seen[:, 1] / usual[:, 1], 2)}; "
            f"tops off by at most {seen[:, 2].max():.1f} and {seen[:, 3].max():.1f} um, "
            f"deviance {told[-1]:.3f}",
            flush=True,
        )


if __name__ == "__main__":
    given = sys.argv[1:]
    main(float(given[0]) if given else 1.0, *given[1:2], *(int(n) for n in given[2:3]))
