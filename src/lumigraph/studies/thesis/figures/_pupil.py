"""A hard pupil of 5 mm lit by a plane wave: the exact diffraction integral, and every method beside it."""

import warnings
from functools import lru_cache

import numpy as np
from scipy.interpolate import CubicSpline

from lumigraph.core.field import Field
from lumigraph.core.grid import Grid
from lumigraph.elements import CircularAperture
from lumigraph.errors import SamplingWarning
from lumigraph.propagation import propagate
from lumigraph.propagation.angular_spectrum import transfer_function
from lumigraph.propagation.sampling import band_limits
from lumigraph.units import mm, nm, um

WAVELENGTH, RADIUS = 633 * nm, 2.5 * mm
WINDOW = Grid.square(3000, 10 * mm / 3000)
ZOOMED = Grid.square(500, 20 * um)
"""The same 1 cm, where the zoom method puts its samples."""

METHODS: dict[str, tuple[str, float]] = {
    "angular spectrum": ("angular_spectrum", 0.0),
    "band limited (circle)": ("band_limited_circular", 0.0),
    "corrected band limited": ("corrected_band_limited", 0.0),
    "band limited, window doubled": ("band_limited", 1.0),
    "zoom": ("zoom", 0.0),
}
"""(method, padding) by name; the first three are those of the thesis."""


@lru_cache(maxsize=16)
def exact_profile(distance: float) -> CubicSpline:
    """Rayleigh-Sommerfeld integral over the disc as a spline in r: Gauss in radius, trapezoid in angle.

    No propagation method is used. The phase turns by less than 180 rad over the angle and by less than
    210 rad over the radius, which the numbers of nodes resolve to rounding.
    """
    nodes, weights = np.polynomial.legendre.leggauss(100)
    rho = RADIUS * (nodes + 1) / 2
    weights = weights * RADIUS / 2 * rho
    angles = (np.arange(128) + 0.5) * np.pi / 128
    r, k = np.linspace(0, 7.1 * mm, 420), 2 * np.pi / WAVELENGTH
    field = np.empty(r.shape, complex)
    for i, value in enumerate(r):
        more = (value**2 + rho[:, None] ** 2 - 2 * value * rho[:, None] * np.cos(angles)) / distance**2
        way = distance * np.sqrt(1 + more)
        phase = k * distance * more / (1 + np.sqrt(1 + more))
        kernel = np.exp(1j * phase) * distance / way**2 * (1 - 1 / (1j * k * way))
        field[i] = (weights[:, None] * kernel).sum() * 2 * np.pi / len(angles) / (1j * WAVELENGTH)
    return CubicSpline(r, np.abs(field) ** 2)


@lru_cache(maxsize=2)
def pupil(edge: str) -> Field:
    """The pupil with "hard" samples (0 or 1) in the whole window, or "grey" ones in half of it."""
    grid = WINDOW if edge == "hard" else WINDOW.resized(1504)
    stop = CircularAperture(2 * RADIUS, edge="hard" if edge == "hard" else "grey")
    return Field(stop.transmission(grid, WAVELENGTH).astype(np.complex64), grid, WAVELENGTH)


def image(name: str, distance: float, output: Grid | None = None) -> Field:
    """The field at a distance [m] by one of `METHODS`."""
    method, pad = METHODS[name]
    if method == "zoom":
        return propagate(pupil("grey"), distance, method, grid=output or ZOOMED)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SamplingWarning)  # aliasing is what is looked at
        return propagate(pupil("hard"), distance, method, pad, grid=output)


def phase_masked(distance: float) -> Field:
    """The band limit as the thesis' text has it: outside the circle the phase is set to 0, so that H = 1."""
    grid = WINDOW
    limit = band_limits(grid, distance, WAVELENGTH)
    circle = (grid.fy[:, None] / limit[0]) ** 2 + (grid.fx / limit[1]) ** 2 <= 1
    transfer = transfer_function(grid.fy, grid.fx, distance, WAVELENGTH)
    data = np.fft.ifft2(np.fft.fft2(pupil("hard").data) * np.where(circle, transfer, 1.0))
    return Field(data, grid, WAVELENGTH)
