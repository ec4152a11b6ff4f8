"""Tables of many rows: CSV, read as well, Parquet through pyarrow, NetCDF with the varied values as axes."""

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from lumigraph.core import labelled
from lumigraph.errors import FormatError, LumigraphError
from lumigraph.store import replacing

ENDINGS = (".csv", ".parquet", ".nc")

MOST_BYTES = 2**22
"""Largest size of a CSV file that is read: a table of a thousand rows of 40 numbers has some 400 KiB."""

Rows = Sequence[Mapping[str, Any]]


@dataclass(frozen=True, slots=True)
class Axes:
    """Columns whose combinations the rows are, in their order.

    Parameters
    ----------
    values
        Values of each column, as the rows have them.
    places
        The same ones as numbers, where they are lengths [m].
    """

    values: Mapping[str, Sequence[Any]]
    places: Mapping[str, Sequence[float]] = field(default_factory=dict)


def save(path: Path, rows: Rows, axes: Axes | None = None) -> None:
    """Write rows; the columns are all names that one of them has.

    Raises
    ------
    FormatError
        Another ending, NetCDF of rows that are no combinations, or a disk that is full.
    LumigraphError
        The package that writes the format is not installed.
    """
    writers = {".csv": _csv, ".parquet": _parquet, ".nc": _netcdf}
    require(path, axes)
    with replacing(path) as temporary:
        writers[path.suffix](temporary, rows, axes or Axes({}))


def require(path: Path, axes: Axes | None = None) -> None:
    """Refuse what cannot be written, before any work.

    Raises
    ------
    FormatError, LumigraphError
        As `save`.
    """
    if path.suffix not in ENDINGS:
        raise FormatError(f"{path} is no table. Use one of {', '.join(ENDINGS)}.")
    if path.suffix == ".nc" and axes is None:
        raise FormatError(f"{path}: its rows are no combinations of values. Use .csv or .parquet.")
    if path.suffix == ".parquet":
        _arrow()
    if path.suffix == ".nc":
        labelled.require()


def read(path: Path, such_as: str) -> tuple[list[str], list[list[float]]]:
    """Titles and numbers of a small CSV file; empty lines and those that begin with # are left out.

    Raises
    ------
    FormatError
        No such file, one that is too large, no text, no rows, whose titles are meant `such_as`, or a row that
        is not as many finite numbers as there are titles.
    """
    try:
        with path.open("rb") as file:
            content = file.read(MOST_BYTES + 1)
        text = content.decode("utf-8-sig")
    except OSError as error:
        raise FormatError(
            f"{str(path)!r} cannot be read: {error.strerror}. Check its name and folder."
        ) from None
    except UnicodeDecodeError:
        raise FormatError(f"{str(path)!r} is not text. Give a CSV file.") from None
    if len(content) > MOST_BYTES:
        raise FormatError(f"{str(path)!r} is larger than {MOST_BYTES >> 20} MiB, too large for a table.")
    lines = [line for line in text.splitlines() if line.strip() and not line.lstrip().startswith("#")]
    titles, *rows = csv.reader(lines) if lines else [[]]
    if not rows:
        raise FormatError(f"{str(path)!r} has no rows. Give a line of names, such as {such_as!r}, and rows.")
    return titles, [_numbers(str(path), number, row, len(titles)) for number, row in enumerate(rows, 1)]


def _numbers(path: str, number: int, row: list[str], count: int) -> list[float]:
    try:
        found = [float(cell) for cell in row]
    except ValueError:
        found = []
    if len(found) != count or not np.isfinite(found).all():
        raise FormatError(f"{path!r}, row {number}: {', '.join(row)[:60]!r} is not {count} finite numbers.")
    return found


def names(rows: Rows) -> list[str]:
    """Columns in the order in which rows first name them.

    >>> names([{"a": 1}, {"a": 2, "b": 3}])
    ['a', 'b']
    """
    return list(dict.fromkeys(name for row in rows for name in row))


def _csv(path: Path, rows: Rows, _: Axes) -> None:
    with path.open("w", newline="") as file:
        table = csv.DictWriter(file, names(rows))
        table.writeheader()
        table.writerows(rows)


def _parquet(path: Path, rows: Rows, _: Axes) -> None:
    arrow, parquet = _arrow()
    columns = {name: _one_kind([row.get(name) for row in rows]) for name in names(rows)}
    parquet.write_table(arrow.table(columns), path)


def _one_kind(values: list[Any]) -> list[Any]:
    """A column as numbers, or as words where one is.

    >>> _one_kind([1, 2.5, None]), _one_kind([1, "many"])
    ([1.0, 2.5, None], ['1', 'many'])
    """
    kinds = {type(value) for value in values if value is not None}
    if len(kinds) <= 1:
        return values
    kind = float if kinds <= {int, float} else str
    return [None if value is None else kind(value) for value in values]


def _arrow() -> tuple[Any, Any]:
    try:
        import pyarrow  # pyright: ignore[reportMissingImports] - an extra
        import pyarrow.parquet  # pyright: ignore[reportMissingImports] - an extra
    except ImportError:
        raise LumigraphError(
            "Parquet needs the package pyarrow. Install it: pip install 'lumigraph[tables]', or use .csv."
        ) from None
    return pyarrow, pyarrow.parquet


def _netcdf(path: Path, rows: Rows, axes: Axes) -> None:
    shape = tuple(len(values) for values in axes.values.values())
    found = {}
    for name in names(rows):
        if name not in axes.values:
            plain, unit = name.partition(" [")[::2]
            column = _column([row.get(name) for row in rows]).reshape(shape)
            found[plain] = column, unit.rstrip("]")
    along = {
        name: (axes.places.get(name, values), "m" if name in axes.places else "")
        for name, values in axes.values.items()
    }
    labelled.save_dataset(path, along, found)


def _column(values: list[Any]) -> np.ndarray:
    """Numbers, NaN where there is none; words where one is."""
    if any(isinstance(value, str) for value in values):
        return np.array(["" if value is None else str(value) for value in values])
    return np.array([np.nan if value is None else value for value in values], np.float64)
