"""OME-Zarr (NGFF 0.5): how other programs learn a volume's axes, units and sizes.

J. Moore et al., *OME-Zarr: a cloud-optimized bioimaging file format*, Histochem. Cell Biol. 160, 223 (2023);
specification 0.5, section "multiscales". Each level has half the samples of the one before along y and x,
until a plane fits a screen; planes stay, which are few. The finest level that may be read is read.
"""

import re
from typing import Any

import numpy as np

from lumigraph.core import checks
from lumigraph.core.grid import Grid
from lumigraph.core.volume import Volume
from lumigraph.errors import FormatError

LEVEL = "0"
"""Name of the finest array."""

_SIDE = 256  # samples along y and x of a plane that needs no coarser level
_MOST_LEVELS = 32

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


def pyramid(values: np.ndarray) -> list[np.ndarray]:
    """Levels of data ([c, ]z, y, x), the finest first: means of 2 x 2 samples, of one or two at odd ends."""
    levels = [values]
    while max(levels[-1].shape[-2:]) > _SIDE:
        fine = levels[-1]
        wider = [(0, 0)] * (fine.ndim - 2) + [(0, n % 2) for n in fine.shape[-2:]]
        even = np.pad(fine, wider, "edge")
        pairs = even.reshape(*even.shape[:-2], even.shape[-2] // 2, 2, even.shape[-1] // 2, 2)
        mean = pairs.mean((-3, -1), dtype=np.result_type(fine.dtype, np.float32))
        levels.append((np.rint(mean) if fine.dtype.kind in "iu" else mean).astype(fine.dtype))
    return levels


def describe(volume: Volume, *, times: bool = False) -> dict[str, Any]:
    """The attribute "ome" of a volume's pyramid, or of a series over time, of one level; in micrometres."""
    axes = [{"name": name, "type": "space", "unit": "micrometer"} for name in "zyx"]
    dz, dy, dx = volume.spacing
    first = (volume.depths[0], float(volume.grid.y[0]), float(volume.grid.x[0]))
    sign = -1.0 if len(volume.depths) > 1 and volume.depths[1] < volume.depths[0] else 1.0
    scale, shift = [sign * (dz or 1e-6) * 1e6, dy * 1e6, dx * 1e6], [value * 1e6 for value in first]
    if len(volume.data.shape) == 4:
        axes, scale, shift = [{"name": "c", "type": "channel"}, *axes], [1.0, *scale], [0.0, *shift]
    if times:
        axes, scale, shift = [{"name": "t", "type": "time"}, *axes], [1.0, *scale], [0.0, *shift]
    sides, levels = volume.data.shape[1:3], []
    while not levels or (not times and max(sides) * 2 ** (1 - len(levels)) > _SIDE):
        levels.append(_placed(scale, shift, len(levels)))
    return {
        "version": "0.5",
        "multiscales": [{"name": "volume", "axes": axes, "datasets": levels, "type": "mean"}],
    }


def _placed(scale: list[float], shift: list[float], number: int) -> dict[str, Any]:
    """A level's name, the sizes of its samples, and the middle of its first one."""
    step = 2**number
    coarse = [*scale[:-2], *(step * one for one in scale[-2:])]
    middle = [a + (step - 1) / 2 * b for a, b in zip(shift[-2:], scale[-2:], strict=True)]
    first = {"type": "translation", "translation": [*shift[:-2], *middle]}
    return {"path": str(number), "coordinateTransformations": [{"type": "scale", "scale": coarse}, first]}


Level = tuple[str, tuple[str, ...], dict[str, tuple[float, float]]]
"""The array's name, its axes, and (scale, first position) [m] of z, y and x."""


def levels(ome: Any) -> list[Level]:
    """Levels of an image, the finest first.

    Raises
    ------
    FormatError
        Metadata of another version or shape.
    """
    try:
        image = ome["multiscales"][0]
        axes = tuple(axis["name"] for axis in image["axes"])
        units = [_UNITS.get(axis.get("unit"), 1e-6) for axis in image["axes"]]
        moves = image.get("coordinateTransformations", ())
        sets = image["datasets"][:_MOST_LEVELS]
        found = [(str(one["path"]), axes, _lengths(one, moves, axes, units)) for one in sets]
    except (KeyError, IndexError, TypeError, ValueError, AttributeError) as error:
        raise FormatError(
            f"its OME-Zarr metadata is not a multiscales image of version 0.5: {error!r}."
        ) from error
    if not found:
        raise FormatError("its OME-Zarr metadata names no dataset.")
    for name, *_ in found:
        if not re.fullmatch(r"[A-Za-z0-9_\-]+(/[A-Za-z0-9_\-]+)*", name) or axes[-3:] != ("z", "y", "x"):
            raise FormatError(
                f"its OME-Zarr axes are {axes} at {name[:40]!r}; only [t, c,] z, y, x are read."
            )
    return found


def _lengths(
    dataset: Any, moves: Any, axes: tuple[str, ...], units: list[float]
) -> dict[str, tuple[float, float]]:
    scale, shift = np.ones(len(axes)), np.zeros(len(axes))
    for step in [*dataset["coordinateTransformations"], *moves]:
        if step["type"] == "scale":
            factor = np.asarray(step["scale"], float)
            scale, shift = scale * factor, shift * factor
        elif step["type"] == "translation":
            shift = shift + np.asarray(step["translation"], float)
    return {
        axis: (checks.positive(axis, abs(float(a * unit))), checks.finite(axis, float(b * unit)))
        for axis, a, b, unit in zip(axes, scale, shift, units, strict=True)
        if axis in "zyx"
    }


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
