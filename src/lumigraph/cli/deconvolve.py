"""`lumigraph deconvolve`."""

import math
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from lumigraph.cli import files
from lumigraph.cli.console import progress
from lumigraph.cli.deconvolved import reached, result
from lumigraph.cli.options import Output, above_zero, length, region
from lumigraph.cli.reporting import REPORTED, Reported
from lumigraph.cli.several import SEVERAL, Several, Shifts
from lumigraph.core.progress import Progress, Stage, silent, within
from lumigraph.core.result import Result
from lumigraph.errors import FormatError

if TYPE_CHECKING:
    from collections.abc import Iterator

    import numpy as np

    from lumigraph.core.calibration import Calibration
    from lumigraph.core.linear import Linear
    from lumigraph.core.prepared import PreparedImage
    from lumigraph.core.raw import RawImage
    from lumigraph.deconvolution import Deconvolver, RichardsonLucy, Step
    from lumigraph.instruments import Instrument

MOST_DEPTHS = 1000


@Parameter(name="*")
@dataclass(frozen=True)
class Seen:
    """What is known of the raw image.

    Parameters
    ----------
    white
        White image: a microscope's lenslets are found on it, and its vignetting is taken into account.
    dark
        Dark image: what pixels read without light, and which shine by themselves.
    background
        Value that every pixel reads without light, if there is no dark image.
    calibration
        File made by 'lumigraph calibrate', or by the camera's maker, instead of the lenslets found on the
        white image.
    region
        Rows and columns of the raw image that count, such as '100:501, 80:641'; the rest is neither fitted
        nor cut off.
    page
        Pages of a stack, counted from 0: one, such as 3, several, such as 3:9 or 3-9, or 'all'.
    """

    white: Path | None = None
    dark: Path | None = None
    background: Annotated[float | None, Parameter(allow_leading_hyphen=True)] = None
    calibration: Path | None = None
    region: str | None = None
    page: str | None = None

    def check(self) -> None:
        """Refuse what can be seen to be wrong before anything is read."""
        if self.dark is not None and self.background is not None:
            raise FormatError("--dark and --background both give the dark level. Give one of them.")
        if self.background is not None and not (math.isfinite(self.background) and self.background >= 0):
            raise FormatError(f"--background is {self.background:g} but must be at least 0.")

    def prepared(self, raw: "RawImage", camera: "Instrument") -> "PreparedImage":
        """The raw image as it was read, with what the model of a deconvolution takes."""
        from lumigraph.preparation import Given

        given = Given(self.calibration, self.white, self.dark)
        ready = given.prepared(raw, camera=camera, mask=self._mask(raw.shape), divide=False)
        return ready if self.background is None else replace(ready, background=self.background)

    def _mask(self, shape: tuple[int, int]) -> "np.ndarray | None":
        import numpy as np

        if self.region is None:
            return None
        mask = np.zeros(shape, bool)
        mask[region(self.region, shape)] = True
        return mask

    def frames(self, path: Path) -> "list[tuple[str, Any]]":
        """Raw images and what to add to the output's name for each."""
        from lumigraph.preparation import read_pages

        found = read_pages(path, self.page)
        digits = len(str(max(found)))
        return [("" if len(found) == 1 else f"-page-{k:0{digits}}", raw) for k, raw in found.items()]


@Parameter(name="*")
@dataclass(frozen=True)
class Wanted:
    """Where objects are looked for.

    Parameters
    ----------
    z
        Depths from the focused plane, positive farther: '-20 um:20 um:2 um' (first, last, step), or some,
        separated by commas; the focused plane if left out.
    samples
        Object samples along each lenslet.
    """

    z: Annotated[str | None, Parameter(allow_leading_hyphen=True)] = None
    samples: Annotated[int | None, Parameter(allow_leading_hyphen=True)] = None

    def depths(self) -> tuple[float, ...] | None:
        """Depths [m]."""
        if self.samples is not None and self.samples < 1:
            raise FormatError(f"--samples is {self.samples} but must be at least 1.")
        return None if self.z is None else depths("--z", self.z)


