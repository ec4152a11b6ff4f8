"""Shared options of verbs: `--json`, `--debug`, and quantities with units."""

import math
import re
from contextvars import ContextVar
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Group, Parameter

from lumigraph.errors import FormatError
from lumigraph.units import parse, spaced

if TYPE_CHECKING:
    from collections.abc import Sequence

    from cyclopts import Token

COMMAND: ContextVar[tuple[str, ...]] = ContextVar("COMMAND", default=())
"""Words after "lumigraph" of the command that runs."""

WARNED: ContextVar[list[str]] = ContextVar("WARNED")
"""Warnings that it has printed."""


SECTIONS = (
    "Raw image", "Known beforehand", "Sampling", "Focus", "Picture", "Raw images of cameras 2.0",
    "Views of cameras 1.0", "Search", "Lengths", "Light", "Scene", "Object", "Method", "Adaptive optics",
    "Several raw images", "Region", "Dark images", "Goal", "Designer", "Page", "Workers", "Output",
)  # fmt: skip
"""Sections of verbs' help, in their order."""


@cache  # the options of one section may stand in several classes
def section(title: str) -> Group:
    """Section of a verb's help, one of `SECTIONS`."""
    return Group(title, sort_key=SECTIONS.index(title))


@Parameter(name="*", group=section("Output"))
@dataclass(frozen=True)
class Common:
    """Options of every verb.

    Parameters
    ----------
    json
        Print one JSON object, lengths in metres.
    debug
        Show the traceback of an error.
    overwrite
        Replace outputs that another command, or the same one for other inputs, has written.
    """

    json: Annotated[bool, Parameter(negative="")] = False
    debug: Annotated[bool, Parameter(negative="")] = False
    overwrite: Annotated[bool, Parameter(negative="")] = False


COMMON = Common()


def _telling(default: object) -> str | None:
    """Text of the default in the help, if it is informative."""
    return None if default is False or default is None else str(default)


PARAMETER = Parameter(negative=(), show_default=_telling)
"""Settings by which all verbs' options are read and shown."""
Output = Annotated[Path, Parameter(name=["--output", "-o"])]


def length(option: str, text: str | None) -> float | None:
    """A length [m] written with its unit after `option`; None stays None.

    Raises
    ------
    FormatError
        No quantity, another dimension, or no unit; the message names the option.
    """
    if text is None:
        return None
    try:
        return parse(text)
    except FormatError as error:
        raise FormatError(f"{option}: {error}") from error


RENAMED = {
    "--z": ("--depth",),
    "--depths": ("--depth",),
    "--lowest": ("--min-confidence",),
    "--highest": ("--full-scale",),
    "--between": ("--range",),
    "--still": ("--pivot",),
    "--smoothness": ("--smooth",),
    "--views": ("--in-views", "--directions"),
    "--shape": ("--aperture-shape",),
    "--pitch": ("--pixel-pitch",),
}
"""Options of earlier versions, and those that took their place."""


def numbers(option: str, text: str) -> list[float]:
    """Numbers of a range after `option`, see `units.spaced`; of pixels, the unit may stand with each.

    Raises
    ------
    FormatError
        Another form, or another unit.
    """
    found, unit = spaced(text, option)
    if unit not in ("", "px"):
        raise FormatError(f"{option} {text!r} has the unit {unit!r} but takes numbers, such as 0.9:1.1:x9.")
    return found


def lengths(option: str, texts: "str | Sequence[str] | None") -> list[float]:
    """Lengths [m] after `option`: each one length, several with commas between them, or a range.

    Raises
    ------
    FormatError
        Another form, another dimension, or no unit.

    >>> lengths("--depth", ["-2 um:2 um:2 um", "5 um, 1 mm"])
    [-2e-06, 0.0, 2e-06, 5e-06, 0.001]
    """
    found: list[float] = []
    for text in [texts] if isinstance(texts, str) else texts or ():
        for part in text.split(","):
            values, unit = spaced(part, option) if ":" in part else ([part.strip()], "")
            found += [length(option, f"{value} {unit}".strip()) or 0.0 for value in values]
    return found


def planes(option: str, texts: "str | Sequence[str]") -> tuple[float, ...]:
    """Depths [m] of a volume after `option`, ascending; see `lengths`.

    Raises
    ------
    FormatError
        A range that goes down, or a depth twice.
    """
    for text in [texts] if isinstance(texts, str) else texts:
        for part in text.split(","):
            values = spaced(part, option)[0] if ":" in part else []
            if values[1:] and values[-1] < values[0]:
                raise FormatError(f"{option} {part.strip()!r} must ascend: write its least depth first.")
    found = sorted(lengths(option, texts))
    if len(set(found)) < len(found):
        raise FormatError(f"{option} {texts!r} names a depth twice.")
    return tuple(found)


_REGION = re.compile(r"\s*(\d+):(\d+)\s*,\s*(\d+):(\d+)\s*")
_CLOSED = re.compile(r"\s*(\d+)-(\d+):(\d+)-(\d+)\s*")  # rows:columns, each with its last one


def region(text: str, shape: tuple[int, ...]) -> tuple[slice, slice]:
    """Rows and columns of a picture (y, x[, c]) after `--region`, such as '100:180, 40:120'.

    The ends are left out, as in slices; '100-179:40-119' is another spelling of the same.

    Raises
    ------
    FormatError
        Another form, or not inside the picture.
    """
    half_open, closed = _REGION.fullmatch(text), _CLOSED.fullmatch(text)
    found = half_open or closed
    if found is None:
        raise FormatError(f"--region {text!r} must be 'y0:y1, x0:x1', such as '100:180, 40:120'.")
    top, bottom, left, right = map(int, found.groups())
    bottom, right = (bottom, right) if half_open else (bottom + 1, right + 1)
    if not (top < bottom <= shape[0] and left < right <= shape[1]):
        raise FormatError(f"--region {text!r} is not inside the picture of {shape[0]} x {shape[1]} px.")
    return slice(top, bottom), slice(left, right)


def above_zero(option: str, value: float | None, unit: str = "") -> float | None:
    """The number after `option`, refused unless it is finite and above zero; None stays None.

    Raises
    ------
    FormatError
        Zero, negative, NaN or infinite.
    """
    if value is not None and (not math.isfinite(value) or value <= 0):
        raise FormatError(f"{option} is {value:g}{unit and ' ' + unit} but must be a finite number above 0.")
    return value


def pixels(_: object, tokens: "Sequence[Token]") -> float:
    """A number of pixels on the command line, with its unit or without: '15' and '15 px'.

    Raises
    ------
    ValueError
        Another unit, or no number; the command line names the option.
    """
    text = tokens[0].value
    try:
        return float(text.removesuffix("px"))
    except ValueError:
        raise ValueError(f"{text!r} must be a number of pixels, such as 15 or '15 px'") from None
