"""The camera that does something best, of all that can be made: `optimise`.

- `optimise`: `optimise` and its result, an `Optimum`
- `goals`: what is made best: bounds of a point's place, or a number of the description
- `space`: what may change, and which cameras that gives
- `evaluations`: each camera once, noted in a ledger, so that a search goes on after a kill
- `tried`: what fits and reconstructions reach in drawn noise, beside what was expected
- `search`: a grid, then downhill from its best, or over all of the ranges
- `gradient`: downhill by derivatives, of what has some
- `front`: the cameras that no other beats in both of two goals
- `mask`: `depth_mask`, a phase in the pupil that leaves detail alike over a range of defocus
"""

from lumigraph.optimisation.goals import Goal
from lumigraph.optimisation.mask import DepthMask, depth_mask
from lumigraph.optimisation.optimise import Optimum, optimise

__all__ = ["DepthMask", "Goal", "Optimum", "depth_mask", "optimise"]
