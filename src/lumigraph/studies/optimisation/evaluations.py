"""Cameras of a search, each computed once and noted in a ledger."""

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from lumigraph.cluster.ledger import Entry, Ledger
from lumigraph.errors import LumigraphError, SamplingWarning
from lumigraph.instruments.instrument import Instrument
from lumigraph.instruments.varied import changed
from lumigraph.studies.optimisation.goals import PLACES, Goal
from lumigraph.studies.optimisation.space import Space

ERROR = "error"

APART = 1e-4
"""Part of a range to either side, where a camera differs by a little."""


@dataclass(eq=False)
class Evaluations:
    """Values of each camera, in the order of the search.

    Parameters
    ----------
    start
        The camera as it is given.
    goal
        What is computed.
    first
        Part of the light that it collects.
    ledger
        Where it is noted; None for nowhere.
    done
        Called with the number of cameras so far.
    names
        Of the values that vary.
    beside
        Another goal, computed too.
    """

    start: Instrument
    goal: Goal
    first: float
    ledger: Ledger | None
    done: Callable[[int], None]
    names: Sequence[str]
    beside: Goal | None = None
    rows: list[dict[str, Any]] = field(default_factory=list)
    seconds: float = 0.0
    computed: int = 0
    _known: dict[str, int] = field(default_factory=dict)

    def row(self, item: Mapping[str, Any]) -> dict[str, Any]:
        """Values of the camera with an item's values, or why there is none."""
        key = _key(item)
        if key not in self._known:
            row = self._noted.get(key) or self._computed(item)
            self._known[key] = len(self.rows)
            self.rows.append(row)
            self.done(len(self.rows))
        return self.rows[self._known[key]]

    @cached_property
    def _noted(self) -> dict[str, dict[str, Any]]:
        """Rows that the ledger has from before, whichever search computed them."""
        entries = {} if self.ledger is None else self.ledger.entries()
        rows = [entry.values for entry in entries.values()]
        return {_key({name: row[name] for name in self.names if name in row}): row for row in rows}

    def cost(self, item: Mapping[str, Any]) -> float:
        """Cost of an item, as `Goal.cost`."""
        return self.goal.cost(self.row(item))

    def slopes(self, item: Mapping[str, Any], space: Space) -> np.ndarray:
        """Derivatives of the cost by the parts of the ranges (n,), from possible cameras to either side."""
        parts, sides = np.array(space.parts(item)), np.eye(len(space.ranges)) * APART
        pairs, widths = [], []
        for side in sides:
            ends = [self._near(space, item, parts, one) for one in (-side, side)]
            pairs.append((ends[0][0], ends[1][0]))
            widths.append(ends[1][1] - ends[0][1])
        camera = changed(self.start, item)
        found = self.goal.slopes(camera, pairs, self.first, int(self.row(item).get(PLACES, 0)))
        return np.divide(found, widths, out=np.zeros(len(found)), where=np.array(widths) > 0)

    def _near(
        self, space: Space, item: Mapping[str, Any], parts: np.ndarray, side: np.ndarray
    ) -> tuple[Instrument, float]:
        """A camera to a side, and how far; the item's own where there is none."""
        there = np.clip(parts + side, 0, 1)
        with suppress(LumigraphError):
            return changed(self.start, space.moved(item, there.tolist())), float((there - parts).sum())
        return changed(self.start, item), 0.0

    def _computed(self, item: Mapping[str, Any]) -> dict[str, Any]:
        began = time.perf_counter()
        try:
            row = {**item, **self._values(changed(self.start, item))}
        except (LumigraphError, SamplingWarning) as error:
            row = {**item, ERROR: " ".join(str(error).split())}
        seconds = time.perf_counter() - began
        if self.ledger is not None:
            self.ledger.record(Entry(len(self._noted) + self.computed, seconds, values=row))
        self.seconds, self.computed = self.seconds + seconds, self.computed + 1
        return row

    def _values(self, camera: Instrument) -> dict[str, float]:
        found = self.goal.values(camera, self.first)
        if self.beside is not None and self.beside.name not in found:
            return {**self.beside.values(camera, self.first), **found}
        return found


def _key(item: Mapping[str, Any]) -> str:
    return repr(sorted(item.items()))


@contextmanager
def noted(output: Path | None, what: Mapping[str, Any]) -> Iterator[Ledger | None]:
    """Context of a ledger beside an output, which no other run writes; None without an output.

    Raises
    ------
    FormatError
        Another search has begun this output, or another run works on it.
    """
    if output is None:
        yield None
        return
    ledger = Ledger.beside(output)
    ledger.open(what, [])
    with ledger.started(0, 1):
        yield ledger
