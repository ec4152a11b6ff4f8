"""Header beside the pixels of a raw image: one JSON object, the same in every format."""

import json
import math
from collections.abc import Mapping
from pathlib import PurePath
from typing import Any

import numpy as np

from lumigraph.core.grid import Grid
from lumigraph.core.lightfield import LightField
from lumigraph.core.raw import RawImage
from lumigraph.core.stack import Stack
from lumigraph.core.volume import Volume
from lumigraph.errors import FormatError, LumigraphError

FORMAT = 1
_FIELDS = ("pixel_pitch", "bit_depth", "bayer")


def describe(raw: RawImage) -> dict[str, Any]:
    """Fields of a raw image other than its pixels, as JSON values; tuples become lists.

    Raises
    ------
    FormatError
        Metadata that JSON cannot hold; the message names the key.
    """
    fields = {name: value for name in _FIELDS if (value := getattr(raw, name)) is not None}
    return {"lumigraph": FORMAT, **fields, "metadata": plain(raw.metadata, "metadata")}


def dumps(raw: RawImage, **more: Any) -> str:
    """`describe(raw)` and `more` as ASCII JSON."""
    return json.dumps({**describe(raw), **more})


def loads(text: Any) -> dict[str, Any] | None:
    """The object that `dumps` wrote, or None for any other text."""
    try:
        found = json.loads(text)
    except (TypeError, ValueError, RecursionError):
        return None
    return found if isinstance(found, dict) and "lumigraph" in found else None


def restore(data: np.ndarray, found: Mapping[str, Any] | None, bit_depth: int | None) -> RawImage:
    """The raw image with these pixels and the fields that `loads` found.

    `bit_depth` stands in where nothing was found.

    Raises
    ------
    FormatError
        Fields that no raw image can have.
    """
    if found is None:
        return RawImage(data, bit_depth=bit_depth)
    if found["lumigraph"] != FORMAT:
        raise FormatError(
            f"the header has format {found['lumigraph']!r} but this lumigraph reads {FORMAT}. Update it."
        )
    metadata = found.get("metadata", {})
    if not isinstance(metadata, Mapping):
        raise FormatError(f"the lumigraph header is damaged: its metadata is a {type(metadata).__name__}.")
    try:
        return RawImage(data, *(found.get(name) for name in _FIELDS), metadata=dict(metadata))
    except (LumigraphError, TypeError, ValueError, OverflowError) as error:
        raise FormatError(f"the lumigraph header is damaged: {error}") from error


def describe_stack(stack: Stack) -> dict[str, Any]:
    """Fields of a stack other than its pixels, as JSON values."""
    return {
        "lumigraph": FORMAT,
        "kind": "Stack",
        "positions": list(stack.positions),
        "quantity": stack.quantity,
        "pixel_pitch": stack.pixel_pitch,
        "bit_depth": stack.bit_depth,
        "metadata": plain(stack.metadata, "metadata"),
    }


def describe_volume(volume: Volume) -> dict[str, Any]:
    """Fields of a volume other than its data, as JSON values."""
    return {
        "lumigraph": FORMAT,
        "kind": "Volume",
        "depths": list(volume.depths),
        "grid": describe_grid(volume.grid),
    }


def describe_views(views: LightField) -> dict[str, Any]:
    """Fields of a light field other than its data, as JSON values."""
    return {
        "lumigraph": FORMAT,
        "kind": "LightField",
        "aperture": describe_grid(views.aperture),
        "lenslets": describe_grid(views.lenslets),
        "separation": float(views.separation),
    }


def describe_grid(grid: Grid) -> dict[str, list[float]]:
    """A grid as JSON values; `grid` reads them."""
    return {"shape": list(grid.shape), "pitch": list(grid.pitch), "center": list(grid.center)}


def grid(fields: Any) -> Grid:
    """The grid that `describe_grid` wrote."""
    if not isinstance(fields, Mapping):
        raise FormatError("the lumigraph header is damaged: a grid is missing.")
    return Grid(tuple(fields["shape"]), tuple(fields["pitch"]), tuple(fields["center"]))


def restore_planes(data: np.ndarray, found: Mapping[str, Any]) -> Stack | Volume:
    """The stack or the volume with these planes and the fields that `loads` found.

    Raises
    ------
    FormatError
        Fields that neither can have, or of another kind.
    """
    try:
        if found.get("kind") == "Volume":
            return Volume(data, grid(found["grid"]), found["depths"])
        if found.get("kind") == "Stack":
            fields = ("quantity", "pixel_pitch", "bit_depth", "metadata")
            return Stack(data, tuple(found["positions"]), *(found[name] for name in fields))
    except (LumigraphError, TypeError, KeyError, ValueError, OverflowError) as error:
        raise FormatError(f"the lumigraph header is damaged: {error}") from error
    raise FormatError(f"the lumigraph header is of a {found.get('kind')!r}, not of planes. Update lumigraph.")


def plain(value: Any, name: str) -> Any:
    """`value` as JSON values; `name` is what an error message calls it.

    Raises
    ------
    FormatError
        Something JSON cannot hold.
    """
    if isinstance(value, Mapping):
        return {str(key): plain(item, f"{name}[{key!r}]") for key, item in value.items()}
    if isinstance(value, list | tuple | set | frozenset):
        return [plain(item, f"{name}[{k}]") for k, item in enumerate(value)]
    if isinstance(value, np.generic | np.ndarray):
        return plain(value.tolist(), name)
    if isinstance(value, float) and not math.isfinite(value):
        raise FormatError(f"{name} is {value} but only finite numbers can be written. Leave it out.")
    if value is None or isinstance(value, bool | int | float | str):
        return value
    if isinstance(value, PurePath):
        return str(value)
    raise FormatError(
        f"{name} is a {type(value).__name__}, which a file cannot hold. Write it as text or numbers."
    )
