"""`lumigraph deconvolve`."""

from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field, replace
from functools import lru_cache
from itertools import repeat
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

from lumigraph.cli import files
from lumigraph.cli.adaptive import ADAPTIVE, Adaptive, with_wavefront
from lumigraph.cli.console import progress
from lumigraph.cli.deconvolve_options import SEEN, WANTED, WAY, MethodOptions, ObjectOptions, RawImageOptions
from lumigraph.cli.deconvolved import reached, result
from lumigraph.cli.options import Output
from lumigraph.cli.reporting import REPORTED, ReportOptions
from lumigraph.cli.several import SEVERAL, SeveralOptions, Shifts, with_shifts
from lumigraph.core import memory
from lumigraph.core.progress import Needs, Progress, Stage, expected, silent, within
from lumigraph.core.result import Result
from lumigraph.errors import FormatError, LumigraphError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from lumigraph.core.calibration import Calibration
    from lumigraph.core.linear import Linear
    from lumigraph.core.prepared import PreparedImage
    from lumigraph.core.raw import RawImage
    from lumigraph.deconvolution import Deconvolver
    from lumigraph.deconvolution.run import RunStep
    from lumigraph.instruments import Instrument


LONG = 5.0
"""Seconds from which on it is said beforehand how long something will take."""


def deconvolve(
    raw: Path,
    /,
    *others: Path,
    output: Output,
    camera: str,
    seen: RawImageOptions = SEEN,
    wanted: ObjectOptions = WANTED,
    way: MethodOptions = WAY,
    several: SeveralOptions = SEVERAL,
    bent: Adaptive = ADAPTIVE,
    common: ReportOptions = REPORTED,
) -> Result:
    """Reconstruct what was in front of a microscope or a camera from raw images, or a time series.

    By the camera's point spread functions (PSF). A light-field microscope gives a volume, a focused camera
    the picture of its main lens, or one for each of several depths. The object is followed as far beyond the picture as light comes from, and cut
    afterwards. Ctrl-C writes what was reached. Several files are raw images of one object, deconvolved
    together; several pages of one file are a time series, deconvolved one after the other.

    Example: `lumigraph deconvolve raw.tif --white white.tif --dark dark.tif --camera scope.toml --depth "-20 um:20 um:2 um" -o volume.ome.tif`

    Example: `lumigraph deconvolve film.tif --page 0:9 --camera scope.toml --depth "-20 um:20 um:2 um" -o volume.ome.tif`

    Example: `lumigraph deconvolve raw.tif --camera scope.toml --depth "-12 um:12 um:4 um" --adaptive --terms 5-11 -o volume.ome.tif`

    Example: `lumigraph deconvolve a.tif b.tif c.tif d.tif --shifts 2x2 --camera camera.toml -o picture.tiff`

    Example: `lumigraph deconvolve a.tif b.tif c.tif d.tif --shifts 2x2 --find-shifts --camera camera.toml -o picture.tiff`

    Parameters
    ----------
    raw
        Raw image (TIFF, PNG, Zarr), as it was read, or a stack of them.
    others
        More raw images of the same object: scanned, or of other exposures.
    output
        Volume (.ome.tif, .ome.zarr, .h5) or picture (.tiff, .png, .zarr); of several pages one file each.
    camera
        Camera file (TOML), or the name of a bundled one.
    """  # noqa: E501 - an example is one line
    from lumigraph import io
    from lumigraph.instruments import load_camera

    files.check_output(output, (*files.PICTURES, ".h5", ".hdf5"))
    _check((common, seen, way), wanted, (several, bent), 1 + len(others))
    described = load_camera(camera)
    frames = seen.frames(raw)
    more = [_only(seen.frames(path), path) for path in others]
    if more:
        _only(frames, raw)
    if len(frames) > 1 and way.checkpoint is not None:
        raise FormatError("--checkpoint keeps one run, not several pages. Give one --page.")
    if way.warm and len(frames) == 1 and _RUN.get() is None:
        raise FormatError(
            "--warm begins with the page before, but there is one page. Give several by --page."
        )
    written, steps, found = [], [], None
    with progress("deconvolve") as shown:
        ready = seen.prepared(frames[0][1], described)
        made = expected(within(shown, 0.0, 1.0, "point images"), LONG)
        made(0.0)
        raws = [ready, *(seen.prepared(frame, described) for frame in more)]
        shifts, moved = several.where(described, raws, within(shown, 0.0, 1.0, "shifts"))
        wavefront = bent.found(ready, described, wanted.depths(), within(shown, 0.0, 1.0, "wavefront"))
        model = described if wavefront is None else wavefront.instrument
        engine = _engine(_Asked.of(model, wanted, way, ready.calibration, made, shifts))
        _begin(engine)
        task = _Task(engine, way, output, None if several.light is None else several.lights())
        for name, page, found in task.run(
            _pages(frames, raws if more else ready, seen, described), (steps, shown)
        ):
            ready = ready if more else page
            written.append(_named(output, name))
            io.save(found, written[-1])
    told = with_shifts(result(found, ready, steps, tuple(written)), moved)
    return told if wavefront is None else with_wavefront(told, wavefront)


