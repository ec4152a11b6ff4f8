"""Three propagation methods of the thesis, for comparison: importing this module adds them to `METHODS`.

- "band_limited_circular" (2.4.2) and "corrected_band_limited" (2.4.3): the angular spectrum within a circle,
  which multiplies the transfer function itself, not its phase as printed
- "multi_step_fresnel" (2.3.1): Fresnel steps that keep the pitch

None of them is better than "band_limited" or "fresnel"; see the errata 2.4.2, 2.66 to 2.69 and 2.3.1.
"""

import math
from dataclasses import replace

import numpy as np

from lumigraph.core import arrays
from lumigraph.core.arrays import Array
from lumigraph.core.field import Field
from lumigraph.core.grid import Grid
from lumigraph.errors import SamplingError
from lumigraph.propagation import register, sampling
from lumigraph.propagation.angular_spectrum import RECTANGLE, PassBand, spectral
from lumigraph.propagation.fresnel import along, carrier, conjugate_if
from lumigraph.propagation.window import check_memory, reach, window_shape

Pair = tuple[float, float]

MOST_STEPS = 10_000
"""Multi-step Fresnel refuses more steps than this."""


def corrected_cutoff(grid: Grid, distance: float, wavelength: float) -> Pair:
    r"""The thesis' cut-off frequencies (y, x) of free space between two windows of one width [1/m].

    .. math:: \nu_{cutoff} = W / (\lambda z)

    the thesis' equation 2.68. Without padding it is twice the paraxial `band_limits`.

    Parameters
    ----------
    grid
        Input grid, of width W.
    distance
        z [m], of either sign but not zero.
    wavelength
        In vacuum [m].
    """
    cutoff = [size / (wavelength * abs(distance)) for size in grid.size]
    return cutoff[0], cutoff[1]


def _wider_limits(grid: Grid, window: Grid, distance: float, wavelength: float) -> Pair:
    free = sampling.band_limits(window, distance, wavelength)
    cutoff = corrected_cutoff(grid, distance, wavelength)
    return max(free[0], cutoff[0]), max(free[1], cutoff[1])


_CIRCLE = PassBand("band_limited_circular", RECTANGLE.limits, circular=True)
_WIDER_CIRCLE = PassBand("corrected_band_limited", _wider_limits, circular=True)


def band_limited_circular(field: Field, distance: float | Array, pad: float, grid: Grid | None) -> Field:
    """Field by the circle of radius f_max (the thesis' 2.4.2); an ellipse on unequal windows."""
    return spectral(field, distance, _CIRCLE, pad, grid)


def corrected_band_limited(field: Field, distance: float | Array, pad: float, grid: Grid | None) -> Field:
    """Field by the circle of radius max(f_max, W/(λz)) (the thesis' 2.4.3); W is the input's width."""
    return spectral(field, distance, _WIDER_CIRCLE, pad, grid)


def multi_step_fresnel(field: Field, distance: float, pad: float, grid: Grid | None) -> Field:
    r"""Steps of dz = W²/(Nλ), each of which keeps the pitch (the thesis' 2.3.1), the rest by its spectrum.

    Each step is one FFT between two chirps exp(iπj²/N). The distance need not be a multiple of dz: what
    is left, less than one step, is multiplied by exp(-iπλzf²), which such a short way samples without
    aliasing. The axes are independent, so that a window may be oblong. The window has an even number of
    samples, because only then a chirp of N samples is periodic; on it the result equals the unpadded
    paraxial angular spectrum to rounding.
    """
    output = grid or field.grid
    first = output.samples_to(field.grid)
    window = Grid(window_shape(field.grid, output, pad, first, (2, 2)), field.grid.pitch)
    _check_steps(field, window, distance, (first, output))
    steps = sampling.fresnel_step(window, field.wavelength)
    data = conjugate_if(distance < 0, field.data)
    for axis, n, step, offset, n_out in zip((-2, -1), window.shape, steps, first, output.shape, strict=True):
        data = _steps_along(data, axis, n, abs(distance) / step)
        data = arrays.namespace(data).roll(data, -offset, axis=axis)
        data = data[..., :n_out, :] if axis == -2 else data[..., :n_out]
    data = data * carrier(abs(distance), field.wavelength)
    return replace(field, data=conjugate_if(distance < 0, data), grid=output)


def _check_steps(field: Field, window: Grid, distance: float, target: tuple[tuple[int, int], Grid]) -> None:
    shortest = min(sampling.fresnel_step(window, field.wavelength))
    if abs(distance) > MOST_STEPS * shortest:
        raise SamplingError(
            f"multi_step_fresnel over {abs(distance):.4g} m takes {abs(distance) / shortest:.0f} steps of "
            f"{shortest:.4g} m, more than {MOST_STEPS}. Use method='band_limited', or a coarser pitch."
        )
    item = 8 if arrays.is_single(field.data) else 16
    samples = math.prod(field.data.shape[:-2]) * math.prod(window.shape)
    check_memory(3 * item * samples, f"multi_step_fresnel on {window.shape[0]} x {window.shape[1]} samples")
    farthest = tuple(map(reach, field.grid.shape, target[0], target[1].shape))
    wave = (distance, field.wavelength)
    sampling.warn(
        sampling.unlimited_aliases("multi_step_fresnel", window, *wave)
        or sampling.light_wraps(window, (math.inf, math.inf), (farthest[0], farthest[1]), *wave)
    )


def _steps_along(data: Array, axis: int, n: int, steps: float) -> Array:
    """Carry data over `steps` times dz along one axis, on a periodic window of `n` samples (even)."""
    whole = math.floor(steps + 1e-9)
    rest = max(steps - whole, 0.0)
    j = np.arange(n)
    chirp = np.exp(1j * math.pi * (j * j % (2 * n)) / n)
    factor = np.exp(-0.25j * math.pi) / math.sqrt(n)
    data = _padded(data, axis, n)
    for index in range(whole):
        data = data * along(chirp if index == 0 else factor * chirp * chirp, data, axis)
        data = arrays.fft(data, axis=axis, overwrite=True)
    if whole:
        data = data * along(factor * chirp, data, axis)
    if rest > 0:  # λ dz f² = N p² (k/(N p))² = k²/N
        frequency = np.fft.fftfreq(n, 1 / n)
        transfer = np.exp(-1j * math.pi * (rest * frequency**2 / n % 2))
        data = arrays.fft(data, axis=axis) * along(transfer, data, axis)
        data = arrays.ifft(data, axis=axis, overwrite=True)
    return data


def _padded(data: Array, axis: int, n: int) -> Array:
    """Zeros behind the samples of one axis, up to `n` of them."""
    missing = n - data.shape[axis]
    if missing == 0:
        return data
    xp = arrays.namespace(data)
    one = data[..., :1, :] if axis == -2 else data[..., :1]
    shape = list(data.shape)
    shape[axis] = missing
    return xp.concat([data, xp.broadcast_to(xp.zeros_like(one), tuple(shape))], axis=axis)


register("band_limited_circular", band_limited_circular, differentiable=True)
register("corrected_band_limited", corrected_band_limited, differentiable=True)
register("multi_step_fresnel", multi_step_fresnel, paraxial=True)
