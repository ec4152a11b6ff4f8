"""Steps of a bench's alignment: what is out of place after each, and the micro-images of one picture."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from lumigraph.core.arrays import Array
from lumigraph.plots.axes import canvas, draw

_UNITS = {"tilt": (180 / np.pi, "°"), "turn": (180 / np.pi, "°"), "aper": (100, "%")}
_LENGTH = (1e6, "µm")


def alignment(steps: Sequence[Mapping[str, Any]]) -> Figure:
    """Figure of what is out of place after each exposure, one axis for lengths, angles and the stop.

    Parameters
    ----------
    steps
        `AlignmentStep.values`, or those of a log.
    """
    units = {name: _UNITS.get(name[:4], _LENGTH) for name in steps[0]["moved_by_motors"]}
    kinds = list(dict.fromkeys(units.values()))
    figure, axes = canvas(1, len(kinds), width=3.6, height=3.4)
    numbers = [one["number"] for one in steps]
    for axis, (scale, unit) in zip(axes, kinds, strict=True):
        for name in (one for one, kind in units.items() if kind == (scale, unit)):
            values = [scale * one["out"][name] for one in steps]
            errors = [1.96 * scale * one["errors"][name] for one in steps]
            axis.errorbar(
                numbers, values, errors, label=name.replace("_", " "), capsize=2, marker="o", markersize=3
            )
        axis.axhline(0, color="0.7", linewidth=0.8, zorder=0)
        axis.set_xlabel("exposure")
        axis.set_ylabel(f"out of place [{unit}]")
        axis.locator_params(axis="x", integer=True)
        axis.legend(frameon=False, fontsize="small")
    return figure


def alignment_picture(picture: Array, step: Mapping[str, Any]) -> Figure:
    """Figure of a step's white image with the micro-images that were found on it.

    Parameters
    ----------
    picture
        The white image (y, x), perhaps of fewer pixels.
    step
        `AlignmentStep.values`, or those of a log.
    """
    image = np.asarray(picture, float)
    figure, (axis,) = canvas(1, 1, width=5.0, height=5.0)
    draw(axis, image / (image.max() or 1.0))
    places = np.array(step["centers"]) * image.shape[0] / step["shape"][0]
    axis.plot(*places.T[::-1], "+", color="tab:red", markersize=3, markeredgewidth=0.6)
    axis.plot(*(n / 2 for n in image.shape[::-1]), "x", color="tab:cyan", markersize=9)
    axis.set_title(f"exposure {step['number']}: {step['status']}")
    return figure
