"""Manufacturing tolerances: cameras as built, the effect of each tolerance, and Monte Carlo trials.

- `lumigraph.instruments.Tolerance`: the error of a value; camera files have them in ``[tolerances]``.
- `making`: `built`, the camera with given errors; `drawn`, `cameras`: random errors, and such cameras.
- `measures`: results of a camera as built beside those of its description; `single`: effects of single
  lenslets that differ.
- `study`: many random cameras (`trials`) beside first-order sensitivities, a `Study` with a
  `ToleranceOutcome` for each measure.
"""

from lumigraph.studies.tolerance.making import built, cameras, drawn
from lumigraph.studies.tolerance.measures import measures
from lumigraph.studies.tolerance.study import study

__all__ = ["built", "cameras", "drawn", "measures", "study"]


def __dir__() -> list[str]:
    return __all__
