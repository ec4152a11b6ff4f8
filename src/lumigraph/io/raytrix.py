"""Raytrix calibration XML: a hexagonal lattice of three lens types, in pixels.

Lengths "lens" count in lenslet diameters, y up. The lens with offset (0, 0) stands at the picture's middle
plus the offset, y up; type 0 is the lattice's kind 0, the next of the row kind 1. A picture that was cropped
has another middle: its lattice is then off by the crop, by up to half a lenslet.
"""

import math
import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from defusedxml import ElementTree
from defusedxml.common import DefusedXmlException

from lumigraph.core import checks
from lumigraph.core.calibration import Calibration
from lumigraph.core.lattice import Lattice
from lumigraph.errors import FormatError
from lumigraph.io import source, target

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
        Rows and columns of the raw image, which the file does not contain.
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


def save(
    calibration: Calibration, path: str | os.PathLike[str], *, lens_types: Sequence[tuple[float, float]] = ()
) -> None:
    """Write the lattice as a Raytrix XML file, which `load` reads with ``shape=calibration.shape``.

    The file has no place for measured centres, light, missing lenslets and lengths.

    Parameters
    ----------
    calibration
        Calibration of a hexagonal array.
    path
        The file (.xml).
    lens_types
        Virtual depths (nearest, farthest) at which each kind is sharp, if they are known.

    Raises
    ------
    FormatError
        A square lattice, one with a warp, or other than one pair of depths for each kind.
    """
    lattice = calibration.lattice
    if lattice.layout != "hex" or calibration.warp is not None:
        what = "square" if lattice.layout != "hex" else "warped"
        raise FormatError(f"the lattice is {what}, which a Raytrix file cannot hold. Save it as .toml.")
    if lens_types and len(lens_types) != lattice.kinds:
        raise FormatError(f"lens_types has {len(lens_types)} pairs but the array has {lattice.kinds} kinds.")
    target.write_bytes(path, ("\n".join(_written(calibration, lens_types)) + "\n").encode())


def _written(calibration: Calibration, lens_types: Sequence[tuple[float, float]]) -> Iterator[str]:
    """Lines of the file; numbers in lens diameters are of a lattice that is turned back."""
    lattice, middle = calibration.lattice, (np.array(calibration.shape) - 1) / 2
    nearby = np.array(lattice.index(*middle)) + np.array([(0, dj) for dj in range(-1, 2)])
    first = next(pair for pair in nearby if lattice.kind(*pair) == 0)
    y, x = lattice.position(first) - middle
    diameter, angle = math.hypot(*lattice.basis[0]), -lattice.rotation
    sin, cos = math.sin(angle), math.cos(angle)
    down, across = np.array([[cos, sin], [-sin, cos]]) @ lattice.basis[1] / diameter
    yield '<RayCalibData version="1.0">'
    yield from _vector("offset", "pix", x, -y)
    yield f'  <diameter units="pix">{diameter!r}</diameter>'
    yield f'  <rotation units="rad">{angle!r}</rotation>'
    yield from _vector("lens_base_x", "lens", 1.0, 0.0)
    yield from _vector("lens_base_y", "lens", across, -down)
    if lattice.kinds == 3:
        yield from _vector("sub_grid_base", "lens", 2 * (1 + across), -2 * down)
    for kind, offset in enumerate((0.0, 1.0, -1.0)[: lattice.kinds]):
        yield f'  <lens_type id="{kind}">'
        yield from ("  " + line for line in _vector("offset", "lens", offset, 0.0))
        if lens_types:
            near, far = map(float, lens_types[kind])
            ends = f"<min>{near!r}</min><max>{far!r}</max>"
            yield f'    <depth_range units="virtual_depth">{ends}</depth_range>'
        yield "  </lens_type>"
    yield "</RayCalibData>"


def _vector(name: str, units: str, x: float, y: float) -> Iterator[str]:
    yield f'  <{name} units="{units}"><x>{float(x)!r}</x><y>{float(y)!r}</y></{name}>'


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
