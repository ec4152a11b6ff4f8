"""Small forward models whose matrices can be written down."""

import numpy as np

from lumigraph.core.matrix import Matrix


def placed(matrix, raw_shape, object_shape, grid, depths=None):
    """A matrix whose object stands on a grid, at depths."""
    return Matrix(matrix, raw_shape, object_shape, object_grid=grid, depths=depths)


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
