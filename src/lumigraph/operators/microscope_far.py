"""Light in cells far from a point's own: a cell counts as one point, its image as one of a few patterns.

Over lenslets that is one small convolution for each pattern, and a product of few columns.
"""

import math
from dataclasses import dataclass

import numpy as np
import scipy.fft

from lumigraph.core import arrays
from lumigraph.core.arrays import Array


@dataclass(frozen=True, slots=True, eq=False)
class Far:
    """What far cells receive of one depth.

    Parameters
    ----------
    offsets
        (n, 2): the cells (dy, dx), relative to the points' own.
    weights
        (n, k): what each has of each pattern.
    images
        (k, N²): the patterns.
    """

    offsets: np.ndarray
    weights: np.ndarray
    images: np.ndarray

    def reached(self, cells: tuple[int, int]) -> np.ndarray:
        """Weights (2 rows - 1, 2 columns - 1, k) of all offsets within an array of lenslets."""
        found = np.zeros((2 * cells[0] - 1, 2 * cells[1] - 1, len(self.images)))
        inside = (np.abs(self.offsets) < cells).all(1)
        at = self.offsets[inside] + np.asarray(cells) - 1
        found[at[:, 0], at[:, 1]] = self.weights[inside]
        return found


@dataclass(frozen=True, slots=True, eq=False)
class FarLight:
    """Far light of all depths, for arrays of one library and precision.

    Parameters
    ----------
    spectra
        (z, k, L, L/2 + 1), of the weights.
    images
        (z k, N²).
    lengths
        Of the transforms (y, x).
    """

    spectra: Array
    images: Array
    lengths: tuple[int, int]

    @classmethod
    def of(cls, fars: list[Far], cells: tuple[int, int], like: Array) -> "FarLight":
        """From the depths' own."""
        y, x = (int(scipy.fft.next_fast_len(2 * n - 1, real=True) or 2 * n) for n in cells)
        spectra = []
        for far in fars:
            wide = np.zeros((y, x, len(far.images)))
            reached = far.reached(cells)
            wide[: reached.shape[0], : reached.shape[1]] = reached
            wide = np.roll(wide, (1 - cells[0], 1 - cells[1]), (0, 1))
            spectra.append(np.fft.rfft2(wide, axes=(0, 1)).transpose(2, 0, 1))
        images = np.concatenate([far.images for far in fars])
        return cls(arrays.like(np.stack(spectra), like), arrays.like(images, like), (y, x))

    def forward(self, volume: Array, points: int) -> Array:
        """Light (N², rows, columns) from a volume (z, rows s, columns s)."""
        xp, (rows, columns) = arrays.namespace(volume), (n // points for n in volume.shape[1:])
        cells = xp.sum(arrays.tiled(volume, (points, points)), axis=(3, 4))
        spectrum = arrays.rfft2(cells, self.lengths, axes=(1, 2))[:, None, ...] * self.spectra
        light = arrays.irfft2(spectrum, self.lengths, axes=(2, 3))[..., :rows, :columns]
        light = xp.reshape(light, (self.images.shape[0], -1))
        return xp.reshape(xp.matrix_transpose(self.images) @ light, (-1, rows, columns))

    def adjoint(self, light: Array, points: int) -> Array:
        """Transpose of `forward`."""
        xp, (_, rows, columns) = arrays.namespace(light), light.shape
        parts = self.images @ xp.reshape(light, (light.shape[0], -1))
        parts = xp.reshape(parts, (*self.spectra.shape[:2], rows, columns))
        spectrum = arrays.rfft2(parts, self.lengths, axes=(2, 3)) * xp.conj(self.spectra)
        cells = arrays.irfft2(xp.sum(spectrum, axis=1), self.lengths, axes=(1, 2))[:, :rows, :columns]
        shape = (math.prod(cells.shape), 1)
        whole = xp.reshape(cells, shape) * xp.ones(
            (1, points**2), dtype=light.dtype, device=arrays.device(light)
        )
        return arrays.untiled(xp.reshape(whole, (*cells.shape, points, points)))
