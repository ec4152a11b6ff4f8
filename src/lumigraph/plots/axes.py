"""Common parts of drawings: a figure without a window, axes with lengths in a readable unit, colour bars."""

from io import BytesIO
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.image import AxesImage

from lumigraph.core.arrays import to_numpy
from lumigraph.core.grid import Grid
from lumigraph.errors import LumigraphError

PANEL = 4.2  # inches
_MOST = 1600  # samples drawn along an axis; more cannot be seen and only cost time
_UNITS = ((1.0, "m"), (1e-3, "mm"), (1e-6, "µm"), (1e-9, "nm"))


class Drawing(Figure):
    """A figure that notebooks show, without pyplot and its global state."""

    def _repr_png_(self) -> bytes:
        file = BytesIO()
        self.savefig(file, format="png", dpi=90)
        return file.getvalue()


def canvas(
    rows: int, columns: int, *, width: float = PANEL, height: float = PANEL
) -> tuple[Figure, list[Axes]]:
    """A figure of panels and its axes, row by row; no window is opened and no global state is touched."""
    figure = Drawing(figsize=(width * columns, height * rows), layout="compressed")
    return figure, list(np.ravel(figure.subplots(rows, columns, squeeze=False)))


def length_unit(size: float) -> tuple[float, str]:
    """Unit [m] and its name in which `size` [m] reads as a number from 1, if there is one."""
    for unit, name in _UNITS:
        if abs(size) >= unit:
            return unit, name
    return _UNITS[-1] if size else _UNITS[1]


def draw(
    axes: Axes, image: Any, grid: Grid | None = None, *, label: str = "", cmap: str | None = None,
    limits: tuple[float | None, float | None] = (None, None),
) -> AxesImage:  # fmt: skip
    """Draw an image (y, x[, 3]) with its first row on top; with a colour bar called `label` if grey.

    With a grid the axes are lengths in mm, µm or nm, else pixels.
    """
    data = to_numpy(image)
    if data.ndim == 3 and data.dtype != np.uint8:
        top = float(data.max()) or 1.0
        data = np.clip(data / top, 0, 1)
    extent = _label(axes, data.shape[:2], grid)
    step = tuple(max(1, -(-n // _MOST)) for n in data.shape[:2])
    low, high = limits
    drawn = axes.imshow(
        data[:: step[0], :: step[1]],
        extent=extent,
        cmap=cmap or "gray",
        vmin=low,
        vmax=high,
        interpolation="nearest",
    )
    if data.ndim == 2 and label and axes.figure is not None:
        axes.figure.colorbar(drawn, ax=axes, label=label, shrink=0.8, pad=0.02)
    return drawn


def check_image(image: Any) -> np.ndarray:
    """The image as real numbers (y, x), (y, x, 1) made (y, x), or (y, x, 3).

    Raises
    ------
    LumigraphError
        Another shape, or complex numbers.
    """
    data = to_numpy(image)
    data = data[..., 0] if data.shape[2:] == (1,) else data
    if data.ndim not in (2, 3) or (data.ndim == 3 and data.shape[2] != 3) or data.size == 0:
        raise LumigraphError(
            f"an image to show has shape (y, x) or (y, x, 3), not {data.shape}. Choose one plane."
        )
    if data.dtype.kind == "c":
        raise LumigraphError("the image is complex. Show abs(image) ** 2, or give a Field.")
    return data


def _label(axes: Axes, shape: tuple[int, ...], grid: Grid | None) -> tuple[float, float, float, float]:
    if grid is None:
        axes.set(xlabel="x [px]", ylabel="y [px]")
        return -0.5, shape[1] - 0.5, shape[0] - 0.5, -0.5
    unit, name = length_unit(max(grid.size))
    axes.set(xlabel=f"x [{name}]", ylabel=f"y [{name}]")
    left, right, top, bottom = (edge / unit for edge in grid.extent)
    # y grows downwards, as rows do; Grid.extent gives the edge below the last row third.
    return left, right, max(top, bottom), min(top, bottom)
