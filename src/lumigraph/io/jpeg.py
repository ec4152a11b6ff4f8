"""JPEG photos, grey or colour of 8 bits; read, not written, as it loses what raw images are about."""

import io
from pathlib import Path

import numpy as np
from PIL.JpegImagePlugin import JpegImageFile

from lumigraph.core.raw import RawImage
from lumigraph.errors import FormatError
from lumigraph.io import source

MOST_PIXELS = 512
"""Pixels that a byte can hold: a block of 8 x 8 takes a bit at least (ITU-T T.81)."""


_MOST_SCANS = 100
"""Progressive pictures have some ten; each scan runs over the whole picture."""


def check_scans(content: bytes) -> None:
    """Refuse a picture that is sent in so many scans that it would take minutes to decode.

    Raises
    ------
    FormatError
        How many there are.
    """
    scans = content.count(b"\xff\xda")  # in packed pixels a zero follows every 255
    if scans > _MOST_SCANS:
        raise FormatError(f"its picture has {scans} scans; up to {_MOST_SCANS} are read. Save it again.")


def load(path: Path, *, max_pixels: int = source.MAX_PIXELS) -> RawImage:
    """The picture in a JPEG file (y, x) or (y, x, 3) as the sensor lies: no recorded orientation is applied.

    Raises
    ------
    FormatError
        Not a JPEG, damaged, too large, or of four inks.
    """
    path = source.regular_file(path)
    content = path.read_bytes()
    source.check_signature(path, content[:8], "JPEG")
    with source.decoding(path, "a JPEG"), JpegImageFile(io.BytesIO(content)) as image:
        check_scans(content)
        if image.mode not in ("L", "RGB"):
            raise FormatError(f"{path} has the colours {image.mode}. Save it as RGB.")
        source.check_size(path, (image.size[1], image.size[0]), max_pixels)
        source.check_stored(path, image.size[0] * image.size[1], len(content), MOST_PIXELS)
        source.check_held(path, image.size[0] * image.size[1] * len(image.mode), len(content), max_pixels)
        return RawImage(np.array(image), bit_depth=8)
