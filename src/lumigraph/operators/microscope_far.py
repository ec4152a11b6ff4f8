"""Light in cells far from a point's own: a cell counts as one point, its image as one of a few patterns.

Over lenslets that is one small convolution for each pattern, and a product of few columns.
"""

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
    cells, seen
        Lenslets (rows, columns) whose images are followed, and those before which the object stands.
    """

    spectra: Array
    images: Array
    lengths: tuple[int, int]
    cells: tuple[int, int]
    seen: tuple[int, int]

    @classmethod
    def of(cls, fars: list[Far], cells: tuple[int, int], margin: int, like: Array) -> "FarLight":
        """From the depths' own, of objects that reach `margin` lenslets beyond those of the image."""
        seen = cells[0] + 2 * margin, cells[1] + 2 * margin
        y, x = (
            int(scipy.fft.next_fast_len(n + m - 1, real=True) or n + m)
            for n, m in zip(cells, seen, strict=True)
        )
        spectra = []
        for far in fars:
            steps = far.offsets - margin  # from the object's first lenslet, to the image's first
            inside = (steps > -np.asarray(seen)).all(1) & (steps < cells).all(1)
            wide = np.zeros((y, x, len(far.images)))
            row, column = (steps[inside] % (y, x)).T
            wide[row, column] = far.weights[inside]
            spectra.append(np.fft.rfft2(wide, axes=(0, 1)).transpose(2, 0, 1))
        images = np.concatenate([far.images for far in fars])
        return cls(arrays.like(np.stack(spectra), like), arrays.like(images, like), (y, x), cells, seen)

    def forward(self, volume: Array, points: int) -> Array:
        """Light (N², rows, columns) from a volume (z, rows s, columns s)."""
        xp, (rows, columns) = arrays.namespace(volume), self.cells
        cells = _summed(volume, points)
        spectrum = arrays.rfft2(cells, self.lengths, axes=(1, 2))[:, None, ...] * self.spectra
        light = arrays.irfft2(spectrum, self.lengths, axes=(2, 3))[..., :rows, :columns]
        light = xp.reshape(light, (self.images.shape[0], -1))
        return xp.reshape(xp.matrix_transpose(self.images) @ light, (-1, rows, columns))

    def adjoint(self, light: Array) -> Array:
        """What each point of a cell (z, rows, columns) sees of light (N², rows, columns)."""
        xp, (rows, columns) = arrays.namespace(light), self.cells
        parts = self.images @ xp.reshape(light, (light.shape[0], -1))
        parts = xp.reshape(parts, (*self.spectra.shape[:2], rows, columns))
        spectrum = arrays.rfft2(parts, self.lengths, axes=(2, 3)) * xp.conj(self.spectra)
        cells = arrays.irfft2(xp.sum(spectrum, axis=1), self.lengths, axes=(1, 2))
        return cells[:, : self.seen[0], : self.seen[1]]


def _summed(volume: Array, s: int) -> Array:
    """Sums (z, rows, columns) over the s × s points of each cell."""
    xp, (z, height, width) = arrays.namespace(volume), volume.shape
    ones = xp.ones((s, 1), dtype=volume.dtype, device=arrays.device(volume))
    along_x = xp.reshape(volume, (-1, s)) @ ones  # as a product: sums of short rows are slow
    return xp.sum(xp.reshape(along_x, (z, height // s, s, width // s)), axis=2)
