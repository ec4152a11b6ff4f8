"""What is left of reconstructed scenes before the Fourier microscopes of `designs`, and of searches for it.

    python -m benchmarks.designs_scenes

Microscopes that were found for a point's depth, for the error of pictures and for that of volumes are set
side by side: expected errors at the depths of the search, at others between and of volumes, errors of scenes
twice as coarse, and those of held-out pictures that are drawn with noise and reconstructed. `search` after it
searches; names do a part.
"""

import sys
import time
from dataclasses import replace
from typing import Any

import numpy as np
from skimage import data
from skimage.transform import downscale_local_mean

import lumigraph as lg
from benchmarks import designs
from lumigraph.instruments import LightFieldMicroscope
from lumigraph.instruments.varied import changed
from lumigraph.studies.information import Light, Scenes, reconstruction_error, reconstruction_trials
from lumigraph.studies.optimisation import Goal
from lumigraph.units import mm, um

SCENES, FEW = Scenes(4 * um, 24), Scenes(4 * um, 16)
"""No finer than the pixels of any of these see."""
LIGHT = Light(3000)
PICTURE = Goal("picture error", depths=designs.GOAL.depths, light=LIGHT, scenes=SCENES)
VOLUME = Goal("volume error", depths=(-40 * um, 0.0, 40 * um), light=LIGHT, scenes=FEW)
ELSEWHERE, OTHER_VOLUME = tuple(dz for *_, dz in designs.HELD_OUT), (-33 * um, -8 * um, 27 * um)
"""Depths of held-out pictures; of scenes that shine at once, where none did in a search."""
PICTURES, COARSER, SQUARES = ("cell", "coins", "camera", "gravel"), (4, 4), 16
"""Held-out pictures of scikit-image, by what they are made coarser, and how many of their squares count."""

RELAY = 95 * mm
"""Fourier lens of regular arrays: scaled together with pitch and focal length it gives the same images."""
PITCHES = {
    3: "0.8 mm:2.2 mm:x4", 4: "0.6 mm:1.6 mm:x4", 5: "0.5 mm:1.3 mm:x4", 6: "0.4 mm:1.1 mm:x3",
    7: "0.4 mm:0.9 mm:x3",
}  # fmt: skip
"""Of n × n lenslets."""
KINDS = {"1,3,7,9": 0.0305, "2,8": -0.0062, "4,6": -0.034, "5": 0.0009}
"""Of 3 × 3 lenslets, those alike, and by what part they are longer where a search begins."""


def alike(n: int) -> tuple[LightFieldMicroscope, dict[str, str]]:
    """A regular array of n × n, and what of it may vary."""
    scope = designs.SCOPE.replace(fourier_lens=RELAY, lenslets={"count": (n, n)})
    return scope, {"lenslets.pitch": PITCHES[n], "lenslets.focal_length": f"8 mm:24 mm:{4 if n < 6 else 3}"}


def of_kinds() -> tuple[LightFieldMicroscope, dict[str, str]]:
    """3 × 3 lenslets of four kinds, from those that were found for a point's depth."""
    scope, vary = designs.in_rows()
    start = changed(scope, designs.FOUND["3 x 3, own focal lengths"])
    own = {f"lenslets.single.{which}.focal_change": c for which, c in KINDS.items()}
    free = {key: values for key, values in vary.items() if "single" not in key}
    return changed(start, own), free | dict.fromkeys(own, "-0.08:0.08:x1")


Search = tuple[Goal, Any, dict[str, str], int]


def searches() -> dict[str, Search]:
    """Goal, where it begins, what may vary and how many cameras, by name."""
    found: dict[str, Search] = {}
    for goal, most in ((PICTURE, 120), (VOLUME, 60)):
        kind = goal.name.split()[0]
        found |= {f"{n} x {n}, alike, for the {kind}": (goal, *alike(n), 24) for n in PITCHES}
        found[f"3 x 3, four kinds, for the {kind}"] = (goal, *of_kinds(), most)
    return found


def _kinds(fourier_lens: str, focal_length: str, pitch: str, *longer: float) -> LightFieldMicroscope:
    own = dict(zip((f"lenslets.single.{which}.focal_change" for which in KINDS), longer, strict=True))
    values = {"fourier_lens": fourier_lens, "lenslets.focal_length": focal_length, "lenslets.pitch": pitch}
    return changed(of_kinds()[0], values | own)


def _alike(n: int, pitch: str, focal_length: str) -> LightFieldMicroscope:
    return changed(alike(n)[0], {"lenslets.pitch": pitch, "lenslets.focal_length": focal_length})


