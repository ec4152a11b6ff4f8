r"""Light that lenslets spill into their neighbours' micro-images, and what it does to views.

Behind each lenslet of a camera 1.0 stands a picture of the main lens' stop S, spread by diffraction at the
lenslet's opening. At a way w from the middle of a micro-image is light from lenslets k beside it, which a
view takes for its own lenslet's from direction w. So a part of each corner that it shows stands aside, and
the corner is found aside. Main lens and lenslets act on the same waves: a point's image is as wide as λ over
the stop's angle, and what spills comes from points that are imaged on lenslets' rims. The field of a point at
c is

.. math::
    A(c) = \int S(u) e^{-i \pi \sigma u^2 / \lambda} e^{-2\pi i u c / \lambda}
    \sum_k e^{i \pi (w - k)^2 / \lambda + 2\pi i u k / \lambda} \hat h(u - w + k) \,\mathrm{d}u

with lengths in pitches, λ short for λ b/d², σ how far corners move from view to view, over the way, and ĥ the
transform of a lenslet's opening. Rays put all the light at c = -σ w. Edges are found where
`analysis.crossings` fits them to \|A\|²: what is farther aside than the edge is soft pulls no more.
"""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.interpolate import RegularGridInterpolator
from scipy.special import erf, j1

from lumigraph.core import checks
from lumigraph.core.lattice import Lattice

GREEN = 550e-9
"""Wavelength where none is said [m]."""

FAR, LEAST_ACROSS = 2, 8
"""Neighbours to each side; and lenslets across which light is looked for, beside those that corners move."""

NARROW, _APART = 0.1, 1.1
"""λ b/d² below which it is computed for this, and ratio of those for which it is: what spills is proportional
to it, within 4 % down to 0.015."""

UNSURE = 0.15
"""Of what is taken out, over itself: by wave optics, up to 0.009 of 0.065 is left from view to view."""

_WAYS, _SLOPES = 0.05, 0.5  # steps of ways [pitches] and of σ, between which it is interpolated
_RIM, _STEEP = 0.5, 4.0  # ways and σ beyond which it is taken to be what it is there
_SOFT = 0.3  # pitches: blur of an edge over its sample, as in `analysis.crossings`
_ROUNDS = 8


@dataclass(frozen=True, slots=True)
class Spill:
    """What it depends on, but for the lenslets' distance from the sensor.

    Parameters
    ----------
    lattice
        Of the micro-images [px].
    fill
        Width of a micro-image over their pitch.
    wavelength
        Of the light [m].

    Raises
    ------
    GeometryError
        A wavelength or a fill that is not above 0.
    """

    lattice: Lattice
    fill: float
    wavelength: float

    def __post_init__(self) -> None:
        checks.positive("wavelength", self.wavelength)
        checks.positive("fill", self.fill, "1")

    def aside(self, way: np.ndarray, slope: np.ndarray, width: float) -> np.ndarray:
        """How far (n, 2) [px] views at ways (n, 2) [px] show corners aside.

        Parameters
        ----------
        way
            Of the views.
        slope
            (n,), how far corners move from view to view, over the way.
        width
            λ b/d over the micro-images' pitch: that of the light behind a lenslet d wide.
        """
        (down, right), pitch = self.lattice.basis[0], self.lattice.pitch
        axes = np.array([(down, right), (right, -down)]) / pitch  # along the lattice's rows, and across them
        ways = np.clip(np.asarray(way) @ axes.T / pitch, -_RIM, _RIM)
        slope = np.clip(slope, -_STEEP, _STEEP)
        computed = max(NARROW, _APART ** round(math.log(max(width, NARROW), _APART)))
        lenslets = tuple(map(tuple, (np.array(self.lattice.basis) @ axes.T / pitch).round(9).tolist()))
        table = _table(
            _Waves(computed, self.fill, lenslets, self.lattice.layout == "square"),
            math.ceil(float(np.abs(ways).max()) / _WAYS),
            (math.floor(slope.min()), math.floor(slope.max()) + 2),
        )  # fmt: skip
        return table(np.column_stack([ways, slope])) @ axes * pitch * (width / computed)


