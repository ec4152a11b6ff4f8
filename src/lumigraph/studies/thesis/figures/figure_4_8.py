"""Figures 4.6 to 4.8: another aperture and another point of view, after the exposure."""

import os
from pathlib import Path

import numpy as np

from lumigraph import io, plots
from lumigraph.calibration import calibrate, devignette
from lumigraph.core.grid import Grid
from lumigraph.core.lightfield import LightField
from lumigraph.core.raw import RawImage
from lumigraph.depth.from_focus import sharpness
from lumigraph.instruments import PlenopticCamera
from lumigraph.rendering import decode, reduce_aperture, refocus
from lumigraph.scene import Scene, targets
from lumigraph.simulation import simulate
from lumigraph.studies.thesis.figures import table_4_1
from lumigraph.studies.thesis.registry import Context, ExperimentOutcome, ResultRow, experiment
from lumigraph.units import mm, um

_DZ = -50 * mm
_FRACTIONS = (1.0, 0.5, 0.05)
_REAL = ("letters_plenoptic1", "letters_ULF_M1.png", "letters_ULF_M1_white.png")


@experiment(
    "figure-4.8",
    "Aperture and point of view, changed after the exposure",
    question="What does a picture gain in depth of field, and what does it lose, when only some directions "
    "are summed; and how do the points of view differ?",
    thesis="Figures 4.6 to 4.8, equations 4.4 and 4.5",
    shows="An onion skin rendered from all directions, blurred, and from central pixels alone, sharp at all "
    "depths.",
    camera="thesis-plenoptic-1",
)
def run(context: Context) -> ExperimentOutcome:
    """A defocused point, a scene of two depths, and a real raw image where LUMIGRAPH_DATA has one."""
    camera = table_4_1.camera(context)
    context.progress(0.0, "defocused point")
    views = decode(table_4_1.point(camera, _DZ), camera.calibration)
    rows = [*_aperture_rows(camera, views), *_view_rows(camera, views)]
    context.progress(0.1, "scene of two depths")
    figures = [
        _figure(_scene_views(context), "simulated stars, 25 mm before (left) and 30 mm behind (right)")
    ]
    if (folder := _real_folder()) is not None:
        context.progress(0.9, "real letters")
        real, pitch = _real_views(folder)
        rows.append(
            ResultRow(
                "real camera, lenslet pitch", pitch / um, "µm", None, 297.3, 0.2, note="the maker says 300"
            )
        )
        figures.append(_figure(real, "a real plenoptic 1.0 picture of letters at three depths"))
    return ExperimentOutcome(
        tuple(rows), tuple(figures),
        why="By ray optics blur shrinks with the aperture; but one pixel of a micro-image holds λ/p of "
        "directions, a third of all, so that even the central pixel alone is no pinhole. The sums of 4.4 and "
        "4.5 run over N, not N + 1 pixels; the printed figure shows an onion skin, whose data are not here.",
    )  # fmt: skip


def _aperture_rows(camera: PlenopticCamera, views: LightField) -> list[ResultRow]:
    """Area that a defocused point covers, for the whole aperture, half of it and the central view."""
    disc = np.pi / 4 * ((1 - camera.alpha(_DZ)) * camera.pupil_diameter / camera.lenslets.pitch) ** 2
    areas, light = [], []
    for fraction in _FRACTIONS:
        kept = reduce_aperture(views, fraction)
        areas.append(1 / float(sharpness(refocus(kept, 1.0, oversample=1)[None])[0]))
        light.append(float(kept.data.sum() / views.data.sum()))
    return [
        ResultRow(
            "area of a point at -50 mm, whole aperture",
            areas[0],
            "lenslets",
            None,
            disc,
            0.2 * disc,
            note="expected: the disc of ray optics",
        ),
        ResultRow(
            "area with half the aperture, over the whole",
            areas[1] / areas[0],
            "",
            "smaller",
            0.6,
            0.05,
            note="ray optics: 1/4; a third of the directions are mixed by diffraction",
            kind="told",
        ),
        ResultRow(
            "area with the central view, over the whole",
            areas[2] / areas[0],
            "",
            "pinhole",
            0.185,
            0.015,
            kind="told",
        ),
        ResultRow(
            "light with half the aperture, over the whole", light[1], "", "less", 0.35, 0.03, kind="told"
        ),
        ResultRow("light with the central view, over the whole", light[2], "", "noisier"),
    ]


def _view_rows(camera: PlenopticCamera, views: LightField) -> list[ResultRow]:
    """Shift of a defocused point between points of view (4.5), over ray optics' (1 - α') Δu."""
    u, x = views.aperture.x, views.lenslets.x
    first, last = len(u) // 4, len(u) - 1 - len(u) // 4
    left, right = (np.maximum(views.data[:, k].mean((0, 1)), 0) for k in (first, last))
    moved = (right @ x) / right.sum() - (left @ x) / left.sum()
    rays = (1 - camera.alpha(_DZ)) * (u[last] - u[first])
    return [
        ResultRow("shift between two points of view", moved / um, "µm"),
        ResultRow("shift between them over ray optics'", moved / rays, "", "moves",
            note="below 1: diffraction brings a part of every direction into every pixel"),
    ]  # fmt: skip


def _stars(grid: Grid) -> Scene:
    width = grid.size[1]
    near = targets.siemens_star(grid, 8, 0.42 * width, (0.0, -0.24 * width)).at(-25 * mm)
    return near + targets.siemens_star(grid, 8, 0.42 * width, (0.0, 0.24 * width)).at(30 * mm)


def _scene_views(context: Context) -> LightField:
    camera = table_4_1.camera(context, (19, 75))
    raw = context.cached("stars", lambda: simulate(camera, _stars(camera.object_grid)).data)
    return decode(raw, camera.calibration, directions=15)


def _real_folder() -> Path | None:
    folder = os.environ.get("LUMIGRAPH_DATA")
    if not folder or not all((Path(folder) / _REAL[0] / name).exists() for name in _REAL[1:]):
        return None
    return Path(folder) / _REAL[0]


def _real_views(folder: Path) -> tuple[LightField, float]:
    """Light field of the letters and the pitch of its lenslets [m]."""
    raw, white = (io.open(folder / name, RawImage) for name in _REAL[1:])
    calibration = calibrate(white, pixel_pitch=6.45 * um, separation=400 * mm, lenslet_distance=18.6 * mm)
    views = decode(devignette(raw, white), calibration)
    return views, float(np.mean(views.lenslets.pitch))


def _figure(views: LightField, what: str) -> tuple[object, str]:
    """The whole aperture, the central view, and two points of view."""
    middle, count = views.data.shape[0] // 2, views.data.shape[1]
    sides = (count // 5, count - 1 - count // 5)
    central = views.data[middle - 1 : middle + 2, count // 2 - 1 : count // 2 + 2].mean((0, 1))
    left, right = (views.data[:, k].mean(0) for k in sides)
    pictures = [
        (refocus(views, 1.0, oversample=1), "whole aperture"), (central, "central 3 x 3 views"),
        (left, "from the left"), (right, "from the right"),
    ]  # fmt: skip
    return plots.images(pictures, columns=4), f"4.8: {what}"
