r"""Main lenses whose aberrations change over the field: images of all their points by few lenses.

Intensity behind the lens of a field θ is linear in what that lens makes of two places of light, which is
smooth in θ. So the images of all fields follow from those of a few, chosen ones,

.. math:: A(\theta) = \sum_r \varphi_r(\theta) A_r, \quad
          \varphi_r(\theta) = \sum_k T_{rk} \ell_k(\theta),

with Lagrange's polynomials on n × n Chebyshev nodes and the matrix T of an interpolative decomposition: the
lenses at the nodes from those of some of them. Images of a few points behind all of them tell which,
how many, and how far off fields between the nodes are, which is stated.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from lumigraph.core.grid import Grid
from lumigraph.core.linear import Chain, Linear, Sum
from lumigraph.elements import OF_ONE_LENS, FieldPlate, ThinLens, Train
from lumigraph.errors import GeometryError, SamplingError
from lumigraph.operators.camera import CameraOptics
from lumigraph.operators.let import Let

COUNTS = (3, 5, 7, 9, 11)
"""Nodes along each axis that are tried."""

SHARE = 0.6
"""Part of the accuracy that fields between the nodes may be off by."""

CHOSEN = 0.4
"""Part of the accuracy that lenses at the nodes may be off by that are not chosen."""

Image = Callable[[CameraOptics], np.ndarray]
"""Of some points behind a camera's lens: what tells lenses apart, as one row of numbers."""


def plate_of(camera: CameraOptics) -> FieldPlate | None:
    """What changes over the field; None where nothing does."""
    return next((part for part in camera.lens.elements if isinstance(part, FieldPlate)), None)


def at(camera: CameraOptics, y: float, x: float) -> CameraOptics:
    """The camera with the lens that light of a field has, tangents (y, x)."""
    elements = []
    for part in camera.lens.elements:
        if isinstance(part, FieldPlate):
            plate = part.at(y, x, camera.wavelength)
            if not plate.coefficients and plate.axes == (1.0, 1.0):
                return replace(camera, lens=_ideal(camera, plate.diameter))
            part = plate
        elements.append(part)
    return replace(camera, lens=Train(elements))


def _ideal(camera: CameraOptics, diameter: float) -> Train:
    """A round lens with its stop, whose light is known better than that behind a plate."""
    return Train(replace(p, diameter=diameter) for p in camera.lens.elements if isinstance(p, ThinLens))


def some(camera: CameraOptics) -> list[CameraOptics]:
    """The camera with lenses from all over the field, or itself."""
    plate = plate_of(camera)
    if plate is None:
        return [camera]
    (down, across), steps = plate.aberrations.reach, (-1.0, -0.5, 0.0, 0.5, 1.0)
    if plate.aberrations.y is None:
        return [at(camera, 0.0, across * step) for step in steps[2:]]
    return [at(camera, *plate.aberrations.nearest(a * down, b * across)) for a in steps for b in steps]


def check_one(camera: CameraOptics) -> None:
    """Refuse a camera whose lens changes over the field.

    Raises
    ------
    GeometryError
        It does.
    """
    if plate_of(camera) is not None:
        raise GeometryError(OF_ONE_LENS)


