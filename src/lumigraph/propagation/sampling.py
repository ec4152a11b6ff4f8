"""Range of validity of each method on a grid, and the grid it needs: closed forms with their sources.

All functions take and return SI floats; pairs are (y, x). The rules for propagation windows and lenses
are in Voelz, *Computational Fourier Optics*, SPIE 2011, chapters 5 and 6; the band limits in Matsushima
and Shimobaba, Opt. Express 17, 19662 (2009).
"""

import math
import sys
import warnings

from lumigraph.core.grid import Grid
from lumigraph.errors import SamplingWarning

Pair = tuple[float, float]


def longest_distance(grid: Grid, wavelength: float) -> float:
    r"""Farthest distance `angular_spectrum` can go before its transfer function aliases [m].

    .. math:: z_{max} = \min_{x,y} N p^2 / \lambda

    Parameters
    ----------
    grid
        Window of the calculation, padding included: N samples of pitch p [m] per axis.
    wavelength
        In vacuum [m].

    References
    ----------
    Voelz, *Computational Fourier Optics*, SPIE 2011. Paraxial: (2p/λ)² well above 1.

    Examples
    --------
    >>> round(longest_distance(Grid.square(1024, 10e-6), 550e-9), 4)
    0.1862
    """
    return min(fresnel_step(grid, wavelength))


def shortest_distance(grid: Grid, wavelength: float) -> float:
    r"""Nearest distance one-step `fresnel` can go before its chirp aliases at the grid's edge [m].

    .. math:: z_{min} = \max_{x,y} N p^2 / \lambda

    Parameters
    ----------
    grid
        Input grid: N samples of pitch p [m] per axis.
    wavelength
        In vacuum [m].

    References
    ----------
    Voelz, *Computational Fourier Optics*, SPIE 2011.
    """
    return max(fresnel_step(grid, wavelength))


def fresnel_step(grid: Grid, wavelength: float) -> Pair:
    r"""Distance (y, x) over which a one-step Fresnel transform keeps the pitch [m].

    .. math:: dz = W^2 / (N \lambda)

    the thesis' equation 2.34; W = N p is the width of the window.

    Examples
    --------
    >>> round(fresnel_step(Grid.square(2000, 5e-6), 633e-9)[0] * 1e3, 3)
    78.989
    """
    step = [n * pitch**2 / wavelength for n, pitch in zip(grid.shape, grid.pitch, strict=True)]
    return step[0], step[1]


def band_limits(window: Grid, distance: float, wavelength: float) -> Pair:
    r"""Highest frequencies (y, x) at which the sampled transfer function does not alias [1/m].

    .. math:: f_{max} = 1 / (\lambda \sqrt{(2 \Delta f z)^2 + 1}), \quad \Delta f = 1 / W

    These are also the frequencies of rays that cross half of the window W. Above 1/(2p) they are no limit.

    Parameters
    ----------
    window
        Window of the calculation, padding included.
    distance
        z [m], of either sign.
    wavelength
        In vacuum [m].

    References
    ----------
    Matsushima and Shimobaba, Opt. Express 17, 19662 (2009), equation 13; the thesis' 2.60 and 2.63.
    """
    limits = [1 / (wavelength * math.hypot(2 * distance / size, 1)) for size in window.size]
    return limits[0], limits[1]


def smallest_window(input_diameter: float, output_diameter: float) -> float:
    """Width of a window that keeps wrapped light off the output: 2 (r_in + r_out) [m].

    Parameters
    ----------
    input_diameter, output_diameter
        Diameters of the light and of what is looked at, 2 r_in and 2 r_out [m].
    """
    return input_diameter + output_diameter


def fresnel_phase_error(distance: float, radius: float, wavelength: float) -> float:
    r"""Phase that the Fresnel approximation leaves out between points `radius` apart across the axis [rad].

    .. math:: \frac{2\pi}{\lambda} \frac{r^4}{8 z^3}

    the next term of the expansion of the distance; Goodman, *Introduction to Fourier Optics*, chapter 4.
    """
    return math.pi * radius**4 / (4 * wavelength * abs(distance) ** 3)


def lens_pitch(focal_length: float, diameter: float, wavelength: float) -> float:
    r"""Coarsest pitch at which the phase of a lens does not alias at its rim [m].

    .. math:: \Delta x \le \lambda |f| / (2 r) = \lambda |f| / D

    A lenslet is a lens of diameter p. The thesis' 2.90 to 2.95 miss the factor 2; at their limit half
    of the light of a one-dimensional lens reaches the focus. Voelz, *Computational Fourier Optics*, 2011.

    Examples
    --------
    >>> round(lens_pitch(158e-3, 5e-3, 633e-9) * 1e6, 3)
    20.003
    """
    return wavelength * abs(focal_length) / diameter


