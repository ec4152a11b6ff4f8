"""The planes of a train of elements, side by side."""

from collections.abc import Iterable, Sequence

import numpy as np
from matplotlib.figure import Figure

from lumigraph.core.arrays import to_numpy
from lumigraph.core.field import Field
from lumigraph.errors import LumigraphError
from lumigraph.plots.axes import canvas, draw


def planes(fields: Iterable[Field], *, names: Sequence[str] = (), decibel: bool = False) -> Figure:
    """Figure of the intensity on every plane of a train.

    Parameters
    ----------
    fields
        Such as ``train.planes(field)``; each one wave (y, x).
    names
        One for each plane; "plane 0" and so on where they are left out.
    decibel
        10 log10 of the intensity over its maximum, down to -60 dB, shows faint light.

    Raises
    ------
    LumigraphError
        No planes, a batch of waves, or another number of names than planes.

    Examples
    --------
    >>> from lumigraph.core.grid import Grid
    >>> wave = Field(np.ones((4, 4)), Grid.square(4, 1e-6), 633e-9)
    >>> [axes.get_title() for axes in planes([wave, wave], names=["source", "lens"]).axes][:2]
    ['source', 'lens']
    """
    waves = list(fields)
    if not waves:
        raise LumigraphError("there are no planes to show. Give train.planes(field).")
    if names and len(names) != len(waves):
        raise LumigraphError(
            f"there are {len(names)} names for {len(waves)} planes. Give one for each, or none."
        )
    columns = min(len(waves), 4)
    figure, axes = canvas(-(-len(waves) // columns), columns)
    for k, (panel, wave) in enumerate(zip(axes, waves, strict=False)):
        image, label = _image(wave, decibel)
        draw(panel, image, wave.grid, label=label, cmap="inferno", limits=(-60, 0) if decibel else (0, None))
        panel.set_title(names[k] if names else f"plane {k}")
    for panel in axes[len(waves) :]:
        panel.set_axis_off()
    return figure


def _image(wave: Field, decibel: bool) -> tuple[np.ndarray, str]:
    image = to_numpy(wave.intensity)
    if image.ndim != 2:
        raise LumigraphError(
            f"a plane to show is one wave (y, x), not a batch {image.shape}. Choose one of it."
        )
    if not decibel:
        return image, "intensity"
    top = float(image.max()) or 1.0
    return 10 * np.log10(np.maximum(image / top, 1e-6)), "intensity [dB]"
