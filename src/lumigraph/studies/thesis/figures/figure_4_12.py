"""Figures 4.10 to 4.12: a defocused point is an oblique line of phase space."""

import numpy as np

from lumigraph import plots
from lumigraph.core.lightfield import LightField
from lumigraph.rendering import decode, refocus
from lumigraph.studies.thesis.figures import table_4_1
from lumigraph.studies.thesis.registry import Context, ExperimentOutcome, ResultRow, experiment
from lumigraph.units import mm

_DEPTHS = (0.0, -80 * mm, -50 * mm, -25 * mm, 50 * mm, 100 * mm)


@experiment(
    "figure-4.12",
    "Slope of a point in phase space",
    question="How does the line of a point in phase space lean, and by how much, when it is out of focus?",
    thesis="Figures 4.10 to 4.12, section 4.4",
    shows="A point in focus is an upright line in phase space, points 0.125 and 0.25 m nearer are "
    "leaning ones.",
    camera="thesis-plenoptic-1",
)
def run(context: Context) -> ExperimentOutcome:
    """The brightest direction of each lenslet that the point lights, and a line through them."""
    camera = table_4_1.camera(context)
    rows, figures = [], []
    for number, dz in enumerate(_DEPTHS):
        context.progress(number / len(_DEPTHS), f"point at {dz / mm:+.0f} mm")
        raw = table_4_1.point(camera, dz)
        views = decode(raw, camera.calibration)
        if dz:
            # Diffraction spreads a lenslet's directions by a third of its micro-image, its lenslets' by 0.02.
            # The other sign, and the 1 - 1/α' of equation 4.10, are off by 0.03 to 1.
            rows.append(
                ResultRow(
                    f"slope dx/du at {dz / mm:+.0f} mm",
                    slope(views),
                    "",
                    "> 0" if dz < 0 else "< 0",
                    1 - camera.alpha(dz),
                    0.02,
                )
            )
        if dz in (0.0, -50 * mm, 50 * mm):
            figures.append((_panel(raw.data, views), f"4.12: a point at {dz / mm:+.0f} mm"))
    ratio = -camera.separation / camera.lenslet_distance
    rows.append(
        ResultRow(
            "slope on the raw pixels over slope on the main lens",
            ratio,
            "",
            None,
            -24.0,
            1e-9,
            kind="closed form",
        )
    )
    return ExperimentOutcome(
        tuple(rows), tuple(figures),
        why="dx/du = 1 - α' with u on the main lens; against the raw pixel's place under the lenslet the "
        "sign is the other. The printed 0.125 and 0.25 m nearer are inside the focal length.",
    )  # fmt: skip


def slope(views: LightField) -> float:
    """dx/du of a point on the axis: from a line through the brightest direction of each lit lenslet."""
    epi = views.data[:, :, views.data.shape[2] // 2].mean(0)
    light = epi.sum(0)
    lit = light > 0.25 * light.max()
    u, x = views.aperture.x, views.lenslets.x[lit]
    brightest = np.array([_vertex(column, u) for column in epi[:, lit].T])
    return float((x**2).sum() / (x * brightest).sum())


def _vertex(column: np.ndarray, u: np.ndarray) -> float:
    """Place of the highest sample, between samples by a parabola."""
    top = int(np.clip(column.argmax(), 1, len(column) - 2))
    below, at, above = column[top - 1 : top + 2]
    bend = below - 2 * at + above
    move = (below - above) / (2 * bend) if bend < 0 else 0.0
    return float(u[top] + np.clip(move, -1, 1) * (u[1] - u[0]))


def _panel(raw: np.ndarray, views: LightField) -> object:
    """Raw image, rendered image and phase space."""
    nu, ns = views.data.shape[1], views.data.shape[3]
    epi = views.data[:, :, views.data.shape[2] // 2].mean(0)
    wide = np.repeat(epi, max(1, ns // nu), 0)
    return plots.images(
        [
            (np.sqrt(raw), "raw, amplitude"),
            (refocus(views, 1.0, oversample=1), "rendered"),
            (wide, "u over x"),
        ],
        cmap="magma",
    )
