"""A camera 2.0 with a phase in its main lens, or without: `python -m benchmarks.designs_camera`.

A stop of 8 mm and a volume of ±10 mm: ±9 waves of defocus at its edge. Of the same main lens, sensor and
light, how much better is a point's depth known if the main lens has a phase of its own, astigmatic in two
orders? `sweep` prints bounds of cameras without, `search` looks for the phase; without a word, what was found
is set side by side at places and depths where nothing was searched, with `fits` by fits to drawn noise.
"""

import itertools
import sys
import time
from typing import Any

import numpy as np
from scipy.optimize import minimize

from lumigraph.information import Bounds, Light, bounds, trials
from lumigraph.instruments import FocusedPlenopticCamera
from lumigraph.units import mm, nm, um

MIDDLE, FOCAL_LENGTH, STOP = 120 * mm, 60 * mm, 8 * mm
"""Of the volume, from the main lens; of the main lens."""

DEPTHS = np.linspace(-10, 10, 4) * mm
"""From the middle."""

BETWEEN = np.array([-9, -6, 0, 6, 9]) * mm
LIGHT, PLACES, OTHERS = Light(20_000), 2, range(3, 5)
HELD_OUT = ((-0.13, 0.04, 8.0), (0.05, -0.11, -7.0))
"""Points (y, x, and depth from the middle) whose depth is fitted [mm]."""
DRAWS = 200

AROUND: dict[str, tuple[float, float]] = {
    "across": (3.0, 3.6), "pitch": (0.36, 0.5), "magnification": (0.1, 0.2), "sharp": (1.7, 3.3),
}  # fmt: skip
"""Of the sweep around the best camera without a mask: lenslets across that see a point in focus, their pitch,
magnifications, and how far beyond the middle of the volume cameras are sharp [mm]."""

REGULAR: dict[str, Any] = {"across": 3.3, "pitch": 0.45, "magnification": 0.15, "sharp": 2.5}
MASKED: dict[str, Any] = {
    "across": 1.3, "pitch": 0.36, "magnification": 0.2, "sharp": 2.2, "mask": {6: -5.0, 12: 1.15},
}  # fmt: skip


def camera(
    across: float, pitch: float, magnification: float, sharp: float, mask: dict[int, float] | None = None
) -> FocusedPlenopticCamera:
    """With so many lenslets across that see a point in focus; lengths in mm, the mask in waves rms (Noll)."""
    distance = MIDDLE + sharp * mm
    image = 1 / (1 / FOCAL_LENGTH - 1 / distance)
    behind = across * pitch * mm * image / (STOP - across * pitch * mm)
    return FocusedPlenopticCamera(
        wavelength=633 * nm,
        object_distance=distance,
        main_lens={"focal_length": FOCAL_LENGTH, "diameter": STOP, "aberrations": mask or {}},
        lenslets={
            "pitch": pitch * mm, "focal_length": behind * magnification / (1 + magnification),
            "count": (39, 39), "magnification": magnification,
        },
        sensor={"pixel_pitch": 3.4 * um, "read_noise": 1.5},
    )  # fmt: skip


def judged(design: dict[str, Any], depths: np.ndarray, places: int | range = PLACES) -> Bounds:
    """Bounds at depths from the middle of the volume."""
    return bounds(camera(**design), (depths - design["sharp"] * mm).tolist(), LIGHT, places=places)


def said(design: dict[str, Any], found: Bounds) -> str:
    """One line."""
    each = ", ".join(f"{one / um:.1f}" for one in found.of("depth"))
    return f"{found.depth / um:.2f} µm ({each}), across {found.lateral / um:.3f} µm: {design}"


def sweep() -> None:
    """Print bounds of cameras without a mask: the best, and others that differ from it in one number."""
    began = time.process_time()
    for design in (REGULAR, *(REGULAR | {key: one} for key, both in AROUND.items() for one in both)):
        print(said(design, judged(design, DEPTHS)), f"{time.process_time() - began:.0f} CPU s", flush=True)


def search(evaluations: int = 24) -> None:
    """Print what a simplex finds of the mask, and of where the camera is sharp, at one place a depth."""
    began = time.process_time()

    def value(at: np.ndarray) -> float:
        design = {**MASKED, "sharp": float(at[0]), "mask": {6: float(at[1]), 12: float(at[2])}}
        found = judged(design, DEPTHS, 1)
        print(said(design, found), f"{time.process_time() - began:.0f} CPU s", flush=True)
        return found.depth / um

    start = np.array([2.2, -4.6, 1.1])
    simplex = start + np.array([[0, 0, 0], [-0.7, 0, 0], [0, 1.2, 0], [0, 0, 0.3]])
    minimize(value, start, method="Nelder-Mead", options={"maxfev": evaluations, "initial_simplex": simplex})


def compare() -> None:
    """Print bounds of what was found, at other places and depths."""
    for design in (REGULAR, MASKED):
        print(said(design, judged(design, DEPTHS, OTHERS)), flush=True)
        print("  between", said(design, judged(design, BETWEEN, OTHERS)), flush=True)


def fits() -> None:
    """Print errors of fits to drawn noise."""
    for (y, x, depth), design in itertools.product(HELD_OUT, (REGULAR, MASKED)):
        place = (y * mm, x * mm, (depth - design["sharp"]) * mm)
        found = trials(camera(**design), place, LIGHT, draws=DRAWS, rng=np.random.default_rng(2))
        print(
            f"at {depth:g} mm: bound {found.bounds[2] / um:.2f} µm, fits {found.rms[2] / um:.2f} ± "
            f"{found.rms_error[2] / um:.2f} µm: {design}", flush=True,
        )  # fmt: skip


if __name__ == "__main__":
    {"sweep": sweep, "search": search, "fits": fits}.get(" ".join(sys.argv[1:]), compare)()
