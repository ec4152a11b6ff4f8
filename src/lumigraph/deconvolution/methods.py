"""Common parts of all methods: the state of an iteration, stopping rules, priors and filters."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

from lumigraph.core import checks
from lumigraph.core.arrays import Array
from lumigraph.deconvolution.problem import Problem
from lumigraph.errors import GeometryError


@dataclass(frozen=True, slots=True, eq=False)
class State:
    """State of an iteration.

    Parameters
    ----------
    estimate
        Intensities (y, x) or (z, y, x).
    model
        What the sensor would read (ny, nx) if the estimate were true.
    deviance
        Of that model: `Problem.deviance`.
    memory
        What else the next step needs, by name.
    done
        Steps so far.
    """

    estimate: Array
    model: Array
    deviance: float
    memory: Mapping[str, Array] = field(default_factory=dict)
    done: int = 0

    @classmethod
    def at(
        cls, problem: Problem, estimate: Array, memory: Mapping[str, Array] | None = None, done: int = 0
    ) -> "State":
        """The state of an estimate, whose model is computed."""
        model = problem.model(estimate)
        return cls(estimate, model, problem.deviance(model), memory or {}, done)

    @classmethod
    def even(cls, problem: Problem) -> "State":
        """State of the even object that is as bright as the data."""
        flat, light = problem.flat(), problem.scale.even
        model = problem.model(flat) if light is None else problem.read(problem.level * light)
        return cls(flat, model, problem.deviance(model))


class Method(Protocol):
    """One way to deconvolve: settings, and the step from one state to the next."""

    @property
    def start(self) -> Array | None:
        """First estimate; None for an even object."""
        ...

    def step(self, problem: Problem, state: State, /) -> State:
        """The next state."""
        ...


class Prior(Protocol):
    """Prior knowledge of objects, towards which an estimate is drawn."""

    def shrink(self, problem: Problem, before: Array, state: State, /) -> tuple[Array, dict[str, Array]]:
        """The estimate, and what the prior wants to remember.

        Parameters
        ----------
        problem
            Gives the sensitivity.
        before
            Estimate after the step towards the data.
        state
            Before that step.
        """
        ...


class Filter(Protocol):
    """Applied to the factor of each step, such as `LowPass`."""

    def __call__(self, factor: Array, /) -> Array:
        """Factor (y, x) or (z, y, x) of the estimate, filtered."""
        ...


@dataclass(frozen=True, slots=True)
class Stop:
    """Rule by which a deconvolution stops.

    Richardson-Lucy fits the noise in the end: it is to be stopped before. Where the electrons are counted
    (`Exposure.gain`), the deviance per pixel of the true object is 1 on average (a little more at one or
    two electrons, less below), and an estimate that goes below it fits noise.

    Parameters
    ----------
    iterations
        At most.
    deviance
        Stops at the first estimate whose deviance per pixel is at most this.
    change
        Stops where a step changes the estimate, ‖Δo‖/‖o‖, by less than this.

    Raises
    ------
    GeometryError
        A limit that is not above zero, or iterations that are no whole number.

    References
    ----------
    M. Bertero et al., "A discrepancy principle for Poisson data", Inverse Problems 26, 105004 (2010).
    """

    iterations: int = 30
    deviance: float | None = None
    change: float | None = None

    def __post_init__(self) -> None:
        checks.whole("iterations", self.iterations)
        for name in ("deviance", "change"):
            if (value := getattr(self, name)) is not None:
                checks.positive(name, value, "1")

    def reached(self, done: int, deviance: float, change: float) -> str:
        """Reason to stop here; empty to continue."""
        if self.deviance is not None and deviance <= self.deviance:
            return f"deviance {deviance:.4g} per pixel is at most {self.deviance:g}"
        if self.change is not None and change < self.change:
            return f"change {change:.3g} is below {self.change:g}"
        return f"{done} iterations" if done >= self.iterations else ""


def check_offers(name: str, thing: Any, wanted: tuple[str, ...], remedy: str) -> None:
    """Refuse an object without all wanted attributes, such as a camera where its operator is needed."""
    if not all(hasattr(thing, attribute) for attribute in wanted):
        raise GeometryError(
            f"{name} is of type {type(thing).__name__} but must have {', '.join(wanted)}. {remedy}"
        )


def check_start(start: Array | None) -> None:
    """Refuse a first estimate with NaN or negative values.

    Raises
    ------
    GeometryError
        It has some.
    """
    if start is None:
        return
    checks.array("start", start)
    checks.finite_array("start", start, GeometryError)
    if (lowest := float(start.min())) < 0:
        raise GeometryError(f"start goes down to {lowest:.4g} but intensities are at least 0.")
