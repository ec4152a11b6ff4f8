r"""How light in the lenslet plane reaches one cell of the image, exactly.

The main lens' light has a band limit, so what it does near a cell follows from samples of it. Behind the
lenslets it goes the distance b to the image in the Fresnel approximation,

.. math:: E(s) = \frac{1}{i \lambda b} \int G(w) \, T(w) \, e^{i \pi (s - w)^2 / (\lambda b)} \, d^2w

with the lenslets' phases and borders T. The integral is taken lenslet by lenslet by Gauss-Legendre
quadrature, so that borders are sharp, whatever the sampling. Lenslets far from the cell matter less and
less: the last pitch of those that are followed fades out.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from lumigraph.elements import LensletArray

SLACK = 1.04
"""How much wider than D/(λL) the band is taken: grey pixels at the stop's edge reach beyond it."""

STEP = 2
"""Points between those of the window: an amplitude has half the band of its intensity."""

FAINTEST = 1e-5
"""Weight of a line of light that is left out."""

Limits = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Axis:
    """One axis of a cell and of the window of light around it, both centred on the cell.

    Parameters
    ----------
    size
        Of the cell [m].
    points, samples
        Of the light and of the image, along the cell.
    neighbourhood
        How far beyond the cell light is followed [m].
    band
        Highest spatial frequency of the light [1/m].
    """

    size: float
    points: int
    samples: int
    neighbourhood: float
    band: float

    @property
    def margin(self) -> int:
        """Points of the window beyond the cell, on each side."""
        return math.ceil(self.neighbourhood * self.points / self.size)

    @property
    def window(self) -> np.ndarray:
        """Positions of every second point of the window [m]: enough for an amplitude."""
        k = np.arange(-self.margin, self.points + self.margin, STEP)
        return ((k + 0.5) / self.points - 0.5) * self.size

    @property
    def image(self) -> np.ndarray:
        """Positions of the image's samples [m]."""
        return ((np.arange(self.samples) + 0.5) / self.samples - 0.5) * self.size

    def basis(self) -> tuple[np.ndarray, Any]:
        """Coefficients (m, window) of band-limited light, and the function that gives their values (x, m).

        They are the discrete prolate sequences of the window: most of a band-limited signal in the fewest
        numbers, and between the samples too.
        """
        x = self.window
        strength, vectors = np.linalg.eigh(np.sinc(2 * self.band * (x[:, None] - x)))
        kept = strength > 1e-10 * strength[-1]
        scaled = vectors[:, kept] / strength[kept]
        return vectors[:, kept].T, lambda at: np.sinc(2 * self.band * (at[:, None] - x)) @ scaled

    def fade(self, at: np.ndarray, pitch: float) -> np.ndarray:
        """Weight of light at positions [m]: 1, and 0 at the end of the neighbourhood."""
        left = np.clip((np.abs(at) - self.size / 2 - self.neighbourhood + pitch) / pitch, 0, 1)
        return np.cos(np.pi / 2 * left) ** 2


@dataclass(frozen=True, slots=True, eq=False)
class Response:
    """Field on a cell's samples: ``core @ vec(down @ light @ across.T)``.

    Parameters
    ----------
    down, across
        (k, window) and (l, window), complex.
    core
        (samples, k l), or None where k and l are the cell's samples themselves.
    """

    down: np.ndarray
    across: np.ndarray
    core: np.ndarray | None


def response(
    axes: tuple[Axis, Axis], array: LensletArray, wavelength: float, distance: float, cell: Any
) -> Response:
    """Of the cell centred at ``cell = (y, x, limits_y, limits_x)`` [m].

    Only lenslets whose centres lie within the limits, from the cell's centre [m], exist.
    """
    center, limits = cell[:2], cell[2:]
    if array.shape == "square" and isinstance(array.focal_length, float):
        pieces = [_straight(axes[k], array, wavelength, distance, (k, center[k], limits[k])) for k in (0, 1)]
        return Response(pieces[0], pieces[1], None)
    return _dense(axes, array, wavelength, distance, cell)


def _straight(
    axis: Axis, array: LensletArray, wavelength: float, distance: float, place: tuple[int, float, Limits]
) -> np.ndarray:
    """Square lenslets: the field (samples, window) along one axis."""
    which, center, limits = place
    step = abs(array.lattice.basis[1 - which][which])
    coefficients, light = axis.basis()
    half, total = array.fill_factor * step / 2, np.zeros((axis.samples, len(coefficients)))
    count = nodes(half, min(map(abs, _focal(array))), axis, (wavelength, distance))
    reach = axis.size / 2 + axis.neighbourhood
    for middle in _row(array.lattice.origin[which] - center, step, reach, limits):
        at, weight = legendre(middle - half, middle + half, count)
        phase = np.exp(-1j * np.pi * (at - middle) ** 2 / (wavelength * _focal(array)[0]))
        weight = weight * axis.fade(at, step)
        total = total + (_spread(axis.image, at, wavelength * distance) * (weight * phase)) @ light(at)
    return total @ coefficients


def _row(origin: float, step: float, reach: float, limits: Limits) -> Iterator[float]:
    """Centres ``origin + k step`` within the reach and the limits."""
    low, high = max(-reach, limits[0]), min(reach, limits[1])
    slack = 1e-9 * step
    for k in range(math.ceil((low - origin - slack) / step), math.floor((high - origin + slack) / step) + 1):
        yield origin + k * step


def _spread(image: np.ndarray, light: np.ndarray, squared: float) -> np.ndarray:
    """Fresnel propagation from positions of light to those of the image, along one axis; λb is `squared`."""
    return np.exp(1j * np.pi * (image[:, None] - light) ** 2 / squared) / math.sqrt(squared)


