"""Light in the output that a band-limited propagation loses with the frequencies it drops."""

import math

import numpy as np

from lumigraph.core.arrays import Array, to_numpy
from lumigraph.core.field import Field
from lumigraph.core.grid import Grid

FEWEST_FREQUENCIES = 100
"""Least frequencies in the band, else "auto" takes zoom: band-limited has 51 dB by 158, 45 dB by 63."""
LARGEST_ERROR = 1e-2
"""Relative rms error that is let pass."""
DARK = 1e-10
"""An output with less than this part of the light counts as dark: its error is of no interest."""
_NEAR = 0.9 + 0.1 * np.sqrt((np.arange(7) + 0.5) / 7)  # of the limit; uneven, to miss the zeros of a square


def dropped_light(
    method: str, window: Grid, limits: tuple[float, float], fields: tuple[Field, Grid, Array], distance: float
) -> str | None:
    r"""Warning text if frequencies that were dropped carry light of the output; else None.

    The band's end acts as an edge in the spectrum: along x it adds a wave from x_e = x_0 + λ z f_max,

    .. math:: |\Delta U(x)|^2 \approx \frac{|A(f_{max})|^2}{\lambda z} \, t^2, \qquad
              t = \min\left(\frac12, \frac{\sqrt{\lambda z}}{2\pi |x - x_e|}\right)

    with t = 1 beyond x_e, where the light is missing. The estimate is within a factor of three for slits,
    squares, circles and Gaussian beams. It is made where few frequencies pass or the output lies beside the
    input; elsewhere the band limit leaves out nothing that lands in the output.

    Parameters
    ----------
    method
        Name of the method.
    window
        Window of the calculation.
    limits
        Highest frequencies (y, x) that are kept [1/m].
    fields
        Input, output grid, and the output's intensity (..., y, x).
    distance
        [m].
    """
    field, output, intensity = fields
    grid, wavelength = field.grid, field.wavelength
    kept = [min(limit, 0.5 / pitch) for limit, pitch in zip(limits, grid.pitch, strict=True)]
    numbers = [round(2 * f * size) for f, size in zip(kept, window.size, strict=True)]
    limited = [n for n, f, pitch in zip(numbers, kept, grid.pitch, strict=True) if f < 0.5 / pitch]
    passing = min(limited, default=min(numbers))
    few = bool(limited) and passing < FEWEST_FREQUENCIES
    centers = zip(output.center, grid.center, grid.size, strict=True)
    beside = any(abs(there - here) > size / 2 for there, here, size in centers)
    if not few and not beside:
        return None
    data = to_numpy(field.data).reshape(-1, *grid.shape)
    light = np.square(np.abs(data)).sum(0, dtype=np.float64)
    arrived = float(to_numpy(intensity).sum(dtype=np.float64)) * math.prod(output.pitch)
    power = max(arrived, DARK * float(light.sum()) * math.prod(grid.pitch))
    if not power > 0:
        return None
    waves = math.sqrt(wavelength * abs(distance))
    lost = sum(
        _lost(np.moveaxis(data, 1 + k, 2), light.sum(1 - k), (grid, output), k, kept[k], waves)
        for k in (0, 1)
    )
    error = math.sqrt(lost / power)
    if error <= LARGEST_ERROR:
        return None
    cure = "Use method='auto', which takes zoom there" if few else "Use a finer input pitch"
    return (
        f"{method} over {abs(distance):.4g} m keeps {passing} frequencies, up to {min(kept):.4g} /m, and the "
        f"light that it drops makes some {100 * min(error, 1.0):.3g} % rms of the output wrong. "
        f"{cure}, or a wider pad."
    )


def _lost(
    data: np.ndarray, light: np.ndarray, grids: tuple[Grid, Grid], axis: int, limit: float, waves: float
) -> float:
    """Light (power) that an axis' band limit puts wrong in the output; `data` has that axis last."""
    grid, output = grids
    at, there = ((g.y, g.x)[axis] for g in grids)
    middle = float(light @ at) / max(float(light.sum()), np.finfo(float).tiny)
    total = 0.0
    for side in (-1, 1):
        wave = np.exp(-2j * np.pi * np.outer(at, side * limit * _NEAR)).astype(data.dtype)
        density = float(np.mean(np.square(np.abs(data @ wave)).sum((0, 1), dtype=np.float64)))
        gap = side * (middle - there) + waves**2 * limit
        share = np.where(gap < 0, 1.0, np.minimum(0.5, waves / (2 * np.pi * np.maximum(gap, 1e-3 * waves))))
        total += density * float(np.mean(share**2)) * output.size[axis] / waves**2
    return total * math.prod(grid.pitch) * grid.pitch[axis]