@lru_cache(maxsize=16)
def _table(waves: "_Waves", reach: int, slopes: tuple[int, int]) -> RegularGridInterpolator:
    """What `_Waves.aside` gives, of ways up to so many steps and slopes from one to another."""
    line = np.arange(-max(reach, 2), max(reach, 2) + 1) * _WAYS
    moved = np.arange(slopes[0], slopes[1] + _SLOPES / 2, _SLOPES)
    ways = np.stack(np.meshgrid(line, line, indexing="ij"), -1).reshape(-1, 2)
    half = np.array([waves.aside(way, moved) for way in ways[: len(ways) // 2 + 1]])
    found = np.concatenate([half, -half[-2::-1]])  # lenslets on the other side spill the other way
    return RegularGridInterpolator((line, line, moved), found.reshape(len(line), len(line), -1, 2), "cubic")


@dataclass(frozen=True, slots=True)
class _Waves:
    """Light of points before neighbouring lenslets, on a lattice of a basis; all lengths in pitches."""

    width: float
    fill: float
    basis: tuple[tuple[float, ...], ...]
    square: bool

    def aside(self, way: np.ndarray, slopes: np.ndarray) -> np.ndarray:
        """(slopes, 2) Where one view shows corners that move by slopes (m,)."""
        found = []
        across = LEAST_ACROSS + math.ceil(np.abs(slopes).max())
        u = self.directions(across)
        field = self.opened(u, way)
        for slope in slopes:
            light, at = self.light(u, field, slope)
            found.append([_edge(light.sum(1 - k), at + slope * way[k]) for k in (0, 1)])
        return -np.array(found)

    def directions(self, across: int) -> np.ndarray:
        """(y, x, 2) So close that light is told over so many lenslets."""
        step = self.width / across
        half = int(self.fill / 2 / step) + 1
        line = np.arange(-half, half + 1) * step
        return np.stack(np.meshgrid(line, line, indexing="ij"), -1)

    def light(self, u: np.ndarray, field: np.ndarray, slope: float) -> tuple[np.ndarray, np.ndarray]:
        """Of points (y, x), and where they are along either axis, by fields in directions u."""
        step, distance = float(u[1, 0, 0] - u[0, 0, 0]), np.hypot(u[..., 0], u[..., 1])
        stop = np.clip((self.fill / 2 - distance) / step + 0.5, 0, 1)
        count = 2 * len(u)
        bent = stop * field * np.exp(-1j * np.pi * slope * distance**2 / self.width)
        light = np.fft.fftshift(np.abs(np.fft.fft2(bent, (count, count))) ** 2)
        return light, (np.arange(count) - count // 2) * self.width / step / count

    def opened(self, u: np.ndarray, way: np.ndarray) -> np.ndarray:
        """Transform of all lenslets' fields in one view, at directions (y, x, 2)."""
        total: np.ndarray = np.zeros(u.shape[:2], complex)
        steps = np.arange(-FAR, FAR + 1)
        for k in np.stack(np.meshgrid(steps, steps), -1).reshape(-1, 2) @ np.array(self.basis):
            phase = np.pi * ((way - k) ** 2).sum() + 2 * np.pi * u @ k
            total += np.exp(1j * phase / self.width) * self.opening((u - way + k) / self.width)
        return total

    def opening(self, frequency: np.ndarray) -> np.ndarray:
        """Transform of one lenslet: a square, or a disc of the same area for hexagons."""
        if self.square:
            return np.sinc(frequency).prod(-1)
        radius = 2 * math.sqrt(np.pi) * np.maximum(np.hypot(*np.moveaxis(frequency, -1, 0)), 1e-9)
        return 2 * j1(radius) / radius


def _edge(light: np.ndarray, at: np.ndarray) -> float:
    """Where an edge is found in light (n,) that each point at (n,) gives [pitches]."""
    place = 0.0
    for _ in range(_ROUNDS):
        place += float(light @ _half(at - place) / light.sum()) * _PULL
    return place


def _half(way: np.ndarray) -> np.ndarray:
    """How much of a soft edge, sampled by lenslets, lies on the near side of a way: -1/2 to 1/2."""
    ends = np.stack([way + 0.5, way - 0.5])
    risen = ends * erf(ends / (math.sqrt(2) * _SOFT)) + _SOFT * math.sqrt(2 / np.pi) * np.exp(
        -0.5 * (ends / _SOFT) ** 2
    )
    return (risen[0] - risen[1]) / 2


_PULL = 1 / float((np.diff(_half(np.arange(-3, 3, 0.01))) ** 2).sum() / 0.01)
"""How far an edge moves with each part of light that is on one side of it [pitches]."""
