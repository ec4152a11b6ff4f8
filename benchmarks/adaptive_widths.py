"""Widths of beads that are deconvolved with the aberrations found, beside those without aberrations.

python -m benchmarks.adaptive_widths [waves rms]: the beads of `benchmarks.adaptive`, 2·10⁴ photons each. Four
volumes by as many iterations of Richardson and Lucy: of a raw image without aberrations; of the aberrated one
by the microscope as described, by what `estimate` made of it, and by the true one. A bead's width is the full
one at half of its highest sample, along lines through it, across (mean of y and x) and along the axis.
"""

import sys

import numpy as np

import lumigraph as lg
from benchmarks.adaptive import BEADS, DEPTHS, EXPOSURE, SCOPE, TERMS, bent, noisy
from lumigraph.adaptive import estimate

PLANES = tuple(np.arange(-14e-6, 23e-6, 2e-6))
SAMPLES, ITERATIONS, PHOTONS = 5, 60, 2e4
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


def widths(volume: np.ndarray, axes: tuple[np.ndarray, ...]) -> np.ndarray:
    """Across and along the axis of each bead, how far its top is across and along it (beads, 4) [um]."""
    found = []
    for y, x, z in BEADS:
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


def main(waves: float) -> None:
    """Print a line for each volume."""
    c = np.random.default_rng(7).normal(size=len(TERMS))
    c *= waves / np.linalg.norm(c)
    true = bent(SCOPE, c)
    plain, aberrated = (
        noisy(np.sum([scope.point_image(*place, accuracy=1e-2) for place in BEADS], axis=0), PHOTONS)
        for scope in (SCOPE, true)
    )
    found = estimate(aberrated, SCOPE, DEPTHS, TERMS, exposure=EXPOSURE)
    usual = None
    for name, raw, scope in (
        ("no aberrations", plain, SCOPE), ("as described", aberrated, SCOPE),
        ("as estimated", aberrated, found.instrument), ("the true ones", aberrated, true),
    ):  # fmt: skip
        operator = scope.operator(PLANES, SAMPLES, accuracy=1e-2)
        volume = np.asarray(lg.deconvolve(raw, operator, ITERATIONS, exposure=EXPOSURE))
        grid = operator.object_grid
        seen = widths(volume, (np.array(PLANES), grid.y, grid.x))
        usual = seen if usual is None else usual
        print(
            f"{name:15} across {np.round(seen[:, 0], 2)} um, along {np.round(seen[:, 1], 1)} um, "
            f"over those without: {np.round(seen[:, 0] / usual[:, 0], 2)} and "
            f"{np.round(seen[:, 1] / usual[:, 1], 2)}; "
            f"tops off by at most {seen[:, 2].max():.1f} and {seen[:, 3].max():.1f} um",
            flush=True,
        )


if __name__ == "__main__":
    main(float(sys.argv[1]) if len(sys.argv) > 1 else 1.0)
