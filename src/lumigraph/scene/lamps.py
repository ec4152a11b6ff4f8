"""Shapes of lamps over the sines of their directions: transforms in closed form, and nodes of quadratures."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.polynomial import legendre
from scipy.special import j1

from lumigraph.core import checks
from lumigraph.core.grid import Grid
from lumigraph.core.short_repr import brief
from lumigraph.errors import GeometryError

Pair = tuple[float, float]
Nodes = tuple[np.ndarray, np.ndarray]


@dataclass(frozen=True, slots=True)
class Disc:
    """An even disc about the axis, of a radius that is a sine."""

    radius: float

    def __post_init__(self) -> None:
        _check_sine("radius", self.radius)

    @property
    def half_size(self) -> Pair:
        """Largest sines along y and x."""
        return self.radius, self.radius

    @property
    def solid_angle(self) -> float:
        """Area of what is lit, in squared sines."""
        return math.pi * self.radius**2

    def transform(self, y: Any, x: Any) -> np.ndarray:
        """2 J1(t)/t, t = radius · hypot(y, x)."""
        t = self.radius * np.hypot(y, x)
        return np.where(t < 1e-6, 1.0, 2 * j1(t) / np.where(t < 1e-6, 1.0, t))

    def nodes(self, y: float, x: float, more: int) -> Nodes:
        """Rings of Gauss and Legendre, each of as many even angles as its size asks for."""
        radians = self.radius * math.hypot(y, x)
        unit, weight = legendre.leggauss(math.ceil(radians / 4) + 1 + more)
        sines, shares = [], []
        for ring, (place, share) in enumerate(zip((unit + 1) / 2, weight, strict=True)):
            count = math.ceil(radians * place) + 1 + 2 * more
            angles = 2 * np.pi * (np.arange(count) / count + 0.618 * ring)
            sines.append(self.radius * place * np.stack([np.sin(angles), np.cos(angles)], axis=1))
            shares.append(np.full(count, share * place / count))
        return np.concatenate(sines), np.concatenate(shares)

    def scaled(self, factor: float) -> "Disc":
        """The same, seen under other angles."""
        return Disc(self.radius * abs(factor))


@dataclass(frozen=True, slots=True)
class Rectangle:
    """An even rectangle about the axis, from minus to plus the sines (y, x)."""

    half_size: Pair

    def __post_init__(self) -> None:
        for name, sine in zip("yx", self.half_size, strict=True):
            _check_sine(f"half_size ({name})", sine)

    @property
    def solid_angle(self) -> float:
        """Area of what is lit, in squared sines."""
        return 4 * math.prod(self.half_size)

    def transform(self, y: Any, x: Any) -> np.ndarray:
        """A product of sin(t)/t, t = y · sine."""
        return np.sinc(self.half_size[0] * np.asarray(y) / np.pi) * np.sinc(
            self.half_size[1] * np.asarray(x) / np.pi
        )

    def nodes(self, y: float, x: float, more: int) -> Nodes:
        """Gauss and Legendre's along both axes."""
        along = [
            legendre.leggauss(math.ceil(sine * radians / 2) + 1 + more)
            for sine, radians in zip(self.half_size, (y, x), strict=True)
        ]
        places = [sine * unit for sine, (unit, _) in zip(self.half_size, along, strict=True)]
        return _pairs(*places), np.outer(along[0][1], along[1][1]).ravel() / 4

    def scaled(self, factor: float) -> "Rectangle":
        """The same, seen under other angles."""
        return Rectangle((self.half_size[0] * abs(factor), self.half_size[1] * abs(factor)))


