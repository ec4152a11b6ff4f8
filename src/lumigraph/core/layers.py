"""Nouns as layers of napari: (data, options, kind), as napari's readers give them; napari is not imported."""

import warnings
from typing import Any

import numpy as np

from lumigraph.core.labelled import Labels
from lumigraph.errors import SamplingWarning

LayerData = tuple[np.ndarray, dict[str, Any], str]
"""Arguments of `napari.layers.Layer.create`."""

_UNITS = {"m": (1e6, "micrometer"), "px": (1.0, "pixel")}
_EVEN = 1e-6


def image(data: np.ndarray, labels: Labels, noun: Any, name: str) -> LayerData:
    """An image layer with scale, place, units and names of axes; what it was made of in its metadata.

    Lengths are in micrometres. Axes that ascend stay; those that descend are turned over, since napari's
    scale is above zero. Coordinates that are not even get their mean step, with a warning.

    Parameters
    ----------
    data
        The array; a last axis beside those of the labels is colour.
    labels
        Coordinates and units.
    noun
        Object that ``metadata["lumigraph"]`` holds.
    name
        Name of the layer.
    """
    axes = labels.axes
    placed = [_placed(labels, axis, data.shape[k]) for k, axis in enumerate(axes)]
    turned = tuple(slice(None, None, -1 if step < 0 else 1) for step, _, _ in placed)
    options = {
        "name": name, "rgb": data.ndim > len(axes) and data.shape[-1] == 3,
        "scale": [abs(step) for step, _, _ in placed],
        "translate": [
            start + min(0, (data.shape[k] - 1) * step) for k, (step, start, _) in enumerate(placed)
        ],
        "units": [unit for _, _, unit in placed], "axis_labels": tuple(axes), "metadata": {"lumigraph": noun},
    }  # fmt: skip
    if data.ndim > len(axes) and not options["rgb"]:
        data = np.moveaxis(data, -1, 0)
        turned = (slice(None), *turned)
        for key, first in (("scale", 1.0), ("translate", 0.0), ("units", "pixel")):
            options[key] = [first, *options[key]]
        options["axis_labels"] = ("c", *axes)
    return data[turned], options, "image"


def _placed(labels: Labels, axis: str, count: int) -> tuple[float, float, str]:
    """Step, first coordinate and unit of an axis."""
    places = labels.along.get(axis)
    if places is None:
        return 1.0, 0.0, "pixel"
    places = np.asarray(places, np.float64)
    known = labels.pitches.get(axis, 1.0)
    times, unit = _UNITS.get(labels.units.get(axis, "m"), (1.0, "dimensionless"))
    steps = np.diff(places)
    step = float(steps.mean()) if count > 1 else known
    if count > 1 and np.ptp(steps) > _EVEN * abs(step):
        warnings.warn(
            f"the axis {axis!r} has steps of {steps.min():.4g} to {steps.max():.4g}; napari shows them as "
            f"{step:.4g} each.",
            SamplingWarning,
            stacklevel=4,
        )
    return (times * step or 1.0), times * float(places[0]), unit
