"""Value at which the pixels of a raw image are full: `saturation_level`."""

from dataclasses import replace
from typing import Any

import numpy as np

from lumigraph.core.arrays import to_numpy
from lumigraph.core.raw import RawImage
from lumigraph.errors import FormatError

GIVEN = "bit_depth_given"
"""Name in the metadata of a raw image whose bits somebody gave: then nothing is found out."""

_FEWEST_BITS = 10  # of which one pixel at the largest number tells; of 8 and 9 two must
_HEAP, _TIMES, _BELOW, _NEAR = 20, 8, 16, 0.1
"""Equal values at the maximum that are no chance: so many, so many times as many as the most frequent of so
many values below, which lie within this share of the range."""
_LEAST_VALUES = 64  # different ones: pictures drawn in fewer have flat parts


def with_bits(raw: RawImage[Any], bits: int | None) -> RawImage[Any]:
    """Raw image whose bits somebody gives, so that nothing is found out; itself where they are None.

    Raises
    ------
    FormatError
        Bits that its numbers do not have.
    """
    if bits is None:
        return raw
    most = to_numpy(raw.data).dtype.itemsize * 8
    if not 1 <= bits <= most or to_numpy(raw.data).dtype.kind not in "ui":
        raise FormatError(
            f"the bit depth is {bits} but the raw image holds {raw.data.dtype}. Give 1 to {most} for whole "
            "numbers, and nothing for others."
        )
    return replace(raw, bit_depth=bits, metadata={**raw.metadata, GIVEN: True})


def saturation_level(raw: RawImage[Any]) -> float | None:
    """Smallest value at which a pixel of a raw image is full; None where none is.

    Cameras of 10, 12 or 14 bits store their pixels in 16, at the low end or at the high end. The bits of the
    raw image count where they are fewer than those of its numbers. Else what the values show does: the
    largest is that of fewer bits, or it occurs far more often than any below it.

    Parameters
    ----------
    raw
        As it was read.

    Examples
    --------
    >>> saturation_level(RawImage(np.array([[7, 4095]], np.uint16), bit_depth=16))
    4095.0
    """
    values, bits = to_numpy(raw.data), raw.bit_depth
    if values.dtype.kind not in "ui":
        return None if bits is None else 2.0**bits - 1
    container = values.dtype.itemsize * 8 - (values.dtype.kind == "i")
    top = int(values.max())
    if bits is not None and (bits < container or raw.metadata.get(GIVEN)):
        return _declared(values, bits, container, top)
    largest = bits is not None and top >= 2**bits - 1
    return _full(values, container, top, largest=largest)


def _declared(values: np.ndarray, bits: int, container: int, top: int) -> float:
    """Largest number of so many bits, which stand at the high end where the values need it."""
    spare = max(container - bits, 0)
    high = top >= 2**bits and _zeros(values) >= spare
    return float((2**bits - 1) << (spare if high else 0))


def _zeros(values: np.ndarray) -> int:
    """Bits at the low end that are 0 in all values."""
    used = int(np.bitwise_or.reduce(values, axis=None))
    return (used & -used).bit_length() - 1 if used else 0


def _full(values: np.ndarray, container: int, top: int, *, largest: bool) -> float | None:
    """Value of full pixels among whole numbers of which `top` is the largest; None where none are full."""
    levels, counts = _levels(values)
    if (heap := _heap(levels, counts)) is not None:
        return heap
    if largest:
        return float(top)
    spare, bits = _zeros(values), top.bit_length()
    if container > 8 and spare and top == 2**container - 2**spare:
        return float(top)
    whole = container > 8 and top == 2**bits - 1 and bits >= 8
    return float(top) if whole and (bits >= _FEWEST_BITS or counts[-1] > 1) else None


def _levels(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Different values in order, and how often each occurs."""
    if values.dtype.kind != "u" or values.dtype.itemsize > 2:
        return np.unique(values, return_counts=True)
    most = 1 << (8 * values.dtype.itemsize)
    counts = sum((np.bincount(row.ravel(), minlength=most) for row in _blocks(values)), np.zeros(most, int))
    levels = np.flatnonzero(counts)
    return levels, counts[levels]


def _blocks(values: np.ndarray) -> list[np.ndarray]:
    """Some rows each: counting makes eight bytes of every value."""
    return np.array_split(values, max(1, values.size >> 22))


def _heap(levels: np.ndarray, counts: np.ndarray) -> float | None:
    """Level that occurs far more often than any below it and is the largest, but for a few hot pixels."""
    above = counts[::-1].cumsum()[::-1] - counts
    found = np.flatnonzero((counts >= _HEAP) & (counts >= _TIMES * above))
    if len(levels) < _LEAST_VALUES or not len(found) or found[-1] < _BELOW:
        return None
    k = found[-1]
    level, below = int(levels[k]), int(levels[k - _BELOW])
    near = level - below <= _NEAR * (level - int(levels[0]))
    return float(level) if near and counts[k] >= _TIMES * counts[k - _BELOW : k].max() else None
