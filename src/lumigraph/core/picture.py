"""Pictures and tables for notebooks: a PNG of a few lines, and a small card of HTML."""

import base64
import html
import struct
import zlib
from collections.abc import Iterable
from typing import Any

import numpy as np

from lumigraph.core.arrays import to_numpy

THUMBNAIL = 240
"""Pixels along the longer side of a thumbnail."""

_STYLE = "border-collapse:collapse;font-variant-numeric:tabular-nums;margin:0"
_NAME = "text-align:left;font-weight:normal;opacity:.75;padding-right:1em"
_UNITS = ((1.0, "m"), (1e-3, "mm"), (1e-6, "µm"), (1e-9, "nm"))


def png(grey_or_colour: np.ndarray) -> bytes:
    r"""A PNG file of (y, x) or (y, x, 3) numbers of 8 bits.

    Examples
    --------
    >>> png(np.zeros((2, 3), np.uint8))[:8] == b"\x89PNG\r\n\x1a\n"
    True
    """
    data = np.ascontiguousarray(grey_or_colour, np.uint8)
    height, width = data.shape[:2]
    lines = np.concatenate([np.zeros((height, 1), np.uint8), data.reshape(height, -1)], axis=1)
    header = struct.pack(">IIBBBBB", width, height, 8, 2 if data.ndim == 3 else 0, 0, 0, 0)
    chunks = ((b"IHDR", header), (b"IDAT", zlib.compress(lines.tobytes(), 6)), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))
        for name, body in chunks
    )


def thumbnail(image: Any, size: int = THUMBNAIL) -> str:
    """A data URI of a picture (y, x[, c]) of any array library: its means over blocks, black to white.

    Black is 0 or the least value, white what one in a thousand exceeds; NaN is black.
    """
    data = to_numpy(image)
    data = (
        data[..., :3] if data.ndim == 3 and data.shape[2] >= 3 else data.reshape(*data.shape[:2], -1)[..., 0]
    )
    step = max(1, -(-max(data.shape[:2]) // size))
    rows, columns = (max(1, n // step) for n in data.shape[:2])
    if min(data.shape[:2]) < step:
        block = data[::step, ::step].astype(np.float64)
    else:
        cut = data[: rows * step, : columns * step].astype(np.float64)
        block = cut.reshape(rows, step, columns, step, *data.shape[2:]).mean(axis=(1, 3))
    larger = max(1, size // 2 // max(block.shape[:2]))  # few pixels are shown as squares
    block = block.repeat(larger, axis=0).repeat(larger, axis=1)
    finite = block[np.isfinite(block)]
    low = min(0.0, float(finite.min())) if finite.size else 0.0
    high = float(np.quantile(finite, 0.999)) if finite.size else 1.0
    scaled = np.clip((np.nan_to_num(block, nan=low) - low) / ((high - low) or 1.0), 0, 1)
    return "data:image/png;base64," + base64.b64encode(png(np.rint(255 * scaled).astype(np.uint8))).decode()


def length(value: float | None) -> str:
    """A length [m] in a unit that suits it; "unknown" for None, 0 for less than a picometre.

    Examples
    --------
    >>> length(1.5e-4), length(-0.2), length(1.7e-21)
    ('150 µm', '-200 mm', '0 m')
    """
    if value is None:
        return "unknown"
    value = 0.0 if abs(value) < 1e-12 else value
    size, unit = next((u for u in _UNITS if abs(value) >= u[0] * 0.99999), _UNITS[-1] if value else _UNITS[0])
    return f"{value / size:.4g} {unit}"


def numbers(data: Any) -> str:
    """Data type and range of an array, such as "uint16, 0 to 4095"."""
    values = to_numpy(data)
    finite = values if values.dtype.kind in "iub" else values[np.isfinite(values)]
    if not finite.size:
        return f"{values.dtype}, none finite"
    return f"{values.dtype}, {finite.min():.5g} to {finite.max():.5g}"


def dots(places: np.ndarray, shape: tuple[int, int]) -> str:
    """A data URI of a picture with a dot at each place (k, 2) as (y, x) [px] of a raw image."""
    step = max(1.0, max(shape) / THUMBNAIL)
    size = [max(1, round(n / step)) for n in shape]
    grey = np.full(size, 24, np.uint8)
    y, x = np.rint(np.asarray(places, np.float64).reshape(-1, 2).T / step).astype(np.int64)
    inside = (y >= 0) & (x >= 0) & (y < size[0]) & (x < size[1])
    grey[y[inside], x[inside]] = 255
    return "data:image/png;base64," + base64.b64encode(png(grey)).decode()


def operator_card(
    title: str, shape: tuple[tuple[int, ...], tuple[int, ...]], memory: int | None = None
) -> str:
    """The card of a forward model: the sizes of the raw image and of the object."""
    rows = [("raw image", f"{sized(shape[0])} px"), ("object", f"{sized(shape[1])} samples")]
    rows += [("memory", f"{memory / 1e6:.3g} MB")] if memory is not None else []
    return card(title, rows)


def sized(shape: Iterable[int]) -> str:
    """Numbers along axes, such as "480 × 640"."""
    return " × ".join(str(int(n)) for n in shape)


def card(title: str, rows: Iterable[tuple[str, str]], picture: str = "", alt: str = "") -> str:
    """A table beside a picture, for a notebook: legible on light and dark, without style sheets or scripts.

    Parameters
    ----------
    title
        Heading.
    rows
        Names, and values with their units; all are escaped.
    picture
        Data URI, or empty.
    alt
        Description of the picture.
    """
    cells = "".join(
        f'<tr><th scope="row" style="{_NAME}">{html.escape(name)}</th>'
        f'<td style="text-align:left">{html.escape(value)}</td></tr>'
        for name, value in rows
    )
    image = ""
    if picture:
        image = (
            f'<img src="{html.escape(picture)}" alt="{html.escape(alt or title)}" '
            f'style="max-width:{THUMBNAIL}px;height:auto;image-rendering:auto;border-radius:4px">'
        )
    return (
        '<div style="display:flex;flex-wrap:wrap;gap:1em;align-items:flex-start">'
        f'{image}<table style="{_STYLE}"><caption style="caption-side:top;text-align:left;font-weight:bold">'
        f"{html.escape(title)}</caption><tbody>{cells}</tbody></table></div>"
    )