@dataclass(frozen=True, slots=True, eq=False)
class PictureLamp:
    """Pixels (y, x), each evenly bright, on a grid of sines."""

    intensity: np.ndarray
    sines: Grid

    __repr__ = brief

    def __post_init__(self) -> None:
        for name, sine in zip("yx", self.half_size, strict=True):
            _check_sine(f"the picture's largest sine ({name})", sine)

    @property
    def half_size(self) -> Pair:
        """Largest sines along y and x."""
        ends = zip(self.sines.size, self.sines.center, strict=True)
        y, x = (size / 2 + abs(center) for size, center in ends)
        return y, x

    @property
    def solid_angle(self) -> float:
        """Area of what is lit, in squared sines."""
        return float(np.count_nonzero(self.intensity)) * math.prod(self.sines.pitch)

    def transform(self, y: Any, x: Any) -> np.ndarray:
        """Fourier transform of the samples times that of a pixel."""
        y, x = np.broadcast_arrays(np.asarray(y, np.float64), np.asarray(x, np.float64))
        pixel = Rectangle((self.sines.pitch[0] / 2, self.sines.pitch[1] / 2)).transform(y, x)
        down, across = (
            np.exp(-1j * np.multiply.outer(at, sines)) for at, sines in ((y, self.sines.y), (x, self.sines.x))
        )
        found = np.einsum("...v,vu,...u->...", down, self.intensity, across, optimize=True)
        return pixel * found / self.intensity.sum()

    def nodes(self, y: float, x: float, more: int) -> Nodes:
        """Gauss and Legendre's in each lit pixel."""
        half = self.sines.pitch[0] / 2, self.sines.pitch[1] / 2
        counts = [
            math.ceil(sine * radians / 2 - 0.25) + more for sine, radians in zip(half, (y, x), strict=True)
        ]
        along = [legendre.leggauss(max(count, 1)) for count in counts]
        lit = np.nonzero(self.intensity)
        middles = np.stack([self.sines.y[lit[0]], self.sines.x[lit[1]]], axis=1)
        inside = _pairs(half[0] * along[0][0], half[1] * along[1][0])
        weights = np.outer(along[0][1], along[1][1]).ravel() / 4
        light = self.intensity[lit] / self.intensity.sum()
        return (middles[:, None] + inside).reshape(-1, 2), np.outer(light, weights).ravel()

    def scaled(self, factor: float) -> "PictureLamp":
        """The same, seen under other angles; turned by 180° where the factor is below 0."""
        flipped = self.intensity if factor > 0 else self.intensity[::-1, ::-1]
        (py, px), (ny, nx) = self.sines.pitch, self.sines.shape
        # Turned over, the middle sample of an even number is another one.
        step = (0.0, 0.0) if factor > 0 else ((ny - 1 - 2 * (ny // 2)) * py, (nx - 1 - 2 * (nx // 2)) * px)
        y, x = (factor * c - abs(factor) * s for c, s in zip(self.sines.center, step, strict=True))
        size = abs(factor)
        return PictureLamp(flipped, Grid(self.sines.shape, (size * py, size * px), (y, x)))


def fewest(rows: np.ndarray, columns: np.ndarray, accuracy: float, dtype: Any) -> tuple[np.ndarray, float]:
    """Modes (modes, y, x) of waves that are products of `rows` (y, waves) and `columns` (x, waves).

    The brightest eigenvectors, as many as keep the intensity 1 of each sample to an accuracy; what is missing
    at most. As what is left out has no negative light, the mutual intensity of two samples misses no more.
    """
    share = (rows.conj().T @ rows) * (columns.conj().T @ columns)
    vectors = np.linalg.eigh(share)[1][:, ::-1]
    modes, missing = [], np.einsum("yn,xn->yx", np.abs(rows) ** 2, np.abs(columns) ** 2)
    for vector in vectors.T:
        mode = (rows * vector) @ columns.T
        modes.append(mode.astype(dtype))
        missing -= np.abs(mode) ** 2
        if missing.max() <= accuracy:
            break
    return np.stack(modes), max(float(missing.max()), 0.0)


def check(grid: Grid, wavelength: float, accuracy: float) -> None:
    """Refuse what modes cannot be sampled on, or to."""
    checks.instance("grid", grid, Grid)
    wavelength = checks.positive("wavelength", wavelength)
    if not 0 < checks.finite("accuracy", accuracy, "1") < 1:
        raise GeometryError(f"accuracy is {accuracy:g} but must lie between 0 and 1.")


def _pairs(y: np.ndarray, x: np.ndarray) -> np.ndarray:
    """All of them together (pairs, 2)."""
    return np.stack(np.meshgrid(y, x, indexing="ij"), axis=-1).reshape(-1, 2)


def _check_sine(name: str, sine: float) -> None:
    if checks.positive(name, sine, "1") > 1:
        raise GeometryError(f"{name} is {sine:.4g} but is a sine: radius over distance, at most 1.")
