"""Arrays as bytes that the page reads: as they are, losslessly smaller, or as pictures.

A blob is four bytes (the header's length, little-endian), the header (JSON: shape, bits, scale, offset, how
it is coded), then the values. A value is ``offset + scale * number``.
"""

import json
import zlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lumigraph.core.arrays import Array, to_numpy
from lumigraph.errors import FormatError

_TOP = 65535
_LOSSLESS = 6  # zlib level


@dataclass(frozen=True, slots=True)
class Coding:
    """Mapping of values to whole numbers: ``(value - offset) / scale``, of the type `kind`."""

    kind: np.dtype
    scale: float = 1.0
    offset: float = 0.0

    @classmethod
    def of(cls, data: np.ndarray) -> "Coding":
        """8 or 16 bits stay as they are; other values fill 16 bits from the least to the largest."""
        if data.dtype == np.bool_:
            return cls(np.dtype(np.uint8))
        if data.dtype.kind in "iu" and data.size and data.min() >= 0 and data.max() <= _TOP:
            return cls(np.dtype(np.uint8 if data.dtype.itemsize <= 1 else "<u2"))
        if data.dtype.kind not in "iuf":
            raise FormatError(f"the viewer shows real numbers, not {data.dtype}. Give the intensity.")
        low, high = _range(data)
        low = 0.0 if 0 <= low < high / 2 else low
        return cls(np.dtype("<u2"), (high - low) / _TOP or 1.0, low)

    @property
    def is_exact(self) -> bool:
        """True if the numbers are the values."""
        return (self.scale, self.offset) == (1.0, 0.0)

    def numbers(self, piece: np.ndarray) -> np.ndarray:
        """Whole numbers of some values; those that are not finite become the least, +inf the largest."""
        if self.is_exact:
            return piece.astype(self.kind, copy=False)
        found = np.nan_to_num(
            (piece.astype(np.float64) - self.offset) / self.scale, posinf=_TOP, neginf=0
        )  # fmt: skip
        return np.rint(np.clip(found, 0, _TOP)).astype(self.kind)


@dataclass(frozen=True, slots=True, eq=False)
class Coded:
    """Whole numbers of 8 or 16 bits that stand for values: ``offset + scale * number``."""

    numbers: np.ndarray
    scale: float = 1.0
    offset: float = 0.0

    @classmethod
    def of(cls, array: Array) -> "Coded":
        """Numbers of 8 or 16 bits stay as they are; others fill 16 bits from the least to the largest.

        Values that are not finite become the least.
        """
        data = to_numpy(array)
        coding = Coding.of(data)
        if coding.is_exact:
            return cls(coding.numbers(data))
        numbers = np.empty(data.shape, coding.kind)
        for k in range(len(data)):  # piece by piece: a light field in float64 would double the memory
            numbers[k] = coding.numbers(data[k])
        return cls(numbers, coding.scale, coding.offset)

    @property
    def bits(self) -> int:
        """8 or 16."""
        return 8 * self.numbers.dtype.itemsize

    def values(self) -> np.ndarray:
        """The values again, float64."""
        return self.offset + self.scale * self.numbers.astype(np.float64)

    def as_bytes(self, part: slice = slice(None)) -> bytes:
        """A blob of the numbers as they are, of a part along the first axis."""
        numbers = np.ascontiguousarray(self.numbers[part])
        return self._blob(numbers.shape, {"coding": "plain"}, numbers.tobytes())

    def deflated(self) -> bytes:
        """A blob without loss: differences to the left neighbour, high and low bytes apart, zlib."""
        numbers = np.ascontiguousarray(self.numbers)
        axis = numbers.ndim - (2 if self._coloured else 1)
        steps = np.diff(numbers, axis=axis, prepend=np.zeros_like(np.take(numbers, [0], axis)))
        planes = steps.reshape(-1).view(np.uint8).reshape(-1, numbers.dtype.itemsize).T
        content = zlib.compress(np.ascontiguousarray(planes).tobytes(), _LOSSLESS)
        header = {"coding": "deflate", "width": int(np.prod(numbers.shape[axis:])), "step": self._step}
        return self._blob(numbers.shape, header, content)

    def pictures(self, quality: int) -> bytes:
        """A blob of 8-bit pictures (n, y, x[, 3]), each as WebP.

        Parameters
        ----------
        quality
            1 to 100, of WebP.
        """
        from lumigraph.io.webp import encode

        coded = [encode(picture, quality) for picture in self.numbers]
        header = {"coding": "webp", "sizes": [len(each) for each in coded]}
        return self._blob(self.numbers.shape, header, b"".join(coded))

    @property
    def _coloured(self) -> bool:
        return self.numbers.ndim > 2 and self.numbers.shape[-1] == 3

    @property
    def _step(self) -> int:
        return 3 if self._coloured else 1

    def _blob(self, shape: Sequence[int], how: dict[str, object], content: bytes) -> bytes:
        header = {
            "shape": list(shape), "bits": self.bits, "scale": float(self.scale),
            "offset": float(self.offset), **how,
        }  # fmt: skip
        text = json.dumps(header).encode()
        text += b" " * (-(len(text) + 4) % 8)  # numbers begin at a multiple of 8
        return len(text).to_bytes(4, "little") + text + content


def white_level(array: Array, bit_depth: int | None = None) -> float:
    """Value shown as white: the top of whole numbers of known bits, else what one in a thousand exceeds."""
    data = to_numpy(array)
    if bit_depth and data.dtype.kind in "iu":
        return float(2**bit_depth - 1)
    if data.dtype == np.uint8:
        return 255.0
    if data.dtype.kind in "iu":
        return float(data.max()) or 1.0
    every = max(1, data.size // 1_000_000)
    sample = data.reshape(-1)[::every]
    sample = sample[np.isfinite(sample)]
    level = (float(np.quantile(sample, 0.999)) or float(sample.max())) if len(sample) else 0.0
    return level if level > 0 else 1.0


def _range(data: np.ndarray) -> tuple[float, float]:
    """The least and the largest finite value, piece by piece."""
    finite = (piece[np.isfinite(piece)] for piece in data)
    ends = [(piece.min(), piece.max()) for piece in finite if piece.size]
    if not ends:
        return 0.0, 1.0
    return float(min(low for low, _ in ends)), float(max(high for _, high in ends))
