"""Figure 5.3 and equations 5.3 to 5.5: where the rendered picture shows a point."""

from dataclasses import replace

import numpy as np

from lumigraph.analysis import centroid
from lumigraph.core.calibration import Calibration
from lumigraph.core.grid import Grid
from lumigraph.core.lattice import Lattice
from lumigraph.core.raw import RawImage
from lumigraph.instruments import FocusedPlenopticCamera
from lumigraph.plots.curves import images
from lumigraph.rendering import render
from lumigraph.rendering.focused import rendered_grid
from lumigraph.scene import targets
from lumigraph.simulation import simulate
from lumigraph.studies.thesis.figures.point_images import camera
from lumigraph.studies.thesis.registry import Context, ExperimentOutcome, ResultRow, experiment

_PLACE = 1e-3
_MOST = 3.0  # um


@experiment(
    "figure-5.3",
    "Patches that tile without seams",
    question="How far from its true place does the rendered picture show a point 1 mm off the axis?",
    thesis="Figure 5.3, equations 5.3 to 5.5",
    shows="A drawing: patches cut from micro-images are turned and set side by side into a picture.",
    camera="thesis-plenoptic-2-m050",
)
def run(context: Context) -> ExperimentOutcome:
    """Light's centre of the rendered point, with the right geometry and with the printed one."""
    rows: list[ResultRow] = []
    panels = []
    for m in (0.5, 0.25):
        found = camera(m, 23 if context.quick else 39)
        raw = simulate(found, targets.points([(0.0, _PLACE, 0.0)]))
        right = render(raw, found.calibration, found.patch)
        grid = rendered_grid(found.calibration, found.patch)
        printed, wrong_grid = _printed(found, raw)
        place, wrong = _place(right, grid), _place(printed, wrong_grid)
        rows.append(ResultRow(f"error, m = {m:g}", 1e6 * (place - _PLACE), "µm", None, 0.0, _MOST))
        # Patches are as far off as the nearest lenslets' a/z2, which two of them see one pitch apart.
        expected = (
            1e6
            * _PLACE
            * found.relay_distance
            / found.image_distance
            * found.separation
            / found.image_distance
        )
        rows.append(
            ResultRow(
                f"error with the printed geometry, m = {m:g}",
                1e6 * (wrong - _PLACE),
                "µm",
                None,
                expected,
                0.06 * expected,
                note="patches are a step too far apart: ± some per cent within one",
            )
        )
        panels += [
            (_near(right, grid), f"m = {m:g}: centres x (1 + b/L), patch m p z2/L"),
            (_near(printed, wrong_grid), f"m = {m:g}: centres x (1 + b/z2), patch m p"),
        ]
    return ExperimentOutcome(
        tuple(rows),
        ((images(panels, columns=2), "A point at x = 1 mm; pictures from 0.5 to 1.5 mm."),),
        why="Equation 5.4 takes z for z + a, and 5.5 leaves z2/L out: patches overlap in what they show, and "
        "the picture is larger than the main-lens image by L/z2.",
    )


def _printed(found: FocusedPlenopticCamera, raw: RawImage) -> tuple[np.ndarray, Grid]:
    """Picture by equations 5.4 and 5.5, one lenslet's pitch p for each patch."""
    right, pixel = found.calibration, found.pixels.pixel_pitch
    pitch = found.lenslets.pitch * (1 + found.lenslet_distance / found.image_distance) / pixel
    lattice = Lattice.square(pitch, origin=(raw.shape[0] // 2, raw.shape[1] // 2))
    none = np.zeros((0, 2))
    calibration: Calibration = replace(right, lattice=lattice, indices=none, centers=none)
    patch = found.lenslet_magnification * found.lenslets.pitch / pixel
    picture = render(raw, calibration, patch)
    unknown = replace(calibration, pixel_pitch=None)
    grid = rendered_grid(unknown, patch)  # one lenslet is 1
    p = found.lenslets.pitch
    return picture, Grid(
        grid.shape, (grid.pitch[0] * p, grid.pitch[1] * p), (grid.center[0] * p, grid.center[1] * p)
    )


def _place(picture: np.ndarray, grid: Grid) -> float:
    """Place x of the light's centre within 0.3 mm of the brightest sample [m]."""
    x = grid.x - grid.x[int(np.argmax(picture.max(0)))]
    near = np.abs(x) < 3e-4
    y = np.abs(grid.y) < 3e-4
    part = np.maximum(picture[np.ix_(y, near)], 0)
    window = Grid(part.shape, grid.pitch, (0.0, float(grid.x[near][part.shape[1] // 2])))
    return centroid(part, window)[1]


def _near(picture: np.ndarray, grid: Grid) -> np.ndarray:
    part = picture[np.ix_(np.abs(grid.y) < 5e-4, np.abs(grid.x - _PLACE) < 5e-4)]
    return np.sqrt(np.maximum(part, 0))