def intensity_pitch(f_number: float, wavelength: float) -> float:
    r"""Coarsest pitch at which the intensity of a diffraction-limited image does not alias [m].

    .. math:: \Delta x \le \lambda F_\# / 2

    The squared modulus reaches twice the frequencies of the amplitude: its cut-off is 1/(λF#).
    """
    return wavelength * f_number / 2


def one_step_aliases(grid: Grid, distance: float, wavelength: float) -> str | None:
    """Warning text if the chirp of a one-step Fresnel transform aliases on the input grid; else None."""
    shortest = shortest_distance(grid, wavelength)
    if abs(distance) >= shortest * (1 - 1e-9):
        return None
    return (
        f"fresnel over {abs(distance):.4g} m aliases: on this grid one step is valid from {shortest:.4g} m "
        "on. Use method='band_limited', or a finer pitch."
    )


def points_alias(pitch: float, farthest: float, distance: float, wavelength: float) -> str | None:
    """Warning text if neighbouring inputs differ by over half a wave at the output; else None."""
    widest = wavelength * abs(distance) / (2 * pitch)
    if farthest <= widest * (1 + 1e-9):
        return None
    return (
        f"fresnel onto this grid aliases: input and output points are up to {farthest:.4g} m apart, but a "
        f"pitch of {pitch:.4g} m serves {widest:.4g} m over {abs(distance):.4g} m. "
        f"Use a pitch of {pitch * widest / farthest:.4g} m, or a smaller output grid."
    )


def unlimited_aliases(method: str, window: Grid, distance: float, wavelength: float) -> str | None:
    """Warning text if a transfer function without band limit aliases on its window; else None.

    An axis of one sample holds only the frequency 0, which never aliases.
    """
    steps = zip(window.shape, fresnel_step(window, wavelength), strict=True)
    longest = min((step for n, step in steps if n > 1), default=math.inf)
    if abs(distance) <= longest * (1 + 1e-9):
        return None
    return (
        f"{method} over {abs(distance):.4g} m aliases: on this window it is valid up to {longest:.4g} m. "
        f"Use method='band_limited', or a window {abs(distance) / longest:.3g} times as wide."
    )


def kept_alias(method: str, limits: Pair, window: Grid, distance: float, wavelength: float) -> str | None:
    """Warning text if a method keeps frequencies (y, x) that alias on its window; else None."""
    free = band_limits(window, distance, wavelength)
    for limit, clean, pitch in zip(limits, free, window.pitch, strict=True):
        if min(limit, 0.5 / pitch) > 1.01 * clean:
            return (
                f"{method} over {abs(distance):.4g} m keeps frequencies up to {limit:.4g} /m, but on this "
                f"window they alias above {clean:.4g} /m. Use method='band_limited', or pad=1."
            )
    return None


def light_wraps(
    window: Grid, limits: Pair, farthest: tuple[int, int], distance: float, wavelength: float
) -> str | None:
    """Warning text if light that leaves the window comes back deep into the output; else None.

    Up to a quarter of the window is let pass: most fields have an empty border.

    Parameters
    ----------
    window
        Window of the calculation.
    limits
        Highest frequencies (y, x) that are kept [1/m].
    farthest
        Largest distance (y, x) between an input and an output sample [samples].
    distance, wavelength
        [m].
    """
    for n, pitch, limit, samples in zip(window.shape, window.pitch, limits, farthest, strict=True):
        sine = min(wavelength * min(limit, 0.5 / pitch), 0.999)
        spread = min(n / 2, abs(distance) * sine / math.sqrt(1 - sine**2) / pitch)
        if samples + spread > 1.25 * n:
            return (
                f"light that leaves the window of {n * pitch:.4g} m may come back "
                f"{(samples + spread - n) * pitch:.4g} m deep on its other side. "
                "Use pad=1, or a smaller output grid."
            )
    return None


def warn(message: str | None, category: type[UserWarning] = SamplingWarning) -> None:
    """Issue a warning in the name of whoever called this package, if there is anything to say."""
    if message:
        warnings.warn(message, category, stacklevel=_callers_level())


def _callers_level() -> int:
    """Level, for `warn`, of whoever called the package; methods registered from elsewhere lie between."""
    level, found, frame = 1, 2, sys._getframe(1)
    while frame is not None:
        level += 1
        if str(frame.f_globals.get("__name__")).startswith("lumigraph.propagation"):
            found = level
        frame = frame.f_back
    return found
