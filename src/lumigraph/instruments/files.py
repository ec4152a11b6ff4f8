"""Camera files: TOML text to a table and back."""

import tomllib
from collections.abc import Mapping
from difflib import get_close_matches
from importlib import resources
from os import PathLike
from pathlib import Path
from typing import Any

from lumigraph.errors import FormatError
from lumigraph.io.source import toml

MOST_BYTES = 2**20
"""A camera file has some 20 lines; whatever is larger than 1 MiB is something else."""

KINDS = ("single-lens", "plenoptic", "focused-plenoptic", "light-field-microscope")


def read(path: str | PathLike[str]) -> dict[str, Any]:
    """The table of a TOML file.

    Raises
    ------
    FormatError
        No such file, no file, larger than 1 MiB, not text, or not TOML.
    """
    path = Path(path)
    if not path.exists():
        raise FormatError(f"there is no camera file {str(path)!r}. Check its name and folder.")
    if not path.is_file():
        raise FormatError(f"{str(path)!r} is not a file. Give a camera file, such as 'camera.toml'.")
    try:
        # A pipe or a growing file can be larger than it says.
        with path.open("rb") as file:
            content = file.read(MOST_BYTES + 1)
    except OSError as error:
        raise FormatError(f"{str(path)!r} cannot be read: {error.strerror}. Check its permissions.") from None
    if len(content) > MOST_BYTES:
        raise FormatError(
            f"{str(path)!r} is larger than 1 MiB, too large for a camera file. Give a TOML file."
        )
    try:
        return _beside(path, toml(path, content.decode("utf-8")))
    except UnicodeDecodeError:
        raise FormatError(f"{str(path)!r} is not text. Give a camera file in TOML.") from None


def _beside(path: Path, table: dict[str, Any]) -> dict[str, Any]:
    """The table, whose main lens names files from the camera file's folder on."""
    lens = table.get("main_lens")
    if isinstance(lens, dict):
        for key in ("over_field", "prescription"):
            if isinstance(lens.get(key), str):
                lens[key] = str(path.parent / lens[key])
    return table


_CATALOGUE = resources.files("lumigraph.instruments") / "catalogue"


def catalogue() -> list[str]:
    """Names of the cameras that come with lumigraph, for `load_camera`.

    Examples
    --------
    >>> "thesis-plenoptic-1" in catalogue()
    True
    """
    names = [entry.name for entry in _CATALOGUE.iterdir()]
    return sorted(name.removesuffix(".toml") for name in names if name.endswith(".toml"))


def read_catalogue(name: str) -> dict[str, Any]:
    """The table of a camera that comes with lumigraph.

    Raises
    ------
    FormatError
        No such name; the message gives the nearest, or all.
    """
    names = catalogue()
    if name not in names:
        near = get_close_matches(name, names, 1, 0.6)
        hint = f"Did you mean {near[0]!r}?" if near else f"The catalogue has {', '.join(names)}."
        raise FormatError(f"{name!r} is neither a camera file nor in the catalogue. {hint}")
    return tomllib.loads((_CATALOGUE / f"{name}.toml").read_text(encoding="utf-8"))


def kind(table: Mapping[str, Any], origin: str) -> str:
    """The kind of camera that a table describes.

    Raises
    ------
    FormatError
        The key is missing or unknown.
    """
    known = ", ".join(map(repr, KINDS))
    if "kind" not in table:
        raise FormatError(f"{origin} has no kind. Add a first line such as kind = 'plenoptic' (or {known}).")
    if table["kind"] not in KINDS:
        raise FormatError(f"{origin}: kind {table['kind']!r} is not one of {known}.")
    return table["kind"]


def write(table: Mapping[str, Any]) -> str:
    """TOML text of plain values and one level of tables; lengths are the floats under known keys."""
    lines = [f"{key} = {_text(key, value)}" for key, value in table.items() if not isinstance(value, dict)]
    for name, inner in table.items():
        if isinstance(inner, dict):
            lines += ["", *_table(name, inner)]
    return "\n".join(lines) + "\n"


_LENGTHS = (
    "wavelength", "object_distance", "focal_length", "diameter", "pitch", "pixel_pitch", "offset",
    "bandwidth", "tube_lens", "focus_depth", "lenslet_offset", "sensor_distance", "fourier_lens",
    "offset_y", "offset_x", "decentre_y", "decentre_x", "separation", "lenslet_distance", "decentre_scatter",
    "form_scatter", "wavelengths", "array_bow",
)  # fmt: skip

_ANGLES = ("rotation", "angles", "field", "y", "x", "array_tilt", "sensor_tilt", "tilt_scatter")


def _table(name: str, values: Mapping[str, Any]) -> list[str]:
    plain = {key: value for key, value in values.items() if not isinstance(value, dict) and value is not None}
    lines = [f"{key} = {_text(str(key), value)}" for key, value in plain.items()]
    if lines or not values:
        lines = [f"[{name}]", *lines]
    for key, inner in values.items():
        if isinstance(inner, dict) and inner:
            lines += _table(f"{name}.{key}", inner)
    return lines


def _text(key: str, value: Any) -> str:
    if isinstance(value, tuple | list):
        if len(value) == 1 and key not in ("field", "y", "x", "wavelengths") and not str(key).isdecimal():
            return _text(key, value[0])
        return "[" + ", ".join(_text(key, each) for each in value) + "]"
    if isinstance(value, float) and key in _LENGTHS:
        return f'"{_metres(value)}"'
    if isinstance(value, float) and key in _ANGLES:
        return f'"{value!r} rad"'
    if isinstance(value, float) and key == "exposure_time":
        return f'"{value!r} s"'
    return f'"{value}"' if isinstance(value, str) else repr(value)


def _metres(value: float) -> str:
    """The length in the largest unit that leaves a number above 1, if that reads back as the same float."""
    from lumigraph import units

    for unit, size in (("mm", 1e-3), ("um", 1e-6), ("nm", 1e-9)):
        text = f"{float(f'{value / size:.12g}'):.12g} {unit}"
        if abs(value) >= size and units.parse(text) == value:
            return text
    return f"{value!r} m"
