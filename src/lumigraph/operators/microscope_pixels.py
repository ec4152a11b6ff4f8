"""Where the pixels of a real camera stand among the evenly spaced samples of the lenslets' cells."""

import math
from dataclasses import dataclass, field

import numpy as np
from scipy.sparse import csr_array

from lumigraph.core import arrays
from lumigraph.core.arrays import Array
from lumigraph.core.calibration import Calibration

SLIVER = 1.2
"""Lenslets of which fewer pixels than this are seen along an axis are left out [px]."""


@dataclass(frozen=True, slots=True, eq=False)
class PixelPlacement:
    """A sparse matrix from samples of the cells (rows, columns) to pixels (ny, nx), bilinear.

    Parameters
    ----------
    shape
        Pixels (ny, nx).
    samples
        Samples (rows, columns).
    matrix
        (ny nx, rows columns), float32.
    """

    shape: tuple[int, int]
    samples: tuple[int, int]
    matrix: csr_array
    _tables: dict = field(default_factory=dict, repr=False)

    @classmethod
    def of(
        cls, calibration: Calibration, pixels: int
    ) -> "tuple[PixelPlacement, tuple[int, int], np.ndarray]":
        """From the micro-images of a raw image, with N samples along each side of a cell.

        Returns
        -------
        tuple
            The placement, the cells (rows, columns), and the pixel (y, x) at the middle of them.
        """
        ny, nx = calibration.shape
        y, x = calibration.straightened(np.arange(ny)[:, None] + 0.0, np.arange(nx)[None, :] + 0.0)
        origin = calibration.lattice.origin
        place = np.stack(np.broadcast_arrays(y - origin[0], x - origin[1]), -1)
        place = place @ np.linalg.inv(calibration.lattice.matrix).T
        # A lenslet of which the outermost pixels alone are seen tells nothing.
        least = SLIVER / calibration.lattice.pitch
        first = np.floor(place.reshape(-1, 2).min(0) + 0.5 + least).astype(int)
        last = np.floor(place.reshape(-1, 2).max(0) + 0.5 - least).astype(int)
        cells = (int(last[0] - first[0]) + 1, int(last[1] - first[1]) + 1)
        samples = (cells[0] * pixels, cells[1] * pixels)
        at = ((place - first + 0.5) * pixels - 0.5).reshape(-1, 2)
        middle = calibration.position((first + last) / 2)
        return cls((ny, nx), samples, _interpolation(at, samples)), cells, middle

    @classmethod
    def every(cls, shape: tuple[int, int]) -> "PixelPlacement":
        """Of pixels (ny, nx) that are the samples themselves."""
        count = math.prod(shape)
        ones, start = np.ones(count, np.float32), np.arange(count + 1)
        return cls(shape, shape, csr_array((ones, start[:-1], start), shape=(count, count)))

    def widened(self, margin: int) -> "PixelPlacement":
        """The same pixels among samples that reach `margin` farther to each side."""
        rows, columns = (n + 2 * margin for n in self.samples)
        y, x = np.divmod(np.asarray(self.matrix.indices, np.int64), self.samples[1])
        indices = (y + margin) * columns + x + margin
        shape = (math.prod(self.shape), rows * columns)
        matrix = csr_array((self.matrix.data, indices, self.matrix.indptr), shape=shape)
        return PixelPlacement(self.shape, (rows, columns), matrix)

    def forward(self, plane: Array) -> Array:
        """Pixels (ny, nx) from samples (rows, columns)."""
        return arrays.namespace(plane).reshape(self._applied(plane, transposed=False), self.shape)

    def adjoint(self, raw: Array) -> Array:
        """Transpose of `forward`."""
        return arrays.namespace(raw).reshape(self._applied(raw, transposed=True), self.samples)

    def _applied(self, values: Array, *, transposed: bool) -> Array:
        xp = arrays.namespace(values)
        flat = xp.reshape(values, (-1,))
        if arrays.is_numpy(values):
            matrix = self.matrix.T if transposed else self.matrix
            return (matrix @ flat).astype(values.dtype, copy=False)
        index, weight = self._table(values, transposed)
        gathered = xp.reshape(xp.take(flat, xp.reshape(index, (-1,)), axis=0), weight.shape)
        return xp.sum(gathered * weight, axis=1)

    def _table(self, like: Array, transposed: bool) -> tuple[Array, Array]:
        """Index and weight of each value's neighbours (n, k), padded with weight 0."""
        key = arrays.placement(like), transposed
        if key not in self._tables:
            matrix = csr_array(self.matrix.T) if transposed else self.matrix
            start = np.asarray(matrix.indptr)
            counts = np.diff(start)
            column = np.arange(len(matrix.data)) - np.repeat(start[:-1], counts)
            row = np.repeat(np.arange(len(counts)), counts)
            index = np.zeros((len(counts), max(1, int(counts.max()))), np.int64)
            weight = np.zeros(index.shape)
            index[row, column], weight[row, column] = np.asarray(matrix.indices), matrix.data
            xp = arrays.namespace(like)
            self._tables[key] = xp.asarray(index, device=arrays.device(like)), arrays.like(weight, like)
        return self._tables[key]


def _interpolation(at: np.ndarray, samples: tuple[int, int]) -> csr_array:
    """Matrix of bilinear weights at places (pixels, 2) among samples; what lies outside them is dark.

    All weights are at least 0: an operator that rings below zero makes Richardson-Lucy explode.
    """
    columns, weights = [], []
    for axis in (0, 1):
        start = np.floor(at[:, axis]).astype(int)
        index = start[:, None] + np.arange(2)
        weight = 1 - np.abs(index - at[:, axis, None])
        weight[(index < 0) | (index >= samples[axis])] = 0
        columns.append(np.clip(index, 0, samples[axis] - 1))
        weights.append(weight)
    index = columns[0][:, :, None] * samples[1] + columns[1][:, None, :]
    weight = weights[0][:, :, None] * weights[1][:, None, :]
    row = np.repeat(np.arange(len(at)), 4)
    shape = (len(at), math.prod(samples))
    matrix = csr_array((weight.ravel().astype(np.float32), (row, index.ravel())), shape=shape)
    matrix.sum_duplicates()
    return matrix


def narrowed(width: float, samples: int) -> float:
    """Width of the square that samples average, so that pixels interpolated from them average `width`.

    Interpolation between samples 1/N apart adds 1/(6 N²) to the variance of the pixel's own square, w²/12.

    >>> round(narrowed(0.065, 27), 4)
    0.0385
    """
    return math.sqrt(max(width**2 - 2 / samples**2, 0.0))
