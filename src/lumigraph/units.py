"""Units as plain floats, and a parser for quantities written with their unit.

Everything inside lumigraph is in SI: metres, radians, seconds. A unit is the number to multiply by,
so ``50*mm`` is ``0.05``; files and the command line write ``"50 mm"``, which `parse` reads.
"""

import math
import re

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
_UNITS: dict[str, tuple[str, float, float]] = {}
"""By name: dimension, and what to multiply and to divide by; each is exact, so that results round once."""


def _name(dimension: str, names: str, times: float = 1.0, over: float = 1.0) -> None:
    _UNITS.update(dict.fromkeys(names.split(), (dimension, times, over)))


_name("length", "km kilometer kilometre kilometers kilometres", 1e3)
_name("length", "m meter metre meters metres")
_name("length", "dm decimeter decimetre", over=1e1)
_name("length", "cm centimeter centimetre centimeters centimetres", over=1e2)
_name("length", "mm millimeter millimetre millimeters millimetres", over=1e3)
_name("length", "um µm μm micron microns micrometer micrometre micrometers micrometres", over=1e6)
_name("length", "nm nanometer nanometre nanometers nanometres", over=1e9)
_name("length", "Å angstrom angstroms", over=1e10)
_name("length", "pm picometer picometre", over=1e12)
_name("length", "in inch inches", 254.0, 1e4)
_name("length", "ft foot feet", 3048.0, 1e4)
_name("angle", "rad radian radians")
_name("angle", "mrad milliradian milliradians", over=1e3)
_name("angle", "urad µrad μrad microradian microradians", over=1e6)
_name("angle", "deg degree degrees °", math.pi, 180.0)
_name("angle", "arcmin arcminute arcminutes", math.pi, 180.0 * 60)
_name("angle", "arcsec arcsecond arcseconds", math.pi, 180.0 * 3600)
_name("time", "h hour hours", 3600.0)
_name("time", "min minute minutes", 60.0)
_name("time", "s sec second seconds")
_name("time", "ms millisecond milliseconds", over=1e3)
_name("time", "us µs μs microsecond microseconds", over=1e6)
_name("mass", "kg g mg")
_name("frequency", "Hz kHz MHz")
_name("time", "ns nanosecond nanoseconds", over=1e9)
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
    known, times, over = _UNITS[unit]
    if known != dimension:
        raise FormatError(f"{text!r} is not a {dimension}. {hint}")
    return number * times / over
