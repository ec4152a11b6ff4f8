"""Arrays and matplotlib figures as images inside a page."""

import base64
import io
import struct
from dataclasses import dataclass
from typing import Any

import numpy as np

from lumigraph.core.arrays import to_numpy
from lumigraph.core.raw import RawImage
from lumigraph.errors import FormatError
from lumigraph.io import png

_PANELS = 1.7
"""A matplotlib figure this much wider than high holds panels side by side, unreadable in a column."""


@dataclass(frozen=True, slots=True)
class Picture:
    """One image of a page: a data URI with its size as shown [CSS pixels] and what is said about it."""

    uri: str
    width: int
    height: int
    caption: str
    alt: str
    pixelated: bool
    wide: bool


def picture(
    image: Any, caption: str, *, alt: str = "", zoom: int | None = None, white: float | None = None,
    wide: bool = False,
) -> Picture:  # fmt: skip
    """The image, embedded as a PNG.

    Parameters
    ----------
    image
        (y, x) or (y, x, 3), a `RawImage`, or a matplotlib figure.
    caption
        Shown below it.
    alt
        What it shows, in words; the caption if left out.
    zoom
        Shows each pixel as a square of this many; None lets the browser fit and smooth the image.
    white
        Value shown as white; the maximum of the image, or the full scale of its bit depth, if left out.
    wide
        Takes the whole width of the page, as a matplotlib figure of several panels side by side always does.
    """
    if zoom is not None and (not isinstance(zoom, int) or zoom < 1):
        raise FormatError(f"zoom is {zoom!r} but must be a whole number from 1.")
    content = _figure(image) if hasattr(image, "savefig") else _array(image, white)
    columns, rows = struct.unpack(">II", content[16:24])
    uri = "data:image/png;base64," + base64.b64encode(content).decode()
    scale = zoom or 1
    wide = wide or (hasattr(image, "savefig") and columns > _PANELS * rows)
    return Picture(uri, columns * scale, rows * scale, caption, alt or caption, zoom is not None, wide)


def _figure(figure: Any) -> bytes:
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=110)
    return buffer.getvalue()


def _array(image: Any, white: float | None) -> bytes:
    data = to_numpy(image.data if isinstance(image, RawImage) else image)
    if data.dtype.kind in "iu" and data.dtype != np.uint8:
        data = data.astype(np.float64)
        if white is None and isinstance(image, RawImage) and image.bit_depth:
            white = 2.0**image.bit_depth - 1
    return png.encode(data, white=white)
