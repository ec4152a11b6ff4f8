"""`deconvolve`: the object before the camera from a raw image; `deconvolve_series` for many."""

import math
import os
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Any, overload

from lumigraph.core import arrays, checks, memory
from lumigraph.core.arrays import A, Array
from lumigraph.core.joint import Joint
from lumigraph.core.linear import Linear
from lumigraph.core.raw import RawImage
from lumigraph.core.threads import single_products
from lumigraph.core.volume import Volume
from lumigraph.deconvolution.beyond import BESIDE, beyond, least_seen, looks_beyond
from lumigraph.deconvolution.checkpoint import Checkpoint, fingerprint
from lumigraph.deconvolution.coarse import warn_of_coarse_samples
from lumigraph.deconvolution.exposure import Exposure
from lumigraph.deconvolution.methods import Method, Stop, check_offers
from lumigraph.deconvolution.problem import Problem, Scale, values
from lumigraph.deconvolution.richardson_lucy import RichardsonLucy
from lumigraph.deconvolution.run import Report, Result, Run, finished
from lumigraph.deconvolution.side_by_side import side_by_side
from lumigraph.deconvolution.together import (
    Raws,
    check_count,
    exposures_of,
    joined,
    together,
    warn_of_brightness,
)
from lumigraph.errors import CalibrationError, GeometryError, LumigraphError, SamplingError

FRESH = 0.05
"""Part of an even object in a warm start: where nothing was, something may be now."""

COPIES = 12
"""Arrays of the object's size that an iteration holds at most, a prior's memory included."""

