"""Data sheets: entries with their intervals and how they were measured."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from lumigraph.core.brief import brief
from lumigraph.core.result import Quantity

_WRITTEN = (("mtf", "MTF"), ("snr", "SNR"), ("micro image", "micro-image"), ("cross talk", "cross-talk"))
_PREFIXES = ((1.0, "m"), (1e3, "mm"), (1e6, "µm"), (1e9, "nm"))


@dataclass(frozen=True, slots=True)
class Entry:
    """One line of a data sheet.

    Parameters
    ----------
    section
        Heading that it stands under.
    quantity
        Name, value, unit and 95 % interval; a value of None was not measured.
    how
        How it was measured, or why it could not be.
    repeats
        How far two sets of as many exposures differ at most, in 95 of 100 cases, in the value's unit; None
        where it was not measured.
    """

    section: str
    quantity: Quantity
    how: str
    repeats: float | None = None

    @property
    def value(self) -> Any:
        """Value of the quantity."""
        return self.quantity.value

    @property
    def label(self) -> str:
        """The name as people read it."""
        words = self.quantity.label
        for plain, written in _WRITTEN:
            words = words.replace(plain, written)
        return words

    @property
    def text(self) -> str:
        """The value as people read it."""
        if self.value is None:
            return "not measured"
        q = _on_chart(self.quantity) if self.quantity.unit == "1/m" else self.quantity
        if q.interval is not None:
            return _to_interval(q)
        if isinstance(q.value, tuple) and q.unit != "m":
            return f"{' to '.join(f'{one:.3g}' for one in q.value)} {q.unit}".rstrip()
        return str(q)


@dataclass(frozen=True, slots=True, eq=False)
class Plane:
    """Measures of one picture of the chart.

    Parameters
    ----------
    depth
        Of the chart from the plane in focus [m]; None where it is not known.
    entries
        Of this picture; their sections are empty.
    picture
        Rendered from the raw image (y, x).
    """

    depth: float | None
    entries: tuple[Entry, ...]
    picture: Any

    __repr__ = brief

    def __getitem__(self, name: str) -> Quantity:
        return _named(self.entries, name)

    @property
    def label(self) -> str:
        """Position of the chart, as text."""
        return "unknown" if self.depth is None else str(Quantity("depth", self.depth, "m"))


@dataclass(frozen=True, slots=True, eq=False)
class Sheet:
    """A camera's data sheet.

    Parameters
    ----------
    name
        Of the camera.
    entries
        Lines, section by section.
    planes
        Of each picture of the chart, the nearest first.
    limits
        (name, value, equation) by ray and wave optics, of the camera file; empty without one.
    profile
        Positions [px] from the middle of a micro-image to the next, and the mean light there.
    notes
        What to know, one sentence each.
    scenes
        Pictures (y, x) of scenes, in focus at their median depth; None of one without any depth.
    """

    name: str
    entries: tuple[Entry, ...]
    planes: tuple[Plane, ...]
    limits: tuple[tuple[str, str, str], ...]
    profile: tuple[Any, Any] | None
    notes: tuple[str, ...]
    scenes: tuple[Any, ...] = ()

    __repr__ = brief

    def __getitem__(self, name: str) -> Quantity:
        return _named(self.entries, name)

    def quantities(self) -> tuple[Quantity, ...]:
        """All that could be measured, but for single planes."""
        return tuple(one.quantity for one in self.entries if one.value is not None)

    def rows(self) -> Iterator[dict[str, Any]]:
        """Rows for programs: a mapping for each entry, those of planes with their depth [m]."""
        lists: list[tuple[float | None, Sequence[Entry]]] = [(None, self.entries)]
        for depth, entries in lists + [(plane.depth, plane.entries) for plane in self.planes]:
            for one in entries:
                q = one.quantity
                yield {
                    "camera": self.name, "section": one.section or "Planes", "name": q.name, "value": q.value,
                    "unit": q.unit, "interval": q.interval, "repeats": one.repeats, "chart_depth": depth,
                    "how": one.how,
                }  # fmt: skip


def _on_chart(q: Quantity) -> Quantity:
    """Quantity in line pairs per millimetre, from line pairs per metre."""
    ends = None if q.interval is None else (q.interval[0] / 1e3, q.interval[1] / 1e3)
    return Quantity(q.name, q.value / 1e3, "lp/mm", ends)


def _to_interval(q: Quantity) -> str:
    """Value and ends of the interval with the decimals of half its width, two digits of that.

    >>> _to_interval(Quantity("pitch", 48.231234, "px", (48.2196, 48.2428)))
    '48.231 px (48.220 to 48.243)'
    >>> _to_interval(Quantity("scale", 2.0412e-4, "m", (1.9912e-4, 2.0912e-4)))
    '204.1 µm (199.1 to 209.1)'
    """
    values, unit = (q.value, *(q.interval or ())), q.unit
    if unit == "m":
        largest = max(map(abs, values))
        factor, unit = next(one for one in _PREFIXES if largest * one[0] >= 1 or one == _PREFIXES[-1])
        values = tuple(factor * one for one in values)
    half = (values[2] - values[1]) / 2
    decimals = 1 - math.floor(math.log10(half)) if 0 < half < math.inf else 6
    value, low, high = (f"{round(one, decimals) + 0.0:.{max(0, decimals)}f}" for one in values)
    return f"{value} {'' if unit == '1' else unit}".rstrip() + f" ({low} to {high})"


def _named(entries: Sequence[Entry], name: str) -> Quantity:
    found = next((one.quantity for one in entries if one.quantity.name == name), None)
    if found is None:
        raise KeyError(name)
    return found
