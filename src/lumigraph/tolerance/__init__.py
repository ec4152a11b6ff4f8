"""Manufacturing tolerances: cameras as built, the effect of each tolerance, and Monte Carlo trials.

- `lumigraph.instruments.Tolerance`: the error of a value; camera files have them in ``[tolerances]``.
- `making`: `built`, the camera with given errors; `drawn`, `cameras`: random errors, and such cameras.
- `measures`: results of a camera as built beside those of its description; `single`: effects of single
  lenslets that differ.
- `study`: many random cameras (`trials`) beside first-order sensitivities, a `Study` with an `Outcome` for
  each measure.
"""

from lumigraph.tolerance.making import built, cameras, drawn
from lumigraph.tolerance.measures import measures
from lumigraph.tolerance.outcome import Outcome
from lumigraph.tolerance.study import Study, study
from lumigraph.tolerance.trials import Trials

__all__ = ["Outcome", "Study", "Trials", "built", "cameras", "drawn", "measures", "study"]
