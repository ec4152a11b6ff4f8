"""`deconvolve`: from a raw image to what was in front of the camera; `deconvolve_series` for many."""

import math
import os
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import overload

import numpy as np

from lumigraph.core import arrays, checks, memory
from lumigraph.core.arrays import A, Array
from lumigraph.core.linear import Linear
from lumigraph.core.raw import RawImage
from lumigraph.core.threads import single_products
from lumigraph.core.volume import Volume
from lumigraph.deconvolution.beyond import BESIDE, Inside, Widening, beyond, continued, cut, least_seen
from lumigraph.deconvolution.checkpoint import Checkpoint, fingerprint
from lumigraph.deconvolution.exposure import Exposure
from lumigraph.deconvolution.methods import Method, State, Stop, check_offers
from lumigraph.deconvolution.problem import Problem, Scale, values
from lumigraph.deconvolution.richardson_lucy import RichardsonLucy
from lumigraph.errors import GeometryError, SamplingError

FRESH = 0.05
"""Part of an even object in a warm start: where nothing was, something may be now."""

COPIES = 12
"""Arrays of the object's size that an iteration holds at most, a prior's memory included."""

Result = Array | Volume | RawImage


@dataclass(frozen=True, slots=True)
class Step:
    """How a deconvolution goes on.

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
        Why it stops before the last iteration; empty while it goes on.
    """

    iteration: int
    iterations: int
    deviance: float
    change: float
    elapsed: float
    remaining: float
    stopped: str = ""


Report = Callable[[Step], None]


class Interrupted(KeyboardInterrupt):
    """A deconvolution was interrupted; `partial` is what it had reached after `iterations`."""

    def __init__(self, partial: Result, iterations: int) -> None:
        super().__init__(f"interrupted after {iterations} iterations")
        self.partial = partial
        self.iterations = iterations


@overload
def deconvolve(
    raw: RawImage[A],
    operator: Linear,
    iterations: int | Stop = 30,
    *,
    method: Method = ...,
    exposure: Exposure | None = None,
    progress: Report | None = None,
    checkpoint: Checkpoint | str | os.PathLike[str] | None = None,
) -> Volume[A] | RawImage[A] | A: ...


@overload
def deconvolve(
    raw: A,
    operator: Linear,
    iterations: int | Stop = 30,
    *,
    method: Method = ...,
    exposure: Exposure | None = None,
    progress: Report | None = None,
    checkpoint: Checkpoint | str | os.PathLike[str] | None = None,
) -> A: ...


def deconvolve(
    raw: RawImage | Array,
    operator: Linear,
    iterations: int | Stop = 30,
    *,
    method: Method = RichardsonLucy(),  # noqa: B008 - frozen
    exposure: Exposure | None = None,
    progress: Report | None = None,
    checkpoint: Checkpoint | str | os.PathLike[str] | None = None,
) -> Result:
    """What was in front of the camera: intensities (y, x) or (z, y, x), at least 0.

    Where the operator can look beyond the picture (`beyond.Widening`), the object reaches as far as light
    comes from, and is cut to the operator's own afterwards: else its border would take up that light.

    Parameters
    ----------
    raw
        What the camera saw (ny, nx), as it was read: dark and white images go into the exposure.
    operator
        How it sees, such as ``camera.operator()``.
    iterations
        At most; or a `Stop`, which ends them where the noise begins to be fitted.
    method
        `RichardsonLucy` (default) with or without a prior, or `LeastSquares`.
    exposure
        Background, vignetting, dead pixels, noise; None for the noise that a `RawImage` records.
    progress
        Called with a `Step` after each iteration.
    checkpoint
        A file (.npz) or `Checkpoint`: written now and then, and read at the start if it is there, so that a
        killed run goes on and ends with the same result bit for bit.

    Returns
    -------
    Volume, RawImage or array
        Of an array an array of its library and precision. Of a `RawImage`, where the operator knows its
        ``object_grid``, a `Volume` if the object has planes, else a picture (`RawImage`) of the grid's pitch.

    Raises
    ------
    CalibrationError
        A raw image of another shape than the operator's, a colour mosaic, NaN where pixels count, no light.
    GeometryError
        A start of the wrong shape, an operator without sensitivity, no operator, method or exposure at all.
    FormatError
        A checkpoint that is damaged or belongs to another raw image.
    Interrupted
        A KeyboardInterrupt; it carries the estimate that was reached, and the checkpoint is written.

    """
    found = deconvolve_series(
        [raw],
        operator,
        iterations,
        method=method,
        exposure=exposure,
        progress=progress,
        checkpoint=checkpoint,
    )
    return next(found)


