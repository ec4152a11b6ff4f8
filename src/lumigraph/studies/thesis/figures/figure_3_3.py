"""Diffraction patterns of a pupil by each method."""

import numpy as np

from lumigraph.core.grid import Grid
from lumigraph.plots import curves
from lumigraph.studies.thesis.figures import _pupil
from lumigraph.studies.thesis.registry import Context, ExperimentOutcome, ResultRow, experiment
from lumigraph.units import mm

DISTANCES = (1.0, 4.0, 7.0, 10.0)
MOST = {"band limited, window doubled": 0.02, "zoom": 1e-3}
"""Largest difference from the exact intensity, which is 1 before diffraction; every other method has 0.02 and
more, the doubled window three times the zoom's limit."""

WHY = (
    "The fringes of the corrected method are not all diffraction: half of the band that it keeps is aliased. "
    "A doubled window has neither noise nor loss."
)


@experiment(
    "figure-3.3",
    "Diffraction patterns of a pupil",
    question="What does the cross section of the diffraction pattern look like by each method?",
    thesis="Figure 3.3",
    shows="Diffraction patterns of a pupil by three methods: the plain one is noisy far away, the "
    "band-limited one loses fringes.",
)
def run(context: Context) -> ExperimentOutcome:
    """Rows through the middle of the window, and the exact integral."""
    rows, figures = [], []
    distances = (10.0,) if context.quick else DISTANCES
    for step, z in enumerate(distances):
        context.progress(step / len(distances), f"{z:g} m")
        drawn = {}
        for name in _pupil.METHODS:
            x, cut = _cut(name, z)
            drawn[name] = (x / mm, cut)
            error = float(np.abs(cut - _pupil.exact_profile(z)(np.abs(x))).max())
            most = MOST.get(name)
            rows.append(
                ResultRow(f"largest error of the intensity, {name}, {z:g} m", error,
                    expected=None if most is None else 0.0, tolerance=most)
            )  # fmt: skip
        x = np.linspace(-5 * mm, 5 * mm, 1501)
        drawn["exact"] = (x / mm, _pupil.exact_profile(z)(np.abs(x)))
        figures += [(_figure(drawn, z), f"Cross sections at {z:g} m")]
    return ExperimentOutcome(tuple(rows), tuple(figures), WHY)


def _cut(name: str, distance: float) -> tuple[np.ndarray, np.ndarray]:
    """Positions [m] and intensity of the row through the middle."""
    if name == "zoom":  # the whole plane: towards a single row it would take fewer frequencies
        found = _pupil.image(name, distance)
        return found.grid.x, found.intensity[found.grid.shape[0] // 2]
    row = Grid((1, _pupil.WINDOW.shape[1]), _pupil.WINDOW.pitch)
    return row.x, _pupil.image(name, distance, row).intensity[0]


def _figure(drawn: dict, distance: float):
    shown = {name: drawn[name] for name in ("angular spectrum", "corrected band limited")}
    shown |= {
        name: drawn[name] for name in ("band limited (circle)", "band limited, window doubled", "exact")
    }
    return curves([], shown, xlabel="x [mm]", ylabel="intensity", title=f"{distance:g} m")
