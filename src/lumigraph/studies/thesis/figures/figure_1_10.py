"""Figures 1.10 and 1.17: phase space of a plenoptic camera 1.0, and rendering as a sum in it."""

import numpy as np

from lumigraph import plots
from lumigraph.core.lightfield import LightField
from lumigraph.instruments import PlenopticCamera
from lumigraph.rendering import decode, refocus
from lumigraph.studies.thesis.figures import table_4_1
from lumigraph.studies.thesis.registry import Context, ExperimentOutcome, ResultRow, experiment
from lumigraph.units import mm

_DEPTHS = (0.0, -50 * mm, 50 * mm)
_COLOURS = ((0.85, 0.2, 0.15), (0.15, 0.55, 0.2), (0.15, 0.35, 0.85))
_CELL = 12  # pixels of the drawing


@experiment(
    "figure-1.10",
    "Phase space of a plenoptic camera 1.0",
    question="Which places and directions does each pixel hold, and where is a point among them?",
    thesis="Figures 1.10 and 1.17, equations 1.6 and 1.7",
    shows="Rays of points in focus, nearer and farther are lines in phase space, and pixels are its cells; "
    "a rendered pixel sums a column.",
    camera="thesis-plenoptic-1",
)
def run(context: Context) -> ExperimentOutcome:
    """Cells that the rays of three points cross, and what a simulated sensor holds there."""
    camera = table_4_1.camera(context)
    rows, pictures = [], []
    for number, dz in enumerate(_DEPTHS):
        context.progress(number / 3, f"point at {dz / mm:+.0f} mm")
        views = decode(table_4_1.point(camera, dz), camera.calibration)
        rows += _rows(camera, views, dz)
        pictures.append((_simulated(views), f"simulated, {dz / mm:+.0f} mm"))
    rays = _rays(camera)
    return ExperimentOutcome(
        tuple(rows),
        ((plots.images([(rays, "rays: u over lenslets")], columns=1),
          "1.10: cells of a point in focus (red), a nearer (green) and a farther one (blue); u downwards"),
         (plots.images(pictures, cmap="magma"),
          "1.10, 1.17: the same cells simulated; rendering sums each column into one pixel of the picture")),
        why="A point in focus fills one column, a defocused one a line of slope 1 - α' across the lenslets "
        "of its blur. Diffraction widens the lines by a third of the column's height.",
    )  # fmt: skip


def _rows(camera: PlenopticCamera, views: LightField, dz: float) -> list[ResultRow]:
    """Lenslets that the point lights along the middle row, and the picture as a sum of columns."""
    picture, light = refocus(views, 1.0, oversample=1), views.data.mean((0, 1))
    covered = abs(1 - camera.alpha(dz)) * camera.pupil_diameter / camera.lenslets.pitch
    if dz:
        seen, tolerance = _diameter(light), 0.1 * covered
    else:
        seen, covered, tolerance = float((light > 0.3 * light.max()).sum()), 1.0, 0.0
    difference = np.abs(picture - light).max() / light.max()
    return [
        ResultRow(
            f"lenslets across the blur at {dz / mm:+.0f} mm",
            seen,
            "",
            1 if dz == 0 else None,
            covered,
            tolerance,
            note="ray optics: |1 - α'| D/p, one in focus",
        ),
        ResultRow(
            f"picture less the sum of columns at {dz / mm:+.0f} mm", float(difference), "", None, 0.0, 1e-5
        ),
    ]


def _diameter(light: np.ndarray) -> float:
    """Width of a disc of lenslets: 4 standard deviations, less the variance 1/12 of sorting by lenslets."""
    across = np.where(light > 0.02 * light.max(), light, 0).sum(0)
    away, across = np.arange(len(across)), across / across.sum()
    variance = across @ away**2 - (across @ away) ** 2
    return float(4 * np.sqrt(variance - 1 / 12))


def _rays(camera: PlenopticCamera, directions: int = 15, lenslets: int = 13) -> np.ndarray:
    """Drawing (y, x, 3): cells (u, s) of which a ray of each point crosses the middle."""
    picture = np.ones((directions * _CELL, lenslets * _CELL, 3))
    u = (np.arange(directions) - directions // 2) / directions * camera.pupil_diameter
    offsets = (0, -3, 3)  # lenslets that keep the points apart
    for dz, colour, away in zip(_DEPTHS, _COLOURS, offsets, strict=True):
        x = u * (1 - camera.alpha(dz)) / camera.lenslets.pitch + away
        for row, s in enumerate(np.rint(x).astype(int) + lenslets // 2):
            if 0 <= s < lenslets:
                picture[row * _CELL : (row + 1) * _CELL, s * _CELL : (s + 1) * _CELL] = colour
    picture[::_CELL] = picture[:, ::_CELL] = 0.75
    return picture


def _simulated(views: LightField) -> np.ndarray:
    """Radiance (u, s) of the middle row of lenslets, 13 of them, with square cells."""
    s, t = views.data.shape[3] // 2, views.data.shape[2] // 2
    part = views.data[:, :, t, s - 6 : s + 7].mean(0)
    return np.repeat(np.maximum(part, 0), max(1, round(part.shape[0] / 13)), 1)
