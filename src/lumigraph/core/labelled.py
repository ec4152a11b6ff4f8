"""Arrays with names along their axes, as xarray holds them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from lumigraph.core import checks
from lumigraph.core.grid import Grid
from lumigraph.errors import GeometryError, LumigraphError

_EVEN = 1e-6
"""Steps that differ by this part of their mean count as equal."""


@dataclass(slots=True)
class Labels:
    """Names, coordinates and attributes of an array.

    Parameters
    ----------
    axes
        Names, such as "yx"; "c" may follow them.
    name, unit
        Name and unit of the values.
    along
        Coordinates by axis, or by name where they take several: arrays of their own with the axes' names.
    units
        Units of coordinates by name; "m" for the others.
    pitches
        Pitches of axes by name: one sample alone does not show its pitch.
    attributes
        Attributes by name; None is left out.
    data
        The array.
    """

    axes: str
    name: str = ""
    unit: str = ""
    along: dict[str, Any] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
    pitches: dict[str, float] = field(default_factory=dict)
    attributes: dict[str, Any] = field(default_factory=dict)
    data: Any = None

    def stands_on(self, grid: Grid, names: str = "yx") -> "Labels":
        """The labels with the places of a grid's samples along two axes."""
        for name, places, pitch in zip(names, (grid.y, grid.x), grid.pitch, strict=True):
            self.along[name], self.pitches[name] = places, pitch
        return self

    def grid(self, names: str = "yx") -> Grid:
        """Grid of the samples along two axes."""
        (y, dy), (x, dx) = (self._even(name) for name in names)
        return Grid((len(y), len(x)), (dy, dx), (y[len(y) // 2], x[len(x) // 2]))

    def attribute(self, name: str) -> Any:
        """An attribute that has to be there."""
        if name not in self.attributes:
            raise GeometryError(f"the DataArray has no attribute {name!r}. Give it: array.attrs[{name!r}].")
        return self.attributes[name]

    def number(self, name: str) -> float:
        """A finite number among the attributes that has to be there."""
        return checks.finite(f"the DataArray's attribute {name!r}", self.attribute(name), "1")

    def coordinate(self, name: str) -> np.ndarray:
        """A coordinate that has to be there, in metres."""
        if name not in self.along:
            raise GeometryError(f"the DataArray has no coordinate {name!r}. Give it, in metres.")
        places = np.asarray(self.along[name])
        if places.dtype.kind not in "iuf" or not places.size or not np.isfinite(places).all():
            raise GeometryError(f"the coordinate {name!r} of the DataArray must hold finite numbers.")
        return places.astype(np.float64)

    def _even(self, name: str) -> tuple[list[float], float]:
        places = self.coordinate(name)
        known = self.pitches.get(name)
        steps = np.diff(places)
        if not len(steps):
            if known is None:
                raise GeometryError(
                    f"the coordinate {name!r} has one sample and no attribute 'pitch' [m]. Give it."
                )
            return places.tolist(), float(known)
        mean = float(steps.mean())
        if np.ptp(steps) > _EVEN * abs(mean) or mean <= 0:
            raise GeometryError(
                f"the coordinate {name!r} has steps of {steps.min():.6g} to {steps.max():.6g} m but must "
                "ascend evenly. Interpolate, or select with a slice."
            )
        if known is not None and abs(known - mean) <= 1e-9 * mean:
            return places.tolist(), float(known)
        return places.tolist(), mean


def _library() -> ModuleType:
    """The module xarray.

    Raises
    ------
    LumigraphError
        It is not installed.
    """
    try:
        import xarray
    except ImportError as error:
        raise LumigraphError(
            "arrays with named axes need the package xarray: pip install 'lumigraph[xarray]'. "
            "Or use np.asarray."
        ) from error
    return xarray


def require() -> None:
    """Refuse if xarray is not installed.

    Raises
    ------
    LumigraphError
        It is not.
    """
    _library()


def save_dataset(
    path: Path,
    along: Mapping[str, tuple[Sequence[Any], str]],
    variables: Mapping[str, tuple[np.ndarray, str]],
) -> None:
    """Write variables over the same axes as NetCDF, which `xarray.open_dataset` reads.

    Parameters
    ----------
    path
        File.
    along
        Coordinates of each axis and their unit, or "".
    variables
        Arrays over all axes in their order, and their unit.
    """
    xarray = _library()

    def told(unit: str) -> dict[str, str]:
        return {"units": unit} if unit else {}

    coordinates = {name: ((name,), list(places), told(unit)) for name, (places, unit) in along.items()}
    data = {name: (tuple(along), array, told(unit)) for name, (array, unit) in variables.items()}
    xarray.Dataset(data, coordinates).to_netcdf(path, engine="scipy")


def to_xarray(data: np.ndarray, labels: Labels) -> Any:
    """An `xarray.DataArray` of an array and its labels."""
    xarray = _library()
    names = tuple(labels.axes) + ("c",) * (data.ndim - len(labels.axes))
    along = {n: c if isinstance(c, tuple) else ((n,), c) for n, c in labels.along.items()}
    attributes = {n: value for n, value in labels.attributes.items() if value is not None}
    unit = {"units": labels.unit} if labels.unit else {}
    array = xarray.DataArray(data, dims=names, coords=along, name=labels.name, attrs=attributes | unit)
    for name in along:
        array[name].attrs.update(_described(labels, name))
    return array


def _described(labels: Labels, name: str) -> dict[str, Any]:
    unit = labels.units.get(name, "m")
    pitch = {"pitch": labels.pitches[name]} if name in labels.pitches else {}
    return ({"units": unit} if unit else {}) | pitch


def from_xarray(array: Any, kind: str, axes: str) -> Labels:
    """The labels and values of a DataArray with the axes of a kind of noun."""
    xarray = _library()
    if not isinstance(array, xarray.DataArray):
        raise GeometryError(f"{kind}.from_xarray takes an xarray.DataArray, not a {type(array).__name__}.")
    names = tuple(str(name) for name in array.dims)
    if names not in (tuple(axes), (*axes, "c")):
        raise GeometryError(
            f"the DataArray has the axes ({', '.join(names)}) but a {kind} has ({', '.join(axes)}), and (c) "
            "for colour. Transpose or rename them."
        )
    along = {str(name): np.asarray(values) for name, values in array.coords.items()}
    pitches = {
        str(n): checks.finite(f"the attribute 'pitch' of the coordinate {n!r}", c.attrs["pitch"])
        for n, c in array.coords.items()
        if "pitch" in c.attrs
    }
    units = {str(n): str(c.attrs.get("units", "")) for n, c in array.coords.items()}
    attributes = {str(name): value for name, value in array.attrs.items()}
    return Labels(axes, along=along, units=units, pitches=pitches, attributes=attributes, data=array.values)