@dataclass(frozen=True, slots=True, eq=False)
class Lenses:
    """Fields whose lenses stand for all others.

    Parameters
    ----------
    chosen
        Their fields (y, x), tangents.
    shares
        Of each chosen lens in those of all nodes (R, n, n).
    middle, half
        Of the fields along y and x that the nodes lie in.
    left
        What fields between the nodes are off by, relative rms, at the worst of those tried.
    """

    chosen: tuple[tuple[float, float], ...]
    shares: np.ndarray
    middle: tuple[float, float]
    half: tuple[float, float]
    left: float

    def weights(self, y: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Of the chosen lenses (R, ny, nx), for fields at y (ny,) and x (nx,)."""
        down, across = (
            lagrange(self.shares.shape[1], (np.asarray(at) - middle) / half)
            for at, middle, half in zip((y, x), self.middle, self.half, strict=True)
        )
        return np.einsum("rij,iy,jx->ryx", self.shares, down, across, optimize=True)

    def of_points(self, fields: np.ndarray) -> np.ndarray:
        """Of the chosen lenses (R, n), for fields (n, 2)."""
        down, across = (
            lagrange(self.shares.shape[1], (fields[:, k] - self.middle[k]) / self.half[k]) for k in (0, 1)
        )
        return np.einsum("rij,in,jn->rn", self.shares, down, across, optimize=True)


def nodes(count: int) -> np.ndarray:
    """Chebyshev's, from -1 to 1."""
    return np.cos(np.pi * (np.arange(count) + 0.5) / count)[::-1]


def lagrange(count: int, at: np.ndarray) -> np.ndarray:
    """Lagrange's polynomials (count, n) on Chebyshev's nodes."""
    known, degree = nodes(count), np.arange(count)
    basis = np.cos(degree[:, None] * np.arccos(known))
    basis[0] /= 2
    clipped = np.clip(at, -1 - 1e-9, 1 + 1e-9)
    return 2 / count * basis.T @ np.cos(degree[:, None] * np.arccos(np.clip(clipped, -1, 1)))


def lenses(
    camera: CameraOptics, fields: tuple[np.ndarray, np.ndarray], image: Image, accuracy: float
) -> Lenses:
    """The fewest lenses that fields along y and along x have, to a part of the accuracy, relative rms.

    Raises
    ------
    GeometryError
        Fields that lie beyond those at which the aberrations are given.
    SamplingError
        Aberrations that change faster than `COUNTS` can follow.
    """
    plate = plate_of(camera)
    assert plate is not None  # asked by those who call
    ends = [(float(at.min()), float(at.max())) for at in fields]
    corners = np.array([(a, b) for a in ends[0] for b in ends[1]])
    plate.aberrations.check(corners[:, 0], corners[:, 1])
    middle = tuple((low + high) / 2 for low, high in ends)
    half = tuple(max((high - low) / 2, 1e-12) for low, high in ends)

    def seen(y: float, x: float) -> np.ndarray:
        field = middle[0] + y * half[0], middle[1] + x * half[1]
        return image(at(camera, *field)).astype(np.float64)

    tried = [(place, seen(*place)) for place in TRIED]
    found = next(
        (f for f in (_lenses(seen, tried, n, accuracy) for n in COUNTS) if f.left <= SHARE * accuracy), None
    )
    if found is None:
        least = _lenses(seen, tried, COUNTS[-1], accuracy).left
        raise SamplingError(
            f"aberrations change so fast over the field that lenses between {COUNTS[-1]} x {COUNTS[-1]} "
            f"others are off by {least:.2g} rms; accuracy {accuracy:g} allows {SHARE * accuracy:.2g}. "
            f"Ask for {least / SHARE:.2g}, or use a smaller field; single points are not interpolated."
        )
    chosen = tuple((middle[0] + y * half[0], middle[1] + x * half[1]) for y, x in found.chosen)
    return replace(found, chosen=chosen, middle=(middle[0], middle[1]), half=(half[0], half[1]))


TRIED = ((0.97, 0.93), (-0.88, 0.31), (0.05, -0.6), (-0.41, -0.77))
"""Fields, of half of them, at which interpolation is measured."""


def _lenses(
    seen: Callable[[float, float], np.ndarray],
    tried: Sequence[tuple[tuple[float, float], np.ndarray]],
    count: int,
    accuracy: float,
) -> Lenses:
    """With so many nodes along each axis, on fields from -1 to 1."""
    places = [(y, x) for y in nodes(count) for x in nodes(count)]
    known = np.array([seen(*place) for place in places])
    picked, shares = decomposed(known, CHOSEN * accuracy)
    found = Lenses(
        tuple((float(places[k][0]), float(places[k][1])) for k in picked),
        shares.reshape(-1, count, count), (0.0, 0.0), (1.0, 1.0), 0.0,
    )  # fmt: skip
    off = 0.0
    for place, expected in tried:
        image = found.of_points(np.array([place]))[:, 0] @ known[picked]
        off = max(off, float(np.linalg.norm(image - expected) / np.linalg.norm(expected)))
    return replace(found, left=off)


def decomposed(rows: np.ndarray, least: float) -> tuple[np.ndarray, np.ndarray]:
    """Rows of which all (n, m) are sums, to a relative rms of `least` each, and their weights (R, n)."""
    gram = rows @ rows.T
    norms, left, picked = np.diag(gram).copy(), np.diag(gram).copy(), []
    factor = np.zeros((len(rows), 0))
    while len(picked) < len(rows) and np.max(left / norms) > least**2:
        k = int(np.argmax(left / norms))
        column = (gram[:, k] - factor @ factor[k]) / math.sqrt(left[k])
        factor, left = np.column_stack((factor, column)), np.maximum(left - column**2, 0)
        picked.append(k)
    mine = np.array(picked or [0])
    return mine, np.linalg.lstsq(rows[mine].T, rows.T, rcond=None)[0]


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class FieldOperator(Sum):
    """Operator of a camera whose main lens changes over the field: of few lenses, each of its share."""

    left: float = 0.0

    title: ClassVar[str] = "Operator of a lens that changes over the field"

    @property
    def error(self) -> float:
        """Of the operators, and of fields between those of their lenses."""
        return math.hypot(max(part.error for part in self.maps), self.left)


def operator(
    camera: CameraOptics, grid: Grid, distance: float, found: Lenses, of: Callable[[CameraOptics], Linear]
) -> FieldOperator:
    """Of a plane at a distance [m], by the operators `of` cameras with one lens."""
    weights = found.weights(grid.y / distance, grid.x / distance).astype(np.float32)
    maps: list[Linear] = []
    for field, weight in zip(found.chosen, weights, strict=True):
        part = of(at(camera, *field))
        maps.append(Chain((Let(weight), part), object_grid=grid))
    return FieldOperator(tuple(maps), (1.0,) * len(maps), left=found.left, object_grid=grid)
