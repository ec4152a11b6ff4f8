"""Random phases on an object: snapshots of spatially incoherent or partially coherent light."""

from typing import Any

import numpy as np

from lumigraph.core import checks
from lumigraph.core.arrays import fft2
from lumigraph.core.grid import Grid
from lumigraph.errors import GeometryError

_DISPLACED_BELOW = 20


def white_phase(grid: Grid, rng: np.random.Generator, dtype: Any = np.complex64) -> np.ndarray:
    """Amplitude exp(iφ) (ny, nx) with an independent phase, uniform over 2π, for each sample.

    The mean intensity of M such snapshots approaches the exact incoherent image as 1/sqrt(M).

    Examples
    --------
    >>> mask = white_phase(Grid.square(64, 1e-6), np.random.default_rng(1))
    >>> bool(abs(mask.mean()) < 0.05), mask.dtype
    (True, dtype('complex64'))
    """
    real = np.float32 if np.dtype(dtype) == np.complex64 else np.float64
    phase = rng.random(grid.shape, dtype=real)
    phase *= real(2 * np.pi)
    mask = np.empty(grid.shape, dtype)
    np.cos(phase, out=mask.real)
    np.sin(phase, out=mask.imag)
    return mask


def random_phase_mask(
    grid: Grid, wavelength: float, coherence_index: int, rng: np.random.Generator, dtype: Any = np.complex64
) -> np.ndarray:
    r"""Amplitude exp(iφ) (ny, nx) of the thesis' random phase mask: patches of light of one phase each.

    C × C sources of random phase, discs of diameter N/C samples that touch, are propagated by one Fresnel
    transform over

    .. math:: d_c = W^2 / (N \lambda)

    so that the pitch is kept; φ is the phase of the result. Fewer than 20 × 20 sources are displaced at
    random by up to half their distance, so that their order does not show. The light stays partially
    coherent: the mean of many snapshots keeps a bias (some 10 % rms at C/N = 0.14).

    Parameters
    ----------
    grid
        Where the object's samples stand, N of them over the width W on each axis.
    wavelength
        Wavelength in vacuum [m]. Since d_c is inverse to it, the mask does not depend on it.
    coherence_index
        C, number of sources along each axis, at most N.
    rng
        Random numbers.
    dtype
        complex64 or complex128.

    Raises
    ------
    GeometryError
        C below 1, or more sources than samples.

    References
    ----------
    The thesis, section 3.4.3 and equation 3.7.
    """
    wavelength = checks.positive("wavelength", wavelength)
    if not 1 <= coherence_index <= min(grid.shape):
        raise GeometryError(
            f"coherence_index is {coherence_index} but must lie between 1 and {min(grid.shape)}, "
            f"the samples of the grid {grid.shape}."
        )
    displaced = coherence_index < _DISPLACED_BELOW
    sources = (_displaced if displaced else _regular)(grid.shape, int(coherence_index), rng)
    chirps = []
    for n, pitch in zip(grid.shape, grid.pitch, strict=True):
        distance = (n * pitch) ** 2 / (n * wavelength)
        position = (np.arange(n) - n // 2) * pitch
        chirps.append(np.exp(1j * np.pi * position**2 / (wavelength * distance)).astype(dtype))
    along_y, along_x = chirps[0][:, None], chirps[1]
    wave = sources.astype(dtype) * along_y * along_x
    wave = np.fft.fftshift(fft2(np.fft.ifftshift(wave), overwrite=True))
    wave *= along_y
    wave *= along_x
    modulus = np.abs(wave)
    return np.divide(wave, modulus, out=np.ones_like(wave), where=modulus > 0)


def _regular(shape: tuple[int, int], count: int, rng: np.random.Generator) -> np.ndarray:
    """Discs side by side on a regular array, each with its phase."""
    amplitudes = white_phase(Grid.square(count, 1.0), rng)
    cells, inside = [], []
    for n in shape:
        position = (np.arange(n) + 0.5) * count / n
        cells.append(np.minimum(position.astype(int), count - 1))
        inside.append(np.square(position - cells[-1] - 0.5))
    disc = inside[0][:, None] + inside[1] <= 0.25
    return amplitudes[cells[0][:, None], cells[1]] * disc


def _displaced(shape: tuple[int, int], count: int, rng: np.random.Generator) -> np.ndarray:
    """Discs moved at random from a regular array; where they overlap, amplitudes add."""
    amplitudes = white_phase(Grid.square(count, 1.0), rng)
    sources = np.zeros(shape, np.complex64)
    position = [(np.arange(n) + 0.5) * count / n for n in shape]
    for row in range(count):
        for column in range(count):
            center = np.array([row, column]) + rng.random(2)
            near = [np.abs(position[axis] - center[axis]) <= 0.5 for axis in (0, 1)]
            rows, columns = (np.flatnonzero(mask) for mask in near)
            if len(rows) == 0 or len(columns) == 0:
                continue
            distance = np.square(position[0][rows] - center[0])[:, None]
            disc = distance + np.square(position[1][columns] - center[1]) <= 0.25
            sources[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1] += amplitudes[row, column] * disc
    return sources
