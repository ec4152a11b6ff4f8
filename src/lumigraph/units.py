"""Units as plain floats, and a parser for quantities written with their unit.

Everything inside lumigraph is in SI: metres, radians, seconds. A unit is the number to multiply by,
so ``50*mm`` is ``0.05``; files and the command line write ``"50 mm"``, which `parse` reads.
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
