"""Light far from a point's image: the main lens' diffraction, which falls as the cube of the distance.

It hardly depends on where in its cell a point stands, and its picture in a cell on the direction alone. So
each cell of the object counts as one, and the pictures at the end of the kernels' reach are taken farther.
"""

import math
from dataclasses import dataclass

import numpy as np

from lumigraph.core import arrays
from lumigraph.core.arrays import Array

Offset = tuple[int, int]


@dataclass(frozen=True, slots=True, eq=False)
class Glare:
    """Matrix from the light of an object's cells to an image's.

    Parameters
    ----------
    spectra
        (q, M, N) complex: how much of each picture an offset between cells gives, transformed.
    pictures
        (q, samples) of a cell, for one point of intensity 1.
    image
        Cells (rows, columns) of the image.
    margin
        Cells of the object beyond those of the image, on each side.
    """

    spectra: np.ndarray
    pictures: np.ndarray
    image: tuple[int, int]
    margin: tuple[int, int]

    def forward(self, cells: Array) -> Array:
        """Light of the object's cells (rows, columns), to the image's (rows, columns, samples)."""
        xp = arrays.namespace(cells)
        spectra = arrays.like(self.spectra, arrays.as_complex(cells))
        window = arrays.framed(cells, (0, 0), self._window)
        spread = arrays.ifft2(arrays.fft2(arrays.as_complex(window)) * spectra)
        inside = self._inside()
        parts = xp.permute_dims(xp.real(spread)[:, inside[0], inside[1]], (1, 2, 0))
        return parts @ arrays.like(self.pictures, cells)

    def adjoint(self, image: Array) -> Array:
        """Transpose of `forward`: (rows, columns, samples) to (rows, columns)."""
        xp = arrays.namespace(image)
        parts = image @ xp.matrix_transpose(arrays.like(self.pictures, image))
        parts = arrays.framed(xp.permute_dims(parts, (2, 0, 1)), self.margin, self._window)
        spectra = arrays.like(np.conj(self.spectra), arrays.as_complex(parts))
        spread = xp.sum(arrays.fft2(arrays.as_complex(parts)) * spectra, axis=0)
        rows, columns = (n + 2 * m for n, m in zip(self.image, self.margin, strict=True))
        return xp.real(arrays.ifft2(spread))[:rows, :columns]

    def _inside(self) -> tuple[slice, slice]:
        y, x = (slice(m, m + n) for n, m in zip(self.image, self.margin, strict=True))
        return y, x

    @property
    def _window(self) -> Offset:
        return self.spectra.shape[1], self.spectra.shape[2]


def glare(means: dict[Offset, np.ndarray], size: tuple[float, float], image: Offset) -> Glare:
    """Beyond the offsets of `means`, for an image of so many cells.

    Parameters
    ----------
    means
        Mean picture (samples,) of a cell's points at each offset (dy, dx) of a rectangle.
    size
        Of a cell [m].
    image
        Cells (rows, columns).
    """
    reach = tuple(max(key[k] for key in means) for k in (0, 1))
    ring = sorted(key for key in means if any(abs(key[k]) == reach[k] for k in (0, 1)))
    number = {key: k for k, key in enumerate(ring)}
    shape = tuple(n + (n + 2 * m) for n, m in zip(image, reach, strict=True))
    weights = np.zeros((len(ring), *shape))
    for dy in range(-image[0] - reach[0] + 1, image[0] + reach[0]):
        for dx in range(-image[1] - reach[1] + 1, image[1] + reach[1]):
            out = max(abs(dy) / reach[0], abs(dx) / reach[1])
            if out > 1:
                near = (round(dy / out), round(dx / out))
                law = math.hypot(near[0] * size[0], near[1] * size[1]) / math.hypot(
                    dy * size[0], dx * size[1]
                )
                weights[number[near], dy % shape[0], dx % shape[1]] = law**3
    spectra = np.conj(np.fft.fft2(weights)).astype(np.complex64)
    pictures = np.array([means[key] for key in ring], np.float32)
    return Glare(spectra, pictures, (image[0], image[1]), (reach[0], reach[1]))