def _pages(
    frames: "list[tuple[str, RawImage]]", first: Any, seen: RawImageOptions, camera: "Instrument"
) -> "Iterator[tuple[str, Any]]":
    """Pages, each judged by its own pixels when its turn comes; the first one is."""
    yield frames[0][0], first
    for name, frame in frames[1:]:
        yield name, seen.prepared(frame, camera)


def _check(
    options: "tuple[ReportOptions, RawImageOptions, MethodOptions]",
    wanted: ObjectOptions,
    more: tuple[SeveralOptions, Adaptive],
    count: int,
) -> None:
    """Refuse a line that contradicts itself, before anything is read."""
    for one in options:
        one.check()
    wanted.depths()
    for one in more:
        one.check(count)


def side_by_side(
    line: "Mapping[str, Any]", frames: "Sequence[Callable[[], tuple[Path, str | None]]]"
) -> "Iterator[list[Any]]":
    """Objects of several raw images, by the arguments of a `deconvolve` of one, or the error of each.

    Each frame gives its file and page, or an error. Those that share an operator are taken some at a time.
    """
    group: list[Any] = []
    for begun in (_begun(line, frame) for frame in frames):
        if not _joins(begun, group):
            yield _objects(group)
            group = []
        group.append(begun)
    yield _objects(group)


@dataclass(frozen=True)
class _Begun:
    """A prepared raw image, and the settings of its operator."""

    ready: "PreparedImage"
    asked: "_Asked"

    def exposure(self, engine: "Deconvolver") -> Any:
        """Exposure of the raw image."""
        known = engine.known(self.ready, None)
        assert not isinstance(known, tuple)  # one raw image
        _check_gain(self.asked.way, known.gain)
        return known


def _begun(line: "Mapping[str, Any]", frame: "Callable[[], tuple[Path, str | None]]") -> "_Begun | Any":
    """A raw image that may share an operator; else the object, or the error."""
    from lumigraph.instruments import load_camera

    try:
        given = SimpleNamespace(**line)
        path, page = frame()
        seen, way = replace(given.seen, page=page), given.way
        if given.others or way.warm or way.checkpoint is not None or given.bent != ADAPTIVE:
            more = {name: value for name, value in line.items() if name not in ("raw", "others")}
            return deconvolve(path, *given.others, **{**more, "seen": seen}).thing
        _check((given.common, seen, way), given.wanted, (given.several, given.bent), 1)
        described = load_camera(given.camera)
        ready = seen.prepared(_only(seen.frames(path), path), described)
        return _Begun(ready, _Asked.of(described, given.wanted, way, ready.calibration, silent))
    except Exception as error:
        return error


def _joins(begun: "_Begun | Any", group: list[Any]) -> bool:
    """True if a raw image can be deconvolved together with the others."""
    others = [one for one in group if isinstance(one, _Begun)]
    if not others or not isinstance(begun, _Begun):
        return True
    return begun.asked == others[0].asked and len(others) < _engine(others[0].asked).side_by_side


def _objects(group: list[Any]) -> list[Any]:
    """Objects of the raw images that were begun, by one operator."""
    mine = [one for one in group if isinstance(one, _Begun)]
    if not mine:
        return group
    try:
        engine = _engine(mine[0].asked)
        found = iter(engine.several([one.ready for one in mine], [one.exposure(engine) for one in mine]))
    except Exception as error:
        found = repeat(error)
    return [next(found) if isinstance(one, _Begun) else one for one in group]


def _only(frames: "list[tuple[str, Any]]", path: Path) -> Any:
    """The raw image of a file that is one of several."""
    if len(frames) > 1:
        raise FormatError(
            f"{path} has {len(frames)} pages, a time series, but several files are raw images of one object. "
            "Give one --page."
        )
    return frames[0][1]


_RUN: ContextVar["list[Deconvolver] | None"] = ContextVar("run", default=None)


@contextmanager
def pages_apart() -> "Iterator[None]":
    """Context in which the pages of a series come in calls of their own; the first one begins cold."""
    token = _RUN.set([])
    try:
        yield
    finally:
        _RUN.reset(token)


def _begin(engine: "Deconvolver") -> None:
    """Forget the result of the page before, unless it is of the same series."""
    run = _RUN.get()
    if run is None or engine not in run:
        engine.forget()
    if run is not None:
        run[:] = [engine]


