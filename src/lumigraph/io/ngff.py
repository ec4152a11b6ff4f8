"""OME-Zarr (NGFF 0.5): how other programs learn a volume's axes, units and sizes.

J. Moore et al., *OME-Zarr: a cloud-optimized bioimaging file format*, Histochem. Cell Biol. 160, 223 (2023);
specification 0.5, section "multiscales". One level is written; of several the first, the finest, is read.
"""

import re
from typing import Any

import numpy as np

from lumigraph.core import checks
from lumigraph.core.grid import Grid
from lumigraph.core.volume import Volume
from lumigraph.errors import FormatError

LEVEL = "0"
"""Name of the array."""

_UNITS = {
    "meter": 1.0, "centimeter": 1e-2, "millimeter": 1e-3, "micrometer": 1e-6, "nanometer": 1e-9,
    "picometer": 1e-12, "angstrom": 1e-10,
}  # fmt: skip


def data(values: np.ndarray) -> np.ndarray:
    """A volume's data in the order that NGFF demands, channels first: ([c, ]z, y, x)."""
    return np.moveaxis(values, -1, 0) if values.ndim == 4 else values


def names(volume: Volume) -> tuple[str, ...]:
    """Names of the axes of `data`."""
    return ("c", "z", "y", "x")[4 - len(volume.data.shape) :]


def describe(volume: Volume, *, times: bool = False) -> dict[str, Any]:
    """The attribute "ome" of a volume, or of a series of them over time; lengths in micrometres."""
    axes = [{"name": name, "type": "space", "unit": "micrometer"} for name in "zyx"]
    dz, dy, dx = volume.spacing
    first = (volume.depths[0], float(volume.grid.y[0]), float(volume.grid.x[0]))
    sign = -1.0 if len(volume.depths) > 1 and volume.depths[1] < volume.depths[0] else 1.0
    scale, shift = [sign * (dz or 1e-6) * 1e6, dy * 1e6, dx * 1e6], [value * 1e6 for value in first]
    if len(volume.data.shape) == 4:
        axes, scale, shift = [{"name": "c", "type": "channel"}, *axes], [1.0, *scale], [0.0, *shift]
    if times:
        axes, scale, shift = [{"name": "t", "type": "time"}, *axes], [1.0, *scale], [0.0, *shift]
    place = [{"type": "scale", "scale": scale}, {"type": "translation", "translation": shift}]
    level = {"path": LEVEL, "coordinateTransformations": place}
    return {"version": "0.5", "multiscales": [{"name": "volume", "axes": axes, "datasets": [level]}]}


def level(ome: Any) -> tuple[str, tuple[str, ...], dict[str, tuple[float, float]]]:
    """Finest level: the array's name, its axes, and (scale, first position) [m] of z, y and x.

    Raises
    ------
    FormatError
        Metadata of another version or shape.
    """
    try:
        image = ome["multiscales"][0]
        axes = tuple(axis["name"] for axis in image["axes"])
        units = [_UNITS.get(axis.get("unit"), 1e-6) for axis in image["axes"]]
        first = image["datasets"][0]
        place, moves = str(first["path"]), [*image.get("coordinateTransformations", ())]
        steps = [*first["coordinateTransformations"], *moves]
        scale, shift = np.ones(len(axes)), np.zeros(len(axes))
        for step in steps:
            if step["type"] == "scale":
                factor = np.asarray(step["scale"], float)
                scale, shift = scale * factor, shift * factor
            elif step["type"] == "translation":
                shift = shift + np.asarray(step["translation"], float)
        lengths = {
            axis: (checks.positive(axis, abs(float(a * unit))), checks.finite(axis, float(b * unit)))
            for axis, a, b, unit in zip(axes, scale, shift, units, strict=True)
            if axis in "zyx"
        }
    except (KeyError, IndexError, TypeError, ValueError, AttributeError) as error:
        raise FormatError(
            f"its OME-Zarr metadata is not a multiscales image of version 0.5: {error!r}."
        ) from error
    if not re.fullmatch(r"[A-Za-z0-9_\-]+(/[A-Za-z0-9_\-]+)*", place) or axes[-3:] != ("z", "y", "x"):
        raise FormatError(f"its OME-Zarr axes are {axes} at {place[:40]!r}; only [t, c,] z, y, x are read.")
    return place, axes, lengths


def volume(values: np.ndarray, axes: tuple[str, ...], lengths: dict[str, tuple[float, float]]) -> Volume:
    """The volume of an OME-Zarr array by another program; of several times the only one.

    Raises
    ------
    FormatError
        Several times, or axes that differ from the array's.
    """
    if values.ndim != len(axes):
        raise FormatError(f"its OME-Zarr axes {axes} do not fit an array of shape {values.shape}.")
    if "t" in axes:
        if values.shape[axes.index("t")] != 1:
            raise FormatError(f"it holds {values.shape[axes.index('t')]} times where one volume is needed.")
        values, axes = np.squeeze(values, axes.index("t")), tuple(name for name in axes if name != "t")
    if axes[0] == "c":
        values = values[0] if values.shape[0] == 1 else np.moveaxis(values, 0, -1)
    elif axes != ("z", "y", "x"):
        raise FormatError(f"its OME-Zarr axes are {axes}; only [t, c,] z, y, x are read.")
    (dz, z), (dy, y), (dx, x) = (lengths[name] for name in "zyx")
    planes, rows, columns = values.shape[:3]
    center = (y + (rows // 2) * dy, x + (columns // 2) * dx)
    return Volume(values, Grid((rows, columns), (dy, dx), center), tuple(z + np.arange(planes) * dz))
