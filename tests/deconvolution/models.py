"""Small forward models whose matrices can be written down."""

from dataclasses import dataclass

import numpy as np

from lumigraph.core import arrays
from lumigraph.core.grid import Grid


@dataclass(frozen=True)
class Matrix:
    """Any matrix (pixels, samples) as a forward model."""

    matrix: np.ndarray
    raw_shape: tuple[int, int]
    object_shape: tuple[int, ...]

    @property
    def shape(self):
        return self.raw_shape, self.object_shape

    def forward(self, intensity):
        xp = arrays.namespace(intensity)
        flat = arrays.like(self.matrix, intensity) @ xp.reshape(intensity, (-1,))
        return xp.reshape(flat, self.raw_shape)

    def adjoint(self, raw):
        xp = arrays.namespace(raw)
        flat = xp.reshape(raw, (-1,)) @ arrays.like(self.matrix, raw)
        return xp.reshape(flat, self.object_shape)

    def psf(self, index):
        return self.matrix[:, np.ravel_multi_index(index, self.object_shape)].reshape(self.raw_shape)


@dataclass(frozen=True)
class Placed(Matrix):
    """One whose object stands on a grid, at depths."""

    object_grid: Grid
    depths: tuple[float, ...] | None = None


def blur(n, sigma):
    """Gaussian blur (n, n) of a line, whose columns sum to 1: no light is lost."""
    at = np.arange(n)
    kernel = np.exp(-((at[:, None] - at) ** 2) / (2 * sigma**2))
    return kernel / kernel.sum(0)


def blurred(shape, sigma):
    """The blur of a picture (y, x), or of a stack (z, y, x) that a camera sees summed, each plane wider."""
    if len(shape) == 2:
        return Matrix(np.kron(blur(shape[0], sigma), blur(shape[1], sigma)), shape, shape)
    planes = [np.kron(*(blur(n, sigma * (1 + k)) for n in shape[1:])) for k in range(shape[0])]
    return Matrix(np.concatenate(planes, 1), shape[1:], shape)


def disc(shape, level=100.0, ground=10.0):
    """An even disc on an even ground, the simplest picture with edges."""
    y, x = (np.arange(n) - n // 2 for n in shape)
    return np.where(np.hypot(*np.meshgrid(y, x, indexing="ij")) < min(shape) / 3.3, level, ground)
