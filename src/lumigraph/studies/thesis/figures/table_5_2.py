"""Table 5.2: the distances a and b and the main lens' diameter of three magnifications."""

from lumigraph.studies.thesis.figures.point_images import MAGNIFICATIONS, camera
from lumigraph.studies.thesis.registry import (
    Context,
    ExperimentOutcome,
    ResultRow,
    closed_forms,
    experiment,
)

_PRINTED = {0.5: (15.6, 7.8, 2.3), 0.3: (22.5, 6.8, 2.7), 0.25: (26.0, 6.5, 2.8)}
_EXACT = {0.5: (15.6, 7.8, 2.3077), 0.3: (22.5333, 6.76, 2.6627), 0.25: (26.0, 6.5, 2.7692)}


@experiment(
    "table-5.2",
    "Distances and apertures of three magnifications",
    question="Which distances a and b, and which main lens, give lenslet magnifications 0.5, 0.3 and 0.25?",
    thesis="Table 5.2, equations 5.13 to 5.15",
    shows="Distances a and b and main lenses for magnifications of 0.5, 0.3 and 0.25, to a tenth of a "
    "millimetre.",
    camera="thesis-plenoptic-2-m050",
)
def run(context: Context) -> ExperimentOutcome:
    """The camera files, whose values must be those of Table 5.2."""
    rows = []
    for m in MAGNIFICATIONS:
        found = camera(m, 39)
        values = found.relay_distance, found.lenslet_distance, found.pupil_diameter
        for name, value, printed, exact in zip(
            ("a", "b", "main lens D"), values, _PRINTED[m], _EXACT[m], strict=True
        ):
            rows.append(ResultRow(f"{name}, m = {m:g}", value * 1e3, "mm", printed, exact, 0.001))
    return ExperimentOutcome(
        closed_forms(rows),
        why="The thesis rounds to 0.1 mm. Table 5.1 prints lenslets of 5.3 mm; Table 5.2 belongs to 5.2 mm.",
    )
