"""Search for the camera that reaches a goal best, of all that can be made: `optimise`.

- `optimise`: `optimise` and its result, an `Optimum`
- `goals`: bounds of a point's place, errors of scenes, or a number of the description; `space`: what may vary
- `evaluations`: each camera once, noted in a ledger, so that a search can be resumed
- `search`, `gradient`: a grid, then downhill from its best, or over all of the ranges; by derivatives
- `tried`: errors of fits and reconstructions in drawn noise, beside the expected ones
- `front`: the cameras that no other beats in both of two goals
- `mask`: `depth_mask`, a phase in the pupil that leaves detail alike over a range of defocus
"""

from lumigraph.studies.optimisation.goals import Goal
from lumigraph.studies.optimisation.mask import depth_mask
from lumigraph.studies.optimisation.optimise import optimise

__all__ = ["Goal", "depth_mask", "optimise"]


def __dir__() -> list[str]:
    return __all__
