"""What a data sheet holds: entries with their intervals and how they were measured."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from lumigraph.core.brief import brief
from lumigraph.core.result import Quantity


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
    """

    section: str
    quantity: Quantity
    how: str

    @property
    def value(self) -> Any:
        """Of the quantity."""
        return self.quantity.value

    @property
    def text(self) -> str:
        """The value as people read it."""
        if self.value is None:
            return "not measured"
        q = self.quantity
        if q.unit != "1/m":
            return str(q)
        ends = None if q.interval is None else (q.interval[0] / 1e3, q.interval[1] / 1e3)
        return str(Quantity(q.name, q.value / 1e3, "lp/mm", ends))


@dataclass(frozen=True, slots=True, eq=False)
class Plane:
    """What was measured on one picture of the chart.

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
        """Where the chart stood."""
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
    """

    name: str
    entries: tuple[Entry, ...]
    planes: tuple[Plane, ...]
    limits: tuple[tuple[str, str, str], ...]
    profile: tuple[Any, Any] | None
    notes: tuple[str, ...]

    __repr__ = brief

    def __getitem__(self, name: str) -> Quantity:
        return _named(self.entries, name)

    def quantities(self) -> tuple[Quantity, ...]:
        """All that could be measured, but for single planes."""
        return tuple(one.quantity for one in self.entries if one.value is not None)

    def rows(self) -> Iterator[dict[str, Any]]:
        """What programs read: one mapping for each entry, planes' with their depth [m]."""
        lists: list[tuple[float | None, Sequence[Entry]]] = [(None, self.entries)]
        for depth, entries in lists + [(plane.depth, plane.entries) for plane in self.planes]:
            for one in entries:
                q = one.quantity
                yield {
                    "camera": self.name, "section": one.section or "Planes", "name": q.name, "value": q.value,
                    "unit": q.unit, "interval": q.interval, "chart_depth": depth, "how": one.how,
                }  # fmt: skip


def _named(entries: Sequence[Entry], name: str) -> Quantity:
    found = next((one.quantity for one in entries if one.quantity.name == name), None)
    if found is None:
        raise KeyError(name)
    return found
