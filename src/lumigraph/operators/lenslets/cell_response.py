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
from functools import cache, cached_property
from typing import Any

import numpy as np
from scipy.special import roots_legendre

from lumigraph.elements import LensletArray
from lumigraph.operators.sampling.cell_axis import INFINITE, MIDDLE, Accepted, Box, CellAxis, Limits, Pair

FEWEST = 24
"""Nodes of a quadrature, however short."""


@dataclass(frozen=True, slots=True, eq=False)
class CellResponse:
    """Field on a cell's samples behind square lenslets: the sum of all ``down @ light @ across.T``.

    Parameters
    ----------
    down, across
        (terms, samples along y, window) and (terms, samples along x, window), complex; one term where the
        two axes are apart.
    """

    down: np.ndarray
    across: np.ndarray


@dataclass(frozen=True, slots=True, eq=False)
class LensletNodes:
    """Of a quadrature along a lenslet; the last two are its edges, which weigh nothing.

    Parameters
    ----------
    off
        Places from the lenslet's middle [m].
    weight
        Of each [m], faded.
    edge
        Part of the light that counts at both edges.
    light
        Values (nodes, m) there, of the numbers that hold light.
    """

    off: np.ndarray
    weight: np.ndarray
    edge: np.ndarray
    light: np.ndarray


