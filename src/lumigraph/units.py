"""Units as plain floats, and a parser for quantities written with their unit.

Everything inside lumigraph is in SI: metres, radians, seconds. A unit is the number to multiply by,
so ``50*mm`` is ``0.05``; files and the command line write ``"50 mm"``, which `parse` reads, and ranges
``"40 mm:60 mm:5 mm"``, which `spaced` reads. Python takes both: `metres` converts what a user gives.
"""

import math
import re
from decimal import Decimal

from lumigraph.errors import FormatError

m = 1.0
cm = 1e-2
mm = 1e-3
um = 1e-6
nm = 1e-9
rad = 1.0
mrad = 1e-3
deg = math.pi / 180
s = 1.0
ms = 1e-3

_EXAMPLE = {"length": "150 um", "angle": "2 deg", "time": "10 ms"}
_UNITS: dict[str, tuple[str, float]] = {}
"""Dimension and size by name."""


def _name(dimension: str, size: float, names: str) -> None:
    _UNITS.update(dict.fromkeys(names.split(), (dimension, size)))


_name("length", 1e3, "km kilometer kilometre kilometers kilometres")
_name("length", m, "m meter metre meters metres")
_name("length", 1e-1, "dm decimeter decimetre")
_name("length", cm, "cm centimeter centimetre centimeters centimetres")
_name("length", mm, "mm millimeter millimetre millimeters millimetres")
_name("length", um, "um µm μm micron microns micrometer micrometre micrometers micrometres")
_name("length", nm, "nm nanometer nanometre nanometers nanometres")
_name("length", 1e-10, "Å angstrom angstroms")
_name("length", 1e-12, "pm picometer picometre")
_name("length", 0.0254, "in inch inches")
_name("length", 0.3048, "ft foot feet")
_name("angle", rad, "rad radian radians")
_name("angle", mrad, "mrad milliradian milliradians")
_name("angle", 1e-6, "urad µrad μrad microradian microradians")
_name("angle", deg, "deg degree degrees °")
_name("angle", deg / 60, "arcmin arcminute arcminutes")
_name("angle", deg / 3600, "arcsec arcsecond arcseconds")
_name("time", 3600.0, "h hour hours")
_name("time", 60.0, "min minute minutes")
_name("time", s, "s sec second seconds")
_name("time", ms, "ms millisecond milliseconds")
_name("time", 1e-6, "us µs μs microsecond microseconds")
_name("time", 1e-9, "ns nanosecond nanoseconds")
_name("mass", 1.0, "kg g mg")
_name("frequency", 1.0, "Hz kHz MHz")
# A number, then one unit name. Expressions are refused: "9**9**9 m" would keep the parser busy for ever.
_LONGEST = 100
_QUANTITY = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*([^\W\d_]*|°)\s*")


def parse(text: str | float, dimension: str = "length") -> float:
    """Value in SI units of a quantity written with its unit.

    Parameters
    ----------
    text
        A number and a unit, such as ``"150 um"`` or ``"2.5 mrad"``. A bare number is refused, because
        it does not say whether it means metres or millimetres; zero needs no unit.
    dimension
        ``"length"`` [m], ``"angle"`` [rad] or ``"time"`` [s].

    Raises
    ------
    FormatError
        Not a quantity, not finite, or of another dimension.

    Examples
    --------
    >>> round(parse("150 um"), 9)
    0.00015
    >>> round(parse("1.5 deg", "angle"), 6)
    0.02618
    """
    hint = f"Write a number and a unit, such as {_EXAMPLE[dimension]!r}."
    # Longer ones would keep the pattern busy: the time it takes grows with the square of the length.
    written = text if isinstance(text, str) else repr(text) if isinstance(text, float) else str(text)[:1000]
    match = _QUANTITY.fullmatch(written) if len(written) <= _LONGEST else None
    if match is None:
        raise FormatError(f"{written[:60]!r} is not a quantity. {hint}")
    number, unit = float(match[1]), match[2]
    if not math.isfinite(number):
        raise FormatError(f"{text!r} is not finite. {hint}")
    if not unit:
        if number == 0:
            return 0.0
        raise FormatError(f"{text!r} has no unit. {hint}")
    if unit not in _UNITS:
        raise FormatError(f"{text!r} has an unknown unit {unit!r}. {hint}")
    known, size = _UNITS[unit]
    if known != dimension:
        article = "an" if dimension[0] in "aeiou" else "a"
        raise FormatError(f"{text!r} is not {article} {dimension}. {hint}")
    return float(Decimal(match[1]) * Decimal(repr(size)))  # 200 * 1e-6 is not 2e-4


