"""Units as plain floats, and a parser for quantities written with their unit.

Everything inside lumigraph is in SI: metres, radians, seconds. A unit is the number to multiply by,
so ``50*mm`` is ``0.05``; files and the command line write ``"50 mm"``, which `parse` reads.
"""

import math
import re
from functools import cache
from typing import Any

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

_SI_UNIT = {"length": "m", "angle": "rad", "time": "s"}
_EXAMPLE = {"length": "150 um", "angle": "2 deg", "time": "10 ms"}
# A number, then one unit name. Expressions are refused: "9**9**9 m" would keep the parser busy for ever.
_LONGEST = 100
_QUANTITY = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*([^\W\d_]*|°)\s*")


@cache
def _registry() -> Any:
    import pint

    return pint.UnitRegistry()


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
    import pint

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
    try:
        return float(_registry().Quantity(number, unit).to(_SI_UNIT[dimension]).magnitude)
    except pint.DimensionalityError:
        raise FormatError(f"{text!r} is not a {dimension}. {hint}") from None
    except pint.UndefinedUnitError:
        raise FormatError(f"{text!r} has an unknown unit {unit!r}. {hint}") from None
