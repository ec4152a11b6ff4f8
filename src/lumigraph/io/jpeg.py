"""JPEG photos, grey or colour of 8 bits; read, not written, as it loses what raw images are about."""

from pathlib import Path

import numpy as np
from PIL.JpegImagePlugin import JpegImageFile

from lumigraph.core.raw import RawImage
from lumigraph.errors import FormatError
from lumigraph.io import source

MOST_PIXELS = 512
"""Pixels that a byte can hold: a block of 8 x 8 takes a bit at least (ITU-T T.81)."""


def load(path: Path, *, max_pixels: int = source.MAX_PIXELS) -> RawImage:
    """The picture in a JPEG file (y, x) or (y, x, 3) as the sensor lies: no recorded orientation is applied.

    Raises
    ------
    FormatError
        Not a JPEG, damaged, too large, or of four inks.
    """
    path = source.regular_file(path)
    with path.open("rb") as file:
        source.check_signature(path, file.read(8), "JPEG")
    with source.decoding(path, "a JPEG"), JpegImageFile(path) as image:
        if image.mode not in ("L", "RGB"):
            raise FormatError(f"{path} has the colours {image.mode}. Save it as RGB.")
        source.check_size(path, (image.size[1], image.size[0]), max_pixels)
        source.check_stored(path, image.size[0] * image.size[1], path.stat().st_size, MOST_PIXELS)
        return RawImage(np.array(image), bit_depth=8)
