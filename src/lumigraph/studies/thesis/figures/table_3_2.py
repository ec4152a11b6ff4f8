"""Noise of each method: variance of a point's image against the Airy pattern, and its cost."""

import numpy as np

from lumigraph.plots import curves
from lumigraph.studies.thesis.figures import _two_f as two_f
from lumigraph.studies.thesis.registry import Context, ExperimentOutcome, ResultRow, experiment
from lumigraph.units import um

THESIS = {
    "angular spectrum": 0.0012,
    "band limited (circle)": 0.00054646,
    "corrected band limited": 0.00056632,
}
LIMITED = ("band limited (circle)", "band limited", "band limited, padded")
MOST = 4e-9
"""Variance that a band-limited method stays below; aliased light gives 1e-6 and more."""

WHY = (
    "The printed variances are those of another Airy pattern: with the right diameter (see table 3.1) the "
    "band-limited methods agree with theory to 1e-9. A pinhole of 10 µm, two samples wide, is no point: its "
    "own image, by Airy amplitudes of its samples, is 2e-8 away from an Airy pattern."
)


@experiment(
    "table-3.2",
    "Noise and cost of each propagation method",
    question="How far is a point's image from the Airy pattern, and how long does it take?",
    thesis="Table 3.2 and section 3.3.2",
    shows="Variances of .0012 by the angular spectrum, and of half as much by the band-limited methods.",
    camera=two_f.CAMERA,
)
def run(context: Context) -> ExperimentOutcome:
    """Variance of the row through the middle, as in the thesis, and seconds for two propagations."""
    rows, errors, times = [], {}, {}
    x = two_f.GRID.x
    right, airy = two_f.pinhole_image(), two_f.airy(x)
    names = [name for name in two_f.METHODS if not (context.quick and name.startswith("multi"))]
    for step, name in enumerate(names):
        context.progress(step / len(names), name)
        image, times[name] = two_f.point_image(name, two_f.DIAMETER, two_f.PINHOLE)
        errors[name] = np.abs(two_f.profile(image) - right)
        limited = name in LIMITED
        rows += [
            ResultRow(
                f"variance against Airy, {name}",
                float(np.var(two_f.profile(image) - airy)),
                thesis=THESIS.get(name),
                note="" if limited else "aliased light",
            ),
            ResultRow(
                f"variance against the pinhole's own image, {name}",
                float(np.var(two_f.profile(image) - right)),
                expected=0.0 if limited else None,
                tolerance=MOST if limited else None,
            ),
        ]
    rows += [ResultRow(f"time of one image, {name}", seconds, "s") for name, seconds in times.items()]
    rows += _cost(times)
    near = two_f.middle(500 * um)
    figure = curves(
        x[near] / um,
        {name: two_f.clipped(error[near], 1e-9) for name, error in errors.items()},
        xlabel="x [µm]",
        ylabel="|intensity - Airy|",
        log=True,
    )
    return ExperimentOutcome(tuple(rows), ((figure, "Distance of each method from the Airy pattern"),), WHY)


def _cost(times: dict[str, float]) -> list[ResultRow]:
    """Multi-step needs 8 + 2 transforms of each axis where the others need two: never the quickest."""
    if "multi-step Fresnel" not in times:
        return []
    ratio = times["multi-step Fresnel"] / times["angular spectrum"]
    return [ResultRow("time of multi-step over angular spectrum", ratio, thesis="slow")]
