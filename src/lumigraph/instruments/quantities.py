"""Types of the numbers in a camera: SI floats or text with a unit in Python, text with a unit in a file.

A validator's message does not name the field: `problems.readable` puts the dotted name before it.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from numbers import Real
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import BeforeValidator, PlainSerializer, ValidationInfo

from lumigraph import units
from lumigraph.core import checks
from lumigraph.errors import FormatError, GeometryError

FROM_FILE = {"file": True}
"""Validation context in which a bare number is no length: it would not say metres or millimetres."""

SHORTEST, LONGEST = 1e-9, 1e5
"""Lengths outside 1 nm to 100 km are mistakes, and would overflow further down [m]."""

_LARGEST = 1e12  # of numbers without a unit; those above zero are at least one over it

_EXAMPLE = {"length": "150 um", "angle": "2 deg", "time": "10 ms"}
_SI_UNIT = {"length": "m", "angle": "rad", "time": "s"}


def _float(value: Real) -> float:
    """The value as a float; a whole number beyond the largest one is infinite."""
    try:
        return float(value)
    except OverflowError:
        return math.inf


def _quantity(value: Any, info: ValidationInfo, dimension: str) -> float:
    hint = f"Write a number and a unit, such as {_EXAMPLE[dimension]!r}."
    if isinstance(value, str):
        return units.parse(value, dimension)
    if isinstance(value, bool) or not isinstance(value, Real):
        raise FormatError(f"{value!r} is not a {dimension}. {hint}")
    if info.context and info.context.get("file") and value != 0:
        raise FormatError(f"{value!r} has no unit. {hint}")
    if not -1e300 < _float(value) < 1e300:
        raise GeometryError(f"{_shown(value, _SI_UNIT[dimension])} is not finite. {hint}")
    return float(value)


def _shown(value: Any, unit: str) -> str:
    return value if isinstance(value, str) else f"{checks.shown(value)} {unit}".strip()


def _length(value: Any, info: ValidationInfo) -> float:
    number = _quantity(value, info, "length")
    if number <= 0:
        raise GeometryError(f"{_shown(value, 'm')} is not above zero. Give a positive length.")
    if not SHORTEST <= number <= LONGEST:
        raise GeometryError(f"{_shown(value, 'm')} is not between 1 nm and 100 km. Check the unit.")
    return number


def _displacement(value: Any, info: ValidationInfo) -> float:
    number = _quantity(value, info, "length")
    if abs(number) > LONGEST:
        raise GeometryError(f"{_shown(value, 'm')} is beyond 100 km. Check the unit.")
    return number


def _wavelength(value: Any, info: ValidationInfo) -> float:
    number = _length(value, info)
    if number > 1e-3:
        raise GeometryError(
            f"{_shown(value, 'm')} is longer than 1 mm. Check the unit: light is near '550 nm'."
        )
    return number


def _angle(value: Any, info: ValidationInfo) -> float:
    number = _quantity(value, info, "angle")
    if abs(number) > math.pi:
        raise GeometryError(f"{_shown(value, 'rad')} is more than half a turn. Check the unit.")
    return number


def _time(value: Any, info: ValidationInfo) -> float:
    number = _quantity(value, info, "time")
    if not 0 <= number <= LONGEST:
        raise GeometryError(f"{_shown(value, 's')} is not between 0 s and 100,000 s. Check the unit.")
    return number


def _number(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, Real) or not -_LARGEST <= _float(value) <= _LARGEST:
        raise GeometryError(
            f"{checks.shown(value)} is not a finite number of at most {_LARGEST:g}. "
            "Give a number without a unit."
        )
    return float(value)


def _positive(value: Any) -> float:
    number = _number(value)
    if number <= 0:
        raise GeometryError(f"{value!r} is not above zero. Give a positive number.")
    if number < 1 / _LARGEST:
        raise GeometryError(
            f"{value!r} is below {1 / _LARGEST:g}. Give a number that an instrument can have."
        )
    return number


def _not_negative(value: Any) -> float:
    number = _number(value)
    if number < 0:
        raise GeometryError(f"{value!r} is below zero. Give zero or a positive number.")
    return number


def _fraction(value: Any) -> float:
    number = _number(value)
    if not 0 < number <= 1:
        raise GeometryError(f"{value!r} is not above 0 and at most 1. Give a fraction, such as 0.9.")
    return number


def _seed(value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < 0:
        raise GeometryError(f"{value!r} is not a whole number of at least 0. Give a seed, such as 1.")
    return int(value)


def _bits(value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or not 1 <= value <= 16:
        raise GeometryError(
            f"{value!r} is not a whole number from 1 to 16. Give the bits read out, such as 12."
        )
    return int(value)


def _counts(value: Any) -> tuple[int, int]:
    whole = isinstance(value, Sequence) and not isinstance(value, str) and len(value) == 2
    if not whole or any(isinstance(n, bool) or not isinstance(n, int | np.integer) for n in value):
        raise GeometryError(f"{value!r} is not two whole numbers. Write [ny, nx], such as [39, 39].")
    ny, nx = int(value[0]), int(value[1])
    if min(ny, nx) < 1:
        raise GeometryError(f"[{ny}, {nx}] has a number below 1. Write [ny, nx], such as [39, 39].")
    return ny, nx


def _pair(value: Any, info: ValidationInfo) -> tuple[float, float]:
    if isinstance(value, str) or not isinstance(value, Sequence) or len(value) != 2:
        raise FormatError(f"{value!r} is not two lengths. Write [y, x], such as ['0 um', '20 um'].")
    return _displacement(value[0], info), _displacement(value[1], info)


def _tilt(value: Any, info: ValidationInfo) -> tuple[float, float]:
    if isinstance(value, str) or not isinstance(value, Sequence) or len(value) != 2:
        raise FormatError(f"{value!r} is not two angles. Write [y, x], such as ['1 mrad', '0 mrad'].")
    return _angle(value[0], info), _angle(value[1], info)


def _one_or_three(value: Any, info: ValidationInfo) -> tuple[float, ...]:
    values = [value] if isinstance(value, str | Real) else list(value) if isinstance(value, Sequence) else []
    if len(values) not in (1, 3):
        raise GeometryError(f"{value!r} is not one length or three. Write one, or three for a 'hex' layout.")
    return tuple(_length(each, info) for each in values)


def _aberrations(value: Any) -> dict[int, float]:
    if not isinstance(value, Mapping):
        raise FormatError(f"{value!r} is not a table. Write a Noll index and waves rms, such as 4 = 0.1.")
    table = {}
    for key, waves in value.items():
        noll_index(key)
        if abs(amount := _number(waves)) > 1000:
            raise GeometryError(f"Noll term {key} has {waves!r} waves rms. Give waves, at most 1000.")
        table[int(key)] = float(math.copysign(amount, waves))
    return table


def noll_index(key: Any) -> int:
    """Noll's index of a key.

    Raises
    ------
    FormatError
        It is none from 1 to 1000.
    """
    if not str(key).isdecimal() or not 1 <= int(key) <= 1000:
        raise FormatError(f"{key!r} is not a Noll index. Write a whole number from 1 to 1000.")
    return int(key)


def numbers(value: Any) -> tuple[float, ...]:
    """Numbers of a list, finite.

    Raises
    ------
    FormatError
        It is no list of numbers.
    GeometryError
        A number that is not finite.
    """
    if isinstance(value, str) or not isinstance(value, Sequence):
        raise FormatError(f"{value!r} is not a list. Write one number for each field, such as [0, 0.1].")
    return tuple(_number(each) for each in value)


def angles(value: Any, info: ValidationInfo) -> tuple[float, ...] | None:
    """Angles of a list [rad]."""
    return _several(value, info, _angle, "['0 deg', '5 deg']")


def wavelengths(value: Any, info: ValidationInfo) -> tuple[float, ...] | None:
    """Wavelengths of a list [m]."""
    return _several(value, info, _wavelength, "['486 nm', '656 nm']")


def _several(
    value: Any, info: ValidationInfo, one: Callable[[Any, ValidationInfo], float], example: str
) -> tuple[float, ...] | None:
    if value is None:
        return None
    if isinstance(value, str) or not isinstance(value, Sequence) or not len(value):
        raise FormatError(f"{value!r} is not a list. Write {example}.")
    return tuple(one(each, info) for each in value)


def _file(value: Any) -> Path:
    if not isinstance(value, str | Path) or not str(value):
        raise FormatError(f"{value!r} is not the name of a file. Write it in quotes.")
    return Path(value)


File = Annotated[Path, BeforeValidator(_file), PlainSerializer(Path.as_posix)]

Length = Annotated[float, BeforeValidator(_length)]
"""A length above zero [m]."""
Displacement = Annotated[float, BeforeValidator(_displacement)]
"""A length of either sign [m]."""
Wavelength = Annotated[float, BeforeValidator(_wavelength)]
"""Wavelength in vacuum [m]."""
Angle = Annotated[float, BeforeValidator(_angle)]
"""Angle of at most half a turn either way [rad]."""
Offset = Annotated[tuple[float, float], BeforeValidator(_pair)]
"""Two displacements (y, x) of either sign [m]."""
Tilt = Annotated[tuple[float, float], BeforeValidator(_tilt)]
"""Two angles: how distances grow along y and along x [rad]."""
OneOrThree = Annotated[tuple[float, ...], BeforeValidator(_one_or_three)]
"""One length, or one for each kind of a multi-focus array [m]."""
Time = Annotated[float, BeforeValidator(_time)]
"""Zero or more [s]."""
Number = Annotated[float, BeforeValidator(_number)]
"""A finite number without a unit."""
Positive = Annotated[float, BeforeValidator(_positive)]
"""A number above zero without a unit."""
NotNegative = Annotated[float, BeforeValidator(_not_negative)]
"""Zero or more, without a unit."""
Fraction = Annotated[float, BeforeValidator(_fraction)]
"""Above 0, at most 1."""
Bits = Annotated[int, BeforeValidator(_bits)]
"""1 to 16."""
Seed = Annotated[int, BeforeValidator(_seed)]
"""Seed of random numbers: 0 or more."""
Counts = Annotated[tuple[int, int], BeforeValidator(_counts)]
"""Two whole numbers (ny, nx), at least 1."""
Aberrations = Annotated[
    dict[int, float], BeforeValidator(_aberrations), PlainSerializer(lambda table: dict(table))
]
"""Noll index to waves rms."""
