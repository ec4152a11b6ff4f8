"""Waves to send through a train, computed in double precision and cast last."""

import warnings
from typing import Any

import numpy as np

from lumigraph.core import checks, memory
from lumigraph.core.field import Field
from lumigraph.core.grid import Grid
from lumigraph.errors import GeometryError, SamplingWarning

Pair = tuple[float, float]


def plane_wave(grid: Grid, wavelength: float, tilt: Pair = (0.0, 0.0), dtype: Any = np.complex128) -> Field:
    r"""Plane wave of amplitude 1, turned by `tilt` about the axis.

    .. math:: U = \exp(i k (y \sin\theta_y + x \sin\theta_x))

    Parameters
    ----------
    grid, wavelength
        Where it is sampled, and the wavelength in vacuum [m].
    tilt
        Angles (θy, θx) [rad]: a positive θx travels towards +x.
    dtype
        complex128 or complex64.

    Raises
    ------
    GeometryError
        Angles that no wave has together: sin²θy + sin²θx > 1.

    Examples
    --------
    >>> wave = plane_wave(Grid.square(4, 1e-6), 500e-9, tilt=(0, 0.1))
    >>> round(float(np.angle(wave.data[0, 3])), 6)  # 2π · 1 um · sin(0.1) / 500 nm
    1.254544
    """
    _check(grid, wavelength)
    tilt = checks.pair("tilt", tilt, "rad")
    sines = np.sin(tilt)
    if np.sum(sines**2) > 1:
        raise GeometryError(
            f"tilt is ({tilt[0]:.4g}, {tilt[1]:.4g}) rad: its squared sines add to {np.sum(sines**2):.4g}, "
            "above 1. Use smaller angles."
        )
    warn_if_coarse("a tilted plane wave", grid, wavelength, (abs(sines[0]), abs(sines[1])))
    k = 2 * np.pi / wavelength
    data = np.outer(np.exp(1j * k * sines[0] * grid.y), np.exp(1j * k * sines[1] * grid.x))
    return Field(data.astype(dtype), grid, wavelength)


def point_source(
    grid: Grid,
    wavelength: float,
    distance: float,
    position: Pair = (0.0, 0.0),
    dtype: Any = np.complex128,
    *,
    paraxial: bool = False,
) -> Field:
    r"""Spherical wave of a point `distance` before the grid, of amplitude 1 at 1 m.

    .. math:: U = \exp(i k r) / r, \quad r = \sqrt{z^2 + (y - y_0)^2 + (x - x_0)^2}

    or, paraxial, exp(ikz + ik ρ² / 2z) / z.

    Parameters
    ----------
    grid, wavelength
        Where it is sampled, and the wavelength in vacuum [m].
    distance
        z [m]; negative for a wave that converges to a point behind the grid, exp(-ikr) / r.
    position
        Position of the point (y0, x0) [m].
    dtype
        complex128 or complex64.
    paraxial
        The Fresnel approximation.

    Raises
    ------
    GeometryError
        A distance of zero.
    """
    _check(grid, wavelength)
    if checks.finite("distance", distance) == 0:
        raise GeometryError(
            "distance is 0 m: the point lies in the grid's plane. Give a distance, or a pinhole."
        )
    center = checks.pair("position", position)
    dy, dx = grid.y - center[0], grid.x - center[1]
    sines = tuple(float(np.abs(d).max() / np.hypot(np.abs(d).max(), distance)) for d in (dy, dx))
    warn_if_coarse("a spherical wave", grid, wavelength, (sines[0], sines[1]))
    k = np.copysign(2 * np.pi / wavelength, distance)
    z = abs(distance)
    if paraxial:
        along_y = np.exp(1j * k * (z + dy**2 / (2 * z))).astype(dtype)
        data = np.outer(along_y, (np.exp(1j * k * dx**2 / (2 * z)) / z).astype(dtype))
    else:
        r = np.sqrt(z**2 + dy[:, None] ** 2 + dx**2)
        data = (np.exp(1j * k * r) / r).astype(dtype)
    return Field(data, grid, wavelength)


def gaussian_beam(
    grid: Grid, wavelength: float, waist: float, distance: float = 0.0, dtype: Any = np.complex128
) -> Field:
    r"""Gaussian beam, of amplitude 1 in the middle of its waist.

    .. math:: U = \frac{q_0}{q} \exp\left(i k z + \frac{i k r^2}{2 q}\right), \quad
              q = z + q_0, \quad q_0 = -i \pi w_0^2 / \lambda

    Parameters
    ----------
    grid, wavelength
        Where it is sampled, and the wavelength in vacuum [m].
    waist
        Radius w0 at 1/e of the amplitude [m].
    distance
        z from the waist to the grid [m].
    dtype
        complex128 or complex64.

    References
    ----------
    Siegman, *Lasers*, 1986, section 17.1 (with the time factor exp(-iωt)).

    Examples
    --------
    >>> beam = gaussian_beam(Grid.square(64, 10e-6), 633e-9, 50e-6, distance=0.02)
    >>> round(float(beam.power) / (np.pi * 50e-6**2 / 2), 6)  # kept over distance
    1.0
    """
    _check(grid, wavelength)
    waist = checks.positive("waist", waist)
    k, start = 2 * np.pi / wavelength, -1j * np.pi * waist**2 / wavelength
    q = checks.finite("distance", distance) + start
    along = [np.exp(1j * k * np.square(c) / (2 * q)) for c in (grid.y, grid.x)]
    return Field((start / q * np.exp(1j * k * distance) * np.outer(*along)).astype(dtype), grid, wavelength)


def _check(grid: Grid, wavelength: float) -> None:
    """Refuse what is no grid or wavelength, or a wave that would not fit in memory."""
    checks.instance("grid", grid, Grid)
    wavelength = checks.positive("wavelength", wavelength)
    memory.require_plane(grid.shape, 32, "a wave")


def warn_if_coarse(what: str, grid: Grid, wavelength: float, sines: Pair) -> None:
    """Warn where the phase turns by more than π from sample to sample: dx > λ / (2 sin θ)."""
    for name, pitch, sine in zip("yx", grid.pitch, sines, strict=True):
        if sine * pitch > wavelength / 2 * (1 + 1e-9):
            warnings.warn(
                f"{what} reaches sin θ = {sine:.4g} along {name} but samples every {pitch * 1e6:.4g} µm "
                f"resolve directions up to {wavelength / (2 * pitch):.4g}. Use a finer or smaller grid.",
                SamplingWarning,
                stacklevel=3,
            )
            return
