"""Fourier microscopes whose lenslets differ, against the best of those alike: `python -m benchmarks.designs`.

Before a Fourier microscope each lenslet of a regular array is sharp at the same depth. Of the same objective,
sensor and light, is a point's depth better known over a deep volume if each lenslet has a focal length and a
place of its own? Microscopes that searches found are set side by side: bounds at the depths of the search, at
others between, and fits to drawn noise. `python -m benchmarks.designs search` searches; names after it, or
without it, such as `"3 x 3, own focal lengths"`, do a part.
"""

import sys
import time
from typing import Any

import numpy as np

import lumigraph as lg
from lumigraph.instruments import LightFieldMicroscope
from lumigraph.instruments.varied import changed
from lumigraph.studies.information import Light, bounds, trials
from lumigraph.studies.optimisation import Goal
from lumigraph.units import mm, um

SCOPE = lg.LightFieldMicroscope.from_catalogue("lfm-fourier")
LIGHT = Light(5000)
DEEP = 40 * um
GOAL = Goal("depth", depths=tuple((DEEP * np.linspace(-1, 1, 7)).tolist()), light=LIGHT, places=3)
BETWEEN = tuple((0.95 * DEEP * np.linspace(-1, 1, 12)).tolist())
HELD_OUT = tuple(
    (y * um, x * um, dz * um)
    for y, x, dz in ((0.3, -0.6, -35), (-0.8, 0.1, -11), (0.5, 0.9, 6), (0.2, -0.4, 29))
)
"""Points (y, x, dz) whose place is fitted."""
EVALUATIONS, DRAWS, OTHERS = 30, 200, range(3, 11)

PITCHES = {2: "1.5 mm:2.3 mm:x3", 3: "1.1 mm:2.3 mm:x3", 4: "0.8 mm:1.5 mm:x3", 5: "0.6 mm:1.1 mm:x3"}
"""Of n × n lenslets."""
# The relay, the pitch and the lenslets' focal length scaled together give the same images, farther apart.
LENGTHS = {"fourier_lens": "65 mm:95 mm:x2", "lenslets.focal_length": "5 mm:25 mm:x3"}
MIDDLE = {"fourier_lens": "65 mm:95 mm:x1", "lenslets.focal_length": "8 mm:24 mm:x1"}

NEAR, FAR, EVEN = -0.035, 0.035, 0.003
"""By what part focal lengths are longer where a search begins."""

RING = ((0.01, 1.4), (1.35, 0.7), (1.35, -0.7), (-0.01, -1.4), (-1.35, -0.7), (-1.35, 0.7))
"""Places (y, x) in the pupil [mm] where a search begins."""


def alike(n: int) -> tuple[LightFieldMicroscope, dict[str, str]]:
    """A regular array of n × n, and what of it may vary."""
    return SCOPE.replace(lenslets={"count": (n, n)}), {**LENGTHS, "lenslets.pitch": PITCHES[n]}


def in_rows() -> tuple[LightFieldMicroscope, dict[str, str]]:
    """3 × 3 lenslets whose focal lengths may differ."""
    changes = (FAR, -EVEN, FAR, NEAR, EVEN, NEAR, FAR, -EVEN, FAR)
    single = {n: {"focal_change": c} for n, c in enumerate(changes, 1)}
    start = {"pitch": 1.5 * mm, "focal_length": 14 * mm, "single": single}
    vary = {**MIDDLE, "lenslets.pitch": "1.2 mm:2.2 mm:x1"}
    return SCOPE.replace(fourier_lens=80 * mm, lenslets=start), vary | _own(
        "focal_change", 9, "-0.08:0.08:x1"
    )


def on_a_ring() -> tuple[LightFieldMicroscope, dict[str, str]]:
    """Six lenslets near the pupil's rim, whose places and focal lengths may differ."""
    width, count = 1.3 * mm, len(RING)
    array = SCOPE.replace(lenslets={"count": (1, count), "pitch": width}).lenslets
    changes = (FAR, NEAR, EVEN) * 2
    moved = np.array(RING) * mm - array.each()[0]
    single = {
        n: {"focal_change": c, "offset_y": y, "offset_x": x}
        for n, (c, (y, x)) in enumerate(zip(changes, moved.tolist(), strict=True), 1)
    }
    start = {
        "count": (1, count),
        "pitch": width,
        "fill_factor": 0.98,
        "focal_length": 17 * mm,
        "single": single,
    }
    vary = {**MIDDLE, "lenslets.fill_factor": "0.8:1:x1"} | _own("focal_change", count, "-0.08:0.08:x1")
    for n, (y, x) in enumerate((moved / mm).tolist(), 1):
        vary[f"lenslets.single.{n}.offset_y"] = f"{y - 0.4:.4f} mm:{y + 0.4:.4f} mm:1"
        vary[f"lenslets.single.{n}.offset_x"] = f"{x - 0.4:.4f} mm:{x + 0.4:.4f} mm:1"
    return SCOPE.replace(fourier_lens=77 * mm, lenslets=start), vary


