"""One-line refusals of bad numbers: the field's name, the value, what to do."""

import math
from collections.abc import Sequence
from numbers import Real
from typing import Any

import numpy as np

from lumigraph.core.arrays import to_numpy
from lumigraph.errors import GeometryError, LumigraphError

Pair = tuple[float, float]


def finite(name: str, value: float, unit: str = "m", error: type[LumigraphError] = GeometryError) -> float:
    """`value` as a float, refused unless it is one finite real number."""
    if isinstance(value, bool) or not isinstance(value, Real) or not math.isfinite(value):
        told = "" if unit == "1" else f" [{unit}]"
        raise error(f"{name} is {value!r} but must be a finite number{told}.")
    return float(value)


def positive(name: str, value: float, unit: str = "m", error: type[LumigraphError] = GeometryError) -> float:
    """`value` as a float, refused unless it is finite and above zero."""
    number = finite(name, value, unit, error)
    if number <= 0:
        told = "" if unit == "1" else f" {unit}"
        raise error(f"{name} is {value:g}{told} but must be above 0{told}.")
    return number


def pair(name: str, value: float | Sequence[float], unit: str = "m") -> Pair:
    """`value` as two finite floats (y, x); one number stands for both axes."""
    values = tuple(value) if isinstance(value, Sequence | np.ndarray) else (value, value)
    if len(values) != 2:
        raise GeometryError(f"{name} has {len(values)} numbers but must be one, or two (y, x).")
    return finite(f"{name} (y)", values[0], unit), finite(f"{name} (x)", values[1], unit)


def shape(name: str, value: int | Sequence[int]) -> tuple[int, int]:
    """`value` as two positive whole numbers (ny, nx); one number stands for both axes."""
    values = (value, value) if isinstance(value, int | np.integer) else tuple(value)
    if len(values) != 2 or any(isinstance(n, bool) or not isinstance(n, int | np.integer) for n in values):
        raise GeometryError(f"{name} is {value!r} but must be two whole numbers (ny, nx).")
    if min(values) < 1:
        raise GeometryError(f"{name} is {tuple(map(int, values))} but both numbers must be at least 1.")
    return int(values[0]), int(values[1])


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