SHARE = 0.2
"""Part of the free memory that raw images side by side may take."""


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
    raw: Sequence[RawImage[A]],
    operator: Linear | Sequence[Linear],
    iterations: int | Stop = 30,
    *,
    method: Method = ...,
    exposure: Exposure | Sequence[Exposure] | None = None,
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
    raw: RawImage | Array | Raws,
    operator: Linear | Sequence[Linear],
    iterations: int | Stop = 30,
    *,
    method: Method = RichardsonLucy(),  # noqa: B008 - frozen
    exposure: Exposure | Sequence[Exposure] | None = None,
    progress: Report | None = None,
    checkpoint: Checkpoint | str | os.PathLike[str] | None = None,
) -> Result:
    """Object before the camera: intensities (y, x) or (z, y, x), at least 0.

    Where the operator can look beyond the picture (`beyond.Widening`), the object reaches as far as light
    comes from, and is cut to the operator's own afterwards: else its border would take up that light.

    Several raw images of one object are explained together, each by its own operator: scanned light fields,
    other exposures, or pictures by other cameras. Each counts by its electrons.

    Parameters
    ----------
    raw
        What the camera saw (ny, nx), as it was read: dark and white images go into the exposure. A list for
        several raw images of one object.
    operator
        How it sees, such as ``camera.operator()``. For several raw images `lumigraph.joint_operator`, or a
        list of operators of one object, one for each.
    iterations
        At most; or a `Stop`, which ends them where the noise begins to be fitted.
    method
        `RichardsonLucy` (default) with or without a prior, or `LeastSquares`.
    exposure
        Background, vignetting, dead pixels, noise; None for the noise that a `RawImage` records. For several
        raw images one for all of them, or a list; None takes their light from what `Sensor.expose` records.
    progress
        Called with a `RunStep` before the first iteration, whose `memory` and `remaining` say what all
        of them will take, and after each one.
    checkpoint
        A file (.npz) or `Checkpoint`: written now and then, and read at the start if it is there. Safe to
        interrupt: the same call resumes, and ends with the same result bit for bit.

    Returns
    -------
    Volume, RawImage or array
        Of an array an array of its library and precision. Of a `RawImage`, where the operator knows its
        ``object_grid``, a `Volume` if the object has planes, else a picture (`RawImage`) of the grid's pitch.

    Raises
    ------
    CalibrationError
        A raw image of another shape than the operator's, a colour mosaic, NaN where pixels count, no light;
        not as many raw images as operators, or the gains of some of them only.
    GeometryError
        A start of the wrong shape, an operator without sensitivity, no operator, method or exposure at all.
    FormatError
        A checkpoint that is damaged or belongs to another raw image.
    Interrupted
        A KeyboardInterrupt; it carries the estimate that was reached, and the checkpoint is written.

    Warns
    -----
    SamplingWarning
        One of several raw images is brighter or darker than the object that explains all of them sends. The
        gain is known, what is left is twice what noise explains, more iterations would leave as much, and
        samples are coarser than the instrument resolves.
    """
    engine = Deconvolver(operator, iterations, method=method)
    return engine(raw, exposure, progress=progress, checkpoint=checkpoint)


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
    frames: Iterable[RawImage | Array | Raws],
    operator: Linear | Sequence[Linear],
    iterations: int | Stop = 30,
    *,
    method: Method = RichardsonLucy(),  # noqa: B008 - frozen
    exposure: Exposure | Sequence[Exposure] | None = None,
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
        Raw images, such as a generator that opens one file after the other; lists of them where several
        show one object.
    operator, iterations, method, exposure, progress, checkpoint
        As in `deconvolve`; the exposure is that of the first frame for all of them, and a checkpoint keeps
        the frame that is being worked on.
    warm
        Whether each frame begins with the result of the one before, which reaches the same likelihood in half
        the iterations where little moves. The first frame begins as it does alone.
    """
    engine = Deconvolver(operator, iterations, method=method, warm=warm)
    for raw in frames:
        exposure = engine.known(raw, exposure)
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
        operator: Linear | Sequence[Linear],
        iterations: int | Stop = 30,
        *,
        method: Method = RichardsonLucy(),  # noqa: B008 - frozen
        warm: bool = False,
    ) -> None:
        self.operator, self.method, self.warm = joined(operator), method, warm
        self.limits = iterations if isinstance(iterations, Stop) else Stop(iterations)
        _check(self.operator, method)
        self._wide, self._inside = beyond(self.operator)
        self._scale: tuple[str, Scale] | None = None
        self._pictured: Array | None = None
        self._last: Array | None = None
        self._pace = math.nan

    @single_products()  # threads of small products spin: three times the work on a busy machine
    def __call__(
        self,
        raw: RawImage | Array | Raws,
        exposure: Exposure | Sequence[Exposure] | None = None,
        *,
        progress: Report | None = None,
        checkpoint: Checkpoint | str | os.PathLike[str] | None = None,
    ) -> Result:
        """The result of one raw image, or of several; parameters and errors are those of `deconvolve`."""
        run, like = self._run(raw, exposure, progress, checkpoint)
        state = finished(run, like)
        warn_of_coarse_samples(run, state)
        if isinstance(self.operator, Joint):
            warn_of_brightness(run.problem, state.model, self.operator)
        self._last = state.estimate if self.warm else None
        return run.result(state, like)

    def _run(
        self, raw: RawImage | Array | Raws, exposure: Exposure | Sequence[Exposure] | None,
        progress: Report | None = None, checkpoint: Checkpoint | str | os.PathLike[str] | None = None,
    ) -> tuple[Run, RawImage | Array]:  # fmt: skip
        """Run of one raw image, or of several, and the image that gives the result its place."""
        like, raw, exposure = self._row(raw, self.known(raw, exposure))
        data = values(raw, self.operator, exposure)
        problem = Problem.of(raw, exposure, self._scaled(exposure, data))
        wanted = self.operator, self._inside, self._pictured
        run = Run(problem, self.method, self.limits, progress, wanted, start=self._begun(problem))
        run.counted, run.needs = exposure.gain is not None, (self._pace, self._size(data))
        if checkpoint is not None:
            run.checkpoint = Checkpoint.of(checkpoint)
            run.key = fingerprint(data, exposure, self.method, run.start)
        return run, like

    @property
    def side_by_side(self) -> int:
        """Raw images that `several` takes in less time than one after the other, as memory has room."""
        count, free = 1 if self.warm else self._wide.side_by_side, memory.available()
        held = COPIES * 4 * math.prod(self._wide.shape[1])
        return count if free is None else max(min(count, int(free * SHARE / held)), 1)

    @single_products()
    def several(
        self, raws: Sequence[RawImage | Array], exposures: Sequence[Exposure | None]
    ) -> list[Result | Exception]:
        """The results of at most `side_by_side` raw images, or the error of each that has none.

        They go through the operator together. Which others there are does not change a bit of a result: it
        is that of a call for it alone.
        """
        found: list[Result | Exception] = []
        begun: list[tuple[int, Callable[[Linear], Result]]] = []
        for number, (raw, exposure) in enumerate(zip(raws, exposures, strict=True)):
            try:
                begun.append((number, self._alone(*self._run(raw, exposure))))
                found.append(LumigraphError("it did not end"))
            except LumigraphError as error:
                found.append(error)
        outcomes = side_by_side(self._wide, [run for _, run in begun]) if begun else []
        for (number, _), outcome in zip(begun, outcomes, strict=True):
            found[number] = outcome
        return found

    def _alone(self, run: Run, like: RawImage | Array) -> Callable[[Linear], Result]:
        """A run by an operator that it is given."""

        def result(operator: Linear) -> Result:
            run.problem = replace(run.problem, scale=replace(run.problem.scale, operator=operator))
            state = finished(run, like)
            warn_of_coarse_samples(run, state)
            return run.result(state, like)

        return result

    def known(
        self, raw: RawImage | Array | Raws, exposure: Exposure | Sequence[Exposure] | None
    ) -> Exposure | tuple[Exposure, ...]:
        """The exposure as given, or as raw images record it; one for each of several."""
        if isinstance(self.operator, Joint):
            return exposures_of(check_count(raw, self.operator), exposure)
        return _known(raw, exposure)

    def _row(
        self, raw: RawImage | Array | Raws, exposure: Exposure | tuple[Exposure, ...]
    ) -> tuple[RawImage | Array, RawImage | Array, Exposure]:
        """Image that gives the result its place, and one raw image with its exposure; several in a row."""
        if isinstance(self.operator, Joint) and isinstance(exposure, tuple):
            raws = check_count(raw, self.operator)
            return raws[0], *together(raws, self.operator, exposure)
        assert isinstance(exposure, Exposure)  # see `known`
        assert not isinstance(raw, list | tuple)
        return raw, raw, exposure

    def forget(self) -> None:
        """Begin the next raw image as if it were the first one, though starts are warm."""
        self._last = None

    def _size(self, data: Array) -> float:
        """Memory of the operator and of what an iteration holds [bytes]."""
        return _held(self._wide, data) + self._wide.memory_bytes

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
            began = time.perf_counter()  # the operator has what it makes at its first use
            even = scale.begun()
            self._pace = 2 * (time.perf_counter() - began)  # A and its transpose
            self._scale = key, scale if self.method.start is not None else even
            if looks_beyond(self.operator):
                self._pictured = scale.pictured(BESIDE)
        return self._scale[1]


def _known(raw: Any, exposure: Any) -> Exposure:
    if isinstance(raw, list | tuple):
        raise CalibrationError(
            f"the raw image must be an array, not a {type(raw).__name__} of {len(raw)}. Several raw images "
            "of one object need an operator for each, such as lumigraph.joint_operator(...); frames of a "
            "time series go into deconvolve_series."
        )
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


def _held(operator: Linear, data: Array) -> float:
    """Arrays of the object's size that an iteration holds [bytes]."""
    return COPIES * math.prod(operator.shape[1]) * (4 if arrays.is_single(data) else 8)


def _require(operator: Linear, data: Array) -> None:
    what = f"a deconvolution into {' x '.join(map(str, operator.shape[1]))} samples"
    memory.require(_held(operator, data), what, "Use fewer planes, or coarser samples.", SamplingError)
