"""Properties of a sensor from pairs of flat and of dark images: EMVA 1288's photon transfer."""

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lumigraph.core import checks
from lumigraph.core.arrays import to_numpy
from lumigraph.core.raw import RawImage
from lumigraph.core.short_repr import brief
from lumigraph.errors import CalibrationError, SamplingWarning

LINEAR = 0.7
"""Part of the way to saturation up to which the standard fits the variance."""
CLIPPED = 1.3e-3
"""Part of the pixels that may read 0 in the dark: three standard deviations of a normal distribution."""
COARSEST = 0.24
"""Variance in the dark [counts²] below which quantisation hides the noise, by the standard."""

Pair = Sequence[Any]


@dataclass(frozen=True, slots=True, eq=False)
class PhotonTransfer:
    """A sensor as `photon_transfer` found it; errors are standard deviations.

    Parameters
    ----------
    gain, gain_error
        Electrons per count.
    dark_signal, dark_signal_error
        Mean of the dark images that belong to the flats [counts].
    dark_noise, dark_noise_error
        Of a pixel in those, quantisation taken out [electrons].
    read_noise
        The same without the dark current's share [electrons]; None without exposure times.
    dark_current, black_level
        [electrons per second] and [counts]; None without exposure times.
    full_well
        Electrons that read the highest number; None where no flat reaches it.
    dsnu, prnu
        Fixed patterns: of the dark signal [electrons], and of the response over its mean. Uneven light counts
        as PRNU.
    means, variances
        The curve: signal over the dark [counts] and temporal variance over the dark's [counts²] of each flat.
    fitted
        Which of them gave the gain.
    """

    gain: float
    gain_error: float
    dark_signal: float
    dark_signal_error: float
    dark_noise: float
    dark_noise_error: float
    read_noise: float | None
    dark_current: float | None
    black_level: float | None
    full_well: float | None
    dsnu: float
    prnu: float
    means: np.ndarray
    variances: np.ndarray
    fitted: np.ndarray

    __repr__ = brief


@dataclass(frozen=True, slots=True)
class _Moments:
    """Moments of a pair of images of one scene: what is alike and what differs between them."""

    mean: float
    variance: float
    covariance: float
    spread: float  # standard deviation of the variance: under uneven light more than sqrt(2 / size) of it
    size: int
    saturated: float


