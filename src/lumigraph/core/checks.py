"""One-line refusals of bad numbers: the field's name, the value, what to do."""

import math
from collections.abc import Iterable, Sequence
from contextlib import suppress
from numbers import Real
from os import PathLike
from typing import Any

import numpy as np

from lumigraph import units
from lumigraph.core.arrays import is_parameter, number, to_numpy
from lumigraph.errors import FormatError, GeometryError, LumigraphError

Pair = tuple[float, float]

_BRIGHTEST = 1e15  # its square, summed over 100 million pixels, still fits into float32
_MOST = 2**31 - 1  # along one axis: more would overflow the index types of array libraries


def finite(name: str, value: float, unit: str = "m", error: type[LumigraphError] = GeometryError) -> float:
    """`value` as a float, refused unless it is one finite real number, or a length as "158 mm"."""
    number = math.nan
    if isinstance(value, str) and unit == "m":
        return _metres(name, value, error)
    if isinstance(value, Real) and not isinstance(value, bool):
        with suppress(OverflowError):  # a whole number beyond the largest float
            number = float(value)
    if not math.isfinite(number):
        told = "" if unit == "1" else f" [{unit}]"
        raise error(f"{name} is {shown(value)} but must be a finite number{told}.")
    return number


def _metres(name: str, text: str, error: type[LumigraphError]) -> float:
    try:
        return units.parse(text)
    except FormatError:
        raise error(
            f"{name} is {text[:60]!r} but must be a finite number [m], or text with a unit such as '150 um'."
        ) from None


def shown(value: Any) -> str:
    """A value as messages show it; Python refuses to write whole numbers of thousands of digits."""
    if isinstance(value, int) and value.bit_length() > 200:
        return f"a whole number of {value.bit_length()} bits"
    return repr(value)


def positive(name: str, value: float, unit: str = "m", error: type[LumigraphError] = GeometryError) -> float:
    """`value` as a float, refused unless it is finite and above zero."""
    number = finite(name, value, unit, error)
    if number <= 0:
        told = "" if unit == "1" else f" {unit}"
        raise error(f"{name} is {number:g}{told} but must be above 0{told}.")
    return number


def parameter(name: str, value: Any, unit: str = "m", error: type[LumigraphError] = GeometryError) -> Any:
    """`value` as a float; a 0-d array of another library than NumPy stays one, to be differentiated."""
    if is_parameter(value):
        finite(name, number(value), unit, error)
        return value
    return finite(name, value, unit, error)


def pair(name: str, value: float | Sequence[float], unit: str = "m") -> Pair:
    """`value` as two finite floats (y, x); one number stands for both axes."""
    values = _both(value)
    if len(values) != 2:
        raise GeometryError(f"{name} has {len(values)} numbers but must be one, or two (y, x).")
    return finite(f"{name} (y)", values[0], unit), finite(f"{name} (x)", values[1], unit)


def shape(name: str, value: int | Sequence[int]) -> tuple[int, int]:
    """`value` as two positive whole numbers (ny, nx); one number stands for both axes."""
    values = _both(value)
    if len(values) != 2 or any(isinstance(n, bool) or not isinstance(n, int | np.integer) for n in values):
        raise GeometryError(f"{name} is {value!r} but must be two whole numbers (ny, nx).")
    if min(values) < 1:
        raise GeometryError(f"{name} is {tuple(map(int, values))} but both numbers must be at least 1.")
    if max(values) > _MOST:
        raise GeometryError(f"{name} is {tuple(map(int, values))} but both numbers must be at most {_MOST}.")
    return int(values[0]), int(values[1])


def _both(value: Any) -> tuple[Any, ...]:
    """The numbers of a list, tuple or array; anything else, a 0-d array too, stands for both axes."""
    if isinstance(value, np.ndarray):
        return tuple(value) if value.ndim else (value.item(), value.item())
    listed = isinstance(value, Sequence) and not isinstance(value, str)
    return tuple(value) if listed else (value, value)


def whole(name: str, value: int, lowest: int = 1, error: type[LumigraphError] = GeometryError) -> int:
    """`value` as an int, refused unless it is a whole number of at least `lowest`."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < lowest:
        raise error(f"{name} is {shown(value)} but must be a whole number of at least {lowest}.")
    return int(value)


def choice(
    name: str, value: Any, choices: Iterable[str], error: type[LumigraphError] = GeometryError
) -> None:
    """Refuse a value that is not one of the names in `choices`."""
    known = tuple(choices)
    if not isinstance(value, str) or value not in known:
        raise error(f"{name} is {value!r} but must be one of {', '.join(known)}.")


def instance(name: str, value: Any, kind: type, error: type[LumigraphError] = GeometryError) -> None:
    """Refuse a value of another class, such as an array where a `Grid` is needed."""
    if not isinstance(value, kind):
        read = " Read the file first, with lumigraph.open." if isinstance(value, str | PathLike) else ""
        raise error(f"{name} is of type {type(value).__name__} but must be a {kind.__name__}.{read}")


def array(name: str, value: Any, error: type[LumigraphError] = GeometryError) -> None:
    """Refuse what is not an array of numbers: lists, scalars, text, objects; of any array library."""
    if not hasattr(value, "shape") or not hasattr(value, "dtype"):
        path = isinstance(value, str | PathLike)
        remedy = "Read the file with lumigraph.open" if path else "Use numpy.asarray(...)"
        raise error(f"{name} is of type {type(value).__name__} but must be an array. {remedy} first.")
    if isinstance(value, np.ndarray | np.generic) and value.dtype.kind not in "biufc":
        raise error(f"{name} holds {value.dtype} but must hold numbers. Use astype(float) first.")


def finite_array(name: str, array: Any, error: type[LumigraphError] = LumigraphError) -> None:
    """Refuse an array with NaN or infinite values, saying how many and where the first one is."""
    values = to_numpy(array)
    if values.dtype.kind not in "fc":
        return
    bad = ~np.isfinite(values)
    count = int(np.count_nonzero(bad))
    if count:
        where = tuple(int(i) for i in np.argwhere(bad)[0])
        raise error(
            f"{name} has {count} NaN or infinite values of {values.size}, the first at index {where}. "
            "Replace them by a measured or interpolated value."
        )


def brightness(name: str, array: Any, error: type[LumigraphError] = LumigraphError) -> None:
    """Refuse a picture with NaN, infinite values, or some whose squares no float32 could sum."""
    finite_array(name, array, error)
    values = to_numpy(array)
    if not values.size or values.dtype.kind not in "iuf":
        return
    ends = [(float(values.flat[k]), k) for k in (values.argmin(), values.argmax())]
    worst, place = max(ends, key=lambda end: abs(end[0]))
    if abs(worst) <= _BRIGHTEST:
        return
    count = int(np.count_nonzero((values > _BRIGHTEST) | (values < -_BRIGHTEST)))
    where = tuple(int(i) for i in np.unravel_index(place, values.shape))
    raise error(
        f"{name} has {count} of {values.size} values beyond ±{_BRIGHTEST:g}, such as {worst:g} at index "
        f"{where}. Replace them if they were not measured; else divide all values by one number."
    )
