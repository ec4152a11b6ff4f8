"""Metadata of a Lytro camera's raw frame (JSON): packing, colours, and the lenslets.

Both generations are read: F01, whose fields stand under image.rawDetails and image.color, and Illum.
"""

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lumigraph.core.calibration import Calibration
from lumigraph.core.lattice import Lattice
from lumigraph.errors import FormatError, LumigraphError
from lumigraph.io import header, source

_LONGEST = 8 << 20  # bytes
_BAYER = {"r": "RGGB", "gr": "GRBG", "gb": "GBRG", "b": "BGGR"}
_COLOURS = ("r", "gr", "gb", "b")
_NOTE = "the lattice is nominal, from the camera's metadata, not measured on a picture"
_FARTHEST = 10.0  # m: an exit pupil farther away than this is a placeholder for infinity


@dataclass(frozen=True, slots=True)
class Frame:
    """Storage and metadata of a raw frame.

    Parameters
    ----------
    shape
        Rows and columns.
    bits, endianness
        A key of `bits.PACKINGS`.
    bayer
        Colours of the first 2 x 2 pixels, or None.
    pixel_pitch
        Pixel pitch in metres, or None.
    known
        `RawImage.metadata`: black_level, white_level and white_balance as (r, gr, gb, b), colour_matrix
        (camera to linear sRGB), gamma, and all that was recorded under "lytro".
    """

    shape: tuple[int, int]
    bits: int
    endianness: str
    bayer: str | None
    pixel_pitch: float | None
    known: dict[str, Any]


def load(path: Path, *, max_pixels: int = source.MAX_PIXELS) -> Calibration:
    """The nominal calibration in a metadata file; see `calibration`."""
    path = source.regular_file(path)
    if path.stat().st_size > _LONGEST:
        raise FormatError(f"{path} has {path.stat().st_size} bytes, too many for metadata. Check the path.")
    with source.decoding(path, "Lytro metadata"):
        found = parse(path.read_bytes())
        source.check_size(path, frame(found).shape, max_pixels)
        return calibration(found)


def parse(content: bytes) -> dict[str, Any]:
    """The JSON object in some bytes.

    Raises
    ------
    FormatError
        Something else, or more than 8 MiB.
    """
    if len(content) > _LONGEST:
        raise FormatError(f"its metadata has {len(content)} bytes, at most {_LONGEST} are read.")
    try:
        found = json.loads(content.rstrip(b"\0").decode("utf-8"))
    except (ValueError, RecursionError) as error:
        raise FormatError(f"its metadata is not JSON: {str(error)[:80]}.") from error
    if not isinstance(found, dict):
        raise FormatError("its metadata is not a JSON object.")
    return found


def frame(found: dict[str, Any]) -> Frame:
    """Storage and metadata of the raw frame that a JSON object describes.

    Raises
    ------
    FormatError
        Metadata of something else, or fields that are missing.
    """
    shape = whole(found, "image.height"), whole(found, "image.width")
    packing = field(found, "image.rawDetails.pixelPacking") or field(found, "image.pixelPacking")
    if not isinstance(packing, dict):
        raise FormatError("its metadata does not say how the pixels are packed (pixelPacking).")
    order = packing.get("endianness", "little")
    mosaic = field(found, "image.rawDetails.mosaic") or field(found, "image.mosaic")
    first = mosaic.get("upperLeftPixel") if isinstance(mosaic, dict) else None
    pitch = _number(found, "devices.sensor.pixelPitch")
    return Frame(
        shape,
        whole(packing, "bitsPerPixel"),
        order if isinstance(order, str) else "",
        _BAYER.get(first) if isinstance(first, str) else None,
        pitch if pitch is not None and pitch > 0 else None,
        _known(found),
    )


