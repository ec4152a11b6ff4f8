"""Parameters of an instrument: sliders with units and ranges, and instruments from their values."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from lumigraph.core import checks
from lumigraph.errors import FormatError
from lumigraph.instruments.lenslets import Lenslets
from lumigraph.instruments.parts import Pixels

MOST_LENSLETS = 301
"""Along each side, so that every answer comes at once."""

_SPAN = 8.0  # a slider reaches from the value over this to the value times this
_UNITS = {"nm": 1e-9, "µm": 1e-6, "mm": 1e-3}


@dataclass(frozen=True, slots=True)
class Parameter:
    """One control.

    Parameters
    ----------
    key
        Key in the camera file, such as "lenslets.pitch".
    label
        Name for people.
    unit, scale
        Unit as it is written, and its size in SI.
    value
        Value in that unit; text for a choice, None where it is computed.
    low, high
        Ends of the slider, in that unit.
    kind
        "log" or "linear" slider, "whole" numbers, or a "choice".
    choices
        Words to choose from.
    optional
        True if it may be left out, and is then computed.
    """

    key: str
    label: str
    unit: str
    scale: float
    value: Any
    low: float = 0.0
    high: float = 1.0
    kind: str = "log"
    choices: tuple[str, ...] = ()
    optional: bool = False

    def in_si(self, value: float) -> float:
        """A value in the parameter's unit, rounded once, as `units.parse` does: 120 µm is 0.00012 m."""
        return value / round(1 / self.scale)


def length(
    key: str, label: str, value: float, unit: str, ends: tuple[float, float] | None = None
) -> Parameter:
    """A length [m] in a unit, from an eighth of it to eight times it unless its ends are given."""
    shown = float(f"{value / _UNITS[unit]:.10g}")
    low, high = ends or (shown / _SPAN, shown * _SPAN)
    return Parameter(key, label, unit, _UNITS[unit], shown, min(low, shown), max(high, shown))


def number(
    key: str, label: str, value: float, ends: tuple[float, float], *, kind: str = "linear"
) -> Parameter:
    """A number between its ends."""
    return Parameter(key, label, "", 1.0, value, *ends, kind)


def magnified(key: str, label: str, value: float, ends: tuple[float, float]) -> Parameter:
    """Parameter of a magnification."""
    return Parameter(key, label, "×", 1.0, value, *ends)


def choice(key: str, label: str, value: str, choices: tuple[str, ...]) -> Parameter:
    """One of some words."""
    return Parameter(key, label, "", 1.0, value, kind="choice", choices=choices)


def optional(parameter: Parameter, *, given: bool) -> Parameter:
    """The same, but it may be left out, and is where it is not given."""
    return replace(parameter, optional=True, value=parameter.value if given else None)


def wavelength(value: float) -> Parameter:
    """Parameter of the wavelength, near ultraviolet to near infrared."""
    return length("wavelength", "Wavelength", value, "nm", (350.0, 1000.0))


def pixel(pixels: Pixels) -> Parameter:
    """Parameter of the pixel pitch."""
    return length("sensor.pixel_pitch", "Pixel pitch", pixels.pixel_pitch, "µm")


def lenslets(part: Lenslets, *, layouts: bool) -> tuple[Parameter, ...]:
    """Parameters of an array; its layout may be changed or is fixed."""
    found = [length("lenslets.pitch", "Lenslet pitch p", part.pitch, "µm")]
    if len(part.focal_length) == 1:
        found.append(length("lenslets.focal_length", "Lenslet focal length", part.focal_length[0], "mm"))
    for k, side in enumerate(("rows", "columns")):
        count, ends = min(part.count[k], MOST_LENSLETS), (1, MOST_LENSLETS)
        found.append(number(f"lenslets.count.{k}", f"Lenslets, {side}", count, ends, kind="whole"))
    if layouts:
        found.append(choice("lenslets.layout", "Layout", part.layout, ("square", "hex")))
    return (*found, number("lenslets.fill_factor", "Fill factor", part.fill_factor, (0.3, 1.0)))


def changes(own: tuple[Parameter, ...], values: Any, count: tuple[int, int] | None) -> dict[str, Any]:
    """Changes for `Instrument.replace` from a page's values: only those that differ from its own.

    Parameters
    ----------
    own
        Parameters at the instrument's values.
    values
        Values by the parameters' keys, in their units; what is missing stays.
    count
        Number of lenslets; None without them.

    Raises
    ------
    FormatError
        An unknown key, or a value of another type.
    """
    if not isinstance(values, Mapping):
        raise FormatError("values must be numbers by their keys.")
    known = {each.key: each for each in own}
    found: dict[str, Any] = {}
    counts = list(count or ())
    for key, value in values.items():
        if key not in known:
            raise FormatError(f"{str(key)[:60]!r} is not a parameter of this camera.")
        each = known[key]
        value = _checked(each, value)
        if value == each.value:
            continue
        if key.startswith("lenslets.count."):
            counts[int(key[-1])] = value
            found.setdefault("lenslets", {})["count"] = tuple(counts)
            continue
        table, _, name = key.rpartition(".")
        inside = found.setdefault(table, {}) if table else found
        inside[name] = value if value is None or each.kind == "choice" else each.in_si(value)
    return found


def _checked(parameter: Parameter, value: Any) -> Any:
    name = parameter.key
    if value is None:
        if parameter.optional:
            return None
        raise FormatError(f"{name} is None but must be a finite number.")
    if parameter.kind == "choice":
        if value not in parameter.choices:
            raise FormatError(f"{name} is {str(value)[:60]!r} but must be {' or '.join(parameter.choices)}.")
        return value
    number = checks.finite(name, value, "1", FormatError)
    if parameter.kind != "whole":
        return number
    if number != int(number) or not 1 <= number <= MOST_LENSLETS:
        raise FormatError(f"{name} is {number:g} but must be a whole number from 1 to {MOST_LENSLETS}.")
    return int(number)


@dataclass(frozen=True, slots=True)
class MagnificationRange:
    """Range of magnifications of an instrument.

    Parameters
    ----------
    label
        Name of the magnification.
    own
        The instrument's.
    ends
        The least and the largest absolute value.
    at
        The instrument with another magnification.
    """

    label: str
    own: float
    ends: tuple[float, float]
    at: Callable[[float], Any]

    def spaced(self, count: int) -> list[float]:
        """So many of them, in equal ratios, with the sign of the instrument's own."""
        (low, high), sign = self.ends, math.copysign(1.0, self.own)
        return [sign * low * (high / low) ** (k / (count - 1)) for k in range(count)]
