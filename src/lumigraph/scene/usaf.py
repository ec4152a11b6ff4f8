"""The resolution target USAF-1951."""

import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np

from lumigraph.core import checks, coverage
from lumigraph.core.grid import Grid
from lumigraph.errors import GeometryError, SamplingWarning
from lumigraph.scene.volumes import Scene, Slice

Pair = tuple[float, float]


def usaf1951(
    grid: Grid,
    groups: int | tuple[int, int] = (2, 4),
    position: Pair = (0.0, 0.0),
    *,
    dark_bars: bool = False,
) -> Scene:
    r"""USAF-1951 resolution target: elements of three bars, upright and lying.

    Element e = 1 to 6 of group g has

    .. math:: 2^{g + (e - 1)/6}\ \text{line pairs per mm},

    bars five times as long as wide, and gaps as wide as bars. The first group fills the left column, its
    largest element on top; the following groups stand one below the other in the right column.

    Parameters
    ----------
    grid
        Samples of the focused plane.
    groups
        First and last group, both drawn; one number for one group.
    position
        Middle of the chart (y, x) [m].
    dark_bars
        Dark bars on a bright ground, instead of bright bars.

    Raises
    ------
    GeometryError
        A chart that does not fit in the grid; the message says the size needed.

    Warns
    -----
    SamplingWarning
        Bars narrower than a sample.

    References
    ----------
    MIL-STD-150A, 1959, section 5.1.1.7.

    Examples
    --------
    >>> chart = usaf1951(Grid.square(300, 20e-6), groups=2).parts[0]
    >>> [round(float(bar_width(2, e)) * 1e6, 2) for e in (1, 6)]
    [125.0, 70.15]
    """
    coverage.check_canvas(grid)
    first, last = _first_and_last(groups)
    if first > last:
        raise GeometryError(f"groups are {first} to {last}: give the coarser (smaller) number first.")
    elements = list(_usaf_elements(first, last))
    height = max(y + 5 * width for y, _, width in elements)
    breadth = max(x + 12 * width for _, x, width in elements)
    center = checks.pair("position", position)
    top, left = center[0] - height / 2, center[1] - breadth / 2
    _check_fits(grid, (top, left), (height, breadth), f"USAF groups {first} to {last}")
    _warn_if_narrow(grid, elements[-1][2])
    picture = np.zeros(grid.shape)
    for y, x, width in elements:
        for k in (0, 2, 4):
            _add_bar(picture, grid, (top + y, left + x + k * width), (5 * width, width))
            _add_bar(picture, grid, (top + y + k * width, left + x + 7 * width), (width, 5 * width))
    return Scene([Slice(1.0 - picture if dark_bars else np.minimum(picture, 1.0), grid)])


def usaf_elements(
    groups: int | tuple[int, int] = (2, 4), position: Pair = (0.0, 0.0)
) -> list[tuple[int, int, Pair, float]]:
    """Group, element, corner (y, x) and bar width [m] of each element of `usaf1951`, coarse to fine.

    From a corner the upright bars extend to +x, 5 widths in all; the lying ones begin 7 widths from it.

    Examples
    --------
    >>> [(group, e, round(width * 1e6, 2)) for group, e, _, width in usaf_elements(7)][:2]
    [(7, 1, 3.91), (7, 2, 3.48)]
    """
    first, last = _first_and_last(groups)
    elements = list(_usaf_elements(first, last))
    height = max(y + 5 * width for y, _, width in elements)
    breadth = max(x + 12 * width for _, x, width in elements)
    center = checks.pair("position", position)
    top, left = center[0] - height / 2, center[1] - breadth / 2
    return [
        (first + k // 6, k % 6 + 1, (top + y, left + x), width) for k, (y, x, width) in enumerate(elements)
    ]


def bar_width(group: int, element: int) -> float:
    """Width of a bar of the USAF-1951 target [m]: half a line pair."""
    return 1e-3 / (2 * 2 ** (group + (element - 1) / 6))


def _first_and_last(groups: int | tuple[int, int]) -> tuple[int, int]:
    """First and last USAF group, whole numbers from -10 to 20."""
    both: tuple[Any, ...] = (
        tuple(groups) if isinstance(groups, Sequence | np.ndarray) and np.ndim(groups) else (groups, groups)
    )
    if len(both) != 2 or any(
        isinstance(n, bool) or not isinstance(n, int | np.integer) or not -10 <= n <= 20 for n in both
    ):
        raise GeometryError(f"groups is {groups!r} but must be one or two whole numbers from -10 to 20.")
    return int(both[0]), int(both[1])


def _usaf_elements(first: int, last: int):
    """Top, left and bar width of each element, from the chart's corner, coarse to fine."""
    unit, below = bar_width(first, 1), 0.0
    for group in range(first, last + 1):
        y, x = (0.0, 0.0) if group == first else (below, 16 * unit)
        for element in range(1, 7):
            width = bar_width(group, element)
            yield y, x, width
            y += 7 * width
        below = y + bar_width(group, 1) if group > first else 0.0


def _add_bar(picture: np.ndarray, grid: Grid, corner: Pair, size: Pair) -> None:
    rows = coverage.interval(grid.y, grid.pitch[0], corner[0], corner[0] + size[0])
    columns = coverage.interval(grid.x, grid.pitch[1], corner[1], corner[1] + size[1])
    y, x = np.flatnonzero(rows), np.flatnonzero(columns)
    picture[y[0] : y[-1] + 1, x[0] : x[-1] + 1] += np.outer(rows[y], columns[x])


def _check_fits(grid: Grid, corner: Pair, size: Pair, what: str) -> None:
    left, right, bottom, top = grid.extent
    slack = 1e-9 * max(size)
    inside_y = top - slack <= corner[0] and corner[0] + size[0] <= bottom + slack
    if not (inside_y and left - slack <= corner[1] and corner[1] + size[1] <= right + slack):
        raise GeometryError(
            f"{what} take {size[0] * 1e3:.4g} x {size[1] * 1e3:.4g} mm but the grid has "
            f"{grid.size[0] * 1e3:.4g} x {grid.size[1] * 1e3:.4g} mm. Enlarge it, or start at a finer group."
        )


def _warn_if_narrow(grid: Grid, width: float) -> None:
    if width < max(grid.pitch):
        warnings.warn(
            f"the finest bars are {width * 1e6:.4g} µm wide, samples {max(grid.pitch) * 1e6:.4g} µm apart. "
            "Use a finer grid, or leave the last groups out.",
            SamplingWarning,
            stacklevel=3,
        )
