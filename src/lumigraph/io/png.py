"""PNG: 1 to 16 bits, grey or colour, are read; 8 and 16 bits grey and 8 bits colour are written.

Fields of the raw image stand in a text chunk.
"""

import io
import struct
import zlib
from math import ceil
from pathlib import Path

import numpy as np
from PIL import Image
from PIL.PngImagePlugin import PngImageFile, PngInfo

from lumigraph.core import checks
from lumigraph.core.arrays import Array, to_numpy
from lumigraph.core.raw import RawImage
from lumigraph.errors import FormatError
from lumigraph.io import header, source, target

_KEY = "lumigraph"
_SAMPLES = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}  # of a colour type
_GREY_ALPHA = 4
_WIDE = {
    2: ("RGB", ("RGB;16B", "RGB;16L")),
    6: ("RGBA", ("RGBA;16B", "RGBA;16L")),
    _GREY_ALPHA: ("RGBA", ("RGBA", "RGBA")),
}  # colour type to Pillow's mode, and the raw modes that take the high and the low bytes of big-endian pixels
_DEPTHS = (1, 2, 4, 8, 16)


def load(path: Path, *, max_pixels: int = source.MAX_PIXELS) -> RawImage:
    """The picture in a PNG file (y, x) or (y, x, 3); transparency is left out, a palette becomes colour.

    Raises
    ------
    FormatError
        Not a PNG, damaged, or too large.
    """
    path = source.regular_file(path)
    shape, depth, colour = _read_header(path)
    source.check_size(path, shape, max_pixels)
    _check_chunks(path)
    needed = ceil(shape[0] * shape[1] * _SAMPLES.get(colour, 1) * depth / 8)
    source.check_stored(path, needed, path.stat().st_size)
    source.check_held(path, needed, path.stat().st_size, max_pixels)
    if depth == 16 and colour in _WIDE:
        return _wide(path, colour)
    # The class is called itself, not Image.open, which has a size limit of its own for the whole process.
    with source.decoding(path, "a PNG"), PngImageFile(path) as image:
        mode = {"I;16": "I;16", "I": "I;16", "L": "L", "1": "L", "LA": "L"}.get(image.mode, "RGB")
        text = image.text.get(_KEY)  # before load(): chunks ahead of the pixels
        data = np.array(image if image.mode == mode else image.convert(mode))
    return header.restore(data, header.loads(text), bit_depth=data.dtype.itemsize * 8)


def _wide(path: Path, colour: int) -> RawImage:
    """Colour, or grey with transparency, of 16 bits: Pillow decodes 8 of them at a time, high, then low."""
    mode, (first, second) = _WIDE[colour]
    with source.decoding(path, "a PNG"):
        decoded, text = _decoded(path, mode, first)
        if colour == _GREY_ALPHA:  # four bytes: high and low of grey, high and low of transparency
            data = decoded[..., 0].astype(np.uint16) << 8
            data |= decoded[..., 1]
        else:
            data = decoded[..., :3].astype(np.uint16)
            del decoded  # before the second half is there
            data <<= 8
            data |= _decoded(path, mode, second)[0][..., :3]
    return header.restore(data, header.loads(text), bit_depth=16)


def _decoded(path: Path, mode: str, raw_mode: str) -> tuple[np.ndarray, str | None]:
    """Bytes (y, x, 3 or 4) of a mode, and our text."""
    with PngImageFile(path) as image:
        image._mode = mode
        image.tile = [tile._replace(args=raw_mode) for tile in image.tile]
        data = np.asarray(image)
        return data, image.text.get(_KEY)  # which decodes, and must come after the tiles are set


def save(raw: RawImage, path: Path, *, white: float | None = None) -> None:
    """Write a raw image; floats are scaled, see `to_integers`."""
    data = to_integers(raw.data, white=white, bits=16 if raw.data.ndim == 2 else 8)
    depth = raw.bit_depth if raw.data.dtype.kind in "iu" else data.dtype.itemsize * 8
    fields = RawImage(data, raw.pixel_pitch, depth, raw.bayer, raw.metadata)
    target.write_bytes(path, _encoded(data, fields))


def encode(image: Array, *, white: float | None = None, bits: int = 8) -> bytes:
    """A picture (y, x) or (y, x, 3) as the bytes of a PNG file; floats are scaled, see `to_integers`."""
    return _encoded(to_integers(image, white=white, bits=bits), None)