class CellLenslets:
    """What a lenslet array does to the light around its cells.

    Parameters
    ----------
    axes
        Of a cell, along y and along x.
    array
        With rows along x.
    wavelength
        [m]
    distance
        To the image [m].
    pixels
        Their angular response and the true distance b that gives the angles [m]; None where it is flat.
    """

    def __init__(
        self, axes: tuple[CellAxis, CellAxis], array: LensletArray, wavelength: float, distance: float,
        pixels: Accepted | None = None,
    ) -> None:  # fmt: skip
        self.axes, self.array, self.pixels = axes, array, pixels
        self.optics = wavelength, distance
        self._bases = axes[0].basis(), axes[1].basis()
        self._nodes: dict[tuple[int, float], LensletNodes] = {}

    @property
    def coefficients(self) -> tuple[np.ndarray, np.ndarray]:
        """Matrices (m, window), along y and along x, to the numbers that hold band-limited light."""
        return self._bases[0][0], self._bases[1][0]

    def values(self, which: int, at: np.ndarray) -> np.ndarray:
        """Light (n, m) at positions along an axis, of the numbers that hold it."""
        return self._bases[which][1](at)

    def response(
        self,
        center: Pair,
        limits: tuple[Limits, Limits] = (INFINITE, INFINITE),
        place: Pair = (0.0, 0.0),
    ) -> CellResponse:
        """Of the cell centred at (y, x) [m], behind square lenslets; others: `lenslet_light`.

        Only lenslets whose centres lie within the limits, along y and x from the cell's centre [m], exist.
        """
        box = place, MIDDLE[1]
        return CellResponse(*(self.along(k, center[k], limits[k], place[k], box) for k in (0, 1)))

    def along(
        self, which: int, center: float, limits: Limits, place: float = 0.0, box: Box = MIDDLE
    ) -> np.ndarray:
        """Square lenslets: the fields (terms, samples, window) along one axis, here of one term.

        A cell with its lenslets is taken as if it stood at `place` [m] from the main lens' axis, one of those
        in a `box`; where lenses are paraxial they are all alike.
        """
        axis, coefficients = self.axes[which], self._bases[which][0]
        total = np.zeros((self.count(box), axis.samples, len(coefficients)), complex)
        for middle in self.middles(which, center, limits):
            total += self._brought(which, middle, place, box)
        return times_real(total, coefficients)

    def count(self, box: Box) -> int:
        """Of terms, for cells centred in a box."""
        return 1

    def middles(self, which: int, center: float, limits: Limits = INFINITE) -> list[float]:
        """Of lenslets along an axis that send light to a cell, from its centre [m]."""
        axis, origin = self.axes[which], self.array.lattice.origin[which] - center
        return list(row(origin, self._step(which), axis.size / 2 + axis.neighbourhood, limits))

    def half(self, which: int) -> float:
        """Of a square lenslet's side [m]."""
        return self.array.fill_factor * self._step(which) / 2

    def on_nodes(self, which: int, middle: float) -> "LensletNodes":
        """Of a quadrature along the lenslet around a place."""
        if (known := self._nodes.get(key := (which, round(middle / self.axes[which].size, 9)))) is None:
            axis, half, (focal_length,) = self.axes[which], self.half(which), focal_lengths(self.array)
            at, weight = legendre(-half, half, nodes(half, focal_length, axis, self.optics))
            off = np.array([*at, -half, half])
            fade = axis.fade(middle + off, self._step(which))
            weight = np.array([*weight, 0.0, 0.0]) * fade
            known = LensletNodes(off, weight, fade[-2:], self.values(which, middle + off))
            self._nodes[key] = known
        return known

    def kernel(
        self, which: int, places: tuple[np.ndarray, ...], place: float = 0.0, box: Box = MIDDLE
    ) -> tuple[np.ndarray, np.ndarray]:
        """Light from nodes of a lenslet: its phase [rad], and (terms, ...) what its amplitude is beside.

        Places are those on the image, of the nodes, and of these from the lenslet's middle [m].
        """
        image, at, off = places
        (wavelength, _), (focal_length,) = self.optics, focal_lengths(self.array)
        squared = math.prod(self.optics)
        phase = np.pi * ((image - at) ** 2 / squared - off**2 / (wavelength * focal_length))
        return phase, self.accepted(image - at)[None] / math.sqrt(squared)

    def _brought(self, which: int, middle: float, place: float, box: Box) -> np.ndarray:
        """Fields (terms, samples, m) of numbers that hold the light, behind the lenslet around a place."""
        one = self.on_nodes(which, middle)
        places = self.axes[which].image[:, None], middle + one.off, one.off
        phase, beside = self.kernel(which, places, place, box)
        return times_real(beside * (np.exp(1j * phase) * one.weight), one.light)

    def _step(self, which: int) -> float:
        return abs(self.array.lattice.basis[1 - which][which])

    def spread(self, image: np.ndarray, light: np.ndarray, tilt: float = 0.0) -> np.ndarray:
        """`fresnel` along an axis, as the pixels count it: whose angles are `tilt` less (tangent).

        Of telecentric places, (s - w)/b is the tangent from the chief ray of the main lens' middle.
        """
        found = fresnel(image, light, math.prod(self.optics))
        return found if self.pixels is None else found * self.accepted(image[:, None] - light, tilt)

    def accepted(self, aside: np.ndarray, tilt: float = 0.0) -> np.ndarray:
        """What the pixels' angular response does to amplitudes that come from so far aside [m]."""
        if self.pixels is None:
            return np.ones_like(aside)
        response, distance = self.pixels
        return response.amplitude(aside / distance - tilt)

    def rows(self, center: Pair, limits: tuple[Limits, Limits]) -> Iterator[tuple[float, list[Pair]]]:
        """Rows of lenslets: their y, and (x, focal length) of their members."""
        lattice, low, high = self.array.lattice.moved(-center[0], -center[1]), [], []
        for axis, (first, last) in zip(self.axes, limits, strict=True):
            reach, slack = axis.size / 2 + axis.neighbourhood, 1e-9 * lattice.pitch
            low.append(max(-reach, first) - slack)
            high.append(min(reach, last) + slack)
        if low[0] > high[0] or low[1] > high[1]:
            return
        pairs = lattice.indices((low[0], high[0]), (low[1], high[1]))
        focal = np.asarray(focal_lengths(self.array))
        focal = focal[lattice.kind(pairs[:, 0], pairs[:, 1]) % len(focal)]
        places = lattice.position(pairs)
        for row in np.unique(pairs[:, 0]):
            mine = pairs[:, 0] == row
            across = places[mine, 1].round(12).tolist()
            yield float(places[mine, 0][0]), list(zip(across, focal[mine].tolist(), strict=True))

    @cached_property
    def lines(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Lines across a lenslet: y from its centre, quadrature weight, half the chord [m]."""
        half = self.array.fill_factor * self.array.lattice.pitch / 2
        steepest = min(map(abs, focal_lengths(self.array)))
        count = nodes(half, steepest, self.axes[0], self.optics)
        if self.array.shape == "round":  # nodes of the angle stand farther apart in the middle
            count = nodes(math.pi / 2 * half, steepest, self.axes[0], self.optics)
            angle, weight = legendre(-math.pi / 2, math.pi / 2, count)
            chord = half * np.cos(angle)
            return half * np.sin(angle), weight * chord, chord
        corner, pieces = half / math.sqrt(3), []
        count = nodes(2 * corner, steepest, self.axes[0], self.optics)
        for low, high in ((-2 * corner, -corner), (-corner, corner), (corner, 2 * corner)):
            share = (high - low) / (4 * corner)
            at, weight = legendre(low, high, FEWEST + math.ceil(share * (count - FEWEST)))
            pieces.append((at, weight, np.minimum(half, 2 * half - math.sqrt(3) * np.abs(at))))
        y, weight, chord = (np.concatenate(part) for part in zip(*pieces, strict=True))
        return y, weight, chord


def times_real(rows: np.ndarray, real: np.ndarray) -> np.ndarray:
    """Complex rows (..., n, k) times a real matrix, as two real products."""
    parts = np.stack([np.real(rows), np.imag(rows)]) @ real
    return parts[0] + 1j * parts[1]


def row(origin: float, step: float, reach: float, limits: Limits) -> Iterator[float]:
    """Centres ``origin + k step`` within the reach and the limits."""
    low, high = max(-reach, limits[0]), min(reach, limits[1])
    slack = 1e-9 * step
    for k in range(math.ceil((low - origin - slack) / step), math.floor((high - origin + slack) / step) + 1):
        yield origin + k * step


def fresnel(image: np.ndarray, light: np.ndarray, squared: float) -> np.ndarray:
    """Fresnel propagation from positions of light to those of the image, along one axis; λb is `squared`."""
    return np.exp(1j * np.pi * (image[:, None] - light) ** 2 / squared) / math.sqrt(squared)


def nodes(half: float, focal_length: float, axis: CellAxis, optics: Pair) -> int:
    """Quadrature nodes across a lenslet: two for each turn of the phase, and a few."""
    wavelength, distance = optics
    steepest = half / abs(focal_length) + (axis.neighbourhood + axis.size + half) / distance
    return FEWEST + math.ceil(2 * 2 * half * steepest / wavelength)


def legendre(low: float, high: float, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Positions and weights of Gauss-Legendre quadrature."""
    x, weight = _legendre(count)
    return (low + high) / 2 + x * (high - low) / 2, weight * (high - low) / 2


@cache
def _legendre(count: int) -> tuple[np.ndarray, np.ndarray]:
    return roots_legendre(count)[:2]


def focal_lengths(array: LensletArray) -> tuple[float, ...]:
    """Of each kind of lenslet [m]."""
    return array.focal_length if isinstance(array.focal_length, tuple) else (array.focal_length,)


def sphere(squared: Any, radius: float) -> Any:
    """Sagitta √(r² + ρ²) - |r| of a sphere, with its radius' sign, without cancellation [m]."""
    return math.copysign(1, radius) * squared / (np.sqrt(radius * radius + squared) + abs(radius))


def bent(squared: np.ndarray, focal_length: float, distance: float) -> np.ndarray:
    """Path that an ideal lenslet takes away at a squared distance from its middle [m].

    The one between the points at `distance` behind it, b, and at a before it, 1/a = 1/f - 1/b.
    """
    inverse = 1 / focal_length - 1 / distance
    flat = abs(inverse) * distance < 1e-9
    before = squared * inverse / 2 if flat else sphere(squared, 1 / inverse)
    return sphere(squared, distance) + before
