"""Modulation transfer: the part of each frequency that an image keeps."""

import numpy as np

from lumigraph.core import checks
from lumigraph.core.arrays import Array, like, to_numpy
from lumigraph.errors import LumigraphError, SamplingError


def mtf(psf: Array, pitch: float, axis: int = -1) -> tuple[np.ndarray, Array]:
    r"""Modulation transfer function along one axis, from a point image: (frequencies [1/m], values).

    A slice through the middle of the 2-D transfer function: the modulus of the line spread's transform,

    .. math:: MTF(f_x) = \left| \sum_x e^{-i 2\pi f_x x} \sum_y I(y, x) \right| / \sum I

    Parameters
    ----------
    psf
        Intensity of a point's image (y, x), not its square; with its surroundings, which hold light too.
    pitch
        Of the samples along the axis [m].
    axis
        -1 for frequencies along x, -2 for y.

    Returns
    -------
    tuple
        Frequencies from 0 to the highest that the samples hold [1/m], and values (n // 2 + 1,), 1 at 0.

    Raises
    ------
    LumigraphError
        Another shape, complex numbers, or no light.

    References
    ----------
    Goodman, *Introduction to Fourier Optics*, section 6.3.

    Examples
    --------
    >>> frequencies, values = mtf(np.ones((1, 4)), 0.5)
    >>> frequencies.tolist(), values.round(9).tolist()
    ([0.0, 0.5, 1.0], [1.0, 0.0, 0.0])
    """
    pitch = checks.positive("pitch", pitch)
    data = np.asarray(to_numpy(psf))
    if data.ndim != 2 or axis not in (-1, -2):
        raise LumigraphError(
            f"the point image has shape {data.shape} and axis is {axis}. Give (y, x) and -1 (x) or -2 (y)."
        )
    if data.dtype.kind == "c":
        raise LumigraphError("the point image is complex. Give its intensity, abs(field)**2.")
    line = data.sum(axis=-2 if axis == -1 else -1, dtype=np.float64)
    total = line.sum()
    if total == 0:
        raise LumigraphError("the point image has no light. Check the position and the window.")
    values = np.abs(np.fft.rfft(line)) / abs(total)
    single = psf if str(psf.dtype).endswith(("float32", "float64")) else None
    return np.fft.rfftfreq(len(line), pitch), values if single is None else like(values, psf)


def cutoff(frequencies: Array, mtf: Array, level: float = 0.01) -> float:
    """Frequency at which an MTF first falls below `level` [unit of the frequencies].

    Linear between samples.

    Parameters
    ----------
    frequencies
        Ascending (n,).
    mtf
        Values (n,), 1 at frequency 0.
    level
        Threshold.

    Raises
    ------
    SamplingError
        The values stay above the level.

    Examples
    --------
    >>> cutoff(np.array([0.0, 10.0, 20.0]), np.array([1.0, 0.5, 0.0]), level=0.25)
    15.0
    """
    f, values = (np.asarray(to_numpy(array), np.float64) for array in (frequencies, mtf))
    below = np.flatnonzero(values < level)
    if len(below) == 0 or below[0] == 0:
        raise SamplingError(
            f"the MTF does not fall below {level:g} between {f[0]:.6g} and {f[-1]:.6g}. "
            "Sample the point image more finely."
        )
    n = int(below[0])
    return float(f[n - 1] + (f[n] - f[n - 1]) * (values[n - 1] - level) / (values[n - 1] - values[n]))
