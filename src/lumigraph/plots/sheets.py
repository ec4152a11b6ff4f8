"""`sheet`: a page of true size, to be printed."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection

from lumigraph.plots.axes import Drawing

INCH, MM = 25.4e-3, 1e-3

RULER = 0.1
"""Length of the rulers [m]."""

BESIDE = (0.020, 0.014, 0.008)
"""Margins: below for a ruler and the text, at the left for a ruler, elsewhere [m]."""


def room(paper: tuple[float, float]) -> tuple[float, float]:
    """Height and width that a sheet has for its chart [m], of paper (height, width)."""
    below, left, beside = BESIDE
    return paper[0] - below - beside, paper[1] - left - beside


def sheet(
    dark: Sequence[np.ndarray], paper: tuple[float, float], words: str, *, picture: Any = None
) -> Drawing:
    """Figure of true size: dark polygons in the middle of a page, rulers of 100 mm on two sides, and words.

    Save it as PDF or SVG without changing its borders.

    Parameters
    ----------
    dark
        Polygons (n, 2) as (y, x) from the middle of the page's room [m].
    paper
        Height and width [m].
    words
        Below, one line or two.
    picture
        Grey (y, x), from 0 to 1, that fills the room; None for none.

    Examples
    --------
    >>> square = np.array([[-1, -1], [-1, 1], [1, 1], [1, -1]]) * 10e-3
    >>> [round(25.4 * float(size), 1) for size in sheet([square], (0.21, 0.297), "").get_size_inches()]
    [297.0, 210.0]
    """
    height, width = paper
    below, left, beside = BESIDE
    figure = Drawing(figsize=(width / INCH, height / INCH))
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set(xlim=(0, width), ylim=(height, 0))
    axes.set_axis_off()
    high, wide = room(paper)
    middle = np.array([beside + high / 2, left + wide / 2])
    if picture is not None:
        axes.imshow(
            picture, cmap="gray", vmin=0, vmax=1, aspect="auto", interpolation="none",
            extent=(left, left + wide, beside + high, beside),
        )  # fmt: skip
    axes.add_collection(_filled([one + middle for one in dark]))
    _ruler(axes, np.array([height - below + 5e-3, left]), along=1)
    _ruler(axes, np.array([beside + high, left - 5e-3]), along=0)
    axes.text(left, height - below + 8e-3, words, fontsize=7, va="top")
    return figure


def _filled(polygons: Sequence[np.ndarray]) -> PolyCollection:
    found = PolyCollection([one[:, ::-1] for one in polygons], facecolors="black", linewidths=0)
    found.set_snap(False)  # else pictures have borders at whole pixels
    return found


def _ruler(axes: Axes, start: np.ndarray, *, along: int) -> None:
    """A bar of `RULER` with a tick at each 10 mm, from its start (y, x) to the right or upwards."""
    way = np.array([0.0, 1.0]) if along else np.array([-1.0, 0.0])
    across = np.array([1.0, 0.0]) if along else np.array([0.0, -1.0])
    parts = []
    for k in range(11):
        at, size = start + way * RULER * k / 10, 2.5e-3 if k % 5 == 0 else 1.5e-3
        half = way * 0.05e-3
        parts.append(np.stack([at - half, at + half, at + half + across * size, at - half + across * size]))
    ends = start, start + way * RULER
    parts.append(np.stack([ends[0], ends[1], ends[1] + across * 0.1e-3, ends[0] + across * 0.1e-3]))
    axes.add_collection(_filled(parts))