@overload
def deconvolve_series(
    frames: Iterable[RawImage[A]],
    operator: Linear,
    iterations: int | Stop = 30,
    *,
    method: Method = ...,
    exposure: Exposure | None = None,
    progress: Report | None = None,
    checkpoint: Checkpoint | str | os.PathLike[str] | None = None,
    warm: bool = False,
) -> Iterator[Volume[A] | RawImage[A] | A]: ...


@overload
def deconvolve_series(
    frames: Iterable[A],
    operator: Linear,
    iterations: int | Stop = 30,
    *,
    method: Method = ...,
    exposure: Exposure | None = None,
    progress: Report | None = None,
    checkpoint: Checkpoint | str | os.PathLike[str] | None = None,
    warm: bool = False,
) -> Iterator[A]: ...


def deconvolve_series(
    frames: Iterable[RawImage | Array],
    operator: Linear,
    iterations: int | Stop = 30,
    *,
    method: Method = RichardsonLucy(),  # noqa: B008 - frozen
    exposure: Exposure | None = None,
    progress: Report | None = None,
    checkpoint: Checkpoint | str | os.PathLike[str] | None = None,
    warm: bool = False,
) -> Iterator[Result]:
    """The result of each frame of a time series, one after the other, as `deconvolve` gives it.

    The operator and its sensitivity are held once; a frame is read when its turn comes and forgotten, so
    that any number of frames needs the memory of one.

    Parameters
    ----------
    frames
        Raw images, such as a generator that opens one file after the other.
    operator, iterations, method, exposure, progress, checkpoint
        As in `deconvolve`; the exposure is that of the first frame for all of them, and a checkpoint keeps
        the frame that is being worked on.
    warm
        Whether each frame begins with the result of the one before, which where little moves is as likely in
        half of the iterations. The first frame begins as it does alone.
    """
    engine = Deconvolver(operator, iterations, method=method, warm=warm)
    for raw in frames:
        exposure = _known(raw, exposure)
        yield engine(raw, exposure, progress=progress, checkpoint=checkpoint)


class Deconvolver:
    """`deconvolve` by one operator and one method for any number of raw images, one after the other.

    What does not depend on the raw image, such as how much light each object sample sends onto the pixels
    that count, is computed once for each exposure. The result is the same bits as that of `deconvolve`.

    Parameters
    ----------
    operator, iterations, method
        As in `deconvolve`.
    warm
        As in `deconvolve_series`.
    """

    def __init__(
        self,
        operator: Linear,
        iterations: int | Stop = 30,
        *,
        method: Method = RichardsonLucy(),  # noqa: B008 - frozen
        warm: bool = False,
    ) -> None:
        self.operator, self.method, self.warm = operator, method, warm
        self.limits = iterations if isinstance(iterations, Stop) else Stop(iterations)
        _check(operator, method)
        self._wide, self._inside = beyond(operator)
        self._scale: tuple[str, Scale] | None = None
        self._pictured: Array | None = None
        self._last: Array | None = None

    @single_products()  # threads of small products spin: three times the work on a busy machine
    def __call__(
        self,
        raw: RawImage | Array,
        exposure: Exposure | None = None,
        *,
        progress: Report | None = None,
        checkpoint: Checkpoint | str | os.PathLike[str] | None = None,
    ) -> Result:
        """The result of one raw image; parameters and errors are those of `deconvolve`."""
        exposure = _known(raw, exposure)
        data = values(raw, self.operator, exposure)
        problem = Problem.of(raw, exposure, self._scaled(exposure, data))
        wanted = self.operator, self._inside, self._pictured
        run = _Run(problem, self.method, self.limits, progress, wanted, start=self._begun(problem))
        if checkpoint is not None:
            run.checkpoint = Checkpoint.of(checkpoint)
            run.key = fingerprint(data, exposure, self.method, run.start)
        state = _finished(run, raw)
        self._last = state.estimate if self.warm else None
        return run.result(state, raw)

    def forget(self) -> None:
        """Begin the next raw image as if it were the first one, though starts are warm."""
        self._last = None

    def _begun(self, problem: Problem) -> Array | None:
        """A warm start: the last object and an even one."""
        if self._last is None or tuple(self._last.shape) != tuple(problem.scale.sensitivity.shape):
            return None
        return (1 - FRESH) * self._last + FRESH * problem.flat()

    def _scaled(self, exposure: Exposure, data: Array) -> Scale:
        """The scale of an exposure: that of the raw image before, if it is the same."""
        key = fingerprint(exposure, str(data.dtype), str(arrays.placement(data)))
        if self._scale is None or self._scale[0] != key:
            _require(self._wide, data)
            scale = Scale.of(self._wide, exposure, data, least_seen(self.operator))
            self._scale = key, scale
            if isinstance(self.operator, Widening):
                self._pictured = scale.pictured(BESIDE)
        return self._scale[1]


