"""Windows bitmaps, grey, palettes or colour of 8 bits; read, not written."""

import io
from pathlib import Path

import numpy as np
from PIL.BmpImagePlugin import BmpImageFile

from lumigraph.core.raw import RawImage
from lumigraph.errors import FormatError
from lumigraph.io import source

_MOST_PIXELS = 128
"""Pixels that a byte can hold: runs of up to 255 equal ones take two bytes."""


def load(path: Path, *, max_pixels: int = source.MAX_PIXELS) -> RawImage:
    """The picture in a BMP file (y, x) or (y, x, 3); transparency is left out.

    Raises
    ------
    FormatError
        Not a BMP, damaged, too large, or of other colours.
    """
    path = source.regular_file(path)
    content = path.read_bytes()
    source.check_signature(path, content[:8], "BMP")
    with source.decoding(path, "a BMP"), BmpImageFile(io.BytesIO(content)) as image:
        columns, rows = image.size
        source.check_size(path, (rows, columns), max_pixels)
        source.check_stored(path, rows * columns, len(content), _MOST_PIXELS)
        source.check_held(path, rows * columns * len(image.getbands()), len(content), max_pixels)
        if image.mode == "1":
            return RawImage(np.array(image).astype(np.uint8) * np.uint8(255), bit_depth=8)
        if image.mode in ("P", "RGBA"):
            return RawImage(np.array(image.convert("RGB")), bit_depth=8)
        if image.mode not in ("L", "RGB"):
            raise FormatError(f"{path} has the colours {image.mode}. Save it as RGB.")
        return RawImage(np.array(image), bit_depth=8)
