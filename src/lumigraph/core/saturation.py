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
    if bits is not None and top >= 2**bits - 1:
        return float(2**bits - 1)
    return float(top) if _is_full(values, container, top) else None


def _declared(values: np.ndarray, bits: int, container: int, top: int) -> float:
    """Largest number of so many bits, which stand at the high end where the values need it."""
    spare = max(container - bits, 0)
    high = top >= 2**bits and _zeros(values) >= spare
    return float((2**bits - 1) << (spare if high else 0))


def _zeros(values: np.ndarray) -> int:
    """Bits at the low end that are 0 in all values."""
    used = int(np.bitwise_or.reduce(values, axis=None))
    return (used & -used).bit_length() - 1 if used else 0


def _is_full(values: np.ndarray, container: int, top: int) -> bool:
    """Whether the largest value of whole numbers is one that full pixels have."""
    spare = _zeros(values)
    if container > 8 and spare and top == 2**container - 2**spare:
        return True
    levels, counts = np.unique(values, return_counts=True)
    bits = top.bit_length()
    if container > 8 and top == 2**bits - 1 and bits >= 8:
        return bits >= _FEWEST_BITS or counts[-1] > 1
    if len(levels) < _LEAST_VALUES or counts[-1] < _HEAP:
        return False
    near = top - int(levels[-1 - _BELOW]) <= _NEAR * (top - int(levels[0]))
    return bool(near and counts[-1] >= _TIMES * counts[-1 - _BELOW : -1].max())