@Parameter(name="*")
@dataclass(frozen=True)
class Way:
    """How it is done.

    Parameters
    ----------
    iterations
        Most iterations of Richardson-Lucy.
    prior
        none; tv: even but for edges (total variation); wavelets: few coefficients that are not noise.
    strength
        Strength of the prior, from 0.001 for bright images to 0.1 for dim ones.
    accelerated
        Momentum: as likely in a third of the iterations.
    deviance
        Stop where the deviance per pixel falls to this: to 1 for raw images of 'simulate --noise', whose
        electrons are known; refused where they are not.
    raw_lattice
        Leave out the low-pass that keeps squares as large as lenslets out of a microscope's volumes. Objects
        that were moved between raw images have none.
    checkpoint
        File (.npz) from which a killed run goes on.
    warm
        Begin each page of a series with the result of the one before: where little moves, half of the
        iterations are enough.
    """

    iterations: Annotated[int, Parameter(allow_leading_hyphen=True)] = 30
    prior: Literal["none", "tv", "wavelets"] = "none"
    strength: Annotated[float | None, Parameter(allow_leading_hyphen=True)] = None
    accelerated: Annotated[bool, Parameter(negative="")] = False
    deviance: Annotated[float | None, Parameter(allow_leading_hyphen=True)] = None
    raw_lattice: Annotated[bool, Parameter(negative="")] = False
    checkpoint: Path | None = None
    warm: Annotated[bool, Parameter(negative="")] = False

    def check(self) -> None:
        """Refuse what can be seen to be wrong before anything is read."""
        if self.iterations < 1:
            raise FormatError(f"--iterations is {self.iterations} but must be at least 1.")
        if self.strength is not None and self.prior == "none":
            raise FormatError("--strength needs a prior. Give --prior tv or --prior wavelets.")
        above_zero("--strength", self.strength)
        above_zero("--deviance", self.deviance)

    def method(self, camera: "Instrument", operator: "Linear") -> "RichardsonLucy":
        """`RichardsonLucy` with what was asked for."""
        from lumigraph.deconvolution import RichardsonLucy, TotalVariation, Wavelets
        from lumigraph.instruments.smoothing import low_pass_of

        given: dict[str, Any] = {} if self.strength is None else {"strength": self.strength}
        prior = {"none": None, "tv": TotalVariation(**given), "wavelets": Wavelets(**given)}[self.prior]
        smooth = None if self.raw_lattice else low_pass_of(camera, operator)
        return RichardsonLucy(prior, smooth, accelerated=self.accelerated)


def deconvolve(
    raw: Path,
    /,
    *others: Path,
    output: Output,
    camera: str,
    seen: Seen = Seen(),
    wanted: Wanted = Wanted(),
    way: Way = Way(),
    several: Several = SEVERAL,
    common: Reported = REPORTED,
) -> Result:
    """Reconstruct what was in front of a microscope or a camera from raw images, or a time series.

    A light-field microscope gives a volume, a focused camera the picture of its main lens, or one for each
    of several depths. The object is followed as far beyond the picture as light comes from, and cut
    afterwards. Ctrl-C writes what was reached. Several files are raw images of one object, deconvolved
    together; several pages of one file are a time series, deconvolved one after the other.

    Example: `lumigraph deconvolve raw.tif --white white.tif --dark dark.tif --camera scope.toml --z "-20 um:20 um:2 um" -o volume.ome.tif`

    Example: `lumigraph deconvolve film.tif --page 0:9 --camera scope.toml --z "-20 um:20 um:2 um" -o volume.ome.tif`

    Example: `lumigraph deconvolve a.tif b.tif c.tif d.tif --shifts 2x2 --camera camera.toml -o picture.tiff`

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
    for options in (common, seen, way):
        options.check()
    wanted.depths()  # refused before anything is read
    several.check(1 + len(others))
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
        made = within(shown, 0.0, 1.0, "point images")
        made(0.0)
        shifts = several.moved(described, 1 + len(more)) if more else None
        engine = _engine(_Asked.of(camera, wanted, way, ready.calibration, made, shifts))
        _begin(engine)
        task = _Task(engine, way, output, None if several.light is None else several.lights())
        pages: list[tuple[str, Any]] = [(name, replace(ready, data=frame.data)) for name, frame in frames]
        if more:
            pages = [("", [ready, *(seen.prepared(frame, described) for frame in more)])]
        for name, found in task.run(pages, (steps, shown)):
            written.append(_named(output, name))
            io.save(found, written[-1])
    return result(found, ready if more else pages[-1][1], steps, tuple(written))


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
    """What the pages of a series share."""

    engine: "Deconvolver"
    way: Way
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
        self, pages: "list[tuple[str, Any]]", followed: "tuple[list[Step], Progress]"
    ) -> "Iterator[tuple[str, Any]]":
        """The name and the object of each page; the steps of one are kept, and shown."""
        from lumigraph import deconvolution, io

        (exposure, gain), (steps, shown), name = self._known(pages[0][1]), followed, ""
        if self.way.deviance is not None and gain is None:
            raise FormatError(
                "--deviance counts electrons, but the raw image does not say how many make a value. "
                "Leave it out and use --iterations."
            )

        def follow(step: "Step") -> None:
            steps.append(step)
            what = f"{name[1:]} {reached(step, gain)}".strip()
            shown(Stage(step.iteration / step.iterations, what))

        try:
            for name, ready in pages:
                steps.clear()
                yield name, self.engine(ready, exposure, progress=follow, checkpoint=self.way.checkpoint)
        except deconvolution.Interrupted as stopped:
            kept = _named(self.output, f"{name}.partial")
            io.save(stopped.partial, kept)
            raise KeyboardInterrupt(f"{stopped.iterations} iterations are in {kept}.") from None


@dataclass(frozen=True)
class _Asked:
    """What a deconvolution is made of; equal where the same comes of it."""

    described: str
    wanted: Wanted
    way: Way
    lattice: str
    shifts: Shifts | None
    camera: "Instrument" = field(compare=False)
    calibration: "Calibration | None" = field(compare=False)
    progress: Progress = field(compare=False)

    @classmethod
    def of(
        cls, camera: str, wanted: Wanted, way: Way, calibration: "Calibration | None", progress: Progress,
        shifts: Shifts | None = None,
    ) -> "_Asked":  # fmt: skip
        """By the content of the camera's description and of the calibration."""
        from lumigraph.deconvolution.checkpoint import fingerprint
        from lumigraph.instruments import load_camera

        found = load_camera(camera)
        return cls(
            found.to_toml(), wanted, way, fingerprint(calibration), shifts, found, calibration, progress
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
        operator, Stop(way.iterations, way.deviance), method=way.method(asked.camera, operator), warm=way.warm
    )


