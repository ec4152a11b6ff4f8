"""The pixels of one TIFF page: by tifffile, by Pillow (LZW, JPEG), or unpacked here (odd bit depths)."""

import os
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from math import ceil
from pathlib import Path
from threading import Lock

import numpy as np
import tifffile
from PIL import TiffImagePlugin

from lumigraph.errors import FormatError
from lumigraph.io import bits, header, source

_NONE, _LZW, _JPEG, _DEFLATES, _PACKBITS = 1, 5, 7, (8, 32946), 32773
_PILLOW = {
    "1": "bool",
    "L": "uint8",
    "RGB": "uint8",
    "RGBA": "uint8",
    "I;16": "uint16",
    "F": "float32",
    "I": "int32",
}
_STANDARD_ERROR = Lock()
_SMALL = 64 << 20  # bytes of one strip that may be inflated without counting first


def pixels(path: Path, image: tifffile.TiffPage, *, transparent: bool) -> np.ndarray:
    """Pixels (y, x) or (y, x, c) of a page, native byte order, white is the largest number.

    Parameters
    ----------
    path
        Path for messages.
    image
        Image whose size has been checked.
    transparent
        True to keep extra samples such as transparency.

    Raises
    ------
    FormatError
        A compression that is not read, or damage.
    """
    depth = image.bitspersample
    if image.compression not in (_NONE, _LZW, _JPEG, *_DEFLATES, _PACKBITS):
        raise _unknown(image)
    if image.compression in _DEFLATES:
        _check_bombs(path, image)
    if depth not in (1, 8, 16, 32, 64):
        data = _packed(path, image)
    elif image.compression in (_LZW, _JPEG):
        data = _by_pillow(path, image)
    else:
        data = image.asarray(maxworkers=1)
        if image.planarconfig == 2 and data.ndim == 3 and image.samplesperpixel > 1:
            data = np.moveaxis(data, 0, -1)
    data = data.astype(np.uint8) * np.uint8(255) if data.dtype == bool and depth == 1 else data
    if image.photometric == tifffile.PHOTOMETRIC.MINISWHITE and data.dtype.kind == "u":
        data = (2 ** (8 if depth == 1 else depth) - 1) - data
    if image.photometric == tifffile.PHOTOMETRIC.PALETTE and image.colormap is not None and data.ndim == 2:
        data = np.moveaxis(image.colormap[:, data], 0, -1)
    if image.extrasamples and not transparent and header.loads(image.description) is None:
        data = data[..., : image.samplesperpixel - len(image.extrasamples)]
        data = data[..., 0] if data.shape[-1] == 1 else data
    return np.ascontiguousarray(data, dtype=data.dtype.newbyteorder("="))


def _unknown(image: tifffile.TiffPage) -> FormatError:
    name = getattr(image.compression, "name", image.compression)
    return FormatError(
        f"its compression {name} cannot be read here. Save it uncompressed, with Deflate or LZW."
    )


def _segments(path: Path, image: tifffile.TiffPage) -> list[bytes]:
    with path.open("rb") as file:
        found = []
        for offset, count in zip(image.dataoffsets, image.databytecounts, strict=True):
            file.seek(offset)
            found.append(file.read(count))
    return found


def _check_bombs(path: Path, image: tifffile.TiffPage) -> None:
    """Refuse strips and tiles that inflate to far more than they should hold."""
    rows, columns = (
        (image.tilelength, image.tilewidth) if image.is_tiled else (image.rowsperstrip, image.imagewidth)
    )
    samples = image.samplesperpixel if image.planarconfig == 1 else 1
    limit = min(rows, image.imagelength + rows if image.is_tiled else image.imagelength)
    limit = limit * columns * samples * max(1, image.bitspersample) // 8 + 1024
    limit = max(limit, _SMALL)
    if max(image.databytecounts, default=0) * source.MOST_INFLATED <= limit:
        return
    for segment in _segments(path, image):
        source.check_inflated(path, segment, limit)


def _packed(path: Path, image: tifffile.TiffPage) -> np.ndarray:
    """Pixels of 2 to 15 bits in strips, uncompressed or Deflate, which tifffile does not unpack alone."""
    depth, samples = image.bitspersample, image.samplesperpixel
    plain = image.compression in (_NONE, *_DEFLATES) and image.predictor == 1 and image.fillorder == 1
    if not plain or image.is_tiled or depth > 16 or (samples > 1 and image.planarconfig != 1):
        raise FormatError(
            f"its pixels of {depth} bits are tiled, compressed or in planes. Save it as 16 bits."
        )
    parts, top = [], 0
    for segment in _segments(path, image):
        rows = min(image.rowsperstrip, image.imagelength - top)
        top += rows
        if rows > 0:
            most = rows * ceil(image.imagewidth * samples * depth / 8)
            raw = segment if image.compression == _NONE else zlib.decompressobj().decompress(segment, most)
            parts.append(bits.unpack_rows(raw, rows, image.imagewidth * samples, depth))
    if top != image.imagelength:
        raise FormatError(f"its strips hold {top} rows of {image.imagelength}.")
    data = np.concatenate(parts)
    return data.reshape(image.imagelength, image.imagewidth, samples) if samples > 1 else data


@contextmanager
def _quiet() -> Iterator[None]:
    """Context in which libtiff's own lines on standard error go nowhere: its failures are raised."""
    with _STANDARD_ERROR:  # of the whole process: a second thread would keep, and put back, the first one's
        try:
            kept = os.dup(2)
        except OSError:  # closed
            yield
            return
        try:
            with open(os.devnull, "wb") as nowhere:  # noqa: PTH123 - a device, no file
                os.dup2(nowhere.fileno(), 2)
            yield
        finally:
            os.dup2(kept, 2)
            os.close(kept)


def _by_pillow(path: Path, image: tifffile.TiffPage) -> np.ndarray:
    with _quiet(), TiffImagePlugin.TiffImageFile(path) as file:
        file.seek(image.index)
        shape = (file.size[1], file.size[0])
        mode = "I;16" if file.mode in ("I;16B", "I;16L") else file.mode
        if mode not in _PILLOW or shape != (image.imagelength, image.imagewidth):
            raise _unknown(image)
        data = np.array(file)
    wanted = shape if image.samplesperpixel == 1 else (*shape, image.samplesperpixel)
    if data.shape != wanted or (image.dtype is not None and data.dtype.itemsize != image.dtype.itemsize):
        raise _unknown(image)
    return data
