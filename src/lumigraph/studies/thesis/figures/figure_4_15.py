"""Figures 4.13 to 4.16: refocusing shears phase space, and keeps its light."""

import numpy as np

from lumigraph import plots
from lumigraph.core.lightfield import LightField
from lumigraph.design import ray_matrices
from lumigraph.rendering import decode, refocus
from lumigraph.studies.thesis.figures import table_4_1
from lumigraph.studies.thesis.registry import Context, ExperimentOutcome, ResultRow, experiment
from lumigraph.units import mm

_DEPTHS = (-50 * mm, 50 * mm)


@experiment(
    "figure-4.15",
    "Refocusing is a shear",
    question="What does refocusing do to the line of a point in phase space, and does light get lost?",
    thesis="Figures 4.13 to 4.16, equations 4.6 to 4.10",
    shows="A slanted line in phase space becomes another by a shear, with the same area.",
    camera="thesis-plenoptic-1",
)
def run(context: Context) -> ExperimentOutcome:
    """Views moved by u (1 - α'), each as a whole; the sheared line's slope, its light, and its rendering."""
    camera = table_4_1.camera(context)
    rows, panels = [], []
    for number, dz in enumerate(_DEPTHS):
        context.progress(number / 2, f"point at {dz / mm:+.0f} mm")
        views = decode(table_4_1.point(camera, dz), camera.calibration)
        alpha = camera.alpha(dz)
        before, what = phase_space(views), f"at {dz / mm:+.0f} mm"
        behind = sheared(views, before, alpha)
        first, left = (_slope(views, one) for one in (before, behind))
        picture = np.asarray(refocus(views, alpha, oversample=1, interpolation="linear")).sum(0)
        rendered = behind.sum(0)
        difference = np.abs(picture / picture.sum() - rendered / rendered.sum()).max()
        rows += [
            ResultRow(
                f"light of the sheared phase space over the first, {what}", behind.sum() / before.sum(),
                "", 1.0, 1.0, 1e-3, "det A = 1: areas stay",
            ),
            ResultRow(
                f"change of the line's slope, {what}", first - left, "", None, 1 - alpha, 0.005,
                "1 - α'; the light's mean place in each direction",
            ),
            ResultRow(
                f"slope that is left, {what}", left, note="diffraction: beyond upright",
            ),
            ResultRow(
                f"picture by `refocus` less the sum of the sheared directions, {what}", float(difference),
                "", None, 0.0, 2e-3, "summed along y, of all light",
            ),
        ]  # fmt: skip
        panels += [(_wide(before), f"{what}"), (_wide(behind), f"sheared, α' = {alpha:.4f}")]
    shear = ray_matrices.free_space(1.0)
    rows.append(
        ResultRow(
            "determinant of a shear", float(np.linalg.det(shear)), "", 1.0, 1.0, 1e-12, kind="closed form"
        )
    )
    return ExperimentOutcome(
        tuple(rows), ((plots.images(panels, columns=2, cmap="magma"),
            "4.15: directions u over places x, before and after the shear"),),
        why="4.9 and 4.10 are printed with 1/α'; with α' = F/F' of 4.7 the shear is x' α' + u (1 - α').",
    )  # fmt: skip


def phase_space(views: LightField) -> np.ndarray:
    """Radiance (u, x), summed over the other direction and place."""
    return np.asarray(views.data, float).sum((0, 2))


def sheared(views: LightField, radiance: np.ndarray, alpha: float) -> np.ndarray:
    """Phase space (u, x) with each direction moved by u (1 - α')."""
    u, x = views.aperture.x, views.lenslets.x
    rows = [
        np.interp(x + at * (1 - alpha), x, row, left=0, right=0) for at, row in zip(u, radiance, strict=True)
    ]
    return np.stack(rows)


def _slope(views: LightField, epi: np.ndarray) -> float:
    """Inclination dx/du of a phase space's light, from its mean place in each direction."""
    light = epi.sum(1)
    place = epi @ views.lenslets.x / np.maximum(light, 1e-12)
    u = views.aperture.x
    return float((light * u * place).sum() / (light * u * u).sum())


def _wide(epi: np.ndarray) -> np.ndarray:
    middle = epi.shape[1] // 2
    return np.repeat(epi[:, middle - 9 : middle + 10], 2, 1)