def photon_transfer(
    flats: Sequence[Pair],
    darks: Sequence[Pair],
    *,
    exposure_times: Sequence[float] | None = None,
    full_scale: float | None = None,
) -> PhotonTransfer:
    r"""Gain, noise, dark signal, full well and fixed patterns of a sensor.

    The variance of a pixel in time grows with its mean as the number of electrons does,

    .. math:: \sigma^2 - \sigma_{dark}^2 = (\mu - \mu_{dark}) / g, \qquad
              \sigma_{dark}^2 = \sigma_d^2 / g^2 + 1/12

    and is half of that of the difference of two images, from which fixed patterns are gone; their covariance
    holds nothing else. The line is fitted up to 70 % of saturation, each flat weighted by its own error.

    Parameters
    ----------
    flats
        Pairs of images (y, x) or `RawImage`, each pair of one even light; several brightnesses, best up to
        saturation.
    darks
        Pairs without light. The first has the flats' exposure time; with `exposure_times` more may follow.
    exposure_times
        Of the darks [s], at least two different ones: they separate dark current from black level.
    full_scale
        Largest number that the sensor reads; None takes it from the bit depth of raw images, and without one
        looks for no saturation.

    Raises
    ------
    CalibrationError
        No pairs, images of different shapes, dark images clipped at 0, saturated flats, flats no brighter
        than the darks, or exposure times that do not fit the darks.

    Warns
    -----
    SamplingWarning
        The dark noise is finer than the numbers read out, so that it is only an upper limit.

    References
    ----------
    EMVA Standard 1288, release 4.0 linear, sections 2.2, 6.4, 6.6, 7 and 8.

    Examples
    --------
    >>> from dataclasses import replace
    >>> from lumigraph.sensor import Sensor
    >>> rng, sensor = np.random.default_rng(0), Sensor((200, 200), 5e-6, read_noise=8.0, black_level=50)
    >>> def pair(light):
    ...     return [sensor.expose(np.full((200, 200), light), photons=9000, rng=rng) for _ in range(2)]
    >>> found = photon_transfer([pair(0.2), pair(0.4), pair(0.6)], [pair(0.0)])
    >>> f"{found.gain:.1f} electrons per count, {sensor.gain:.1f} in truth; noise {found.dark_noise:.1f}"
    '2.5 electrons per count, 2.5 in truth; noise 8.0'
    """
    if not len(flats) or not len(darks):
        raise CalibrationError(
            f"there are {len(flats)} pairs of flats and {len(darks)} of darks. Give one of each."
        )
    top = _full_scale(flats, full_scale)
    lit, unlit = ([_moments(pair, top) for pair in pairs] for pairs in (flats, darks))
    _check_dark(darks[0], unlit[0])
    dark = unlit[0]
    means = np.array([each.mean - dark.mean for each in lit])
    variances = np.array([each.variance - dark.variance for each in lit])
    fitted = (means > 0) & (means <= LINEAR * (top - dark.mean))
    fitted &= np.array([each.saturated < 1e-4 for each in lit])
    if not fitted.any():
        raise CalibrationError(
            f"no flat lies between the dark signal of {dark.mean:.4g} and {LINEAR:.0%} of the way to "
            f"{top:.6g} counts: they are {', '.join(f'{each.mean:.4g}' for each in lit)} in the mean. "
            "Change the light or the exposure."
        )
    spreads = np.array([each.spread for each in lit])
    gain, gain_error, with_dark = _gain(means[fitted], variances[fitted], spreads[fitted])
    noise, noise_error = _dark_noise(dark, gain, gain_error, with_dark)
    gain_error = math.hypot(gain_error, with_dark * dark.spread)
    current, level, read_noise = _dark_current(unlit, exposure_times, gain, noise)
    saturates = any(each.saturated > 1e-2 for each in lit)
    return PhotonTransfer(
        gain, gain_error, dark.mean, math.sqrt(dark.variance / (2 * dark.size)), noise, noise_error,
        read_noise, current, level,
        full_well=gain * (top - dark.mean) if saturates else None,
        dsnu=gain * math.sqrt(max(dark.covariance, 0.0)), prnu=_prnu(lit, dark, fitted, top),
        means=means, variances=variances, fitted=fitted,
    )  # fmt: skip


def _full_scale(flats: Sequence[Pair], full_scale: float | None) -> float:
    if full_scale is not None:
        return checks.positive("full_scale", full_scale, "counts", CalibrationError)
    depth = getattr(flats[0][0], "bit_depth", None)
    return math.inf if depth is None else float(2**depth - 1)


def _moments(pair: Pair, top: float) -> _Moments:
    if len(pair) != 2:
        raise CalibrationError(f"a pair of images has {len(pair)} of them. Give two of one light.")
    a, b = (np.asarray(to_numpy(i.data if isinstance(i, RawImage) else i), np.float64) for i in pair)
    if a.shape != b.shape or a.size < 2:
        raise CalibrationError(f"a pair of images has shapes {a.shape} and {b.shape}. Give two of one size.")
    for image in (a, b):
        checks.finite_array("an image", image, CalibrationError)
    covariance = float(np.mean((a - a.mean()) * (b - b.mean())))
    off = (a - b - (a - b).mean()) ** 2 / 2
    return _Moments(
        float(a.mean() + b.mean()) / 2, float(off.mean()), covariance, float(off.std()) / math.sqrt(a.size),
        a.size, float(np.mean(a >= top)),
    )  # fmt: skip


