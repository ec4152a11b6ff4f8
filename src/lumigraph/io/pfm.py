"""PFM: a picture or a map of 32-bit floats, such as a disparity; rows are stored from the bottom up.

Format: "PF" (colour) or "Pf" (grey), width and height, a scale whose sign is the byte order (negative:
little-endian), each ended by white space; then the rows. P. Debevec, *PFM Portable FloatMap Image Format*.
"""

import io
import math
import re
from pathlib import Path
from typing import Any

import numpy as np

from lumigraph.core.raw import RawImage
from lumigraph.errors import FormatError
from lumigraph.io import source, target

_HEADER = re.compile(rb"(P[Ff])\s+(\d{1,9})\s+(\d{1,9})\s+([-+0-9.eE]{1,30})[ \t]*\r?[\n\r ]")
_LONGEST = 256  # bytes of a header


def load(path: Path, *, max_pixels: int = source.MAX_PIXELS) -> RawImage:
    """The map in a PFM file, (y, x) or (y, x, 3) float32, first row on top.

    Values that are not finite are kept: they mark what is unknown. A scale other than 1 is in
    ``metadata["scale"]``; values are not multiplied by it.

    Raises
    ------
    FormatError
        Not a PFM, cut short, or too large.
    """
    path = source.regular_file(path)
    with path.open("rb") as file:
        start = file.read(_LONGEST)
        header = _HEADER.match(start)
        if not start.startswith((b"PF", b"Pf")):
            source.check_signature(path, start[:8], "PFM")
        if header is None:
            raise FormatError(
                f"{path} is a damaged PFM: its header is {start[:24]!r}. Copy or save it again."
            )
        shape, scale = _declared(path, header)
        source.check_size(path, shape, max_pixels)
        wanted, stored = 4 * math.prod(shape), path.stat().st_size - header.end()
        if stored < wanted:
            raise FormatError(
                f"{path} is cut short: its pixels need {wanted} bytes but it has {stored}. Copy it again."
            )
        file.seek(header.end())
        values = np.frombuffer(file.read(wanted), "<f4" if scale < 0 else ">f4").reshape(shape)
    known = {} if abs(scale) == 1 else {"scale": abs(scale)}
    return RawImage(values[::-1].astype(np.float32), metadata=known)


def save(raw: RawImage, path: Path) -> None:
    """Write a picture or a map (y, x) or (y, x, 3) as float32, little-endian.

    Raises
    ------
    FormatError
        Another shape, or complex numbers.
    """
    data = raw.data
    if data.dtype.kind not in "iufb" or data.shape[2:] not in ((), (1,), (3,)):
        raise FormatError(
            f"a PFM holds real numbers (y, x) or (y, x, 3), not {data.dtype} of shape {data.shape}. Use TIFF."
        )
    rows, columns = data.shape[:2]
    buffer = io.BytesIO()
    buffer.write(b"%s\n%d %d\n-1.0\n" % (b"PF" if data.shape[2:] == (3,) else b"Pf", columns, rows))
    buffer.write(np.ascontiguousarray(data[::-1], "<f4").tobytes())
    target.write_bytes(path, buffer.getvalue())


def _declared(path: Path, header: re.Match[bytes]) -> tuple[tuple[int, ...], float]:
    try:
        scale = float(header[4])
    except ValueError:
        scale = 0.0
    if not math.isfinite(scale) or scale == 0:
        raise FormatError(
            f"{path} is a damaged PFM: its scale is {header[4].decode()!r}. Copy or save it again."
        )
    channels: tuple[Any, ...] = (3,) if header[1] == b"PF" else ()
    return (int(header[3]), int(header[2]), *channels), scale