def calibration(found: dict[str, Any]) -> Calibration:
    """The lattice as the camera was made: lens pitch, rotation and offset of the lenslets on the sensor.

    It is nominal, good to a pixel or so: refine it on a white image. Offsets and the rotation are taken from
    +x (right) towards +y (down), from the sensor's middle.

    Raises
    ------
    FormatError
        Metadata without lenslets, or of another tiling than hexUniformRowMajor.
    """
    stored = frame(found)
    if field(found, "devices.mla.tiling") != "hexUniformRowMajor":
        tiling = str(field(found, "devices.mla.tiling"))[:40]
        raise FormatError(f"its lenslets are tiled {tiling!r}, not hexUniformRowMajor.")
    pitch, rotation = _number(found, "devices.mla.lensPitch"), _number(found, "devices.mla.rotation") or 0.0
    if stored.pixel_pitch is None or pitch is None or pitch <= 0:
        raise FormatError("its metadata lacks devices.mla.lensPitch or devices.sensor.pixelPitch.")
    stretch = [_number(found, f"devices.mla.scaleFactor.{axis}") or 1.0 for axis in "yx"]
    offset = [_number(found, f"devices.mla.sensorOffset.{axis}") or 0.0 for axis in "yx"]
    distance = _number(found, "devices.mla.sensorOffset.z")
    pupil = _number(found, "devices.lens.exitPupilOffset.z")
    separation = pupil if pupil is not None and 0 < pupil < _FARTHEST else None
    distance = distance if distance is not None and distance > 0 else None
    grown = 1 + distance / separation if distance and separation else 1.0
    try:
        regular = Lattice.hex(pitch / stored.pixel_pitch * grown, rotation)
        basis = tuple((y * stretch[0], x * stretch[1]) for y, x in regular.basis)
        origin = tuple(
            (n - 1) / 2 + o / stored.pixel_pitch for n, o in zip(stored.shape, offset, strict=True)
        )
        lattice = Lattice((basis[0], basis[1]), (origin[0], origin[1]), "hex")
        indices = source.nominal_indices(Path("its metadata"), lattice, stored.shape)
        return Calibration(
            lattice, stored.shape, indices, lattice.position(indices), 0.0, stored.pixel_pitch, separation,
            distance, notes=(_NOTE,), by_maker=True,
        )  # fmt: skip
    except LumigraphError as error:
        raise FormatError(f"its lenslets make no lattice: {error}") from error


def field(found: Any, name: str) -> Any:
    """Value under a dotted name; None if there is none."""
    for part in name.split("."):
        found = found.get(part) if isinstance(found, dict) else None
    return found


def whole(found: Any, name: str, most: int = 1 << 20) -> int:
    """A whole number from 1 to `most` under a dotted name.

    Raises
    ------
    FormatError
        Something else.
    """
    value = field(found, name)
    if isinstance(value, bool) or not isinstance(value, int) or not 1 <= value <= most:
        raise FormatError(f"its metadata has {name} = {str(value)[:40]!r} where a count above 0 is needed.")
    return value


def _number(found: Any, name: str) -> float | None:
    value = field(found, name)
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    return float(value) if abs(value) < 1e30 and math.isfinite(value) else None


def _four(found: Any, *names: str) -> list[float] | None:
    """Four numbers (r, gr, gb, b) under the first of these names that has them."""
    for name in names:
        values = [_number(found, f"{name}.{colour}") for colour in _COLOURS]
        if None not in values:
            return [float(value) for value in values if value is not None]
    return None


def _known(found: dict[str, Any]) -> dict[str, Any]:
    raw, colour = "image.rawDetails.pixelFormat", "image.color"
    matrix = field(found, f"{colour}.ccmRgbToSrgbArray") or field(found, f"{colour}.ccm")
    rows = None
    if isinstance(matrix, list) and len(matrix) == 9 and all(isinstance(v, int | float) for v in matrix):
        rows = [[float(v) for v in matrix[k : k + 3]] for k in (0, 3, 6)]
    known = {
        "black_level": _four(found, f"{raw}.black", "image.pixelFormat.black"),
        "white_level": _four(found, f"{raw}.white", "image.pixelFormat.white"),
        "white_balance": _four(found, f"{colour}.whiteBalanceGain", "algorithms.awb.computed.gain"),
        "colour_matrix": rows,
        "gamma": _number(found, f"{colour}.gamma"),
        "camera": " ".join(str(field(found, f"camera.{key}") or "") for key in ("make", "model")).strip(),
    }
    known = {name: value for name, value in known.items() if value}
    try:
        return {**known, "lytro": header.plain(found, "metadata")}
    except (FormatError, RecursionError):  # numbers that are not finite: the fields above are enough
        return known