@dataclass(frozen=True)
class _Task:
    """Settings that the pages of a series share."""

    engine: "Deconvolver"
    way: MethodOptions
    output: Path
    lights: tuple[float, ...] | None = None

    def _known(self, ready: Any) -> "tuple[Any, float | None]":
        """The exposure of a page, or those of several raw images of one object; and the gain of the first."""
        found = self.engine.known(ready, None)
        if not isinstance(found, tuple):
            return found, found.gain
        if self.lights is not None:
            found = tuple(replace(one, light=t) for one, t in zip(found, self.lights, strict=True))
        return found, found[0].gain

    def run(
        self, pages: "Iterator[tuple[str, Any]]", followed: "tuple[list[RunStep], Progress]"
    ) -> "Iterator[tuple[str, Any, Any]]":
        """Each page's name, the page and its object; the steps of one are kept, and shown."""
        from lumigraph import deconvolution, io

        (steps, shown), name, gain = followed, "", None

        def follow(step: "RunStep") -> None:
            if step.announces:
                if step.remaining > LONG:
                    shown(Needs(0.0, _needs(step)))
                return
            steps.append(step)
            what = f"{name[1:]} {reached(step, gain)}".strip()
            shown(Stage(step.iteration / step.iterations, what))

        try:
            for name, ready in pages:
                steps.clear()
                exposure, gain = self._known(ready)
                _check_gain(self.way, gain)
                found = self.engine(ready, exposure, progress=follow, checkpoint=self.way.checkpoint)
                yield name, ready, found
        except LumigraphError as error:
            raise type(error)(f"{name[1:].replace('-', ' ')}: {error}" if name else str(error)) from error
        except deconvolution.Interrupted as stopped:
            kept = _named(self.output, f"{name}.partial")
            io.save(stopped.partial, kept)
            raise KeyboardInterrupt(f"{stopped.iterations} iterations are in {kept}.") from None


def _needs(step: "RunStep") -> str:
    """Time and memory of all iterations, in words."""
    return (
        f"at most {step.iterations - step.iteration} iterations, about {step.remaining:.0f} s, "
        f"{memory.told(step.memory)}"
    )


def _check_gain(way: MethodOptions, gain: float | None) -> None:
    if way.deviance is not None and gain is None:
        raise FormatError(
            "--deviance counts electrons, but the raw image does not say how many make a value. "
            "Leave it out and use --iterations."
        )


@dataclass(frozen=True)
class _Asked:
    """Settings of a deconvolution; equal if the same result follows from them."""

    described: str
    wanted: ObjectOptions
    way: MethodOptions
    lattice: str
    shifts: Shifts | None
    camera: "Instrument" = field(compare=False)
    calibration: "Calibration | None" = field(compare=False)
    progress: Progress = field(compare=False)

    @classmethod
    def of(
        cls,
        camera: "Instrument",
        wanted: ObjectOptions,
        way: MethodOptions,
        calibration: "Calibration | None",
        progress: Progress,
        shifts: Shifts | None = None,
    ) -> "_Asked":
        """Settings, compared by the content of the camera's description and of the calibration."""
        from lumigraph.deconvolution.checkpoint import fingerprint

        return cls(
            camera.to_toml(), wanted, way, fingerprint(calibration), shifts, camera, calibration, progress
        )


@lru_cache(1)  # the frames of a batch share it
def _engine(asked: _Asked) -> "Deconvolver":
    from lumigraph.deconvolution import Deconvolver, Stop

    way = asked.way
    operator = operator_of(
        asked.camera, asked.wanted.depths(), asked.wanted.samples, asked.calibration, asked.progress,
        asked.shifts,
    )  # fmt: skip
    if asked.shifts is not None and len(set(asked.shifts)) > 1:  # finer than lenslets sample: no low-pass
        way = replace(way, raw_lattice=True)
    return Deconvolver(
        operator,
        Stop(way.iterations, way.deviance, way.change),
        method=way.method(asked.camera, operator),
        warm=way.warm,
    )


def _named(output: Path, name: str) -> Path:
    """The output with something between its name and its endings."""
    return output.with_name(f"{output.name.split('.')[0]}{name}{''.join(output.suffixes)}")


def operator_of(
    camera: "Instrument", planes: tuple[float, ...] | None, samples: int | None,
    calibration: "Calibration | None", progress: Progress = silent, shifts: Shifts | None = None,
) -> "Linear":  # fmt: skip
    """Operator of the camera for planes [m], or for an object that was moved by shifts [m]."""
    from lumigraph.metrology.scanning.joint import joint_operator_for

    if camera.calibration is None and samples is not None:
        raise FormatError(f"a {camera.noun} camera has no lenslets to count --samples by. Leave it out.")
    if shifts is not None:
        return joint_operator_for(camera, calibration, shifts, planes, samples, progress)
    return camera.operator_for(calibration, planes, samples, progress)
