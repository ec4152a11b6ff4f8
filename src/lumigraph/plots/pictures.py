"""One image, raw image, wave, light field, map, stack or volume, drawn."""

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from lumigraph.core.arrays import to_numpy
from lumigraph.core.depth_map import DepthMap
from lumigraph.core.field import Field
from lumigraph.core.grid import Grid
from lumigraph.core.lightfield import LightField
from lumigraph.core.raw import RawImage
from lumigraph.core.stack import Stack
from lumigraph.core.volume import Volume
from lumigraph.errors import LumigraphError
from lumigraph.plots.axes import canvas, check_image, draw, length_unit
from lumigraph.plots.curves import images
from lumigraph.plots.volumes import projections

_SHOWN = 9
"""Pictures of a stack, from the first to the last."""

_ENDS = 1, 99
"""Percentiles of a map that its colours span: a few wrong places would take them all."""


def show(
    image: Any, *, grid: Grid | None = None, title: str = "", label: str = "", cmap: str | None = None,
    limits: tuple[float | None, float | None] = (None, None),
) -> Figure:  # fmt: skip
    """Figure of an image or of any noun that holds one.

    A `Field` shows its intensity and its phase; a `LightField` its central view, a sample of views and
    two epipolar-plane images; a `RawImage` is drawn on its pixels, in millimetres where the pitch is
    known; a `DepthMap` between its 1st and 99th percentile; a `Stack` as up to nine of its pictures, a
    `Volume` as the brightest sample along each axis.

    Parameters
    ----------
    image
        (y, x) or (y, x, 3), `RawImage`, `Field` (one wave), `LightField`, `DepthMap`, `Stack` or `Volume`.
    grid
        Where the samples of an array stand; its axes are then lengths.
    title, label
        Above the figure, and beside the colour bar.
    cmap
        Colours of a grey image, a name that matplotlib knows.
    limits
        Values of its first and last colour; None for the image's own.

    Raises
    ------
    LumigraphError
        Another shape, or complex numbers outside a field.

    Examples
    --------
    >>> figure = show(np.eye(4), grid=Grid.square(4, 1e-6), label="intensity")
    >>> figure.axes[0].get_xlabel()
    'x [µm]'
    """
    if isinstance(image, Field):
        return _field(image, title)
    if isinstance(image, LightField):
        return _light_field(image, title)
    if isinstance(image, Volume):
        return projections(image, cmap=cmap or "magma")
    if isinstance(image, Stack):
        return _stack(image, cmap)
    if isinstance(image, DepthMap):
        label, cmap, image, limits = _mapped(image, label, cmap)
    if isinstance(image, RawImage):
        pitch = image.pixel_pitch
        grid = grid or (Grid(image.shape, (pitch, pitch)) if pitch else None)
        label, image = label or "pixel value", image.data
    figure, (axes,) = canvas(1, 1, width=5.6, height=4.8)
    draw(axes, check_image(image), grid, label=label or "value", cmap=cmap, limits=limits)
    axes.set_title(title)
    return figure


def _mapped(
    found: DepthMap, label: str, cmap: str | None
) -> tuple[str, str, np.ndarray, tuple[float, float]]:
    """Label, colours, values and their limits; lengths in a unit that suits them."""
    values = np.asarray(to_numpy(found.values), np.float64)
    known = values[np.isfinite(values)]
    low, high = np.percentile(known, _ENDS) if known.size else (0.0, 1.0)
    unit, name = length_unit(max(abs(low), abs(high))) if found.unit == "m" else (1.0, found.unit)
    called = found.quantity + ("" if name == "1" else f" [{name}]")
    return label or called, cmap or "viridis", values / unit, (float(low) / unit, float(high) / unit)


def _stack(stack: Stack, cmap: str | None) -> Figure:
    pitch = stack.pixel_pitch
    grid = Grid(stack.shape, (pitch, pitch)) if pitch else None
    return images([(stack[k], stack.titles[k]) for k in _sample(len(stack), _SHOWN)], grid=grid, cmap=cmap)


def _field(field: Field, title: str) -> Figure:
    wave = to_numpy(field.data)
    if wave.ndim != 2:
        raise LumigraphError(
            f"a field to show is one wave (y, x), not a batch {wave.shape}. Choose one of it."
        )
    figure, (left, right) = canvas(1, 2, width=5.2)
    draw(left, np.abs(wave) ** 2, field.grid, label="intensity", cmap="inferno")
    draw(right, np.angle(wave), field.grid, label="phase [rad]", cmap="twilight", limits=(-np.pi, np.pi))
    left.set_title("intensity")
    right.set_title("phase")
    figure.suptitle(title)
    return figure


def _light_field(views: LightField, title: str) -> Figure:
    nv, nu, nt, ns = views.data.shape[:4]
    data = to_numpy(views.data)
    data = data[..., 0] if data.shape[4:] == (1,) else data
    figure, (view, mosaic, epi, other) = canvas(2, 2, width=5.2)
    draw(view, check_image(data[nv // 2, nu // 2]), views.lenslets, label="radiance")
    view.set_title(f"central view ({nv // 2}, {nu // 2}) of {nv} x {nu}")
    rows, columns = (_sample(n) for n in (nv, nu))
    tiles = np.concatenate([np.concatenate([data[v, u] for u in columns], 1) for v in rows], 0)
    draw(mosaic, tiles)
    mosaic.set(title=f"{len(rows)} x {len(columns)} views", xticks=[], yticks=[], xlabel="u", ylabel="v")
    _epi(epi, data[nv // 2, :, nt // 2], ("u", "s"))
    _epi(other, data[:, nu // 2, :, ns // 2], ("v", "t"))
    figure.suptitle(title)
    return figure


def _epi(axes: Any, image: np.ndarray, names: tuple[str, str]) -> None:
    draw(axes, image)
    axes.set(
        aspect="auto", ylabel=f"{names[0]} [view]", xlabel=f"{names[1]} [lenslet]", title="epipolar plane"
    )


def _sample(count: int, most: int = 5) -> list[int]:
    """Indices of up to `most` views, evenly from the first to the last."""
    return sorted({round(k) for k in np.linspace(0, count - 1, min(count, most))})
