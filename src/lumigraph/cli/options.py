"""What verbs share: `--json`, `--debug`, and quantities with units."""

import math
from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from lumigraph.errors import FormatError
from lumigraph.units import parse

COMMAND: ContextVar[tuple[str, ...]] = ContextVar("COMMAND", default=())
"""Words after "lumigraph" of the command that runs."""

WARNED: ContextVar[list[str]] = ContextVar("WARNED")
"""Warnings that it has printed."""


@Parameter(name="*")
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
    """The default as the help shows it, if it is worth showing."""
    return None if default is False or default is None else str(default)


PARAMETER = Parameter(negative=(), show_default=_telling)
"""How all verbs' options are read and shown."""
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
