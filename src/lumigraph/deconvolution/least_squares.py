r"""Least squares: for noise that is alike in all pixels, and for series where a step must be cheap.

.. math:: \min_{o \ge 0}\; \tfrac12 \sum w\,(v A o + b - r)^2 + \lambda \bar s\, \bar L \sum |\nabla o|
"""

import math
from dataclasses import dataclass

import numpy as np

from lumigraph.core import arrays, checks
from lumigraph.core.arrays import Array
from lumigraph.deconvolution.methods import State, check_start
from lumigraph.deconvolution.problem import Problem
from lumigraph.deconvolution.total_variation import TotalVariation

_POWERS = 6
"""Applications of AᵀA whose last bounds its largest eigenvalue."""


@dataclass(frozen=True, slots=True, eq=False)
class LeastSquares:
    """FISTA: gradient steps with momentum, kept positive.

    Parameters
    ----------
    prior
        `TotalVariation`; its strength is relative to the steepest direction of AᵀA and the mean intensity.
    start
        First estimate (y, x) or (z, y, x); an even object if left out.

    Raises
    ------
    GeometryError
        A start with negative or NaN values.

    References
    ----------
    A. Beck & M. Teboulle, SIAM J. Imaging Sci. 2, 183 (2009).
    """

    prior: TotalVariation | None = None
    start: Array | None = None

    def __post_init__(self) -> None:
        check_start(self.start)
        if self.prior is not None:
            checks.instance("prior", self.prior, TotalVariation)

    def step(self, problem: Problem, state: State) -> State:
        """The next state: one application of Aᵀ and one of A."""
        memory = dict(state.memory)
        if "bound" not in memory:
            bound = largest_eigenvalue(problem, state.estimate)
            memory |= {"bound": _scalar(bound, state), "pace": _scalar(1.0, state), "last": state.estimate}
        xp, bound, pace = arrays.namespace(state.estimate), float(memory["bound"]), float(memory["pace"])
        moved = state.estimate - problem.scale.back(state.model - problem.data) / bound
        found = xp.where(moved > 0, moved, xp.zeros_like(moved))
        if self.prior is not None:
            metric = xp.zeros_like(found) + problem.level
            found, kept = self.prior.smoothed(problem, moved, metric, memory.get("dual"))
            memory |= kept
        faster = (1 + math.sqrt(1 + 4 * pace**2)) / 2
        ahead = found + (pace - 1) / faster * (found - memory["last"])
        ahead = xp.where(ahead > 0, ahead, xp.zeros_like(ahead))
        memory |= {"last": found, "pace": _scalar(faster, state)}
        return State.at(problem, ahead, memory, state.done + 1)


def largest_eigenvalue(problem: Problem, like: Array) -> float:
    """An upper bound, tight after a few powers, of the largest eigenvalue of Aᵀ v w v A.

    For a matrix B without negative entries and any x > 0 it is at most max (B x)/x (Collatz-Wielandt).
    """
    xp, scale = arrays.namespace(like), problem.scale
    vector, bound = xp.ones_like(like), np.inf
    for _ in range(_POWERS):
        image = scale.operator.forward(vector)
        following = scale.back(image if scale.response is None else image * scale.response)
        bound = min(bound, float(xp.max(following / vector)))
        vector = following / xp.max(following) + 1e-6
    return bound


def _scalar(value: float, state: State) -> Array:
    return arrays.like(np.asarray(value), state.estimate)
