"""Convolution by a band-limited transfer function, without the transforms of zeros.

Of a padded window only the input's own rows are transformed along x, only the columns inside the band
along y, and only the rows that are asked for back along x; where every second sample is asked for and the
band fits, the way back is of half the length. On NumPy arrays the work goes through
blocks that stay in the processor's cache, one thread for each processor; other libraries do the same
steps on whole arrays, with nothing written in place, so that PyTorch differentiates through them.
"""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import scipy

from lumigraph.core import arrays
from lumigraph.core.arrays import Array

BLOCK_BYTES = 1 << 21
"""Size of one block of rows: it stays in the second-level cache of one processor."""


@dataclass(frozen=True, slots=True)
class Band:
    """Frequencies of one axis' DFT that pass: `positive` from zero upwards and `negative` below zero."""

    n: int
    positive: int
    negative: int

    @classmethod
    def below(cls, frequencies: np.ndarray, limit: float) -> "Band":
        """All of `frequencies` (n,), in FFT order, of modulus up to `limit`; zero always passes."""
        n = len(frequencies)
        inside = np.abs(frequencies) <= limit
        return cls(n, max(1, int(inside[: (n + 1) // 2].sum())), int(inside[(n + 1) // 2 :].sum()))

    @property
    def count(self) -> int:
        """Frequencies that pass."""
        return self.positive + self.negative

    @property
    def parts(self) -> tuple[slice, slice]:
        """Slices of the passing frequencies among all n."""
        return slice(self.positive), slice(self.n - self.negative, self.n)

    @property
    def packed(self) -> tuple[slice, slice]:
        """Slices of the positive and negative frequencies among those that pass."""
        return slice(self.positive), slice(self.positive, self.count)

    def take(self, values: np.ndarray) -> np.ndarray:
        """The passing entries of the last axis, in FFT order."""
        return np.concatenate([values[..., : self.positive], values[..., self.n - self.negative :]], -1)

    def fewer(self, step: int) -> int:
        """Factor by which a DFT that returns every `step`-th sample may be shorter: a divisor of `step`."""
        return max(k for k in range(1, step + 1) if step % k == 0 and self.count * k <= self.n)

    def thinned(self, step: int) -> "Band":
        """The same frequencies in that shorter DFT."""
        return Band(self.n // self.fewer(step), self.positive, self.negative)


@dataclass(frozen=True, slots=True)
class Transfer:
    """A transfer function on its band: `values` (columns, rows), so that a column is contiguous.

    Of the window every `step`-th sample (y, x) is wanted; `step` divides its shape.
    """

    values: Array
    rows: Band
    columns: Band
    step: tuple[int, int] = (1, 1)

    @property
    def thinned(self) -> tuple[Band, Band]:
        """Rows and columns of the inverse transforms."""
        return self.rows.thinned(self.step[0]), self.columns.thinned(self.step[1])

    def kept(self, shape: tuple[int, ...]) -> list[slice]:
        """Slices of those transforms that make up an output of the given shape."""
        bands = zip((self.rows, self.columns), self.step, shape, strict=True)
        steps = [(step // band.fewer(step), n) for band, step, n in bands]
        return [slice(0, n * step, step) for step, n in steps]


def convolve(data: Array, transfer: Transfer, shape: tuple[int, int]) -> Array:
    """First `shape` (ny, nx) samples of the circular convolution of `data` (..., y, x), or of every few."""
    if not arrays.is_numpy(data):
        return _functional(data, transfer, shape)
    return _planes(data, transfer, shape, data.dtype)


def convolved_intensity(data: Array, transfer: Transfer, shape: tuple[int, int]) -> Array:
    """Squared modulus of `convolve`, real; on NumPy arrays made block by block, without the field itself."""
    if not arrays.is_numpy(data):
        return arrays.intensity(_functional(data, transfer, shape))
    return _planes(data, transfer, shape, data.real.dtype)


def _planes(data: np.ndarray, transfer: Transfer, shape: tuple[int, int], dtype: Any) -> np.ndarray:
    planes = data.reshape(-1, *data.shape[-2:])
    result = np.empty((len(planes), *shape), dtype)
    for plane, out in zip(planes, result, strict=True):
        _blocked(plane, transfer, out)
    return result.reshape(data.shape[:-2] + shape)


def _functional(data: Array, transfer: Transfer, shape: tuple[int, int]) -> Array:
    xp, rows, columns = arrays.namespace(data), transfer.rows, transfer.columns
    fewer, kept = transfer.thinned, transfer.kept(shape)
    spectrum = _only(arrays.fft(data, columns.n), columns)
    spectrum = _only(arrays.fft(xp.matrix_transpose(spectrum), rows.n), rows)
    spectrum = arrays.ifft(_spread(spectrum * transfer.values, fewer[0]))[..., kept[0]]
    return arrays.ifft(_spread(xp.matrix_transpose(spectrum), fewer[1]))[..., kept[1]]


def _only(spectrum: Array, band: Band) -> Array:
    """The entries of the last axis inside the band."""
    if band.count == band.n:
        return spectrum
    parts = [spectrum[..., : band.positive], spectrum[..., band.n - band.negative :]]
    return arrays.namespace(spectrum).concat(parts, axis=-1)


def _spread(values: Array, band: Band) -> Array:
    """Zeros between the positive and the negative entries: the inverse of `_only`."""
    if band.count == band.n:
        return values
    xp = arrays.namespace(values)
    zeros = xp.broadcast_to(xp.zeros_like(values[..., :1]), (*values.shape[:-1], band.n - band.count))
    return xp.concat([values[..., : band.positive], zeros, values[..., band.positive :]], axis=-1)


def _blocked(data: np.ndarray, transfer: Transfer, out: np.ndarray) -> None:
    """The pruned convolution of one plane (y, x) into `out`: the field, or its intensity if `out` is real."""
    rows, columns, H = transfer.rows, transfer.columns, transfer.values
    (fewer_rows, fewer_columns), (kept_rows, kept_columns) = transfer.thinned, transfer.kept(out.shape)
    top, bottom = nonzero_rows(data)
    spectrum = np.empty((columns.count, max(bottom - top, out.shape[0])), data.dtype)

    def forward(start: int, stop: int) -> None:
        line: Any = scipy.fft.fft(data[top + start : top + stop], columns.n)
        for here, of in zip(columns.parts, columns.packed, strict=True):
            spectrum[of, start:stop] = line[:, here].T

    def across(start: int, stop: int) -> None:
        work = np.zeros((stop - start, rows.n), data.dtype)
        work[:, top:bottom] = spectrum[start:stop, : bottom - top]
        work: Any = scipy.fft.fft(work, overwrite_x=True)
        line = np.zeros((stop - start, fewer_rows.n), data.dtype)
        for here, there, of in zip(rows.parts, fewer_rows.parts, rows.packed, strict=True):
            np.multiply(work[:, here], H[start:stop, of], out=line[:, there])
        spectrum[start:stop, : out.shape[0]] = scipy.fft.ifft(line, overwrite_x=True)[:, kept_rows]

    def back(start: int, stop: int) -> None:
        line = np.zeros((stop - start, fewer_columns.n), data.dtype)
        for there, of in zip(fewer_columns.parts, columns.packed, strict=True):
            line[:, there] = spectrum[of, start:stop].T
        line = scipy.fft.ifft(line, overwrite_x=True)[:, kept_columns]
        out[start:stop] = line if np.iscomplexobj(out) else arrays.intensity(line)

    _in_blocks(forward, bottom - top, columns.n * data.itemsize)
    _in_blocks(across, columns.count, rows.n * data.itemsize)
    _in_blocks(back, out.shape[0], fewer_columns.n * data.itemsize)


def _in_blocks(job: Callable[[int, int], None], count: int, row_bytes: int) -> None:
    """Run `job(start, stop)` over blocks of rows, on all processors."""
    size = max(8, min(BLOCK_BYTES // row_bytes, -(-count // arrays.WORKERS)))
    starts = range(0, count, size)
    stops = [min(start + size, count) for start in starts]
    if arrays.WORKERS == 1 or len(starts) < 2:
        for start, stop in zip(starts, stops, strict=True):
            job(start, stop)
        return
    for _ in _pool().map(job, starts, stops):
        pass


@cache
def _pool() -> ThreadPoolExecutor:
    """Threads that stay: new ones for each transform cost a fifth of the time, most of it in fresh memory."""
    return ThreadPoolExecutor(arrays.WORKERS, thread_name_prefix="lumigraph-fft")


if hasattr(os, "register_at_fork"):  # a forked process has none of its parent's threads
    os.register_at_fork(after_in_child=_pool.cache_clear)


def nonzero_rows(data: np.ndarray) -> tuple[int, int]:
    """First row of (y, x) that is not all zero, and the one after the last; costs only the zero rows."""
    top, bottom = 0, data.shape[0]
    while top < bottom and not data[top].any():
        top += 1
    while bottom > top and not data[bottom - 1].any():
        bottom -= 1
    return top, bottom
