"""Measures of light on a plane, coherent or not: how wide, how divergent, how coherent."""

import math
from collections.abc import Callable, Iterator

import numpy as np

from lumigraph.core import checks
from lumigraph.core.arrays import to_numpy
from lumigraph.core.field import Field
from lumigraph.core.grid import Grid
from lumigraph.core.modes import CoherentModes
from lumigraph.errors import GeometryError, LumigraphError

Pair = tuple[float, float]


def beam_width(light: Field | CoherentModes) -> Pair:
    """Root mean square of the intensity about its middle (y, x) [m]; half of ISO 11146's beam radius.

    Raises
    ------
    LumigraphError
        No light, or not one field (y, x).

    Examples
    --------
    >>> beam = Field(np.eye(3)[[1]], Grid((1, 3), 1.0), 500e-9)
    >>> beam_width(beam)
    (0.0, 0.0)
    """
    return _along(lambda axis: math.sqrt(_moments(_modes(light), axis)[0]))


def divergence(light: Field | CoherentModes) -> Pair:
    """Root mean square of the direction sines about their mean (y, x), from the angular spectrum.

    Free space does not change it. A hard edge has no such number: it grows with the samples.

    Raises
    ------
    LumigraphError
        No light, or not one field (y, x).
    """
    return _along(lambda axis: math.sqrt(_moments(_modes(light), axis)[1]))


def beam_quality(light: Field | CoherentModes) -> Pair:
    r"""M² (y, x): how many times more divergent than a Gaussian beam of the same waist.

    .. math:: M^2 = \frac{4 \pi}{\lambda}
              \sqrt{\langle x^2 \rangle \langle \theta^2 \rangle - \langle x \theta \rangle^2}

    Lenses without aberrations and free space do not change it.

    Raises
    ------
    LumigraphError
        No light, not one field (y, x), or several wavelengths.

    References
    ----------
    A. E. Siegman, Proc. SPIE 1224, 2 (1990).
    """
    modes = _modes(light)
    if len(modes.fields) > 1:
        raise LumigraphError(
            f"the light has {len(modes.fields)} wavelengths but M² is that of one. "
            "Give CoherentModes(light.fields[k])."
        )

    def quality(axis: int) -> float:
        squared, angles, both = _moments(modes, axis)
        return 4 * math.pi / modes.wavelengths[0] * math.sqrt(max(squared * angles - both**2, 0.0))

    return _along(quality)


def degree_of_coherence(light: Field | CoherentModes, at: Pair = (0.0, 0.0)) -> np.ndarray:
    r"""Complex degree of coherence µ (y, x) of each sample with the sample nearest to a place.

    .. math:: \mu(r) = \frac{\langle U(r) U^*(r_0) \rangle}{\sqrt{I(r) \, I(r_0)}}

    At equal times, all wavelengths together; 0 where there is no light.

    Parameters
    ----------
    light
        On one grid.
    at
        The place r0 (y, x) [m].

    Raises
    ------
    GeometryError
        A place outside the grid, or wavelengths on different grids.
    LumigraphError
        No light there.

    Examples
    --------
    >>> noise = np.array([[[1.0, 1.0]], [[1.0, -1.0]]])
    >>> degree_of_coherence(CoherentModes(Field(noise, Grid((1, 2), 1.0), 500e-9))).real.tolist()
    [[0.0, 1.0]]
    """
    modes = _modes(light)
    row, column = _index(modes.grid, checks.pair("at", at))
    mutual, intensity = np.zeros(modes.grid.shape, np.complex128), np.zeros(modes.grid.shape)
    for mode, _ in _each(modes):
        mutual += mode * mode[row, column].conj()
        intensity += np.abs(mode) ** 2
    if intensity[row, column] <= 0:
        raise LumigraphError(f"there is no light at ({at[0]:.4g}, {at[1]:.4g}) m. Choose another place.")
    norm = np.sqrt(intensity * intensity[row, column])
    return np.divide(mutual, norm, out=np.zeros_like(mutual), where=norm > 0)


def overall_coherence(light: Field | CoherentModes) -> float:
    r"""Overall degree of coherence of a plane: 1 of a single mode, 1/n of n equal ones.

    .. math:: \frac{\iint |J(r_1, r_2)|^2 \, d^2 r_1 d^2 r_2}{\left( \int I(r) \, d^2 r \right)^2}

    That of a Gaussian-Schell source is the inverse of its M² along y and x.

    Raises
    ------
    LumigraphError
        No light.

    References
    ----------
    P. Vahimaa and J. Turunen, Opt. Express 14, 1376 (2006).
    """
    modes = _modes(light)
    assert modes.grid
    data = np.concatenate([to_numpy(f.data).reshape(f.data.shape[0], -1) for f in modes.fields])
    overlap = np.abs(data.conj() @ data.T) ** 2
    return float(overlap.sum(dtype=float) / float(modes.power) ** 2 * math.prod(modes.grid.pitch) ** 2)


def _along(measure: Callable[[int], float]) -> Pair:
    return measure(0), measure(1)


def _modes(light: Field | CoherentModes) -> CoherentModes:
    modes = CoherentModes(light) if isinstance(light, Field) else light
    checks.instance("light", modes, CoherentModes, LumigraphError)
    if float(modes.power) <= 0:
        raise LumigraphError("there is no light. Check the source and the window.")
    return modes


def _each(modes: CoherentModes) -> Iterator[tuple[np.ndarray, Field]]:
    """Every mode (y, x) in double precision, and the field that it is of."""
    for field in modes.fields:
        for mode in to_numpy(field.data):
            yield mode.astype(np.complex128), field


def _moments(modes: CoherentModes, axis: int) -> tuple[float, float, float]:
    """Variances of the place and of the sine along an axis, and how they vary together."""
    sums = np.zeros(6)
    for mode, field in _each(modes):
        grid = field.grid
        places, sines = ((grid.y, grid.fy), (grid.x, grid.fx))[axis]
        places, sines = (np.expand_dims(v, 1 - axis) for v in (places, sines * field.wavelength))
        turned = np.fft.ifft(np.fft.fft(mode, axis=axis) * sines, axis=axis)
        light, tilt = np.abs(mode) ** 2, np.real(mode.conj() * turned)
        found = [light, light * places, light * places**2, tilt, np.abs(turned) ** 2, tilt * places]
        sums += np.array([part.sum() for part in found]) * math.prod(grid.pitch)
    place, squared, sine, angles, both = sums[1:] / sums[0]
    return max(squared - place**2, 0.0), max(angles - sine**2, 0.0), both - place * sine


def _index(grid: Grid, at: Pair) -> tuple[int, int]:
    """Row and column of the sample nearest to a place."""
    found = []
    for name, place, axis in zip("yx", at, (grid.y, grid.x), strict=True):
        nearest = int(np.argmin(np.abs(axis - place)))
        half = (axis[-1] - axis[0]) / max(len(axis) - 1, 1) / 2
        if len(axis) > 1 and abs(axis[nearest] - place) > half * (1 + 1e-9):
            raise GeometryError(
                f"at ({name}) is {place:.4g} m but the grid reaches from {axis[0]:.4g} to {axis[-1]:.4g} m. "
                "Choose a place inside."
            )
        found.append(nearest)
    return found[0], found[1]
