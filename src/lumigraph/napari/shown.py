"""Nouns as layers, and layers as nouns."""

from typing import Any

import numpy as np

from lumigraph.core.arrays import to_numpy
from lumigraph.core.calibration import Calibration
from lumigraph.core.cloud import PointCloud
from lumigraph.core.depth_map import DepthMap
from lumigraph.core.layers import LayerData
from lumigraph.core.lightfield import LightField
from lumigraph.core.noun import Noun
from lumigraph.core.raw import RawImage
from lumigraph.errors import FormatError

KEY = "lumigraph"
"""Key of a layer's metadata that holds the noun it was made of."""

_MICRO = {"meter": 1.0, "millimeter": 1e-3, "micrometer": 1e-6, "nanometer": 1e-9}
_SURE = (1, 99)  # percentiles that the colours of a depth map span


def layer_of(thing: Any, name: str) -> LayerData:
    """Layer of a noun, as napari shows it.

    Raises
    ------
    FormatError
        Something that has no picture.
    """
    match thing:
        case DepthMap():
            return _coloured(thing, thing.to_napari(name))
        case Noun():
            return thing.to_napari(name)
        case Calibration():
            return _centres(thing, name)
        case PointCloud():
            return to_numpy(thing.points), {"name": name, "size": 1, "metadata": {KEY: thing}}, "points"
    raise FormatError(f"napari shows no {type(thing).__name__}. Open it with lumigraph.")


def beside(views: LightField, picture: Any, name: str, noun: Any = None) -> LayerData:
    """A picture (t, s[, c]) of a light field as a layer that lies on its views."""
    _, options, _ = views.to_napari(name)
    for key in ("scale", "translate", "units", "axis_labels"):
        options[key] = options[key][-2:]
    data = to_numpy(picture)
    options |= {"rgb": data.ndim == 3, "metadata": {KEY: noun}}
    return data, options, "image"


def depth_beside(views: LightField, found: DepthMap, name: str) -> LayerData:
    """A depth map of the middle view, in colours, where the views are."""
    return _coloured(found, beside(views, found.values, name, found))


def held(layer: Any, kind: type) -> Any:
    """Noun that a layer was made of, of this kind; an image of two axes counts as a raw image. Else None."""
    noun = layer.metadata.get(KEY)
    if isinstance(noun, kind):
        return noun
    plain = noun is None and type(layer).__name__ == "Image" and kind is RawImage
    if not plain or np.ndim(layer.data) != (3 if layer.rgb else 2):
        return None
    unit = _MICRO.get(str(layer.units[-1]))
    return RawImage(np.asarray(layer.data), unit and float(layer.scale[-1]) * unit)


def _coloured(found: DepthMap, layer: LayerData) -> LayerData:
    data, options, kind = layer
    known = data[np.isfinite(data) & (to_numpy(found.confidence) > 0)]
    low, high = np.percentile(known if known.size else [0.0, 1.0], _SURE)
    limits = [float(low), float(max(high, low + 1e-9))]
    return data, options | {"colormap": "turbo", "contrast_limits": limits}, kind


def _centres(calibration: Calibration, name: str) -> LayerData:
    pitch = calibration.pixel_pitch
    scale, unit = (1e6 * pitch, "micrometer") if pitch else (1.0, "pixel")
    options = {
        "name": name, "size": calibration.lattice.pitch / 6, "face_color": "transparent",
        "border_color": "orange", "scale": [scale] * 2, "units": [unit] * 2, "axis_labels": ("y", "x"),
        "metadata": {KEY: calibration},
    }  # fmt: skip
    return calibration.centers, options, "points"