def nodes(half: float, focal_length: float, axis: Axis, optics: tuple[float, float]) -> int:
    """Quadrature nodes across a lenslet: two for each turn of the phase, and a few."""
    wavelength, distance = optics
    steepest = half / focal_length + (axis.neighbourhood + axis.size + half) / distance
    return 24 + math.ceil(2 * 2 * half * steepest / wavelength)


def legendre(low: float, high: float, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Positions and weights of Gauss-Legendre quadrature."""
    x, weight = _legendre(count)
    return (low + high) / 2 + x * (high - low) / 2, weight * (high - low) / 2


@cache
def _legendre(count: int) -> tuple[np.ndarray, np.ndarray]:
    return np.polynomial.legendre.leggauss(count)


def _focal(array: LensletArray) -> tuple[float, ...]:
    return array.focal_length if isinstance(array.focal_length, tuple) else (array.focal_length,)


def _dense(
    axes: tuple[Axis, Axis], array: LensletArray, wavelength: float, distance: float, cell: Any
) -> Response:
    """Lenslets of any shape: line after line across each row of them."""
    (down, light_y), (across, light_x) = axes[0].basis(), axes[1].basis()
    n_y, n_x, m_y, m_x = axes[0].samples, axes[1].samples, len(down), len(across)
    lines_y, lines_x = [], []
    pitch, squared = array.lattice.pitch, wavelength * distance
    known: dict[Any, np.ndarray] = {}
    for row, members in _rows(axes, array, cell):
        for y, weight, chord in _lines(array, axes[0], (wavelength, distance)):
            at = np.array([row + y])
            shade = weight * axes[0].fade(at, pitch)
            if shade[0] < FAINTEST * weight:
                continue
            key = (y, chord, members)
            if key not in known:
                known[key] = _line(axes[1], array, (wavelength, distance), key, light_x).astype(np.complex64)
            along = _spread(axes[0].image, at, squared) * shade  # (n_y, 1)
            lines_y.append((along * light_y(at)).astype(np.complex64).ravel())  # (n_y m_y)
            lines_x.append(known[key].ravel())
    if not lines_y:
        return Response(down, across, np.zeros((n_y * n_x, m_y * m_x), np.complex64))
    core = np.array(lines_y).T @ np.array(lines_x)  # (n_y m_y, n_x m_x)
    core = core.reshape(n_y, m_y, n_x, m_x).transpose(0, 2, 1, 3)
    return Response(down, across, core.reshape(n_y * n_x, m_y * m_x))


def _rows(axes: tuple[Axis, Axis], array: LensletArray, cell: Any) -> Iterator[tuple[float, tuple]]:
    """Rows of lenslets: their y, and (x, focal length) of their members."""
    y, x, limits_y, limits_x = cell
    reach = [axis.size / 2 + axis.neighbourhood for axis in axes]
    lattice = array.lattice.moved(-y, -x)
    slack = 1e-9 * lattice.pitch
    low = [max(-r, limit[0]) - slack for r, limit in zip(reach, (limits_y, limits_x), strict=True)]
    high = [min(r, limit[1]) + slack for r, limit in zip(reach, (limits_y, limits_x), strict=True)]
    if low[0] > high[0] or low[1] > high[1]:
        return
    pairs = lattice.indices((low[0], high[0]), (low[1], high[1]))
    focal = np.asarray(_focal(array))
    focal = focal[lattice.kind(pairs[:, 0], pairs[:, 1]) % len(focal)]
    places = lattice.position(pairs)
    for row in np.unique(pairs[:, 0]):
        mine = pairs[:, 0] == row
        members = tuple(
            (round(float(c), 12), float(f)) for c, f in zip(places[mine, 1], focal[mine], strict=True)
        )
        yield float(places[mine, 0][0]), members


def _lines(
    array: LensletArray, axis: Axis, optics: tuple[float, float]
) -> Iterator[tuple[float, float, float]]:
    """Lines across a lenslet: y from its centre, quadrature weight, half the chord [m]."""
    half, shortest = array.fill_factor * array.lattice.pitch / 2, min(map(abs, _focal(array)))
    count = nodes(half, shortest, axis, optics)
    if array.shape == "round":
        angle, weight = legendre(-math.pi / 2, math.pi / 2, count)
        yield from zip(half * np.sin(angle), weight * half * np.cos(angle), half * np.cos(angle), strict=True)
        return
    if array.shape == "square":
        at, weight = legendre(-half, half, count)
        yield from zip(at, weight, np.full(count, half), strict=True)
        return
    corner = half / math.sqrt(3)
    for low, high in ((-2 * corner, -corner), (-corner, corner), (corner, 2 * corner)):
        at, weight = legendre(low, high, max(24, count * 2 // 3))
        yield from zip(at, weight, np.minimum(half, 2 * half - math.sqrt(3) * np.abs(at)), strict=True)


def _line(axis: Axis, array: LensletArray, optics: tuple[float, float], key: Any, light: Any) -> np.ndarray:
    """Field (samples, m) along x of the lenslets of one row, on one line across them."""
    (y, chord, members), (wavelength, distance), total = key, optics, 0.0
    for middle, focal_length in members:
        count = nodes(chord, abs(focal_length), axis, optics)
        at, weight = legendre(middle - chord, middle + chord, count)
        phase = np.exp(-1j * np.pi * ((at - middle) ** 2 + y**2) / (wavelength * focal_length))
        weight = weight * axis.fade(at, array.lattice.pitch)
        total = total + (_spread(axis.image, at, wavelength * distance) * (weight * phase)) @ light(at)
    return np.asarray(total)
