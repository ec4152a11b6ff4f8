"""One run of a deconvolution: from the first state to the last, with its reports and its result."""

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from lumigraph.core import arrays
from lumigraph.core.arrays import Array
from lumigraph.core.linear import Linear
from lumigraph.core.raw import RawImage
from lumigraph.core.volume import Volume
from lumigraph.deconvolution.beyond import Inside, continued, cut
from lumigraph.deconvolution.checkpoint import Checkpoint
from lumigraph.deconvolution.methods import Method, State, Stop
from lumigraph.deconvolution.problem import Problem
from lumigraph.errors import GeometryError

Result = Array | Volume | RawImage


@dataclass(frozen=True, slots=True)
class RunStep:
    """Progress of a deconvolution.

    Parameters
    ----------
    iteration, iterations
        Done, and at most to do.
    deviance
        Poisson deviance per pixel of the estimate: -2 ln of its likelihood over that of a perfect fit,
        in electrons where the gain is known. See `Stop`.
    change
        Of the last step, ‖Δo‖/‖o‖.
    elapsed, remaining
        Time [s] so far, and still to go at the present pace.
    stopped
        Reason to stop before the last iteration; empty while it continues.
    memory
        What operator and iterations hold [bytes]; only of the step before the first iteration.
    """

    iteration: int
    iterations: int
    deviance: float
    change: float
    elapsed: float
    remaining: float
    stopped: str = ""
    memory: float = math.nan

    @property
    def announces(self) -> bool:
        """True of the step before the first iteration, with the time and memory that all will take."""
        return not math.isnan(self.memory)


Report = Callable[[RunStep], None]


class Interrupted(KeyboardInterrupt):
    """A deconvolution was interrupted; `partial` is what it had reached after `iterations`."""

    def __init__(self, partial: Result, iterations: int) -> None:
        super().__init__(f"interrupted after {iterations} iterations")
        self.partial = partial
        self.iterations = iterations


@dataclass(slots=True)
class Run:
    """A problem, a method and when to stop; `wanted` are the operator and the part of the object to return.

    `counted` says whether deviances are in electrons; `fall` is the decrease of it in the last step; `needs`
    are the time of an iteration [s] and the memory of all [bytes], as far as they are known beforehand.
    """

    problem: Problem
    method: Method
    limits: Stop
    progress: Report | None
    wanted: tuple[Linear, Inside, Array | None]
    checkpoint: Checkpoint | None = None
    key: str = ""
    began: float = 0.0
    start: Array | None = None
    counted: bool = False
    fall: float = math.inf
    needs: tuple[float, float] = (math.nan, 0.0)

    def states(self) -> Iterator[State]:
        """The first state and each that follows, until it is time to stop."""
        self.began = time.perf_counter()
        state = self._first()
        first, change = state.done, np.inf
        yield state
        self._announce(state)
        while not self.limits.reached(state.done, state.deviance, change):
            before, state = state, self.method.step(self.problem, state)
            self.fall = before.deviance - state.deviance
            if self.progress is not None or self.limits.change is not None:
                change = _change(before.estimate, state.estimate)
            if self.checkpoint is not None:
                self.checkpoint.keep(self.problem, state, self.key)
            yield state
            self._tell(state, change, first)
        if self.checkpoint is not None and state.done > first:
            self.checkpoint.keep(self.problem, state, self.key, now=True)

    def result(self, state: State, raw: RawImage | Array) -> Result:
        """Wanted part of the object, with its place in space."""
        operator, inside, pictured = self.wanted
        return _placed(cut(state.estimate, inside, pictured), raw, operator)

    def _first(self) -> State:
        kept = None if self.checkpoint is None else self.checkpoint.found(self.problem, self.key)
        if kept is not None:
            return kept
        if self.start is not None:
            return State.at(self.problem, self.start)
        if self.method.start is None:
            return State.even(self.problem)
        start, needed = self.method.start, tuple(self.wanted[0].shape[1])
        if tuple(start.shape) != needed:
            raise GeometryError(f"start has shape {tuple(start.shape)} but the object has {needed}.")
        start = continued(start, tuple(self.problem.scale.sensitivity.shape), self.wanted[1])
        return State.at(self.problem, arrays.like(np.asarray(arrays.to_numpy(start)), self.problem.data))

    def _announce(self, state: State) -> None:
        """Say what the iterations will take, before the first one."""
        limits, (seconds, size) = self.limits, self.needs
        if self.progress is None or limits.reached(state.done, state.deviance, np.inf):
            return
        left = limits.iterations - state.done
        self.progress(
            RunStep(state.done, limits.iterations, state.deviance, np.inf, 0.0, left * seconds, memory=size)
        )

    def _tell(self, state: State, change: float, first: int) -> None:
        if self.progress is None:
            return
        elapsed = time.perf_counter() - self.began
        stopped = self.limits.reached(state.done, state.deviance, change)
        left = 0 if stopped else self.limits.iterations - state.done
        remaining = left * elapsed / (state.done - first)
        self.progress(
            RunStep(state.done, self.limits.iterations, state.deviance, change, elapsed, remaining, stopped)
        )


def finished(run: Run, raw: RawImage | Array) -> State:
    """The last state; interrupted, the one reached is kept and carried by the error."""
    reached: list[State] = []
    try:
        for state in run.states():
            reached[:] = [state]
    except KeyboardInterrupt:
        if not reached:
            raise
        if run.checkpoint is not None:
            run.checkpoint.keep(run.problem, reached[0], run.key, now=True)
        raise Interrupted(run.result(reached[0], raw), reached[0].done) from None
    return reached[0]


def _placed(estimate: Array, raw: RawImage | Array, operator: Linear) -> Result:
    """The estimate with its place in space, where the raw image is one and the operator knows it."""
    grid = operator.object_grid
    if not isinstance(raw, RawImage) or grid is None:
        return estimate
    if len(estimate.shape) == 3:
        depths = operator.depths
        return estimate if depths is None else Volume(estimate, grid, depths)
    known = {"center": grid.center, "wavelength": raw.metadata.get("wavelength")}
    return RawImage(estimate, float(np.mean(grid.pitch)), metadata=known)


def _change(before: Array, after: Array) -> float:
    moved = arrays.sum_by_part(lambda one, other: (one - other) ** 2, after, before)
    whole = arrays.sum_by_part(lambda one: one**2, after)
    return math.sqrt(moved / whole) if whole > 0 else 0.0
