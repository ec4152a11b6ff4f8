"""WebP: pictures for pages, in memory; never read from files."""

import io

import numpy as np
from PIL import Image

from lumigraph.errors import FormatError


def encode(picture: np.ndarray, quality: int = 90) -> bytes:
    """A picture (y, x) or (y, x, 3) of 8 bits as the bytes of a WebP file.

    Parameters
    ----------
    picture
        uint8.
    quality
        1 to 100; 100 is without loss.

    Raises
    ------
    FormatError
        Another shape, type of number or quality.
    """
    if (
        picture.dtype != np.uint8
        or picture.ndim not in (2, 3)
        or (picture.ndim == 3 and picture.shape[2] != 3)
    ):
        raise FormatError(
            f"a WebP holds uint8 (y, x) or (y, x, 3), not {picture.dtype} {picture.shape}. Scale it first."
        )
    if not 1 <= quality <= 100:
        raise FormatError(f"quality is {quality} but must be from 1 to 100.")
    buffer = io.BytesIO()
    image = Image.fromarray(np.ascontiguousarray(picture)).convert("RGB")
    image.save(buffer, "WEBP", quality=quality, lossless=quality == 100, method=2)
    return buffer.getvalue()
