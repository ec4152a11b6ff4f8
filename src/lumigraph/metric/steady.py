"""Depth of a flat chart over the field: its value, how much places scatter about it, how well both repeat.

Each exposure's depth is measured alone, as a user's would be: methods smooth noisy pictures more, so that the
mean of many exposures has another scatter than one of them, in places twice as much. Squares are averaged.
"""

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from scipy.stats import t as student

from lumigraph.core.arrays import to_numpy
from lumigraph.core.depth_map import DepthMap
from lumigraph.core.result import Quantity
from lumigraph.errors import SamplingError
from lumigraph.metric.sheet import Entry

TRUSTED = 0.5
"""Confidence from which on a place counts for depth."""

REPEATED = 2.0
"""Per cent by which two sheets of a camera may differ: beyond it the sheet recommends more exposures."""

_BLOCKS = 4
"""Pieces of the field along each axis: places closer together do not err independently."""

_SEVERAL = 8  # values from which strays can be told
_STRAY = 4.0  # standard deviations from which on a value does not count
_TO_SIGMA = 1.4826  # of a normal distribution, over the median distance from its middle


def inner(values: np.ndarray) -> np.ndarray:
    """Values of the field without its outermost tenth."""
    return values[tuple(slice(n // 10, n - n // 10) for n in values.shape)]


def trusted(found: DepthMap) -> np.ndarray:
    """Inner values (y, x); NaN of those that are not trusted."""
    return inner(np.asarray(to_numpy(found.trusted(TRUSTED)), float))


def trusted_median(found: Sequence[DepthMap]) -> float:
    """Median of the values that are trusted, of all exposures.

    Raises
    ------
    SamplingError
        None is.
    """
    values = np.array([trusted(one) for one in found])
    known = values[np.isfinite(values)]
    if not known.size:
        raise SamplingError("no place of the picture has a depth to trust. Use a chart with more contrast.")
    return float(np.median(known))


def mean_within(values: Sequence[float] | np.ndarray) -> tuple[float, tuple[float, float] | None]:
    """Mean and its 95 % interval, by Student's t; None of a single value."""
    n, mean = len(values), float(np.mean(values))
    if n < 2:
        return mean, None
    half = float(student.ppf(0.975, n - 1) * np.std(values, ddof=1) / math.sqrt(n))
    return mean, (mean - half, mean + half)


def without_strays(values: Sequence[float]) -> list[float]:
    """Values nearer to the median than `_STRAY` standard deviations by the others; all of a few."""
    known = np.array(values, float)
    away = np.abs(known - np.median(known))
    near = away <= _STRAY * _TO_SIGMA * np.median(away)
    return known[near].tolist() if len(known) >= _SEVERAL else known.tolist()


def steady(found: Sequence[DepthMap], name: str, unit: str) -> list[Entry]:
    """The plane's value over the field, and how much places of one exposure scatter about it.

    Parameters
    ----------
    found
        Of each exposure.
    name, unit
        Of the depth.
    """
    maps = [trusted(one) for one in found]
    known = min(int(np.isfinite(one).sum()) for one in maps)
    if known < _BLOCKS**2:
        how = f"not measured: {known} places with a confidence above {TRUSTED:g}"
        return [Entry("", Quantity(name, None), how)]
    levels = [_parts(one, np.median) for one in maps]
    told = _over(levels)
    value, interval = mean_within(told)
    noise, ends = scatter(maps)
    share = np.mean([np.isfinite(one).mean() for one in maps])
    part = f"{share:.0%} of the places, those with a confidence above {TRUSTED:g}"
    mean = f"mean of {len(told)} parts of the field; {part}"
    spread = f"standard deviation of the places, strays beyond {_STRAY:g} of them left out; {part}"
    at, about = (
        _apart([float(np.nanmean(one)) for one in levels]),
        _apart([scatter([one])[0] for one in maps]),
    )
    return [
        Entry("", Quantity(name, value, unit, interval), f"{mean}; {_repeats(at, len(maps), unit)}", at),
        Entry(
            "", Quantity(f"{name}_noise", noise, unit, ends),
            f"{spread}; {_repeats(None if about is None else 100 * about / noise, len(maps), '%')}", about,
        ),
    ]  # fmt: skip


def scatter(maps: Sequence[np.ndarray]) -> tuple[float, tuple[float, float] | None]:
    """Standard deviation of values without strays, and its interval by how pieces of the field differ.

    Parameters
    ----------
    maps
        (y, x) Of exposures, NaN where they are not known: each about its own median, squares averaged.
    """
    squares = [_squares(one) for one in maps]
    noise = math.sqrt(np.mean([np.nanmean(one) for one in squares]))
    _, interval = mean_within(_over([_parts(one, np.mean) for one in squares]))
    if interval is None:
        return noise, None
    low, high = (math.sqrt(max(0.0, end)) for end in interval)
    return noise, (min(low, noise), max(high, noise))


def _squares(values: np.ndarray) -> np.ndarray:
    """Squared distances from the mean; NaN of strays."""
    away = values - np.nanmedian(values)
    near = np.where(np.abs(away) <= _STRAY * _TO_SIGMA * np.nanmedian(np.abs(away)), away, np.nan)
    return (near - np.nanmean(near)) ** 2


def _parts(values: np.ndarray, told: Callable[[np.ndarray], Any]) -> np.ndarray:
    """Value of each piece of the field by a function; NaN for those with fewer than three known values."""
    pieces = [
        part[np.isfinite(part)]
        for rows in np.array_split(values, _BLOCKS, axis=0)
        for part in np.array_split(rows, _BLOCKS, axis=1)
    ]
    return np.array([told(part) if part.size >= 3 else np.nan for part in pieces])


def _over(parts: Sequence[np.ndarray]) -> np.ndarray:
    """Means over exposures of those pieces (n,) that all exposures know."""
    together = np.mean(parts, axis=0)
    return together[np.isfinite(together)]


def _apart(values: Sequence[float]) -> float | None:
    """Largest difference of two means of as many exposures, in 95 of 100 cases, by their scatter."""
    n = len(values)
    if n < 2:
        return None
    return float(student.ppf(0.975, n - 1) * np.std(values, ddof=1)) * math.sqrt(2 / n)


def _repeats(apart: float | None, count: int, unit: str) -> str:
    if apart is None:
        return "one exposure, so that its repeatability is unknown"
    told = f"{count} exposures, two such sets differ by {apart:.2g} {unit} at most"
    if unit == "%" and apart > REPEATED:
        told += f" ({math.ceil(count * (apart / REPEATED) ** 2)} exposures: {REPEATED:g} %)"
    return told