@dataclass(slots=True)
class _Run:
    problem: Problem
    method: Method
    limits: Stop
    progress: Report | None
    wanted: tuple[Linear, Inside, Array | None]
    checkpoint: Checkpoint | None = None
    key: str = ""
    began: float = 0.0
    start: Array | None = None

    def states(self) -> Iterator[State]:
        """The first state and each that follows, until it is time to stop."""
        self.began = time.perf_counter()
        state = self._first()
        first, change = state.done, np.inf
        yield state
        while not self.limits.reached(state.done, state.deviance, change):
            before, state = state, self.method.step(self.problem, state)
            change = _change(before.estimate, state.estimate)
            if self.checkpoint is not None:
                self.checkpoint.keep(self.problem, state, self.key)
            yield state
            self._tell(state, change, first)
        if self.checkpoint is not None and state.done > first:
            self.checkpoint.keep(self.problem, state, self.key, now=True)

    def result(self, state: State, raw: RawImage | Array) -> Result:
        """What is asked for of the object, with its place in space."""
        operator, inside, pictured = self.wanted
        return _placed(cut(state.estimate, inside, pictured), raw, operator)

    def _first(self) -> State:
        kept = None if self.checkpoint is None else self.checkpoint.found(self.problem, self.key)
        if kept is not None:
            return kept
        if self.start is not None:
            return State.at(self.problem, self.start)
        if self.method.start is None:
            return State.at(self.problem, self.problem.flat())
        start, needed = self.method.start, tuple(self.wanted[0].shape[1])
        if tuple(start.shape) != needed:
            raise GeometryError(f"start has shape {tuple(start.shape)} but the object has {needed}.")
        start = continued(start, tuple(self.problem.scale.sensitivity.shape), self.wanted[1])
        return State.at(self.problem, arrays.like(np.asarray(arrays.to_numpy(start)), self.problem.data))

    def _tell(self, state: State, change: float, first: int) -> None:
        if self.progress is None:
            return
        elapsed = time.perf_counter() - self.began
        stopped = self.limits.reached(state.done, state.deviance, change)
        left = 0 if stopped else self.limits.iterations - state.done
        remaining = left * elapsed / (state.done - first)
        self.progress(
            Step(state.done, self.limits.iterations, state.deviance, change, elapsed, remaining, stopped)
        )


def _finished(run: _Run, raw: RawImage | Array) -> State:
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


def _known(raw: RawImage | Array, exposure: Exposure | None) -> Exposure:
    if exposure is not None:
        checks.instance("exposure", exposure, Exposure)
        return exposure
    return Exposure.of(raw) if isinstance(raw, RawImage) else Exposure()


def _check(operator: Linear, method: Method) -> None:
    if not isinstance(operator, Linear):
        raise GeometryError(
            f"operator is of type {type(operator).__name__} but must be a Linear. Give camera.operator()."
        )
    check_offers("method", method, ("step", "start"), "Give RichardsonLucy() or LeastSquares().")


def _require(operator: Linear, data: Array) -> None:
    size = math.prod(operator.shape[1]) * (4 if arrays.is_single(data) else 8)
    what = f"a deconvolution into {' x '.join(map(str, operator.shape[1]))} samples"
    memory.require(COPIES * size, what, "Use fewer planes, or coarser samples.", SamplingError)


def _change(before: Array, after: Array) -> float:
    moved = arrays.sum_by_plane(lambda one, other: (one - other) ** 2, after, before)
    whole = arrays.sum_by_plane(lambda one: one**2, after)
    return math.sqrt(moved / whole) if whole > 0 else 0.0