def _check_dark(pair: Pair, dark: _Moments) -> None:
    image = np.asarray(to_numpy(pair[0].data if isinstance(pair[0], RawImage) else pair[0]))
    zero = float(np.mean(image <= 0))
    if zero > CLIPPED and dark.variance > 0:
        raise CalibrationError(
            f"{zero:.2g} of the dark pixels read 0: their noise is clipped and cannot be measured. "
            f"Raise the black level by {6 * math.sqrt(dark.variance) + 1:.0f} counts or more."
        )
    if dark.variance < COARSEST:
        warnings.warn(
            f"the variance in the dark is {dark.variance:.2g} counts², below {COARSEST}: quantisation "
            "hides the dark noise, and what is given is no more than a limit. Raise the sensor's gain.",
            SamplingWarning,
            stacklevel=3,
        )


def _gain(means: np.ndarray, variances: np.ndarray, spreads: np.ndarray) -> tuple[float, float, float]:
    """Electrons per count, its error by the flats alone, and its derivative by the dark pair's variance.

    Of a line through the dark pair, whose variance was taken from all of the flats'.
    """
    weights = 1 / np.maximum(spreads, 1e-9 * means) ** 2
    total = float(weights @ means**2)
    slope = float(weights @ (means * variances)) / total
    if slope <= 0:
        raise CalibrationError(
            f"the variance does not grow with the mean: {slope:.3g} counts² per count. "
            "Give raw images as read out, not averaged, denoised or compressed."
        )
    return 1 / slope, math.sqrt(1 / total) / slope**2, float(weights @ means) / total / slope**2


def _dark_noise(dark: _Moments, gain: float, gain_error: float, with_dark: float) -> tuple[float, float]:
    """Noise [electrons] and its error; the gain grows `with_dark`, the dark pair's variance, so both add."""
    variance = max(dark.variance - 1 / 12, 0.0)
    noise = gain * math.sqrt(variance)
    if not variance:
        return noise, gain * math.sqrt(dark.spread)
    own = (gain / (2 * math.sqrt(variance)) + math.sqrt(variance) * with_dark) * dark.spread
    rounded = gain * _rounding(variance) / (2 * math.sqrt(variance))
    return noise, math.hypot(own, rounded, noise * gain_error / gain)


def _rounding(variance: float) -> float:
    """Standard deviation of what rounding to counts adds to a variance [counts²] beside 1/12.

    By Poisson's sum over whole counts, of a normal distribution whose mean stands anywhere between two: its
    first term is (4 σ² + 1/π²) exp(-2 π² σ²) times the cosine of that place.
    """
    return (4 * variance + 1 / math.pi**2) * math.exp(-2 * math.pi**2 * variance) / math.sqrt(2)


def _dark_current(
    darks: Sequence[_Moments], times: Sequence[float] | None, gain: float, noise: float
) -> tuple[float | None, float | None, float | None]:
    """Dark current [electrons/s], black level [counts], read noise [electrons], from a line through means."""
    if times is None:
        return None, None, None
    if len(times) != len(darks) or len(set(times)) < 2:
        raise CalibrationError(
            f"there are {len(times)} exposure times, {len(set(times))} of them different, for {len(darks)} "
            "pairs of darks. Give one for each pair, and at least two different ones."
        )
    at = [checks.finite("an exposure time", t, "s", CalibrationError) for t in times]
    slope, level = np.polyfit(at, [each.mean for each in darks], 1)
    current = float(slope) * gain
    return current, float(level), math.sqrt(max(noise**2 - max(current, 0.0) * at[0], 0.0))


def _prnu(lit: Sequence[_Moments], dark: _Moments, fitted: np.ndarray, top: float) -> float:
    """PRNU at half of saturation, or at the brightest flat of the fit if that is not known."""
    goal = (dark.mean + top) / 2 if math.isfinite(top) else math.inf
    usable = [each for each, used in zip(lit, fitted, strict=True) if used]
    flat = (
        max(usable, key=lambda m: m.mean)
        if math.isinf(goal)
        else min(usable, key=lambda m: abs(m.mean - goal))
    )
    return math.sqrt(max(flat.covariance - dark.covariance, 0.0)) / (flat.mean - dark.mean)
