"""Trade-offs of a camera in closed form: the same quantities over a range of magnifications."""

import math
from collections.abc import Callable
from typing import Any

from lumigraph.errors import LumigraphError
from lumigraph.instruments import Instrument, Row

POINTS = 41
"""Magnifications along a curve."""


def trade_offs(camera: Instrument) -> dict[str, Any]:
    """Curves over the magnification and where the camera stands on them, as JSON can hold them.

    They are the rows of the camera's own `trade_offs`; what no camera can have is None.
    """
    span = camera.magnifications()
    numbers = span.spaced(POINTS)
    rows = [_attempt(lambda value: _by_name(span.at(value)), value) or {} for value in numbers]
    curves = []
    for own in camera.trade_offs():
        size, unit = own.scale
        values = [_finite(row[own.name].value / size) if own.name in row else None for row in rows]
        curves.append({
            "name": own.name[0].upper() + own.name[1:], "unit": unit,
            "equation": own.source, "values": values, "here": _finite(own.value / size),
        })  # fmt: skip
    return {"label": span.label, "at": span.own, "positions": numbers, "curves": curves}


def _by_name(camera: Instrument) -> dict[str, Row]:
    return {row.name: row for row in camera.trade_offs()}


def _attempt(function: Callable[[float], Any], value: float) -> Any:
    try:
        return function(value)
    except (LumigraphError, ZeroDivisionError, OverflowError):
        return None


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
