"""Pixels packed without gaps: 12 bits in three half bytes, 10 bits in five bytes, any depth of a TIFF."""

import math

import numpy as np

from lumigraph.errors import FormatError

PACKINGS = {
    (8, "big"): (1, 1),
    (8, "little"): (1, 1),
    (10, "little"): (4, 5),
    (12, "big"): (2, 3),
    (16, "big"): (1, 2),
    (16, "little"): (1, 2),
}
"""(bits, byte order) to (pixels, bytes) of a group.

- 12 bits, big: two pixels in three bytes, the high bits first (Lytro F01).
- 10 bits, little: four bytes with the high 8 bits of four pixels, then one byte with their low bits, those
  of the first pixel lowest (Lytro Illum; MIPI CSI-2 calls it RAW10).
"""


def packed_size(count: int, bits: int, endianness: str) -> int:
    """Bytes that `count` packed pixels take, whole groups.

    Raises
    ------
    FormatError
        A packing that is not in `PACKINGS`.
    """
    if (bits, endianness) not in PACKINGS:
        known = ", ".join(f"{b} bits {order}-endian" for b, order in PACKINGS)
        raise FormatError(f"pixels of {bits} bits, {endianness}-endian, cannot be unpacked. Known: {known}.")
    pixels, size = PACKINGS[bits, endianness]
    return math.ceil(count / pixels) * size


def unpack(packed: bytes | np.ndarray, count: int, bits: int, endianness: str) -> np.ndarray:
    """The first `count` pixels, uint16 (uint8 for 8 bits).

    Parameters
    ----------
    packed
        At least `packed_size` bytes.
    count
        Pixels.
    bits, endianness
        A key of `PACKINGS`.

    Raises
    ------
    FormatError
        Too few bytes, or an unknown packing.

    Examples
    --------
    >>> unpack(bytes([0xAB, 0xCD, 0xEF]), 2, 12, "big").tolist() == [0xABC, 0xDEF]
    True
    >>> unpack(bytes([1, 2, 3, 255, 0b11_10_01_00]), 4, 10, "little").tolist()
    [4, 9, 14, 1023]
    """
    size = packed_size(count, bits, endianness)
    data = np.frombuffer(packed, np.uint8)
    if data.size < size:
        raise FormatError(f"{count} pixels of {bits} bits need {size} bytes but there are {data.size}.")
    data = data[:size]
    if bits == 8:
        return data.copy()
    if bits == 16:
        return data.view(">u2" if endianness == "big" else "<u2").astype(np.uint16)
    pixels, step = PACKINGS[bits, endianness]
    groups = data.reshape(-1, step).astype(np.uint16)
    result = np.empty((len(groups), pixels), np.uint16)
    if bits == 12:
        result[:, 0] = (groups[:, 0] << 4) | (groups[:, 1] >> 4)
        result[:, 1] = ((groups[:, 1] & 15) << 8) | groups[:, 2]
    else:
        for k in range(4):
            result[:, k] = (groups[:, k] << 2) | ((groups[:, 4] >> (2 * k)) & 3)
    return result.ravel()[:count]


def pack(pixels: np.ndarray, bits: int, endianness: str) -> bytes:
    """The inverse of `unpack`.

    Raises
    ------
    FormatError
        Values that do not fit, or an unknown packing.
    """
    flat = np.asarray(pixels).ravel()
    packed_size(flat.size, bits, endianness)
    if flat.dtype.kind not in "iu" or (flat.size and not 0 <= int(flat.min()) <= int(flat.max()) < 2**bits):
        raise FormatError(
            f"pixels of {bits} bits are whole numbers 0 ... {2**bits - 1}, not these {flat.dtype}."
        )
    if bits == 8:
        return flat.astype(np.uint8).tobytes()
    if bits == 16:
        return flat.astype(">u2" if endianness == "big" else "<u2").tobytes()
    pixels_, step = PACKINGS[bits, endianness]
    groups = np.zeros((math.ceil(flat.size / pixels_), pixels_), np.uint16)
    groups.ravel()[: flat.size] = flat
    result = np.zeros((len(groups), step), np.uint16)
    if bits == 12:
        result[:, 0], result[:, 2] = groups[:, 0] >> 4, groups[:, 1] & 255
        result[:, 1] = ((groups[:, 0] & 15) << 4) | (groups[:, 1] >> 8)
    else:
        for k in range(4):
            result[:, k] = groups[:, k] >> 2
            result[:, 4] |= (groups[:, k] & 3) << (2 * k)
    return result.astype(np.uint8).tobytes()


def unpack_rows(packed: bytes, rows: int, samples: int, bits: int) -> np.ndarray:
    """Rows (rows, samples) of samples of 1 to 16 bits, high bits first, each row from a new byte (TIFF).

    Raises
    ------
    FormatError
        Too few bytes.
    """
    width = math.ceil(samples * bits / 8)
    data = np.frombuffer(packed, np.uint8)
    if data.size < rows * width:
        raise FormatError(f"{rows} rows of {width} bytes are needed but there are {data.size} bytes.")
    data = data[: rows * width].reshape(rows, width)
    result = np.empty((rows, samples), np.uint8 if bits <= 8 else np.uint16)
    weights = (1 << np.arange(bits - 1, -1, -1)).astype(np.uint32)
    for row in range(rows):  # row by row: the bits of a whole picture would need 8 times its memory
        chosen = np.unpackbits(data[row])[: samples * bits].reshape(samples, bits)
        result[row] = chosen @ weights
    return result
