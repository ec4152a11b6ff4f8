"""Cameras that no other beats in both of two goals: a Pareto front."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from lumigraph.optimisation.evaluations import Evaluations
from lumigraph.optimisation.goals import Goal
from lumigraph.optimisation.search import Search, refined
from lumigraph.optimisation.space import Space

WEIGHTS = (0.5, 0.2, 0.8)
"""Weights of the first goal, in searches between the ends of a front."""

SLIGHT = 0.01
"""Weight of the costs' sum beside the larger one: of two cameras alike in that, the better is taken."""

Goals = tuple[Goal, Goal]
Cost = Callable[[Mapping[str, Any]], float]


@dataclass(frozen=True, slots=True)
class Towards:
    """Cameras of a search by another cost."""

    cameras: Evaluations
    by: Cost

    @property
    def rows(self) -> list[dict[str, Any]]:
        """All cameras so far."""
        return self.cameras.rows

    def cost(self, item: Mapping[str, Any]) -> float:
        """Cost of an item."""
        return self.by(self.cameras.row(item))


def front(rows: Sequence[dict[str, Any]], goals: Goals) -> list[dict[str, Any]]:
    """The rows that no other is as good as in both goals and better in one, from the best in the first on.

    >>> rows = [{"a": 1, "b": 3}, {"a": 2, "b": 2}, {"a": 2, "b": 4}, {"a": 3, "b": 1}, {"a": 4, "b": 1}]
    >>> front(rows, (Goal("a"), Goal("b")))
    [{'a': 1, 'b': 3}, {'a': 2, 'b': 2}, {'a': 3, 'b': 1}]
    """
    known = [(costs, k) for k, row in enumerate(rows) if all(map(math.isfinite, costs := _costs(row, goals)))]
    found, least = [], math.inf
    for (_, second), k in sorted(known):
        if second < least:
            found.append(rows[k])
            least = second
    return found


def trace(cameras: Evaluations, space: Space, goals: Goals, how: tuple[Search, int, int]) -> None:
    """Searches for the best of the second goal, then between the two ends.

    Between them the larger one of two weighted distances is made small, each from the best in its goal and
    over the way between the ends: that reaches hollow parts of a front, too, which weighted sums do not.

    Parameters
    ----------
    cameras, space, goals
        What is searched.
    how
        The search, evaluations at most, seed.

    References
    ----------
    K. Miettinen, "Nonlinear multiobjective optimization", Kluwer 1999, section 3.4 (weighted Chebyshev).
    """
    search, most, seed = how
    begun, aims = len(cameras.rows), (None, *WEIGHTS)
    for k, weight in enumerate(aims):
        by = goals[1].cost if weight is None else _between(front(cameras.rows, goals), goals, weight)
        items = [row for row in cameras.rows if space.grid.keys() <= row.keys() and math.isfinite(by(row))]
        if not items:
            return
        item = {key: min(items, key=by)[key] for key in space.grid}
        left = most - (len(cameras.rows) - begun)
        refined(Towards(cameras, by), space, item, (search, left // (len(aims) - k), seed))


def _costs(row: Mapping[str, Any], goals: Goals) -> tuple[float, float]:
    return goals[0].cost(row), goals[1].cost(row)


def _between(found: Sequence[Mapping[str, Any]], goals: Goals, weight: float) -> Cost:
    ends = [_costs(found[k], goals) for k in (0, -1)]
    best, way = (ends[0][0], ends[1][1]), (ends[1][0] - ends[0][0], ends[0][1] - ends[1][1])

    def cost(row: Mapping[str, Any]) -> float:
        away = [
            part * (one - least) / (long or 1.0)
            for part, one, least, long in zip(
                (weight, 1 - weight), _costs(row, goals), best, way, strict=True
            )
        ]
        return max(away) + SLIGHT * sum(away)

    return cost
