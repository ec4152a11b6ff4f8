"""Table ``[main_lens.over_field]``, or a CSV file: Zernike terms of a main lens by field and wavelength."""

import math
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, PlainSerializer, model_validator

from lumigraph.elements.field_plate import ZernikeMap
from lumigraph.errors import FormatError, GeometryError
from lumigraph.instruments.part import CameraTable
from lumigraph.instruments.quantities import angles, noll_index, numbers, wavelengths
from lumigraph.io import tables

MOST_VALUES = 2**18

STEEPEST = math.radians(80)
"""Largest field angle."""

_PATHS = {"nm": 1e-9, "um": 1e-6, "m": 1.0}

_COLUMN = re.compile(r"\s*([A-Za-z]+)\s*(\d*)\s*\[\s*([A-Za-zµ]+)\s*\]\s*")

Terms = Annotated[
    dict[int, tuple[float, ...]],
    BeforeValidator(lambda table: {noll_index(key): numbers(values) for key, values in _items(table)}),
    PlainSerializer(lambda table: dict(table)),
]

Angles = Annotated[tuple[float, ...], BeforeValidator(angles)]
Wavelengths = Annotated[tuple[float, ...], BeforeValidator(wavelengths)]


def _items(table: Any) -> Iterable[tuple[Any, Any]]:
    if not isinstance(table, dict):
        raise FormatError(
            f"{table!r} is not a table. Write a Noll index and its values, such as 8 = [0, 0.1]."
        )
    return table.items()


class OverField(CameraTable):
    """Aberrations of a main lens that change over the field: Zernike terms, rms, at some fields.

    A round lens has one row of fields, angles from the axis, as seen from the middle of the lens; others have
    columns and rows. Between them, terms follow splines.

    Parameters
    ----------
    field
        Angles from the axis, ascending from 0, of a round lens; an object point lies along +x there.
    y, x
        Angles along y and x, ascending, of a lens that is not round, in the place of `field`.
    wavelengths
        Ascending; left out, the terms are the same for every wavelength.
    unit
        Unit of the terms: "waves", or "nm", "um" or "m" of path.
    terms
        Terms by Noll's index, a value for each field: by `y` row by row, by `wavelengths` one set of fields
        after the other.

    Examples
    --------
    >>> OverField(field=["0 deg", "10 deg"], unit="waves", terms={8: [0, 0.2]}).terms
    {8: (0.0, 0.2)}
    """

    field: Angles | None = None
    y: Angles | None = None
    x: Angles | None = None
    wavelengths: Wavelengths | None = None
    unit: Literal["waves", "nm", "um", "m"]
    terms: Terms

    @model_validator(mode="after")
    def _is_possible(self) -> "OverField":
        if (self.field is None) == (self.x is None) or (self.y is None) != (self.x is None):
            raise FormatError("write field, of a round lens, or both y and x.")
        if not self.terms:
            raise FormatError("terms is empty. Write a Noll index and its values, such as 8 = [0, 0.1].")
        count = math.prod(len(axis or (0,)) for axis in (self.field, self.y, self.x, self.wavelengths))
        if count * len(self.terms) > MOST_VALUES:
            raise GeometryError(
                f"{count} fields of {len(self.terms)} terms are more than {MOST_VALUES} values."
            )
        for j, values in self.terms.items():
            if len(values) != count:
                raise GeometryError(f"term {j} has {len(values)} values but there are {count} fields.")
            if self.unit == "waves" and max(map(abs, values)) > 1000:
                raise GeometryError(
                    f"term {j} has {max(values, key=abs)!r} waves rms. Give waves, at most 1000."
                )
        _ = self.aberrations  # it refuses what cannot be
        return self

    @property
    def aberrations(self) -> ZernikeMap:
        """The map, of tangents of the angles.

        Raises
        ------
        GeometryError
            Fields or wavelengths that do not ascend, angles that are too large, terms of no round lens.
        """
        across = self.x if self.field is None else self.field
        assert across is not None  # checked above
        steepest = max(map(abs, (*across, *(self.y or ()))))
        if steepest > STEEPEST:
            raise GeometryError(
                f"a field of {math.degrees(steepest):.4g} degrees is too far from the axis for a lens."
            )
        shape = (len(self.wavelengths or (0,)), len(self.y or (0,)), len(across))
        scale = 1.0 if self.unit == "waves" else _PATHS[self.unit]
        values = np.stack([np.reshape(v, shape) for v in self.terms.values()], axis=-1) * scale
        return ZernikeMap(
            tuple(self.terms), values, tuple(map(math.tan, across)),
            None if self.y is None else tuple(map(math.tan, self.y)),
            self.wavelengths, metres=self.unit != "waves",
        )  # fmt: skip


