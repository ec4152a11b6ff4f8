"""Searches: each camera of a grid, then downhill from the best, or all of the ranges at once."""

from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any, Literal, Protocol

import numpy as np
from scipy import optimize

from lumigraph.optimisation.gradient import SPREAD, downhill
from lumigraph.optimisation.space import Space

Search = Literal["grid", "local", "global", "gradient"]

FINE = 1e-3
"""Relative size of a simplex at last, and spread of its costs."""

Slopes = Callable[[Mapping[str, Any]], np.ndarray]

MANY = 10**6
"""Evaluations that no search reaches: its own limit is another."""

IMPOSSIBLE = 1e30
"""Cost of what no camera can be."""


class Costs(Protocol):
    """Cameras and what a search makes small of them."""

    @property
    def rows(self) -> list[dict[str, Any]]:
        """All cameras so far."""
        ...

    def cost(self, item: Mapping[str, Any]) -> float:
        """Cost of an item; infinite where there is no such camera."""
        ...


class _Enough(Exception):  # noqa: N818 - no error
    """All evaluations that were allowed are done."""


def grid(cameras: Costs, space: Space) -> dict[str, Any] | None:
    """The best item of the first values; None where no camera has any."""
    items = space.combinations()
    costs = [cameras.cost(item) for item in items]
    best = int(np.argmin(costs))
    return items[best] if np.isfinite(costs[best]) else None


def refined(
    cameras: Costs,
    space: Space,
    item: Mapping[str, Any],
    how: tuple[Search, int, int],
    slopes: Slopes | None = None,
) -> dict[str, Any]:
    """A better item than one given, its stock values kept.

    Parameters
    ----------
    cameras, space
        What is searched.
    item
        Where to begin.
    how
        The search, evaluations at most, seed.
    slopes
        Of an item's cost, by the parts of the ranges; of search "gradient" alone.
    """
    search, most, seed = how
    if search == "grid" or not space.ranges or most < 1:
        return dict(item)
    best, limit = (cameras.cost(item), dict(item)), len(cameras.rows) + most
    size = abs(best[0]) or 1.0

    def cost(parts: np.ndarray) -> float:
        nonlocal best
        here = space.moved(item, parts.tolist())
        if len(cameras.rows) >= limit:
            raise _Enough
        found = cameras.cost(here)
        if found < best[0]:
            best = found, here
        return found / size if np.isfinite(found) else IMPOSSIBLE

    start = np.array(space.parts(item))
    with suppress(_Enough):
        if slopes is not None:
            downhill(cost, lambda at: slopes(space.moved(item, at.tolist())) / size, start)
        else:
            (_by_simplex if search == "local" else _everywhere)(cost, start, seed)
    return best[1]


def _by_simplex(cost: Callable[[np.ndarray], float], start: np.ndarray, seed: int) -> None:
    """Nelder and Mead's simplex, again from where it ended."""
    for spread in (SPREAD, SPREAD / 3):
        steps = np.where(start + spread <= 1, spread, -spread)
        simplex = np.vstack([start, start + np.diag(steps)])
        found = optimize.minimize(
            cost, start, method="Nelder-Mead", bounds=[(0, 1)] * len(start),
            options={"initial_simplex": simplex, "xatol": FINE, "fatol": FINE, "maxfev": MANY},
        )  # fmt: skip
        start = np.asarray(found.x)


def _everywhere(cost: Callable[[np.ndarray], float], start: np.ndarray, seed: int) -> None:
    optimize.differential_evolution(
        cost,
        [(0, 1)] * len(start),
        rng=np.random.default_rng(seed),
        x0=start,
        polish=False,
        popsize=8,
        tol=FINE,
    )