def to_integers(image: Array, *, white: float | None = None, bits: int = 16) -> np.ndarray:
    """Pixels as uint8 or uint16: these stay as they are, floats 0 ... `white` fill the range of `bits`.

    Parameters
    ----------
    image
        (y, x) or (y, x, 3).
    white
        Becomes the largest whole number; the image's maximum if left out. Values outside 0 ... `white`
        are clipped.
    bits
        8 or 16; for floats and truth values.

    Raises
    ------
    FormatError
        Another shape or type of number, or values that are not finite.
    """
    data = to_numpy(image)
    if data.ndim not in (2, 3) or (data.ndim == 3 and data.shape[2] != 3) or data.size == 0:
        raise FormatError(
            f"a PNG holds (y, x) or (y, x, 3) but the picture has shape {data.shape}. Use TIFF."
        )
    data = data.astype(data.dtype.newbyteorder("="), copy=False)
    if data.dtype == np.uint8 or (data.dtype == np.uint16 and data.ndim == 2):
        return data
    if data.dtype.kind not in "fb":
        raise FormatError(
            f"a PNG holds uint8, or uint16 if grey, but the picture is {data.dtype}. "
            "Use TIFF, or give it as floats, which are scaled."
        )
    checks.finite_array("the picture", data, FormatError)
    white = float(data.max()) or 1.0 if white is None else checks.positive("white", white, "1", FormatError)
    top = 2**bits - 1
    scaled = np.clip(np.asarray(data, np.float64) / white if white > 0 else data * 0.0, 0, 1) * top
    return np.rint(scaled).astype(np.uint8 if bits == 8 else np.uint16)


def _encoded(data: np.ndarray, fields: RawImage | None) -> bytes:
    info, resolution = PngInfo(), {}
    if fields is not None:
        info.add_text(_KEY, header.dumps(fields))
        if fields.pixel_pitch and fields.pixel_pitch > 1e-9:
            resolution = {"dpi": (0.0254 / fields.pixel_pitch,) * 2}
    buffer = io.BytesIO()
    Image.fromarray(np.ascontiguousarray(data)).save(buffer, "PNG", pnginfo=info, **resolution)
    return buffer.getvalue()


def _check_chunks(path: Path) -> None:
    """Refuse chunks that end behind the file, which Pillow would allocate, or differ from their checksums."""
    size, at, kind = path.stat().st_size, 8, b""
    with path.open("rb") as file:
        file.seek(at)
        while kind != b"IEND":
            start = file.read(8)
            length, kind = int.from_bytes(start[:4], "big"), start[4:]
            at += 12 + length
            if at > size or len(start) < 8:
                raise FormatError(f"{path} is cut short: a chunk ends at byte {at} of {size}. Copy it again.")
            if _checksum(file, kind, length) != int.from_bytes(file.read(4), "big"):
                name = kind.decode("latin-1")
                raise FormatError(
                    f"{path} is damaged: its chunk {name!r} differs from its checksum. Copy it again."
                )


def _checksum(file: io.BufferedReader, kind: bytes, length: int) -> int:
    total = zlib.crc32(kind)
    while length > 0:
        piece = file.read(min(length, 1 << 20))
        length -= len(piece)
        total = zlib.crc32(piece, total)
    return total


def _read_header(path: Path) -> tuple[tuple[int, int], int, int]:
    """Size (rows, columns), bits and colour type from the first 26 bytes."""
    with path.open("rb") as file:
        start = file.read(26)
    source.check_signature(path, start, "PNG")
    if len(start) < 26 or start[12:16] != b"IHDR":
        raise FormatError(f"{path} is a damaged PNG: its header is missing. Copy or save it again.")
    columns, rows, depth, colour = struct.unpack(">IIBB", start[16:26])
    if depth not in _DEPTHS:
        raise FormatError(f"{path} is a damaged PNG: it declares {depth} bits. Copy or save it again.")
    return (rows, columns), depth, colour


def in_few_colours(content: bytes, colours: int) -> bytes:
    """The same picture as a PNG of so many colours (2 to 256), chosen for it: smaller, alike to the eye."""
    with Image.open(io.BytesIO(content)) as image:
        whole = image.convert("RGB")
    few = whole.quantize(colours, method=Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE)
    buffer = io.BytesIO()
    few.save(buffer, "PNG", optimize=True)
    return buffer.getvalue()