def given(value: Any) -> Any:
    """A table as it is, or that of the CSV file that a text names."""
    if not isinstance(value, str | Path):
        return value
    return read(Path(value))


def read(path: Path) -> dict[str, Any]:
    """The table of a CSV file.

    Its first line names its columns: `field [deg]`, or `y [deg]` and `x [deg]`; `wavelength [nm]` or none;
    Noll's terms, such as `Z8 [waves]`.

    Raises
    ------
    FormatError
        No such file, one that is too large, no text, an unknown column, or a row that is no numbers.
    GeometryError
        Fields that are given twice, or not at every wavelength.
    """
    return _table(str(path), *tables.read(path, "field [deg], Z8 [waves]"))


def _table(path: str, header: list[str], numbers: list[list[float]]) -> dict[str, Any]:
    names, written_in, unit = _columns(path, header)
    places = [k for k, name in enumerate(names) if isinstance(name, str)]
    order = [name for name in ("wavelength", "y", "x", "field") if name in names]
    axes = {name: sorted({row[names.index(name)] for row in numbers}) for name in order}
    shape = [len(axis) for axis in axes.values()]
    terms = {name: np.full(shape, np.nan) for name in names if isinstance(name, int)}
    for row in numbers:
        at = tuple(axis.index(row[names.index(name)]) for name, axis in axes.items())
        for k, name in enumerate(names):
            if k in places or not isinstance(name, int):
                continue
            if not math.isnan(terms[name][at]):
                told = ", ".join(f"{name} {row[names.index(name)]:g}" for name in order)
                raise GeometryError(f"{path!r} has {told} twice.")
            terms[name][at] = row[k]
    if len(numbers) != math.prod(shape):
        raise GeometryError(
            f"{path!r} has {len(numbers)} rows but {' x '.join(map(str, shape))} different values of "
            f"{', '.join(order)}. Give a row for each of them together."
        )
    table: dict[str, Any] = {
        "unit": unit,
        "terms": {j: values.ravel().tolist() for j, values in terms.items()},
    }
    for name, axis in axes.items():
        written = [f"{at!r} {written_in[names.index(name)]}" for at in axis]
        table["wavelengths" if name == "wavelength" else name] = written
    return table


def _columns(path: str, header: list[str]) -> tuple[list[str | int], list[str], str]:
    """Names of the columns, an index for a term; their units; and the terms' unit."""
    names: list[str | int] = []
    written_in, found = [], set()
    for title in header:
        match = _COLUMN.fullmatch(title)
        name, index, unit = match.groups() if match else ("", "", "")
        unit = unit.replace("µ", "u")
        if name == "Z" and index and unit in ("waves", *_PATHS):
            names.append(noll_index(index))
            written_in.append("")
            found.add(unit)
        elif name in ("field", "y", "x", "wavelength") and not index:
            names.append(name)
            written_in.append(unit)
        else:
            raise FormatError(
                f"{path!r} has a column {title.strip()!r}. Name columns 'field [deg]' or 'y [deg]' and "
                "'x [deg]', 'wavelength [nm]', and Noll's terms as 'Z8 [waves]' or in nm, um or m."
            )
    if len(found) != 1 or len(set(names)) != len(names):
        raise FormatError(
            f"{path!r} has terms in {', '.join(sorted(found)) or 'no unit'} and {len(names)} columns. Give "
            "each column once, and all terms in one unit."
        )
    return names, written_in, found.pop()
