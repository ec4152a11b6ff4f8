"""Raytrix calibration XML: a hexagonal lattice of three lens types, in pixels.

Lengths "lens" count in lenslet diameters, y up. The lens with offset (0, 0) stands at the picture's middle
plus the offset, y up; type 0 is the lattice's kind 0, the next of the row kind 1. A picture that was cropped
has another middle: its lattice is then off by the crop, by up to half a lenslet.
"""

import math
from pathlib import Path
from typing import Any

import numpy as np
from defusedxml import ElementTree
from defusedxml.common import DefusedXmlException

from lumigraph.core import checks
from lumigraph.core.calibration import Calibration
from lumigraph.core.lattice import Lattice
from lumigraph.errors import FormatError
from lumigraph.io import source

_LONGEST = 1 << 20  # bytes
_NOTE = "the lattice stands where the maker's file puts it; a cropped picture may be shifted against it"


def load(
    path: Path, *, shape: tuple[int, int] | None = None, max_pixels: int = source.MAX_PIXELS
) -> Calibration:
    """The calibration in a Raytrix XML file.

    Parameters
    ----------
    path
        The file, `RayCalibData`.
    shape
        Rows and columns of the raw image: the file does not tell.
    max_pixels
        Larger shapes are refused.

    Raises
    ------
    FormatError
        Another file, a number that is missing, or no shape.
    """
    path = source.regular_file(path)
    if shape is None:
        raise FormatError(
            f"{path} does not say how large the raw image is. Call lumigraph.open(path, shape=raw.shape)."
        )
    shape = checks.shape("shape", shape)
    source.check_size(path, shape, max_pixels)
    root = _root(path)
    diameter = checks.positive("diameter", _number(path, root, "diameter"), "px", FormatError)
    rotation = _number(path, root, "rotation")
    y, x = (_number(path, root, f"offset/{axis}") for axis in "yx")
    origin = (shape[0] - 1) / 2 - y, (shape[1] - 1) / 2 + x
    with source.decoding(path, "a Raytrix calibration"):
        lattice = Lattice(_basis(path, root, diameter, rotation), origin, "hex", _kinds(root))
    indices = source.nominal_indices(path, lattice, shape)
    return Calibration(lattice, shape, indices, lattice.position(indices), 0.0, notes=(_NOTE,), by_maker=True)


def contents(path: Path) -> list[tuple[str, str, str]]:
    """One calibration; `open` needs the shape of the raw image."""
    kinds = len(lens_types(path))
    return [("", "Calibration", f"hexagonal, {kinds} lens types; open it with shape=")]


def lens_types(path: str | Path) -> tuple[tuple[float, float], ...]:
    """Virtual depths (nearest, farthest) at which each lens type is sharp, in the order of the kinds.

    Raises
    ------
    FormatError
        Another file, or numbers that are missing.
    """
    place = source.regular_file(path)
    root = _root(place)
    found = {}
    for node in root.findall("lens_type"):
        ends = _number(place, node, "depth_range/min"), _number(place, node, "depth_range/max")
        found[round(_number(place, node, "offset/x")) % 3] = ends
    return tuple(found[kind] for kind in sorted(found))


def _root(path: Path) -> Any:
    if path.stat().st_size > _LONGEST:
        raise FormatError(f"{path} has {path.stat().st_size} bytes, too many for a calibration.")
    try:
        root = ElementTree.fromstring(path.read_bytes())
    except (ElementTree.ParseError, DefusedXmlException, ValueError, LookupError) as error:
        raise FormatError(f"{path} is damaged XML: {error}. Copy it again.") from error
    if root.tag != "RayCalibData":
        raise FormatError(f"{path} is not a Raytrix calibration: it begins with <{str(root.tag)[:40]}>.")
    return root


def _number(path: Path, root: Any, name: str) -> float:
    text = root.findtext(name)
    try:
        value = float(text)
    except (TypeError, ValueError):
        value = math.nan
    if not math.isfinite(value):
        raise FormatError(f"{path} has no number {name}: {text!r}. Export it again from Raytrix' software.")
    return value


def _basis(path: Path, root: Any, diameter: float, rotation: float) -> Any:
    """Row vector and the one to the next row down (y, x) [px]; the file's second may lead up or down."""
    vectors = [
        np.array([-_number(path, root, f"{name}/y"), _number(path, root, f"{name}/x")]) * diameter
        for name in ("lens_base_x", "lens_base_y")
    ]
    sin, cos = math.sin(rotation), math.cos(rotation)
    turn = np.array([[cos, -sin], [sin, cos]])  # y up: a positive angle turns pictures counter-clockwise
    row, column = (turn @ vector for vector in vectors)
    if column[0] < 0:
        column = row - column
    return (float(row[0]), float(row[1])), (float(column[0]), float(column[1]))


def _kinds(root: Any) -> int:
    return 3 if len(root.findall("lens_type")) == 3 else 1