MOST_VALUES = 1000
"""Values of a range, unless its user takes more."""

RANGE = "first:last:step, such as '-20 um:20 um:2 um', or first:last:xN, such as 0.9:1.1:x9"
"""The two forms of a range, for messages."""


def spaced(text: str, option: str = "the range", most: int = MOST_VALUES) -> tuple[list[float], str]:
    """Values of a range in its unit, and that unit.

    Parameters
    ----------
    text
        ``first:last:step``, with the step's own unit, or ``first:last:xN`` for N values, of which one stands
        in the middle. The last value is left out where no whole number of steps leads to it.
    option
        What errors call it, such as ``"--depth"``.
    most
        Values that are taken at most.

    Raises
    ------
    FormatError
        Another form, units of two dimensions, a step that leads away from the last value, or too many values.

    Examples
    --------
    >>> spaced("-20 um:20 um:10 um")
    ([-20.0, -10.0, 0.0, 10.0, 20.0], 'um')
    >>> spaced("0.9:1.1:x3"), spaced("4 mm:5 mm:500 um")
    (([0.9, 1.0, 1.1], ''), ([4.0, 4.5, 5.0], 'mm'))
    """
    words = [word.strip() for word in text.split(":")] if len(text) <= 3 * _LONGEST else []
    if len(words) != 3:
        raise FormatError(f"{option} is {text[:60]!r} but must be {RANGE}.")
    number = re.fullmatch(r"x\s*(\d{1,9})", words[2])
    found = [_QUANTITY.fullmatch(word) for word in (words[:2] if number else words)]
    if any(one is None or not math.isfinite(float(one[1])) for one in found):
        raise FormatError(f"{option} is {text[:60]!r} but must be {RANGE}, in finite numbers.")
    parts = [(Decimal(one[1]), one[2]) for one in found if one]
    unit = next((name for _, name in parts if name), "")
    if number is None:
        _check_step(option, words, parts, unit)
    values = [size * _ratio(name, unit, f"{option} {text!r}") if size else size for size, name in parts]
    count = int(number[1]) if number else _steps(values, f"{option} {text!r}")
    if not 1 <= count <= most:
        raise FormatError(f"{option} {text!r} asks for {count} values but must have 1 to {most}.")
    first, last = values[:2]
    if number is None:
        return [float(first + k * values[2]) for k in range(count)], unit
    if count == 1:
        return [float((first + last) / 2)], unit
    return [float(first + (last - first) * k / (count - 1)) for k in range(count)], unit


def _check_step(option: str, words: list[str], parts: list[tuple[Decimal, str]], unit: str) -> None:
    """Refuse a third number that could be a count: it was one in earlier versions."""
    ends, last = f"{words[0]}:{words[1]}", words[2]
    if unit and not parts[2][1]:
        raise FormatError(
            f"{option} {':'.join(words)!r} has a step without a unit. Write '{ends}:x{last}' for a count, "
            f"or '{ends}:{last} {unit}' for a step."
        )
    if not unit and last.isdecimal():
        raise FormatError(
            f"{option} {':'.join(words)!r} does not say whether {last} is a count or a step. "
            f"Write '{ends}:x{last}' for a count, or '{ends}:{last}.0' for a step."
        )


def _ratio(name: str, unit: str, written: str) -> Decimal:
    """Size of one unit in another."""
    if name == unit:
        return Decimal(1)
    known, other = _UNITS.get(name), _UNITS.get(unit)
    if known is None or other is None or known[0] != other[0]:
        raise FormatError(f"{written} has the units {name!r} and {unit!r}. Give all parts in one.")
    return Decimal(repr(known[1])) / Decimal(repr(other[1]))


def _steps(values: list[Decimal], written: str) -> int:
    """Number of values from the first to the last by a step."""
    first, last, step = values
    if float(step) == 0 or (last - first) * step < 0:
        raise FormatError(
            f"{written} must lead from its first to its last value: its step is {float(step):g}."
        )
    return int(min(float(last - first) / float(step), 1e15) * (1 + 1e-9)) + 1
