"""The camera that does something best, of all that can be made: `optimise`.

- `optimise`: `optimise` and its result, an `Optimum`
- `goals`: what is made best: bounds of a point's place, or a number of the description
- `space`: what may change, and which cameras that gives
- `evaluations`: each camera once, noted in a ledger, so that a search goes on after a kill
- `search`: a grid, then downhill from its best, or over all of the ranges
"""

from lumigraph.optimisation.goals import Goal
from lumigraph.optimisation.optimise import Optimum, optimise

__all__ = ["Goal", "Optimum", "optimise"]
