"""What errors of making do to a camera: cameras as built, how much each tolerance costs, and by chance.

- `lumigraph.instruments.Tolerance`: how far a value may be off; camera files have them in ``[tolerances]``.
- `built`: the camera with errors, all else where its description puts it; `drawn`, `cameras`: errors, and
  cameras, by chance (`making`).
- `measures`: what follows from a camera as built beside what was meant; `single`: what single lenslets do to
  it that differ.
- `study`: many cameras drawn by chance (`trials`) beside first-order sensitivities, a `Study` with an
  `Outcome` for each measure.
"""

from lumigraph.tolerance.making import built, cameras, drawn
from lumigraph.tolerance.measures import measures
from lumigraph.tolerance.outcome import Outcome
from lumigraph.tolerance.study import Study, study
from lumigraph.tolerance.trials import Trials

__all__ = ["Outcome", "Study", "Trials", "built", "cameras", "drawn", "measures", "study"]
