"""Portable grey and colour maps (`.pgm`, `.ppm`, `.pnm`), binary or text, 1 to 16 bits; read, not written."""

import re
from pathlib import Path

import numpy as np

from lumigraph.core.raw import RawImage
from lumigraph.errors import FormatError
from lumigraph.io import source

_SPACE = rb"(?:\s|#[^\n]{0,1000}\n){1,1000}"
_HEADER = re.compile(rb"P([2356])" + 2 * (_SPACE + rb"(\d{1,9})") + _SPACE + rb"(\d{1,5})\s")
_LONGEST = 1 << 16  # bytes of a header with its comments


def load(path: Path, *, max_pixels: int = source.MAX_PIXELS) -> RawImage:
    """The picture in a PGM or PPM file (y, x) or (y, x, 3), every bit kept.

    Raises
    ------
    FormatError
        Another kind of file (a bitmap, P1 or P4, too), damaged, cut short or too large.
    """
    path = source.regular_file(path)
    with path.open("rb") as file:
        source.check_signature(path, file.read(2), "PNM")
    with source.decoding(path, "a PNM"):
        return _decoded(path, path.read_bytes(), max_pixels)


def _decoded(path: Path, content: bytes, max_pixels: int) -> RawImage:
    head = _HEADER.match(content[:_LONGEST])
    if head is None:
        raise FormatError(f"{path} is a PNM file whose header is damaged. Save it again.")
    kind, columns, rows, white = (int(text) for text in head.groups())
    shape = (rows, columns, 3) if kind in (3, 6) else (rows, columns)
    source.check_size(path, shape, max_pixels)
    if not 1 <= white < 1 << 16:
        raise FormatError(f"{path} gives white as {white} but it is 1 to 65535. Save it again.")
    wide, count = white > 255, int(np.prod(shape))
    # A number in a text takes at least a digit and a blank.
    size = count * (2 if kind in (2, 3) or wide else 1) - (kind in (2, 3))
    source.check_stored(path, size, len(content) - head.end(), 1)
    source.check_held(path, count * (64 if kind in (2, 3) else 2), len(content), max_pixels)
    if kind in (2, 3):
        values = np.array(content[head.end() :].split(None, count)[:count], np.int64)
    else:
        values = np.frombuffer(content, ">u2" if wide else np.uint8, count, head.end())
    if values.size != count or int(values.max()) > white or int(values.min()) < 0:
        raise FormatError(f"{path} is damaged: its values are not {count} numbers from 0 to {white}.")
    data = values.astype(np.uint16 if wide else np.uint8).reshape(shape)
    return RawImage(data, bit_depth=white.bit_length())
