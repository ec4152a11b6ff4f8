"""Measures of a one-dimensional profile of intensity: zeros, widths, contrast."""

import numpy as np
from scipy.interpolate import CubicSpline

from lumigraph.core import checks
from lumigraph.core.arrays import Array, to_numpy
from lumigraph.errors import LumigraphError, SamplingError


def first_zero(x: Array, profile: Array) -> float:
    """Distance from the peak of a profile to its first minimum towards larger x [unit of x].

    Both are found between samples by a cubic spline. A parabola would be too far out by 1 % where ten samples
    lead to the zero of an Airy pattern, which is not symmetric about it.

    Parameters
    ----------
    x
        Positions (n,), ascending.
    profile
        Intensity (n,).

    Raises
    ------
    SamplingError
        The profile falls up to its end.

    Examples
    --------
    >>> x = np.linspace(-2, 2, 401)
    >>> round(first_zero(x, np.sinc(x) ** 2), 3)
    1.0
    """
    across, values = _profile(x, profile)
    peak = int(np.argmax(values))
    after = values[peak:]
    rising = np.flatnonzero((after[1:-1] <= after[:-2]) & (after[2:] > after[1:-1]))
    if len(rising) == 0:
        raise SamplingError(
            f"the profile has no minimum between its peak at {across[peak]:.6g} and its end at "
            f"{across[-1]:.6g}. Give a wider profile."
        )
    return _vertex(across, values, peak + 1 + int(rising[0])) - _vertex(across, values, peak)


def full_width(x: Array, profile: Array, level: float = 0.5) -> float:
    """Width of a profile's main peak at `level` times its maximum [unit of x], by linear interpolation.

    Parameters
    ----------
    x
        Positions (n,), ascending.
    profile
        Intensity (n,).
    level
        Fraction of the maximum, above 0 and below 1.

    Raises
    ------
    SamplingError
        The profile does not fall below the level on both sides.
    LumigraphError
        A level that is not between 0 and 1.

    Examples
    --------
    >>> x = np.linspace(-1, 1, 201)
    >>> round(full_width(x, 1 - abs(x)), 6)
    1.0
    """
    if not 0 < level < 1:
        raise LumigraphError(f"level is {level:g} but must lie between 0 and 1.")
    across, values = _profile(x, profile)
    peak, limit = int(np.argmax(values)), level * values.max()
    below = np.flatnonzero(values < limit)
    left, right = below[below < peak], below[below > peak]
    if len(left) == 0 or len(right) == 0:
        raise SamplingError(
            f"the profile does not fall below {level:g} of its maximum on both sides. Give a wider profile."
        )
    edges = [
        float(np.interp(limit, (values[out], values[inside]), (across[out], across[inside])))
        for out, inside in ((left[-1], left[-1] + 1), (right[0], right[0] - 1))
    ]
    return edges[1] - edges[0]


def contrast(profile: Array, frequency: float, pitch: float) -> float:
    r"""Contrast of one frequency in a profile: amplitude of its wave over the mean.

    The profile is fitted by :math:`a + b \cos 2\pi f x + c \sin 2\pi f x` (least squares); the result is
    :math:`\sqrt{b^2 + c^2} / a`. A wave between 0 and 1 has the contrast 1; bars of equal width 4/π.

    Parameters
    ----------
    profile
        Intensity (n,), a whole number of periods or many.
    frequency
        [1/m].
    pitch
        Of the samples [m].

    Raises
    ------
    SamplingError
        Less than one period, or fewer than two samples for one.

    Examples
    --------
    >>> x = np.arange(100) * 0.01
    >>> round(contrast(3 + 1.5 * np.cos(2 * np.pi * 7.3 * x + 1), 7.3, 0.01), 9)
    0.5
    """
    values = np.asarray(to_numpy(profile), np.float64)
    pitch = checks.positive("pitch", pitch)
    checks.positive("frequency", frequency, "1/m")
    if len(values) * pitch * frequency < 1 - 1e-9 or frequency * pitch > 0.5:
        raise SamplingError(
            f"a frequency of {frequency:.6g} /m cannot be measured on {len(values)} samples of pitch "
            f"{pitch:.4g} m. Give at least one period and two samples for each."
        )
    angle = 2 * np.pi * frequency * pitch * np.arange(len(values))
    basis = np.stack([np.ones_like(angle), np.cos(angle), np.sin(angle)], axis=1)
    mean, b, c = np.linalg.lstsq(basis, values, rcond=None)[0]
    return float(np.hypot(b, c) / mean)


def _profile(x: Array, profile: Array) -> tuple[np.ndarray, np.ndarray]:
    across, values = (np.asarray(to_numpy(array), np.float64) for array in (x, profile))
    if across.ndim != 1 or across.shape != values.shape or len(across) < 3:
        raise LumigraphError(
            f"a profile needs as many positions as values, at least 3: there are {across.shape} and "
            f"{values.shape}."
        )
    return across, values


def _vertex(x: np.ndarray, values: np.ndarray, index: int) -> float:
    """Extremum nearest to a sample, of a cubic spline through its neighbours; the sample at an end."""
    if not 0 < index < len(x) - 1:
        return float(x[index])
    here = slice(max(index - 4, 0), index + 5)
    spline = CubicSpline(x[here], values[here] / (np.abs(values[here]).max() or 1.0))
    turns = spline.derivative().roots(extrapolate=False)
    near = turns[np.abs(turns - x[index]) <= x[index + 1] - x[index - 1]]
    return float(near[np.argmin(np.abs(near - x[index]))]) if near.size else float(x[index])
