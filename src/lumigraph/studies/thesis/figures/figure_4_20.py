"""Figure 4.20: the refocus factor of a defocused object."""

import numpy as np

from lumigraph import plots
from lumigraph.design import plenoptic1
from lumigraph.instruments import PlenopticCamera
from lumigraph.studies.thesis.registry import (
    Context,
    ExperimentOutcome,
    ResultRow,
    closed_forms,
    experiment,
)
from lumigraph.units import mm

_PRINTED = {
    -50 * mm: (0.738, 0.7368),
    -25 * mm: (0.8837, 0.8837),
    25 * mm: (1.0943, 1.0943),
    50 * mm: (1.1724,) * 2,
}


@experiment(
    "figure-4.20",
    "Refocus factor against defocus",
    question="Which α' = F/F' brings an object at Δz from the focused plane into focus?",
    thesis="Figure 4.20, equations 4.12 to 4.14",
    shows="A curve of the refocus factor over defocus, which rises from below 1 to above it, faster on the "
    "near side.",
    camera="thesis-plenoptic-1",
)
def run(context: Context) -> ExperimentOutcome:
    """The lens equation, and its inverse."""
    camera = PlenopticCamera.from_catalogue("thesis-plenoptic-1")
    f, z1 = camera.main_lens.focal_length, camera.object_distance
    rows = [
        ResultRow(f"α' at {dz / mm:+.0f} mm", camera.alpha(dz), "", printed, right, 1e-4)
        for dz, (printed, right) in _PRINTED.items()
    ]
    rows += [
        ResultRow(
            f"defocus of α' = {camera.alpha(dz):.4f}",
            plenoptic1.defocus(f, z1, camera.alpha(dz)) / mm,
            "mm",
            None,
            dz / mm,
            1e-9,
        )
        for dz in (-50 * mm, 50 * mm)
    ]
    defocus = np.linspace(-100, 100, 201)
    alphas = [camera.alpha(dz * mm) for dz in defocus]
    figure = plots.curves(
        defocus, {"α' = (2f + 2Δz) / (2f + Δz)": alphas}, xlabel="defocus [mm]", ylabel="α'"
    )
    return ExperimentOutcome(
        closed_forms(rows),
        ((figure, "4.20: the factor changes quickly before the focused plane and slowly behind it"),),
        why="In 4.14 the factor s of the defocus is printed without a value: it is 2.",
    )
