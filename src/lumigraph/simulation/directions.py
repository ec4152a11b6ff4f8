"""Directions of mutually incoherent plane waves: quasi-random, more of them where more light comes from."""

import math

import numpy as np
import scipy.fft

from lumigraph.core import arrays, coverage
from lumigraph.core.grid import Grid

GOLDEN = 1.32471795724474602596
"""Root of x³ = x + 1, which makes Roberts' R2 sequence."""

EVENNESS = 0.75
"""Power of the light's share that waves follow: faint directions differ more from one another than bright."""

FINEST = 4
"""Frequencies of a table that the radius of the pupil spans at least."""

LARGEST_TABLE = 1024
"""Frequencies per axis up to which a small object's table is refined for that."""

RINGS = 96
"""Rows and columns of the table of a disc of directions."""


def quasi_random(count: int) -> np.ndarray:
    """Points (count, 2) of the R2 sequence, which fill the unit square evenly, whatever their number.

    References
    ----------
    M. Roberts, "The unreasonable effectiveness of quasirandom sequences", 2018.

    Examples
    --------
    >>> quasi_random(2).round(3).tolist()
    [[0.5, 0.5], [0.255, 0.07]]
    """
    return np.mod(0.5 + np.arange(count)[:, None] / [GOLDEN, GOLDEN**2], 1.0)


def follow(density: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points (k, 2) of the unit square moved so that they follow a density, and their density (k,).

    Rows first, then along the row, each by the inverse of its cumulated density, so that even points stay as
    even as they can.

    Parameters
    ----------
    density
        (rows, columns) of even cells of the unit square, not negative.
    points
        (k, 2), evenly distributed.

    Examples
    --------
    >>> moved, relative = follow(np.array([[0.0, 1.0], [0.0, 3.0]]), np.array([[0.5, 0.5]]))
    >>> moved.round(3).tolist(), relative.tolist()
    ([[0.667, 0.75]], [3.0])
    """
    rows, columns = density.shape
    if not density.any():
        density = np.ones_like(density)
    y = _inverse(density.sum(1), points[:, 0])
    row = np.minimum((y * rows).astype(int), rows - 1)
    x = np.array([_inverse(density[k], at) for k, at in zip(row, points[:, 1], strict=True)])
    column = np.minimum((x * columns).astype(int), columns - 1)
    return np.stack([y, x], axis=1), density[row, column] / density.mean(dtype=float)


def _inverse(density: np.ndarray, at: np.ndarray | float) -> np.ndarray:
    cumulated = np.concatenate([[0.0], np.cumsum(density, dtype=float)])
    return np.asarray(np.interp(at, cumulated / cumulated[-1], np.linspace(0, 1, len(cumulated))))


def share_of_light(amplitude: np.ndarray, grid: Grid, radius: float) -> tuple[np.ndarray, Grid]:
    r"""Light that a wave from each direction sends from an object through the pupil, in any unit.

    A wave of frequency s moves the object's spectrum T by s, of which the pupil takes a disc:

    .. math:: S(s) = \int_{|f| < R} |T(f - s)|^2 \, df

    a convolution of |T|² with the disc, because both are even.

    Parameters
    ----------
    amplitude
        Amplitude of the object (y, x), real.
    grid
        Where its samples stand.
    radius
        R of the pupil, D / (2λz) [1/m].

    Returns
    -------
    tuple
        The share (ny, nx), float32, and the grid of its frequencies [1/m], which fill the object's band.
    """
    shape = tuple(_table_size(n, p, radius) for n, p in zip(grid.shape, grid.pitch, strict=True))
    spacing = tuple(1 / (n * p) for n, p in zip(shape, grid.pitch, strict=True))
    frequencies = Grid((shape[0], shape[1]), (spacing[0], spacing[1]))
    power = np.abs(np.asarray(scipy.fft.fft2(amplitude, shape, workers=arrays.WORKERS))) ** 2
    along = [scipy.fft.ifftshift(f) for f in (frequencies.y, frequencies.x)]
    disc = coverage.disc(along[0][:, None], along[1], radius, frequencies.pitch).astype(np.float32)
    spectra = [np.asarray(scipy.fft.rfft2(part, workers=arrays.WORKERS)) for part in (power, disc)]
    share = np.asarray(scipy.fft.irfft2(spectra[0] * spectra[1], shape, workers=arrays.WORKERS))
    return np.maximum(scipy.fft.fftshift(share), 0).astype(np.float32), frequencies


def _table_size(n: int, pitch: float, radius: float) -> int:
    wanted = min(FINEST / (radius * pitch), LARGEST_TABLE)
    return int(scipy.fft.next_fast_len(max(n, math.ceil(wanted)), real=True) or n)


def over_the_band(share: np.ndarray, frequencies: Grid, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies (count, 2) [1/m] from a whole band, and their weights (count,), whose mean is about 1."""
    places, density = follow(share**EVENNESS, quasi_random(count))
    first = np.array([frequencies.y[0], frequencies.x[0]]) - np.array(frequencies.pitch) / 2
    return first + places * frequencies.size, 1 / density


def over_a_disc(
    share: np.ndarray, frequencies: Grid, radius: float, count: int
) -> tuple[np.ndarray, np.ndarray]:
    """The same from a disc of directions of the given radius [1/m]."""
    middle = (np.arange(RINGS) + 0.5) / RINGS
    table = np.stack(np.meshgrid(middle, middle, indexing="ij"), axis=-1).reshape(-1, 2)
    cells = np.round(_on_disc(table, radius) / frequencies.pitch).astype(int)
    shape = np.array(frequencies.shape)
    rows, columns = np.clip(cells + shape // 2, 0, shape - 1).T
    density = share[rows, columns].reshape(RINGS, RINGS) ** EVENNESS
    places, relative = follow(density, quasi_random(count))
    return _on_disc(places, radius), 1 / relative


def _on_disc(unit: np.ndarray, radius: float) -> np.ndarray:
    """Points of the unit square on a disc, equal areas to equal areas."""
    distance, angle = radius * np.sqrt(unit[:, 0]), 2 * math.pi * unit[:, 1]
    return np.stack([distance * np.sin(angle), distance * np.cos(angle)], axis=1)
