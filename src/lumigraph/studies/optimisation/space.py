"""Values of a camera that may vary: ranges, whose counts make a first grid, and values of a stock."""

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from lumigraph import units
from lumigraph.errors import FormatError, LumigraphError
from lumigraph.instruments.instrument import Instrument
from lumigraph.instruments.varied import NUMBER, combinations, value, values

ACTIVE = 1e-3
"""Part of a range within which a value is at its end."""

ROUNDED = 1e-9
"""Part of a range, or of a value, by which what is written may be off."""


@dataclass(frozen=True, slots=True)
class Range:
    """Values from a least to a largest one.

    Parameters
    ----------
    low, high
        Ends, in the unit.
    unit
        As in a camera file; empty for numbers.
    """

    low: float
    high: float
    unit: str = ""

    def at(self, part: float) -> Any:
        """The value at a part of the range, as a camera file has it."""
        number = self.low + (self.high - self.low) * min(max(part, 0.0), 1.0)
        return f"{number:.10g} {self.unit}" if self.unit else float(f"{number:.10g}")

    def near(self, value: Any) -> Any:
        """A value in the unit of the range; None beyond its ends."""
        number = _number(value) / _number(f"1 {self.unit}" if self.unit else 1)
        part = (number - self.low) / (self.high - self.low)
        return self.at(part) if -ROUNDED <= part <= 1 + ROUNDED else None

    def in_units(self, number: float) -> float:
        """A number in the unit of the range, in SI."""
        return number * _number(f"1 {self.unit}") if self.unit else number

    @staticmethod
    def si(value: Any) -> float:
        """Number of a value in SI, or without a unit; NaN for a word."""
        return _number(value)

    def part(self, value: Any) -> float:
        """Relative place of a value in the range, 0 to 1."""
        found = NUMBER.fullmatch(str(value))
        assert found is not None
        return (float(found[1]) - self.low) / (self.high - self.low)


@dataclass(frozen=True, slots=True)
class Space:
    """All that may change.

    Parameters
    ----------
    grid
        First values of each key: evenly spaced over a range, all of a stock.
    ranges
        By key, of what changes continuously.
    """

    grid: Mapping[str, list[Any]]
    ranges: Mapping[str, Range]

    @classmethod
    def of(cls, vary: Mapping[str, str] | Sequence[str]) -> "Space":
        """Space from texts as `lumigraph sweep --vary` takes them: ranges, or stocks.

        Raises
        ------
        FormatError
            Another text, no range that goes up, nothing to change, a key that stands twice.

        >>> space = Space.of(["lenslets.magnification=0.3:0.5:x3", "lenslets.pitch=100 um, 150 um"])
        >>> len(space.combinations()), space.ranges["lenslets.magnification"].at(0.5)
        (6, 0.4)
        """
        texts = [f"{k}={v}" for k, v in vary.items()] if isinstance(vary, Mapping) else list(vary)
        grid: dict[str, list[Any]] = {}
        ranges: dict[str, Range] = {}
        for text in texts:
            name, some = values(text)
            if name in grid:
                raise FormatError(f"--vary names {name} twice. Give all its values at once.")
            grid[name] = some
            if ":" in text:
                ranges[name] = _range(text)
        if not grid:
            raise FormatError("there is nothing to vary. Give a key and its values.")
        return cls(grid, ranges)

    def combinations(self) -> list[dict[str, Any]]:
        """Items of all combinations of the first values."""
        return combinations(self.grid)

    def own(self, camera: Instrument) -> dict[str, Any] | None:
        """The item of a camera's own values; None where it lies beyond, or its file has not all of them."""
        found: dict[str, Any] = {}
        for name, some in self.grid.items():
            here = value(camera, name)
            if here is None:
                return None
            known = self.ranges[name].near(here) if name in self.ranges else _same(here, some)
            if known is None:
                return None
            found[name] = known
        return found

    def moved(self, item: Mapping[str, Any], parts: Sequence[float]) -> dict[str, Any]:
        """An item whose ranges stand at other parts, in their order."""
        found = {
            name: one.at(float(part)) for part, (name, one) in zip(parts, self.ranges.items(), strict=True)
        }
        return {**item, **found}

    def parts(self, item: Mapping[str, Any]) -> list[float]:
        """Relative places of an item in its ranges, 0 to 1."""
        return [one.part(item[name]) for name, one in self.ranges.items()]

    def active(self, item: Mapping[str, Any]) -> dict[str, Any]:
        """Values at an end of their range, by key."""
        return {
            name: item[name]
            for name, part in zip(self.ranges, self.parts(item), strict=True)
            if min(part, 1 - part) < ACTIVE
        }


def _same(here: Any, stock: Sequence[Any]) -> Any:
    """The value of a stock that a camera has; None where it has another."""
    for one in stock:
        if one == here or math.isclose(_number(one), _number(here), rel_tol=ROUNDED):
            return one
    return None


def _number(value: Any) -> float:
    """Number of a value in SI, or without a unit; NaN for a word."""
    found = NUMBER.fullmatch(str(value))
    if found is None:
        return math.nan
    for dimension in ("length", "angle", "time"):
        with suppress(LumigraphError):
            return units.parse(str(value), dimension)
    return float(found[1])


def _range(text: str) -> Range:
    name, _, words = text.partition("=")
    (low, high), unit = units.spaced(f"{words.rpartition(':')[0]}:x2", f"--vary {name.strip()}")
    if not low < high:
        raise FormatError(f"--vary {text!r} must go up: its last value must be above its first.")
    return Range(low, high, unit)
