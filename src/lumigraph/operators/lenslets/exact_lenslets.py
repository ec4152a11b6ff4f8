"""Square lenslets beyond the paraxial: exact phases and distances, as sums of products of one axis each.

Light goes to the sensor by Rayleigh and Sommerfeld's first integral, after lenslets that are thin and free of
spherical aberration, or of glass (`GlassSurface`); a curved side that faces the sensor is followed where it
stands (`CurvedGlassLenslets`). No way, lenslet or sphere of the main lens is a product of a function of y and
one of x, as its paraxial form is, but each is a sum of few: singular values of what is left of it beside its
axes' own phases. See docs/theory/lenslets.md.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import product
from typing import Any

import numpy as np
from numpy.polynomial import chebyshev

from lumigraph.elements import LensletArray
from lumigraph.elements.surface import GlassSurface
from lumigraph.operators.lenslets.cell_response import CellLenslets, bent, focal_lengths, sphere
from lumigraph.operators.sampling import cells as _cells
from lumigraph.operators.sampling.cell_axis import MIDDLE, Accepted, Box, CellAxis, Pair
from lumigraph.operators.sampling.optics import Optics

KEPT = 0.2
"""Part of the accuracy that products may leave out."""

ALIKE = 1e-3
"""How near two singular values are whose vectors may be any in their plane, over their mean."""

Function = Callable[[np.ndarray, np.ndarray], Any]
"""Of places along y and along x [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class Products:
    """A function of two axes: a sum of products of a function of each.

    Parameters
    ----------
    middle, half
        Of each axis' interval [m].
    coefficients
        Of Chebyshev's polynomials there, (n, R) for each axis.
    strength
        Of each product, from 1 on.
    """

    middle: Pair
    half: Pair
    coefficients: tuple[np.ndarray, np.ndarray]
    strength: np.ndarray

    def along(self, which: int, at: np.ndarray) -> np.ndarray:
        """Factors (R, ...) of all products at places on an axis [m]."""
        place, coefficients = (at - self.middle[which]) / self.half[which], self.coefficients[which]
        return np.moveaxis(chebyshev.chebvander(place, len(coefficients) - 1) @ coefficients, -1, 0)

    def turned(self, like: "Products") -> "Products":
        """The same sum, of products that are nearest to those of a function that hardly differs.

        Singular vectors have any phase, and any basis where they are as strong as others.
        """
        (y, x), (own_y, own_x) = self.coefficients, like.coefficients
        strength = self.strength[:, None]
        near = np.abs(strength - like.strength) < ALIKE * (strength + like.strength)
        left, _, right = np.linalg.svd(np.where(near, y.conj().T @ own_y + x.T @ own_x.conj(), 0))
        turn = left @ right
        return replace(self, coefficients=(y @ turn, x @ turn.conj()), strength=like.strength)


def products(
    function: Function, middle: Pair, half: Pair, to: "Terms", bright: Function | None = None
) -> Products:
    """A function of (y, x) [m] as a sum of products of one axis each, but for a part that is left out.

    What is left out is weighed by how `bright` it is at (y, x), a product of both axes' own.
    """
    (nodes, values), like = interpolated(to.count), to.like
    y, x = (m + h * nodes for m, h in zip(middle, half, strict=True))
    down, across = (np.ones(to.count), np.ones(to.count)) if bright is None else bright(y, x)
    left, strength, right = np.linalg.svd(down[:, None] * function(y[:, None], x[None, :]) * across)
    rest = np.sqrt(np.cumsum(strength[::-1] ** 2)[::-1])
    kept = max(1, int((rest > to.least * rest[0]).sum())) if like is None else len(like.strength)
    root = np.sqrt(strength[:kept])
    pair = left[:, :kept] * root / down[:, None], right[:kept].T * root / across[:, None]
    found = Products(middle, half, (values @ pair[0], values @ pair[1]), strength[:kept] / strength[0])
    return found if like is None else found.turned(like)


@dataclass(frozen=True, slots=True)
class Terms:
    """Number of products that a function of two axes is the sum of.

    Parameters
    ----------
    turns
        Of the function across its intervals.
    least
        Part of it that may be left out.
    like
        Of a function that hardly differs: as many, which go over into these.
    """

    turns: float
    least: float
    like: Products | None = None

    @property
    def count(self) -> int:
        """Number of nodes along an axis."""
        return 24 + math.ceil(4 * self.turns) if self.like is None else len(self.like.coefficients[0])


@cache
def interpolated(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Chebyshev's nodes from -1 to 1, and the matrix from values there to coefficients."""
    nodes = np.cos(np.pi * (np.arange(count) + 0.5) / count)
    to = 2 / count * np.cos(np.arange(count)[:, None] * np.arccos(nodes))
    to[0] /= 2
    return nodes, to


def between(at: np.ndarray, count: int) -> np.ndarray:
    """Matrix (places, count) from values at so many of these nodes to those at places from -1 to 1."""
    return chebyshev.chebvander(at, count - 1) @ interpolated(count)[1]


class ExactLenslets(CellLenslets):
    """Lenslets of one focal length, square; see `CellLenslets`.

    Parameters
    ----------
    axes, array, wavelength
        As of `CellLenslets`.
    distance
        Lenslets to sensor, b [m].
    separation
        Main lens to lenslets, L [m].
    accuracy
        Relative rms of the image.
    surface
        Of glass; None where lenslets are ideal.
    """

    def __init__(
        self,
        axes: tuple[CellAxis, CellAxis],
        array: LensletArray,
        wavelength: float,
        distance: float,
        separation: float,
        accuracy: float,
        pixels: Accepted | None = None,
        surface: GlassSurface | None = None,
    ) -> None:
        scale = 1 + distance / separation
        super().__init__(axes, array, wavelength, distance / scale, pixels)
        self.b, self.L, self.scale, self.k = distance, separation, scale, 2 * np.pi / wavelength
        self.least = KEPT * accuracy
        (self.focal_length,) = focal_lengths(array)
        self.surface, self.width = surface, array.fill_factor * array.lattice.pitch / 2
        self._half = self.width if surface is None else self._seen(surface)
        self._terms: dict[Box, tuple[tuple[Products, ...], list[tuple[int, ...]]]] = {}

    def _seen(self, surface: GlassSurface) -> float:
        """Half the width of what is seen of glass [m]."""
        return surface.seen(self.width, self.focal_length)

    def _bent(self, squared: np.ndarray) -> np.ndarray:
        if self.surface is None:
            return bent(squared, self.focal_length, self.b)
        return self.surface.path(squared, self.width, self.focal_length)

    def _bright(self, squared: np.ndarray) -> Any:
        if self.surface is None:
            return 1.0
        return self.surface.amplitude(squared, self.width, self.focal_length)

    def terms(self, box: Box) -> tuple[tuple[Products, ...], list[tuple[int, ...]]]:
        """Sums of products for cells centred in a box (way to the sensor, lenslets, sphere), and those kept.

        Kept are those whose strengths' product counts.
        """
        if box not in self._terms:
            parts = self._parts(box, (None,) * self.sums)
            numbers = product(*(range(len(part.strength)) for part in parts))
            strengths = {n: math.prod(p.strength[k] for p, k in zip(parts, n, strict=True)) for n in numbers}
            self._terms[box] = parts, [n for n, strength in strengths.items() if strength > self.least]
        return self._terms[box]

    def align(self, box: Box, like: "ExactLenslets", theirs: Box) -> None:
        """Take terms in a box that are as those of others in theirs."""
        if box not in self._terms:
            parts, numbers = like.terms(theirs)
            self._terms[box] = self._parts(box, parts), numbers

    sums = 3
    """Of products, whose product light is beside the axes' own phases."""

    def _parts(self, box: Box, like: Sequence[Products | None]) -> tuple[Products, ...]:
        return self._way(box, like[0]), self._lenslet(like[1]), self._sphere_around(box, like[2])

    def _reach(self, box: Box) -> Pair:
        y, x = (
            half + (self.scale + 1) / 2 * axis.size + axis.neighbourhood
            for axis, half in zip(self.axes, box[1], strict=True)
        )
        return y, x

    def _way(self, box: Box, like: Products | None) -> Products:
        b, k, (middle, half) = self.b, self.k, self._ways(box)

        def beside(y: np.ndarray, x: np.ndarray) -> np.ndarray:
            squared = b * b + y * y + x * x
            path = _left(lambda squared: sphere(squared, b), y, x)
            return self._oblique(squared) * (1 + 1j / (k * np.sqrt(squared))) * np.exp(1j * k * path)

        def bright(*places: np.ndarray) -> tuple[np.ndarray, ...]:
            return tuple(self._falling(which, at, box) for which, at in enumerate(places))

        far = max(abs(m) + h for m, h in zip(middle, half, strict=True))
        return products(beside, middle, half, Terms(self._turns(far, b), self.least, like), bright)

    def _ways(self, box: Box) -> tuple[Pair, Pair]:
        """Middle and half of the ways across from lenslets to the sensor, for cells in a box [m]."""
        tilt = self.scale - 1
        middle = box[0][0] * tilt, box[0][1] * tilt
        return middle, self._reach((box[0], (box[1][0] * tilt, box[1][1] * tilt)))

    def _oblique(self, squared: np.ndarray) -> np.ndarray:
        """Amplitude by the squared way, 1 along the axis."""
        return self.b * self.b / squared

    def _falling(self, which: int, at: np.ndarray, box: Box) -> np.ndarray:
        """Edges send light aside that falls with the distance, from a lenslet's own micro-image on."""
        pitch, tilt = self.array.lattice.pitch, self.scale - 1
        falls = np.pi * pitch / math.sqrt(math.prod(self.optics))
        beyond = np.abs(at - box[0][which] * tilt) - box[1][which] * tilt - pitch
        return 1 / (1 + falls * np.maximum(0, beyond) / pitch)

    def _lenslet(self, like: Products | None) -> Products:
        def beside(y: np.ndarray, x: np.ndarray) -> np.ndarray:
            return self._bright(y * y + x * x) * np.exp(-1j * self.k * _left(self._bent, y, x))

        to = Terms(2 * self._turns(self._half, self.b), self.least, like)
        return products(beside, (0.0, 0.0), (self._half, self._half), to)

    def _sphere_around(self, box: Box, like: Products | None) -> Products:
        def beside(y: np.ndarray, x: np.ndarray) -> np.ndarray:
            return np.exp(1j * self.k * _left(lambda squared: sphere(squared, self.L), y, x))

        half = self._reach(box)
        far = max(abs(m) + h for m, h in zip(box[0], half, strict=True))
        return products(beside, box[0], half, Terms(self._turns(far, self.L), self.least, like))

    def _turns(self, far: float, radius: float) -> float:
        """Turns of the phase beside both axes' own, at a corner."""
        corner = np.asarray(far)
        path = _left(lambda squared: sphere(squared, radius), corner, corner)
        return abs(float(path)) * self.k / (2 * np.pi)

    def count(self, box: Box) -> int:
        """Number of products that are kept, for cells centred in a box."""
        return len(self.terms(box)[1])

    def half(self, which: int) -> float:
        """Half of a lenslet's side [m]; of glass, of what is seen of it."""
        return self._half

    def kernel(
        self, which: int, places: tuple[np.ndarray, ...], place: float = 0.0, box: Box = MIDDLE
    ) -> tuple[np.ndarray, np.ndarray]:
        """Phase [rad] and factors (terms, ...), whose products of both axes are added up."""
        (image, at, off), (parts, terms) = places, self.terms(box)
        apart, there = self.scale * image - at + (self.scale - 1) * place, at + place
        way, lenslet, curved, *mixed = (
            part.along(which, one)
            for part, one in zip(parts, self._places(which, (apart, off, there)), strict=True)
        )
        beside = np.stack([
            math.prod((part[m] for part, m in zip(mixed, more, strict=True)), start=way[n])
            * (lenslet[i] * curved[j])
            for n, i, j, *more in terms
        ])  # fmt: skip
        path, beside = self._along_axis(apart, off, beside)
        path = path + sphere(there**2, self.L)
        if self.pixels is not None:
            chief = np.arctan((image + place) / self.L)
            beside *= np.sqrt(self.pixels[0].of(np.arctan(apart / self.b) - chief))
        return self.k * path, beside / math.sqrt(math.prod(self.optics))

    def _places(self, which: int, places: tuple[np.ndarray, ...]) -> tuple[np.ndarray, ...]:
        """Arguments of each sum of products, of ways, places in lenslets and places from the axis [m]."""
        return places

    def _along_axis(
        self, apart: np.ndarray, off: np.ndarray, beside: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Path along one axis [m], and all terms with what this axis alone does to amplitudes."""
        return sphere(apart**2, self.b) - self._bent(off**2), beside


class CurvedGlassLenslets(ExactLenslets):
    """Lenslets of glass whose curved side faces the sensor, followed from that side; see `ExactLenslets`."""

    surface: GlassSurface
    sums = 5

    def _seen(self, surface: GlassSurface) -> float:
        return self.width

    def _bent(self, squared: np.ndarray) -> np.ndarray:
        return (self.surface.index - 1) * self._curved(squared)[0]

    def _bright(self, squared: np.ndarray) -> Any:
        """Amplitude of light along the axis that goes on along it: no power is lost where it is refracted."""
        sag, cosine, _ = self._curved(squared)
        turned = self._turned(cosine)
        return np.sqrt(cosine / turned) / cosine * (turned + cosine) / 2 * self.b / (self.b + sag)

    def _oblique(self, squared: np.ndarray) -> np.ndarray:
        ratio = self.b / np.sqrt(squared)
        return ratio * (1 + ratio) / 2

    def _curved(self, squared: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return self.surface.curved(squared, self.focal_length)

    def _turned(self, cosine: np.ndarray) -> np.ndarray:
        """Cosine of the refracted ray with the normal, by that of the ray in glass."""
        return np.sqrt(1 - self.surface.index**2 * (1 - cosine**2))

    def _parts(self, box: Box, like: Sequence[Products | None]) -> tuple[Products, ...]:
        return (*super()._parts(box, like[:3]), self._mixed(box, 0, like[3]), self._mixed(box, 1, like[4]))

    def _mixed(self, box: Box, which: int, like: Products | None) -> Products:
        """Sum of products by which the sagitta along one axis changes ways along the other."""
        (middle, half), other = self._ways(box), 1 - which

        def beside(*places: np.ndarray) -> np.ndarray:
            return np.exp(1j * self.k * self._longer(places[which], places[other]))

        def bright(*places: np.ndarray) -> tuple[np.ndarray, ...]:
            fall, even = self._falling(other, places[other], box), np.ones(len(places[which]))
            return (even, fall) if which == 0 else (fall, even)

        far = np.asarray(abs(middle[other]) + half[other])
        turns = abs(float(self._longer(np.asarray(self.width), far))) * self.k / (2 * np.pi)
        there = [0.0, 0.0], [self.width, self.width]
        there[0][other], there[1][other] = middle[other], half[other]
        return products(
            beside,
            (there[0][0], there[0][1]),
            (there[1][0], there[1][1]),
            Terms(turns, self.least, like),
            bright,
        )

    def _longer(self, off: np.ndarray, apart: np.ndarray) -> np.ndarray:
        """Extra length of a way across from a place in front of the vertex' plane, beyond both alone [m]."""
        squared, ahead = apart**2, self.b + self._curved(off**2)[0]
        return squared / (np.sqrt(ahead**2 + squared) + ahead) - sphere(squared, self.b)

    def _places(self, which: int, places: tuple[np.ndarray, ...]) -> tuple[np.ndarray, ...]:
        apart, off, there = places
        return (apart, off, there, off, apart) if which == 0 else (apart, off, there, apart, off)

    def _along_axis(
        self, apart: np.ndarray, off: np.ndarray, beside: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        sag, cosine, across = self._curved(off**2)
        turned, ahead = self._turned(cosine), self.b + sag
        way, straight = np.sqrt(ahead**2 + apart**2), np.sqrt(self.b**2 + apart**2)
        leaning = turned + (cosine * ahead + across * off * apart) / way
        alone = (turned + cosine) * (1 + self.b / straight) / 2
        beside = beside * (leaning / alone * (ahead * straight) / (self.b * way))
        return sphere(apart**2, self.b) + self._longer(off, apart) - self._bent(off**2), beside


def _left(path: Callable[[np.ndarray], np.ndarray], y: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Rest of a path by the squared distance, beside those along both axes [m]."""
    return path(y * y + x * x) - path(y * y) - path(x * x)


def lenslets_of(optics: Optics) -> CellLenslets:
    """Lenslets of a camera by its model: paraxial, exact, or of glass curved towards the sensor."""
    camera, (axes, array) = optics.camera, (optics.axes, optics.array)
    if camera.model == "paraxial":
        telecentric = _cells.telecentric_distance(camera)
        return CellLenslets(axes, array, camera.wavelength, telecentric, _cells.accepted(camera))
    distance, accuracy = _cells.lenslet_distance(camera), optics.fineness.accuracy
    glass = camera.surface
    return (ExactLenslets if glass is None or glass.thickness is not None else CurvedGlassLenslets)(
        axes, array, camera.wavelength, distance, camera.separation, accuracy, _cells.accepted(camera),
        camera.surface,
    )  # fmt: skip


def terms_of(optics: Optics) -> int:
    """Products whose sum the light behind square lenslets is."""
    lenslets = lenslets_of(optics)
    return len(lenslets.terms(MIDDLE)[1]) if isinstance(lenslets, ExactLenslets) else 1
