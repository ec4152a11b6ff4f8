"""Figure 5.10: the Airy disc of the main lens, its lobe and the light in it."""

import math

import numpy as np
from scipy.special import j0, j1

from lumigraph.analysis import encircled_energy, first_zero
from lumigraph.core.grid import Grid
from lumigraph.plots.curves import curves
from lumigraph.scene import targets
from lumigraph.simulation import simulate
from lumigraph.studies.thesis.figures.point_images import camera, main_lens_camera
from lumigraph.studies.thesis.registry import Context, ExperimentOutcome, ResultRow, experiment

_ZERO = 3.8317059702075125  # of J1


@experiment(
    "figure-5.10",
    "The Airy disc",
    question="How wide is the central lobe of a point behind the main lens, and how much light does it hold?",
    thesis="Figure 5.10, equation 5.16",
    shows="A cross section of Airy's disc, whose central lobe is the resolution, with approximately 90 % of "
    "the light.",
    camera="thesis-plenoptic-2-m050",
)
def run(context: Context) -> ExperimentOutcome:
    """A point's image behind the main lens of Table 5.1, on ever finer pixels than the lobe is wide."""
    alone = main_lens_camera(camera(0.5, 3), pixels=401 if context.quick else 1201)
    alone = alone.replace(sensor={"pixel_pitch": 2e-6})
    image = np.asarray(simulate(alone, targets.points([(0.0, 0.0)])).data, float)
    grid, f_number = alone.sensor.grid, alone.f_number
    profile, middle = image[grid.shape[0] // 2], Grid(grid.shape, grid.pitch)
    lobe = 2 * first_zero(grid.x, profile)
    right = 2 * _ZERO / math.pi * alone.wavelength * f_number
    window = 1 - _outside(grid.size[0] / 2 * math.pi / (alone.wavelength * f_number))
    inside = encircled_energy(image, middle, right / 2, (0.0, 0.0)) * window
    rows = (
        ResultRow(
            "central lobe", lobe * 1e6, "µm", 2.44 * alone.wavelength * f_number * 1e6, right * 1e6, 0.2
        ),
        ResultRow(
            "light in the central lobe",
            inside,
            "",
            0.9,
            1 - _outside(_ZERO),
            0.002,
            "1 - J0²(3.83) - J1²(3.83), less what falls beside the sensor",
        ),
    )
    near = np.abs(grid.x) < 2 * right
    airy = {"behind the main lens": profile[near] / profile.max()}
    figure = curves(
        grid.x[near] * 1e6, airy, xlabel="x in the main-lens image [µm]", ylabel="intensity",
        marks={"zero": right * 5e5, " zero": -right * 5e5},
    )  # fmt: skip
    return ExperimentOutcome(
        rows, ((figure, "A point's image and its first zeros (5.10)."),),
        why="The lobe holds 83.8 % of the light, not approximately 90 %.",
    )  # fmt: skip


def _outside(v: float) -> float:
    """Part of an Airy pattern's light beyond the radius v λF#/π: J0² + J1² (Born and Wolf, section 8.5.2)."""
    return float(j0(v) ** 2 + j1(v) ** 2)