def found() -> dict[str, LightFieldMicroscope]:
    """The best of each search, by name."""
    return {
        **{f"{name}, for points": designs.microscope(name) for name in designs.FOUND},
        "5 x 5, alike, for the picture": _alike(5, "0.8717838542 mm", "8 mm"),
        "6 x 6, alike, for the picture": _alike(6, "0.77953125 mm", "8.54375 mm"),
        "7 x 7, alike, for the picture": _alike(7, "0.771875 mm", "8 mm"),
        "3 x 3, four kinds, for the picture": _kinds(
            "79.65326774 mm", "13.49940116 mm", "1.342998162 mm",
            0.03082272487, -0.0062095368, -0.03239837824, 0.02020282546,
        ),
        "6 x 6, alike, for the volume": _alike(6, "0.7929638672 mm", "8.8 mm"),
        "3 x 3, four kinds, for the volume": _kinds(
            "80.91955536 mm", "13.30535997 mm", "1.361651845 mm",
            0.04022715238, -0.002630282025, -0.03588765098, 0.005484295234,
        ),
    }  # fmt: skip


CAMERA = lg.load_camera("thesis-plenoptic-2-m050").replace(
    main_lens={"diameter": 3 * mm}, sensor={"pixel_pitch": 3.4 * um, "shape": None}
)
CAMERA_GOAL = Goal(
    "picture error", depths=(-6 * mm, -3 * mm, 0.0, 3 * mm, 6 * mm), light=LIGHT, scenes=Scenes(26 * um, 16)
)
CAMERA_BETWEEN = (-4.5 * mm, -1.5 * mm, 1.5 * mm, 4.5 * mm)
CAMERAS = {
    "a camera 2.0, as given": (0.5, "150 um"), "a camera 2.0, best of the sweep for points": (0.6, "200 um"),
    "a camera 2.0, for points": (0.47, "200 um"),
}  # fmt: skip
"""Magnification and pitch of lenslets of the cameras of docs/validation/optimise.md, ±6 mm."""


def search(name: str) -> None:
    """Print what a search finds."""
    began, (goal, scope, vary, most) = time.process_time(), searches()[name]
    best = lg.optimise(scope, vary, goal, evaluations=most)
    values = [f"{one[goal.name]:.4f}" for one in (best.start, best.swept, best.best)]
    print(f"{name}: {values[0]} where it began, {values[1]} the best of the grid, {values[2]} of all")
    print(f"  {len(best.rows)} cameras, {time.process_time() - began:.0f} CPU s; half-way between the depths "
          f"{best.checked['best'].between:.4f}")  # fmt: skip
    print("  " + ", ".join(f"{key}={value}" for key, value in best.best.items() if key in vary), flush=True)


def held_out() -> list[np.ndarray]:
    """Squares of pictures that no search saw."""
    return SCENES.squares([downscale_local_mean(getattr(data, one)(), COARSER) for one in PICTURES], SQUARES)


def judge(name: str) -> None:
    """Print errors before a microscope."""
    began, scope = time.process_time(), found()[name]
    expected = {
        "at the depths of the search": reconstruction_error(scope, PICTURE.depths, SCENES, LIGHT),
        "at others": reconstruction_error(scope, designs.BETWEEN, SCENES, LIGHT),
        "a volume": reconstruction_error(scope, VOLUME.depths, FEW, LIGHT, volume=True),
        "another volume": reconstruction_error(scope, OTHER_VOLUME, FEW, LIGHT, volume=True),
        "coarse scenes": reconstruction_error(scope, PICTURE.depths, replace(SCENES, pitch=8 * um), LIGHT),
        "a tenth of the light": reconstruction_error(scope, PICTURE.depths, SCENES, Light(300)),
    }
    print(f"{name}:", ", ".join(f"{words} {one.value:.4f}" for words, one in expected.items()))
    for volume, depths, scenes in ((False, ELSEWHERE, held_out()), (True, OTHER_VOLUME, held_out()[::2])):
        drawn = reconstruction_trials(
            scope, depths, SCENES, LIGHT, draws=scenes, volume=volume, rng=np.random.default_rng(3)
        )
        what = "a volume of held-out pictures" if volume else "held-out pictures"
        print(f"  {what}: {drawn.rms:.4f} ± {drawn.rms_error:.4f} by their number")
    print(f"  {time.process_time() - began:.0f} CPU s", flush=True)


def judge_camera(name: str) -> None:
    """Print errors before a camera."""
    began, (magnification, pitch) = time.process_time(), CAMERAS[name]
    camera = CAMERA.replace(lenslets={"magnification": magnification, "pitch": pitch})
    for depths in (CAMERA_GOAL.depths, CAMERA_BETWEEN):
        left = reconstruction_error(camera, depths, CAMERA_GOAL.judged_scenes, LIGHT)
        print(f"{name}: {left.value:.4f}, {', '.join(f'{one:.3f}' for one in left.errors)}")
    print(f"  {time.process_time() - began:.0f} CPU s", flush=True)


def main() -> None:
    """Search, or judge what was found."""
    names = sys.argv[1:]
    searching = names[:1] == ["search"]
    verbs = dict.fromkeys(searches(), search)
    if not searching:
        verbs = dict.fromkeys(found(), judge) | dict.fromkeys(CAMERAS, judge_camera)
    for name in names[searching:] or verbs:
        verbs[name](name)


if __name__ == "__main__":
    main()
