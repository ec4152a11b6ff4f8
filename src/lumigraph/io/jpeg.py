"""JPEG photos, grey or colour of 8 bits. Written with quality 95: for showing, as it loses detail."""

import io
from pathlib import Path

import numpy as np
from PIL import Image
from PIL.JpegImagePlugin import JpegImageFile

from lumigraph.core.raw import RawImage
from lumigraph.errors import FormatError
from lumigraph.io import source, target
from lumigraph.io.png import to_integers

QUALITY = 95
"""Quality of what is written, without subsampled colour."""

MOST_PIXELS = 512
"""Pixels that a byte can hold: a block of 8 x 8 takes a bit at least (ITU-T T.81)."""


_LARGEST = 65535  # ITU-T T.81
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


def save(raw: RawImage, path: Path, *, white: float | None = None) -> None:
    """Write a picture (y, x) or (y, x, 3) as 8 bits; floats are scaled, see `png.to_integers`.

    Raises
    ------
    FormatError
        Another shape, more than 65535 pixels along an axis, or whole numbers of more than 8 bits, which would
        lose the darkest.
    """
    data = to_integers(raw.data, white=white, bits=8)
    if data.dtype != np.uint8:
        raise FormatError(
            f"a JPEG holds 8 bits but the picture is {data.dtype}. Use PNG or TIFF, or give floats, which "
            "are scaled."
        )
    if max(data.shape[:2]) > _LARGEST:
        raise FormatError(
            f"a JPEG holds {_LARGEST} pixels along an axis, not {max(data.shape[:2])}. Use PNG."
        )
    buffer = io.BytesIO()
    Image.fromarray(data).save(buffer, "JPEG", quality=QUALITY, subsampling=0)
    target.write_bytes(path, buffer.getvalue())