def _named(output: Path, name: str) -> Path:
    """The output with something between its name and its endings."""
    return output.with_name(f"{output.name.split('.')[0]}{name}{''.join(output.suffixes)}")


def depths(option: str, text: str) -> tuple[float, ...]:
    """Depths [m] written as 'first:last:step' or separated by commas.

    Raises
    ------
    FormatError
        No lengths, a step that does not lead from the first to the last, or more than `MOST_DEPTHS`.

    >>> [round(dz * 1e6, 6) for dz in depths("--z", "-2 um:3 um:2 um")]
    [-2.0, 0.0, 2.0]
    >>> depths("--z", "-20 um:20 um:2 um")[10]
    0.0
    """
    if ":" not in text:
        found = sorted(length(option, part.strip()) or 0.0 for part in text.split(","))
        if len(set(found)) < len(found):
            raise FormatError(f"{option} {text!r} names a depth twice.")
        return tuple(found)
    parts = [length(option, part.strip()) or 0.0 for part in text.split(":")]
    if len(parts) != 3:
        raise FormatError(f"{option} is {text!r} but must be 'first:last:step', such as '-20 um:20 um:2 um'.")
    first, last, step = parts
    if step <= 0 or last < first:
        raise FormatError(
            f"{option} {text!r} must ascend: its step must be above 0, its last after its first."
        )
    count = (last - first) / step * (1 + 1e-9) + 1
    if count > MOST_DEPTHS:
        raise FormatError(f"{option} {text!r} asks for {count:.3g} depths; at most {MOST_DEPTHS} are taken.")
    planes = (first + k * step for k in range(int(count)))
    return tuple(0.0 if abs(dz) < 1e-9 * step else dz for dz in planes)  # no 1.7e-21 for the focused plane


def operator_of(
    camera: "Instrument", planes: tuple[float, ...] | None, samples: int | None,
    calibration: "Calibration | None", progress: Progress = silent, shifts: Shifts | None = None,
) -> "Linear":  # fmt: skip
    """The camera's model of how it sees planes [m], or an object that was moved by shifts [m]."""
    from lumigraph.instruments.joint import joint_operator_for

    if camera.calibration is None and samples is not None:
        raise FormatError(f"a {camera.noun} camera has no lenslets to count --samples by. Leave it out.")
    if shifts is not None:
        return joint_operator_for(camera, calibration, shifts, planes, samples, progress)
    return camera.operator_for(calibration, planes, samples, progress)
