"""Curves over one axis, and several images side by side."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from lumigraph.core.arrays import to_numpy
from lumigraph.core.grid import Grid
from lumigraph.errors import LumigraphError
from lumigraph.plots.axes import canvas, check_image, draw, length_unit

MARK_COLOUR = "#444444"
STYLES = ("-", "--", "-.", ":")


def curves(
    x: Any, values: Mapping[str, Any], *, xlabel: str = "", ylabel: str = "", title: str = "",
    log: bool = False, marks: Mapping[str, float] | None = None,
) -> Figure:  # fmt: skip
    """Figure of one or more curves over a shared axis.

    Parameters
    ----------
    x
        Positions (n,), in the unit that `xlabel` names.
    values
        Curves by their names: y (n,), or a pair (x, y) with positions of its own.
    xlabel, ylabel, title
        Beside and above the axes.
    log
        Draws y on a logarithmic scale.
    marks
        Positions x, by names, shown as vertical lines.

    Raises
    ------
    LumigraphError
        No curves, or a curve with another number of points than x.

    Examples
    --------
    >>> figure = curves([0, 1, 2], {"square": [0, 1, 4]}, xlabel="x [m]", marks={"limit": 1.5})
    >>> [text.get_text() for text in figure.axes[0].get_legend().get_texts()]
    ['square']
    """
    if not values:
        raise LumigraphError("there are no curves to draw. Give {name: y}.")
    figure, (axes,) = canvas(1, 1, width=7.2, height=4.6)
    for number, (name, given) in enumerate(values.items()):
        across, y = given if isinstance(given, tuple) else (x, given)
        across, y = np.asarray(to_numpy(across)), np.asarray(to_numpy(y))
        if across.shape != y.shape:
            raise LumigraphError(
                f"the curve {name!r} has {y.size} points over {across.size} positions. Give one for each."
            )
        style = STYLES[number // 10 % len(STYLES)] if number >= 10 else "-"
        width = 2.6 - 1.6 * number / max(len(values) - 1, 1)  # a curve under another one stays visible
        axes.plot(across, y, style, label=name, lw=width, marker="o" if y.size <= 15 else None, ms=4)
    axes.set(xlabel=xlabel, ylabel=ylabel, title=title, yscale="log" if log else "linear")
    axes.grid(visible=True, color="#dddddd", lw=0.6)
    for name, where in (marks or {}).items():
        axes.axvline(where, color=MARK_COLOUR, lw=1.0, ls="--", zorder=0)
        axes.annotate(
            name, (where, 0.99), (-3, 0), xycoords=("data", "axes fraction"), textcoords="offset points",
            rotation=90, fontsize=8, ha="right", va="top", color=MARK_COLOUR,
        )  # fmt: skip
    if len(values) > 1 or any(values):
        axes.legend(fontsize=9, framealpha=0.9)
    return figure


WIDE = 20.0
"""Ratio of the largest to the smallest value above which an axis is logarithmic."""


def over_depth(depths: Any, values: Mapping[str, Any], label: str, *, lengths: bool = True) -> Figure:
    """Figure of curves over depth, in units that suit them, logarithmic where they differ by much.

    Parameters
    ----------
    depths
        (nz,), in any order [m].
    values
        Curves (nz,) by their names; infinite values are left out.
    label
        What they are; its unit is added.
    lengths
        Whether the values are lengths [m].

    Raises
    ------
    LumigraphError
        No curves, or a curve with another number of points.

    Examples
    --------
    >>> figure = over_depth([-1e-5, 0.0, 1e-5], {"x": [2e-8, 1e-8, 2e-8]}, "error")
    >>> figure.axes[0].get_xlabel(), figure.axes[0].get_ylabel()
    ('depth [µm]', 'error [nm]')
    """
    curves_of = {name: np.asarray(to_numpy(one), np.float64) for name, one in values.items()}
    sizes = np.abs(np.concatenate([one[np.isfinite(one)] for one in curves_of.values()] or [np.zeros(0)]))
    largest = float(sizes.max(initial=0.0))
    size, unit = length_unit(largest) if lengths else (1.0, "")
    places = np.asarray(to_numpy(depths), np.float64)
    across, named = length_unit(float(np.abs(places).max(initial=0.0)))
    order = np.argsort(places)
    shown = {name: np.where(np.isfinite(one), one, np.nan)[order] / size for name, one in curves_of.items()}
    return curves(
        places[order] / across, shown, xlabel=f"depth [{named}]",
        ylabel=f"{label} [{unit}]" if unit else label, log=largest > WIDE * sizes.min(initial=math.inf),
    )  # fmt: skip


def images(
    pictures: Sequence[tuple[Any, str]], *, columns: int = 3, grid: Grid | None = None,
    cmap: str | None = None, label: str = "", limits: tuple[float | None, float | None] = (None, None),
) -> Figure:  # fmt: skip
    """Figure of several images with their titles, row by row.

    Parameters
    ----------
    pictures
        (image (y, x) or (y, x, 3), title).
    columns
        At most this many side by side.
    grid
        Where the samples of every image stand; the axes are then lengths. None for pixels.
    cmap
        Colours of grey images, a name that matplotlib knows.
    label
        Beside a colour bar for each grey image; empty for none.
    limits
        Values of a grey image that are black and white; None for each image's own.

    Raises
    ------
    LumigraphError
        No images, another shape, or complex numbers.

    Examples
    --------
    >>> figure = images([(np.eye(4), "one"), (np.eye(4), "two")], columns=2)
    >>> [axes.get_title() for axes in figure.axes]
    ['one', 'two']
    """
    if not pictures:
        raise LumigraphError("there are no images to draw. Give [(image, title), ...].")
    count = max(1, min(columns, len(pictures)))
    figure, panels = canvas(-(-len(pictures) // count), count)
    for panel, (image, title) in zip(panels, pictures, strict=False):
        draw(panel, check_image(image), grid, label=label, cmap=cmap, limits=limits)
        panel.set_title(title, fontsize=10)
    for panel in panels[len(pictures) :]:
        panel.set_axis_off()
    return figure