def _own(key: str, count: int, values: str) -> dict[str, str]:
    return {f"lenslets.single.{n}.{key}": values for n in range(1, count + 1)}


SEARCHES = {
    **{f"{n} x {n}, alike": (alike, n) for n in PITCHES},
    "3 x 3, own focal lengths": (in_rows,),
    "6 on a ring, own places and focal lengths": (on_a_ring,),
}

ROUND = (
    (0.04399, -0.0053, 4.5305), (-0.03967, 1.2876, 2.6949), (0.00270, 1.3456, -0.0485),
    (0.04435, -0.0213, -1.9309), (-0.04016, -1.3772, -2.6766), (0.00273, -1.3452, -2.5589),
)  # fmt: skip
"""Of the ring's lenslets, by what part they are longer, and how far from the lattice (y, x) [mm]."""

LONGER = (0.0305, -0.0060, 0.0308, -0.0338, 0.0009, -0.0343, 0.0303, -0.0064, 0.0305)

FOUND: dict[str, dict[str, Any]] = {
    "3 x 3, alike": {
        "fourier_lens": "68.02 mm", "lenslets.focal_length": "5.711 mm", "lenslets.pitch": "2.121 mm",
    },
    "4 x 4, alike": {
        "fourier_lens": "94.89 mm", "lenslets.focal_length": "10.24 mm", "lenslets.pitch": "1.471 mm",
    },
    "3 x 3, own focal lengths": {
        "fourier_lens": "80.06 mm", "lenslets.focal_length": "13.88 mm", "lenslets.pitch": "1.333 mm",
        **{
            f"lenslets.single.{n}.focal_change": c
            for n, c in enumerate(LONGER, 1)
        },
    },
    "6 on a ring, own places and focal lengths": {
        "fourier_lens": "76.92 mm", "lenslets.focal_length": "16.84 mm", "lenslets.fill_factor": 0.9809,
        **{f"lenslets.single.{n}.focal_change": one[0] for n, one in enumerate(ROUND, 1)},
        **{f"lenslets.single.{n}.offset_y": f"{one[1]} mm" for n, one in enumerate(ROUND, 1)},
        **{f"lenslets.single.{n}.offset_x": f"{one[2]} mm" for n, one in enumerate(ROUND, 1)},
    },
}  # fmt: skip


def search(name: str) -> None:
    """Print what a search finds."""
    began, (of, *how) = time.process_time(), SEARCHES[name]
    scope, vary = of(*how)
    found = lg.optimise(scope, vary, GOAL, search="gradient", evaluations=EVALUATIONS)
    values = [f"{one['depth'] * 1e9:.1f}" for one in (found.start, found.swept, found.best)]
    print(f"{name}: {values[0]} nm where it began, {values[1]} the best of the grid, {values[2]} of all")
    print(
        f"  at other places {found.checked['best'].value * 1e9:.1f} nm; {len(found.rows)} cameras, "
        f"{time.process_time() - began:.0f} CPU s"
    )
    print("  " + ", ".join(f"{key}={value}" for key, value in found.best.items() if key in vary), flush=True)


def microscope(name: str) -> LightFieldMicroscope:
    """A microscope that a search found."""
    begun, *how = SEARCHES[name]
    return changed(begun(*how)[0], FOUND[name])


def judge(name: str) -> None:
    """Print bounds of a microscope that was found, and errors of fits."""
    scope = microscope(name)
    lasting = bounds(scope, GOAL.depths, LIGHT, places=OTHERS).depth
    between = bounds(scope, BETWEEN, LIGHT, places=4)
    each = ", ".join(f"{one * 1e9:.0f}" for one in between.of("depth"))
    print(f"{name}: {lasting * 1e9:.1f} nm at other places than the search's")
    print(f"  {between.depth * 1e9:.1f} nm at other depths: {each}")
    errors = []
    for place in HELD_OUT:
        fits = trials(scope, place, LIGHT, draws=DRAWS, rng=np.random.default_rng(2))
        errors.append(fits.rms[2])
        print(
            f"  at {place[2] / um:.0f} µm: bound {fits.bounds[2] * 1e9:.1f} nm, "
            f"fits {fits.rms[2] * 1e9:.1f} ± {fits.rms_error[2] * 1e9:.1f} nm", flush=True,
        )  # fmt: skip
    print(f"  fits to all: {np.sqrt(np.mean(np.square(errors))) * 1e9:.1f} nm rms")


if __name__ == "__main__":
    asked = sys.argv[1:]
    done, names = (search, SEARCHES) if asked[:1] == ["search"] else (judge, FOUND)
    for one in asked[asked[:1] == ["search"] :] or names:
        done(one)
