"""Lenslets that differ, against the best of those alike: `python -m benchmarks.designs`.

Before a Fourier microscope each lenslet of a regular array is sharp at the same depth. Of the same objective,
sensor and light, is a point's depth better known over a volume if some lenslets focus nearer, others farther?
Microscopes that searches found are set side by side: bounds at the depths of the search, at others between,
and fits to drawn noise. `python -m benchmarks.designs search` searches, in some minutes; names after it, or
without it, such as `"2 x 2, two focal lengths"`, do a part.
"""

import sys
import time
from typing import Any

import numpy as np

import lumigraph as lg
from lumigraph.information import Light, bounds, trials
from lumigraph.optimisation import Goal
from lumigraph.units import um

SCOPE = lg.load_camera("lfm-fourier")
LIGHT = Light(5000)
GOAL = Goal("depth", depths=tuple(dz * um for dz in (-24, -12, 0, 12, 24)), light=LIGHT, places=3)
LENGTHS = {
    "fourier_lens": "60 mm:110 mm:3",
    "lenslets.pitch": "1 mm:2.5 mm:4",
    "lenslets.focal_length": "12 mm:30 mm:2",
}
OWN = {
    "fourier_lens": "60 mm:90 mm:1",
    "lenslets.pitch": "1.5 mm:2 mm:2",
    "lenslets.focal_length": "12 mm:30 mm:3",
    "lenslets.single.1,4.focal_change": "0:0.06:4",
    "lenslets.single.2,3.focal_change": "-0.06:0:4",
}
SEARCHES = {"3 x 3": (3, LENGTHS), "2 x 2": (2, LENGTHS), "2 x 2, two focal lengths": (2, OWN)}
EVALUATIONS = 60


FOUND: dict[str, dict[str, Any]] = {
    "3 x 3 as given": {},
    "3 x 3, best of a search": {
        "fourier_lens": "76.8 mm", "lenslets": {"pitch": "2.203 mm", "focal_length": "13.3 mm"},
    },
    "2 x 2, two focal lengths": {
        "fourier_lens": "76.32 mm",
        "lenslets": {
            "count": (2, 2), "pitch": "1.982 mm", "focal_length": "15.16 mm",
            "single": {n: {"focal_change": 0.0201 if n in (1, 4) else -0.0197} for n in (1, 2, 3, 4)},
        },
    },
}  # fmt: skip
BETWEEN = tuple(dz * um for dz in (-22, -17, -8, -5, 4, 9, 16, 21))
HELD_OUT = tuple(
    (y * um, x * um, dz * um) for y, x, dz in ((0.3, -0.6, -21), (-0.8, 0.1, -7), (0.5, 0.9, 17))
)
"""Points (y, x, dz) whose place is fitted."""
DRAWS = 200


def search(name: str) -> None:
    """Print what a search finds."""
    began, (count, vary) = time.process_time(), SEARCHES[name]
    found = lg.optimise(
        SCOPE.replace(lenslets={"count": (count, count)}), vary, GOAL, evaluations=EVALUATIONS
    )
    swept, best = (f"{one['depth'] * 1e9:.1f} nm" for one in (found.swept, found.best))
    values = ", ".join(f"{key} {value}" for key, value in found.best.items() if key in vary)
    print(f"{name}: {swept} the best of the grid, {best} the best of {len(found.rows)}")
    print(f"  {values}; {time.process_time() - began:.0f} CPU s", flush=True)


def judge(name: str) -> None:
    """Print bounds of a microscope that was found, and errors of fits."""
    scope = SCOPE.replace(**FOUND[name])
    searched, between = (bounds(scope, depths, LIGHT, places=4).depth for depths in (GOAL.depths, BETWEEN))
    print(f"{name}: {searched * 1e9:.1f} nm at the depths of the search, {between * 1e9:.1f} nm between")
    for place in HELD_OUT:
        fits = trials(scope, place, LIGHT, draws=DRAWS, rng=np.random.default_rng(2))
        print(
            f"  at {place[2] / um:.0f} µm: bound {fits.bounds[2] * 1e9:.1f} nm, "
            f"fits {fits.rms[2] * 1e9:.1f} ± {fits.rms_error[2] * 1e9:.1f} nm", flush=True,
        )  # fmt: skip


if __name__ == "__main__":
    asked = sys.argv[1:]
    done, names = (search, SEARCHES) if asked[:1] == ["search"] else (judge, FOUND)
    for one in asked[asked[:1] == ["search"] :] or names:
        done(one)
