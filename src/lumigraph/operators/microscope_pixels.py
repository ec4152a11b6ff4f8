"""Places of a real camera's pixels among the evenly spaced samples of the lenslets' cells."""

import math

import numpy as np
from scipy.sparse import csr_array

from lumigraph.core.banded import Banded, banded
from lumigraph.core.calibration import Calibration
from lumigraph.core.linear import Linear
from lumigraph.core.matrix import Matrix
from lumigraph.operators.resampling import Resampling

SLIVER = 1.2
"""Lenslets of which fewer pixels than this are seen along an axis are left out [px]."""

STRAIGHT = 1e-9
"""Lenslets that a row or column of pixels may wind if it counts as straight along those of the lattice."""

ROWS = 16
"""Of the blocks of banded matrices: with more of them they hold more zeros."""

FRAME = 1
"""Lenslets around those that are seen, to each side, whose light falls on pixels."""

STEADY = 0.025
"""Pixels of the accuracy asked for that pixels may stand beside samples which count as the pixels.

A shift by δ pixels changes an image by at most some 3 δ of its rms (spots of half a pixel), so by 0.07 of the
accuracy.
"""


def whole_pixels(calibration: Calibration, accuracy: float) -> int | None:
    """Number of pixels along each side of a lenslet, all at the same places; None if there is none.

    >>> from lumigraph.core.lattice import Lattice
    >>> center = np.array([[30.0, 30.0]])
    >>> lattices = [Lattice.square(pitch, 0.0, (30.0, 30.0)) for pitch in (15.0, 15.01)]
    >>> given = [Calibration(one, (61, 61), np.zeros((1, 2), int), center, 0.0) for one in lattices]
    >>> [whole_pixels(one, 1e-2) for one in given]
    [15, None]
    """
    N = round(calibration.lattice.pitch)
    at = on_lattice(calibration) * N + (N - 1) / 2
    return N if N > 1 and np.abs(at - np.rint(at)).max() <= STEADY * accuracy else None


def on_lattice(calibration: Calibration) -> np.ndarray:
    """Places (ny, nx, 2) of the pixels along the lattice's rows and columns [lenslets]."""
    ny, nx = calibration.shape
    y, x = calibration.straightened(np.arange(ny)[:, None] + 0.0, np.arange(nx)[None, :] + 0.0)
    origin = calibration.lattice.origin
    place = np.stack(np.broadcast_arrays(y - origin[0], x - origin[1]), -1)
    return place @ np.linalg.inv(calibration.lattice.matrix).T


def placement(
    calibration: Calibration, pixels: int, degree: int, dtype: type = np.float32
) -> tuple[Linear | None, tuple[int, int], np.ndarray]:
    """Map from the cells' samples to pixels, by a raw image's micro-images, N samples along a cell's side.

    Parameters
    ----------
    calibration
        Of a raw image (ny, nx).
    pixels
        N.
    degree
        Of the B-splines whose coefficients the samples are; 0 where they are the pixels (`whole_pixels`).
    dtype
        Of the map's numbers.

    Returns
    -------
    tuple
        Map from samples, of `FRAME` more cells to each side, to pixels (ny, nx), None where the samples of
        the cells are all pixels; the cells (rows, columns) that are seen; and the pixel (y, x) at the middle
        of them.
    """
    place = on_lattice(calibration)
    # A lenslet whose outermost pixels alone are seen says nothing.
    least = SLIVER / calibration.lattice.pitch
    first = np.floor(place.reshape(-1, 2).min(0) + 0.5 + least).astype(int)
    last = np.floor(place.reshape(-1, 2).max(0) + 0.5 - least).astype(int)
    cells = (int(last[0] - first[0]) + 1, int(last[1] - first[1]) + 1)
    samples = (cells[0] + 2 * FRAME) * pixels, (cells[1] + 2 * FRAME) * pixels
    at = (place - first + FRAME + 0.5) * pixels - 0.5
    middle = calibration.position((first + last) / 2)
    if degree:
        return _interpolation(at, samples, degree, STRAIGHT * pixels, dtype), cells, middle
    at = np.rint(at)
    if at[0, 0].tolist() == [FRAME * pixels] * 2 and at.shape[:2] == (cells[0] * pixels, cells[1] * pixels):
        return None, cells, middle
    return _interpolation(at, samples, 1, 0.0, dtype), cells, middle


def _interpolation(
    at: np.ndarray, samples: tuple[int, int], degree: int, straight: float, dtype: type
) -> Linear:
    """B-splines at places (ny, nx, 2) among samples; what lies outside them is dark.

    All weights are at least 0: an operator that rings below zero makes Richardson-Lucy explode.
    """
    y, x = at[:, 0, 0], at[0, :, 1]
    if max(np.ptp(at[..., 0], axis=1).max(), np.ptp(at[..., 1], axis=0).max()) > straight:
        return Matrix(_splines(at.reshape(-1, 2), samples, degree, dtype), (len(y), len(x)), samples)
    return Resampling(*(_spline(places, n, degree, dtype) for places, n in zip((y, x), samples, strict=True)))


def _spline(at: np.ndarray, samples: int, degree: int, dtype: type) -> Banded:
    """B-splines at places along one axis."""

    def weights(d: np.ndarray) -> np.ndarray:
        return b_spline(d, degree)

    return banded(at, np.arange(samples), weights, (degree + 1) / 2, ROWS, dtype)


def _splines(at: np.ndarray, samples: tuple[int, int], degree: int, dtype: type) -> csr_array:
    """Matrix of B-splines at places (pixels, 2) among samples."""
    columns, weights, taps = [], [], degree + 1
    for axis in (0, 1):
        n, places = samples[axis], at[:, axis]
        start = np.floor(places - (degree - 1) / 2).astype(int)
        index = start[:, None] + np.arange(taps)
        weight = b_spline(places[:, None] - index, degree)
        weight[(index < 0) | (index >= n)] = 0
        columns.append(np.clip(index, 0, n - 1))
        weights.append(weight.astype(dtype))
    index = columns[0][:, :, None] * samples[1] + columns[1][:, None, :]
    weight = weights[0][:, :, None] * weights[1][:, None, :]
    start, shape = np.arange(len(at) + 1) * taps**2, (len(at), math.prod(samples))
    short = np.int32 if max(start[-1], shape[1]) <= np.iinfo(np.int32).max else np.int64  # read each time
    matrix = csr_array((weight.ravel(), index.ravel().astype(short), start.astype(short)), shape=shape)
    matrix.sum_duplicates()
    return matrix


def b_spline(x: np.ndarray, degree: int) -> np.ndarray:
    """Cardinal B-spline of unit knots, centred on 0.

    >>> b_spline(np.array([-1.0, 0.0, 1.0]), 3).round(6).tolist()
    [0.166667, 0.666667, 0.166667]
    """
    total = np.zeros_like(x)
    for k in range(degree + 2):
        rest = np.maximum((degree + 1) / 2 - np.abs(x) - k, 0)
        total += (-1) ** k * math.comb(degree + 1, k) * rest**degree
    return total / math.factorial(degree)


def narrowed(width: float, samples: int) -> float:
    """Width of the square that samples average, so that pixels interpolated from them average `width`.

    Linear interpolation between samples 1/N apart adds 1/(6 N²) to the variance of the pixel's own square,
    w²/12.

    >>> round(narrowed(0.065, 27), 4)
    0.0385
    """
    return math.sqrt(max(width**2 - 2 / samples**2, 0.0))
