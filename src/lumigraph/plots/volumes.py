"""Volumes: maximum projections, and slices through one place."""

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from lumigraph.core.arrays import to_numpy
from lumigraph.core.volume import Volume
from lumigraph.errors import LumigraphError
from lumigraph.plots.axes import PANEL, Drawing, length_unit

_MOST = 1600  # samples drawn along an axis


def projections(volume: Volume, *, cmap: str = "magma") -> Figure:
    """Figure of the brightest sample along z, y and x: three views of a volume, at one scale of lengths.

    Parameters
    ----------
    volume
        (z, y, x), grey.
    cmap
        Colours, a name that matplotlib knows.

    Raises
    ------
    LumigraphError
        A volume in colour.

    Examples
    --------
    >>> from lumigraph.core.grid import Grid
    >>> volume = Volume(np.ones((3, 4, 5)), Grid((4, 5), 1e-6), (-2e-6, 0.0, 2e-6))
    >>> [axes.get_title() for axes in projections(volume).axes[:3]]
    ['maximum along z', 'maximum along x', 'maximum along y']
    """
    data = _grey(volume)
    views = (data.max(0), data.max(2).T, data.max(1))
    return _three(volume, views, [f"maximum along {axis}" for axis in "zxy"], cmap)


def slices(volume: Volume, at: tuple[float, float, float] | None = None, *, cmap: str = "magma") -> Figure:
    """Figure of the three planes through one place.

    Parameters
    ----------
    volume
        (z, y, x), grey.
    at
        The place (z, y, x) [m]; the brightest sample if left out.
    cmap
        Colours, a name that matplotlib knows.

    Raises
    ------
    LumigraphError
        A volume in colour.
    """
    data, places = _grey(volume), (np.asarray(volume.depths), volume.grid.y, volume.grid.x)
    if at is None:
        k, i, j = np.unravel_index(int(np.argmax(data)), data.shape)
    else:
        k, i, j = (int(np.argmin(np.abs(axis - value))) for axis, value in zip(places, at, strict=True))
    views = (data[k], data[:, :, j].T, data[:, i])
    titles = [
        f"{axis} = {_length(places[n][index])}" for axis, n, index in (("z", 0, k), ("x", 2, j), ("y", 1, i))
    ]
    return _three(volume, views, titles, cmap)


def _three(volume: Volume, views: tuple[np.ndarray, ...], titles: list[str], cmap: str) -> Figure:
    """(y, x), beside it (y, z), below it (z, x); z grows to the right and downwards."""
    (height, width), depths = volume.grid.size, np.asarray(volume.depths)
    step = abs(volume.spacing[0]) or min(volume.grid.pitch)
    deep = float(np.ptp(depths)) + step
    unit, name = length_unit(max(height, width, deep))
    shown = np.clip(deep / max(height, width), 0.15, 1.5) * max(height, width)
    figure = Drawing(
        figsize=(1.6 * PANEL, 1.6 * PANEL * (height + shown) / (width + shown)), layout="constrained"
    )
    panels = figure.subplots(
        2, 2, gridspec_kw={"width_ratios": [width, shown], "height_ratios": [height, shown]}
    )
    left, right, top, bottom = (edge / unit for edge in volume.grid.extent)
    # Rows go downwards: the edge beyond the last row is the lower one. Planes are drawn evenly spaced.
    first, last = (depths[0], depths[-1]) if depths[-1] >= depths[0] else (depths[-1], depths[0])
    near, far = (first - step / 2) / unit, (last + step / 2) / unit
    if depths[0] > depths[-1]:
        near, far = far, near
    y_edges = (max(top, bottom), min(top, bottom))
    extents = ((left, right, *y_edges), (near, far, *y_edges), (left, right, far, near))
    labels = (("x", "y"), ("z", "y"), ("x", "z"))
    limits = 0.0, max(float(views[0].max()), 1e-30)
    for panel, view, extent, title, (across, down) in zip(
        (panels[0, 0], panels[0, 1], panels[1, 0]), views, extents, titles, labels, strict=True
    ):
        thin = tuple(slice(None, None, max(1, -(-n // _MOST))) for n in view.shape)
        panel.imshow(
            view[thin], extent=extent, cmap=cmap, vmin=limits[0], vmax=limits[1], aspect="auto",
            interpolation="nearest",
        )  # fmt: skip
        panel.set_title(title, fontsize=10)
        panel.set(xlabel=f"{across} [{name}]", ylabel=f"{down} [{name}]")
    panels[1, 1].set_axis_off()
    return figure


def _grey(volume: Volume) -> np.ndarray:
    data: Any = to_numpy(volume.data)
    if data.ndim != 3:
        raise LumigraphError(
            f"a volume to draw has shape (z, y, x), not {tuple(data.shape)}. Choose one channel."
        )
    return np.asarray(data)


def _length(value: float) -> str:
    unit, name = length_unit(abs(value) if value else 1e-6)
    return f"{value / unit:.4g} {name}"
