"""Shared options of verbs: `--json`, `--debug`, and quantities with units."""

import math
import re
from contextvars import ContextVar
from dataclasses import dataclass
from functools import cache
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Group, Parameter

from lumigraph.errors import FormatError
from lumigraph.units import parse

if TYPE_CHECKING:
    from collections.abc import Sequence

    from cyclopts import Token

COMMAND: ContextVar[tuple[str, ...]] = ContextVar("COMMAND", default=())
"""Words after "lumigraph" of the command that runs."""

WARNED: ContextVar[list[str]] = ContextVar("WARNED")
"""Warnings that it has printed."""


_COUNTED, _LAST = count(), 1000


@cache  # the options of one section may stand in several classes
def section(title: str, *, last: bool = False) -> Group:
    """Section of a verb's help: those of a verb stand in the order of their making, the last at the end."""
    return Group(title, sort_key=_LAST if last else next(_COUNTED))


@Parameter(name="*", group=section("Output", last=True))
@dataclass(frozen=True)
class Common:
    """Options of every verb.

    Parameters
    ----------
    json
        Print one JSON object, lengths in metres.
    debug
        Show the traceback of an error.
    """

    json: Annotated[bool, Parameter(negative="")] = False
    debug: Annotated[bool, Parameter(negative="")] = False


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
