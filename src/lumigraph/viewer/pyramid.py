"""Pictures in steps of 1, 2, 4, ... samples, in tiles, so that a page loads what it shows and no more."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from lumigraph.core import threads
from lumigraph.core.progress import Progress, silent
from lumigraph.viewer.encoding import Coding

COARSE = 12 << 20
"""Bytes that the coarsest pictures may take together: what a page loads before anything finer."""

TILE = 256
"""Samples across a tile."""

PACK = 1 << 20
"""Bytes of one file of tiles of consecutive pictures, before they are made smaller."""

_TAPS = (1, 4, 6, 4, 1)
_SUM = sum(_TAPS) ** 2

Write = Callable[[str, np.ndarray], None]


@dataclass(frozen=True, slots=True)
class Pyramid:
    """Pictures of one size in finer steps than the coarsest, which the page has as an ordinary array.

    A picture of step s has the samples 0, s, 2s, ... of the whole one, low-passed. Tiles lie in files
    "STEP/ROW-COLUMN/PACK", each with `pack` consecutive pictures.

    Parameters
    ----------
    shape
        Pictures, rows and columns.
    channels
        1 or 3.
    coding
        How values become numbers.
    coarsest
        Step of the pictures that the page has from the start.
    tile
        Samples across a tile.
    """

    shape: tuple[int, int, int]
    channels: int
    coding: Coding
    coarsest: int
    tile: int = TILE

    @classmethod
    def of(cls, data: np.ndarray, coarse: int = COARSE, tile: int = TILE) -> "Pyramid":
        """The pyramid of pictures (n, y, x[, c]) whose coarsest step takes `coarse` bytes at most."""
        coding = Coding.of(data)
        count, ny, nx = data.shape[:3]
        channels = data.shape[3] if data.ndim == 4 else 1
        step = 1
        while count * math.ceil(ny / step) * math.ceil(nx / step) * channels * coding.kind.itemsize > coarse:
            if step >= max(ny, nx):
                break
            step *= 2
        return cls((count, ny, nx), channels, coding, step, tile)

    @property
    def pack(self) -> int:
        """Pictures in one file."""
        size = self.tile**2 * self.channels * self.coding.kind.itemsize
        return max(1, min(self.shape[0], PACK // size))

    def about(self) -> dict[str, Any]:
        """Description for the page, as JSON can hold it."""
        return {
            "shape": list(self.shape), "coarsest": self.coarsest, "tile": self.tile, "pack": self.pack,
        }  # fmt: skip

    def write(
        self, data: np.ndarray, write: Write, valid: np.ndarray | None = None, progress: Progress = silent
    ) -> tuple[np.ndarray, np.ndarray | None]:
        """Write all tiles; returns the coarsest pictures' numbers, and which of them are valid.

        Parameters
        ----------
        data
            Pictures (n, y, x[, c]).
        write
            Called from several threads with the name of a file and its numbers (n, y, x[, c]).
        valid
            Which samples (n, y, x) count; the others are left out of the low-pass. Their tiles have names
            that begin with "valid-".
        progress
            Called with the fraction that is done.
        """
        starts = range(0, self.shape[0], self.pack)
        coarsest: list[tuple[np.ndarray, np.ndarray | None]] = []
        for found in threads.each(lambda k: self._pack(data, valid, k, write), starts):
            coarsest.append(found)
            progress(len(coarsest) / len(starts))
        masks = [mask for _, mask in coarsest if mask is not None]
        return np.concatenate([numbers for numbers, _ in coarsest]), np.concatenate(masks) if masks else None

    def _pack(
        self, data: np.ndarray, valid: np.ndarray | None, start: int, write: Write
    ) -> tuple[np.ndarray, np.ndarray | None]:
        part = slice(start, start + self.pack)
        numbers = self.coding.numbers(np.asarray(data[part]))
        mask = None if valid is None else np.asarray(valid[part]) > 0
        step = 1
        while step < self.coarsest:
            for place, rows, columns in self._tiles(numbers.shape):
                name = f"{step}/{place}/{start // self.pack}"
                write(name, numbers[:, rows, columns])
                if mask is not None:
                    write(f"valid-{name}", mask[:, rows, columns])
            numbers, mask = halved(numbers, mask)
            step *= 2
        return numbers, mask

    def _tiles(self, shape: tuple[int, ...]) -> Iterator[tuple[str, slice, slice]]:
        for j, i in np.ndindex(math.ceil(shape[1] / self.tile), math.ceil(shape[2] / self.tile)):
            rows, columns = (slice(k * self.tile, (k + 1) * self.tile) for k in (j, i))
            yield f"{j}-{i}", rows, columns


def halved(numbers: np.ndarray, valid: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray | None]:
    """Every other sample of pictures (n, y, x[, c]), low-passed by the binomial (1, 4, 6, 4, 1)² / 256.

    Sample 0 stays where it is. Samples that are not `valid` are left out; a new one is valid where the valid
    ones have half of the weight.
    """
    if valid is None:
        return ((summed(summed(numbers, 1), 2) + _SUM // 2) // _SUM).astype(numbers.dtype), None
    weight = summed(summed(valid.astype(np.uint8), 1), 2)
    mask = valid if numbers.ndim == 3 else valid[..., None]
    total = summed(summed(numbers * mask, 1), 2)
    over = np.maximum(weight if numbers.ndim == 3 else weight[..., None], 1)
    return ((total + over // 2) // over).astype(numbers.dtype), weight >= _SUM // 2


def summed(numbers: np.ndarray, axis: int) -> np.ndarray:
    """Every other sample along an axis, 16 times too large: weights 1, 4, 6, 4, 1, edges repeated."""
    width = [(2, 2) if k == axis else (0, 0) for k in range(numbers.ndim)]
    wide = np.pad(numbers, width, mode="edge")
    last = 2 * math.ceil(numbers.shape[axis] / 2) - 1
    kind = np.uint16 if numbers.dtype == np.uint8 else np.uint32
    total = np.zeros((), kind)
    for k, weight in enumerate(_TAPS):
        part = tuple(slice(k, k + last, 2) if a == axis else slice(None) for a in range(numbers.ndim))
        total = total + wide[part].astype(kind) * kind(weight)
    return total
