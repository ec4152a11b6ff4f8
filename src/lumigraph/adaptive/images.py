r"""Images of one bead on the pixels, a point or a ball that shines evenly, and their derivatives.

A ball is replaced by 27 points that have its moments up to the seventh order: its middle, 6 points on the
axes, 12 between two of them and 8 between three. Derivation: docs/theory/adaptive.md.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from itertools import product
from typing import Protocol

import numpy as np

from lumigraph.operators.microscope_pupil import PLACES, Lit
from lumigraph.operators.resampling import Part
from lumigraph.scene import Points

OWN = PLACES + 1
"""Unknowns of a bead: y, x, dz and the logarithm of its light."""

STEP = 0.05
"""Step of the spread, for differences of images."""

Q = (18 - math.sqrt(30)) / 7
P, S = (9 - Q) / 5, 9 - 2 * Q

BALL = np.array(list(product((-1, 0, 1), repeat=3)), float)
KINDS = np.abs(BALL).sum(1).astype(int)
"""Coordinates that are not 0."""

BALL *= np.array([1, P, Q, S])[KINDS, None] ** -0.5
"""Points that stand for a ball, from its middle [radii]."""

WEIGHTS = np.array([0, P**3 / 63, Q**3 / 630, S**3 / 2520])[KINDS]
WEIGHTS[KINDS == 0] = 1 - WEIGHTS.sum()
"""Parts of a ball's light at its points."""

SMALL = np.concatenate([np.eye(3), -np.eye(3)]) * math.sqrt(3 / 5)
"""Points, alike, that stand for a ball whose spread is no more than `STEP`: they have its moments up to the
third order."""

Seen = tuple[Part, np.ndarray]
"""Rows and columns of a raw image, and planes (k, rows, columns) there."""


class Images(Protocol):
    """Images of points by Zernike coefficients: `PupilImages` of microscopes, `Star` of cameras."""

    @property
    def shape(self) -> tuple[int, int]:
        """Shape (ny, nx) of a raw image."""
        ...

    def fixed(self, coefficients: np.ndarray) -> "Images":
        """The same with these coefficients (terms,) [waves rms] known, and no terms left."""
        ...

    def lit(
        self, points: Points, coefficients: np.ndarray, directions: np.ndarray | None = None
    ) -> Iterator[Lit]:
        """Image of each point of intensity 1, for coefficients (terms,) [waves rms], around its cell.

        With derivatives along directions (k, terms + 3): by all terms, y, x and dz if left out.
        """
        ...

    def share(self, dz: float) -> float:
        """Part of the raw image that a window takes, of a point at a depth [m]."""
        ...

    def seen(self, images: np.ndarray, cell: tuple[int, int]) -> tuple[Part, np.ndarray]:
        """Part of the raw image that images (k, n, n) of a window around a cell light, and its pixels."""
        ...


def diameter(spread: float, unit: float) -> float:
    """Diameter of a ball [m] whose light has a variance of so many squared units along each axis."""
    return 2 * unit * math.sqrt(5 * spread)


def image_of(images: Images, at: np.ndarray, unit: float) -> Seen:
    """Image (1, rows, columns) of a bead of light 1, by its place and coefficients (3 + terms,).

    With a unit [m] the last coefficient is the bead's spread: see `diameter`. Below 0 it counts as 0.
    """
    return _together(images, at, unit, lambda lit: lit.image[None], np.zeros((0, len(at) - bool(unit))))


def changes_of(images: Images, at: np.ndarray, unit: float) -> Seen:
    """Derivatives (unknowns, rows, columns) of a bead's image by place and light, then by coefficients."""
    n = len(at) - PLACES - bool(unit)

    def own(lit: Lit) -> np.ndarray:
        return np.concatenate([lit.changes[n:], lit.image[None], lit.changes[:n]]).astype(np.float32)

    part, by = _together(images, at, unit, own, None)
    if not unit:
        return part, by
    more = np.append(at[:-1], max(at[-1], 0) + STEP)
    part, planes = _beside([(part, by), image_of(images, more, unit)])
    return part, np.concatenate([planes[:-1], (planes[-1:] - planes[PLACES:OWN]) / np.float32(STEP)])


def _together(
    images: Images, at: np.ndarray, unit: float, planes: Callable[[Lit], np.ndarray], along: np.ndarray | None
) -> Seen:
    """Planes of a bead's points, by directions as `Images.lit` takes them."""
    places, weights = _points(max(at[-1], 0) if unit else 0.0)
    radius = diameter(max(at[-1], 0), unit) / 2
    points = Points(at[:PLACES] + radius * places, np.ones(len(places)))
    lit = images.lit(points, at[PLACES : len(at) - bool(unit)], along)
    seen = [images.seen(planes(one), one.cell) for one in lit]
    part = _around([one for one, _ in seen])
    found = weights[0] * _placed(seen[0], part)
    for weight, one in zip(weights[1:], seen[1:], strict=True):
        found += weight * _placed(one, part)
    return part, found


def _points(spread: float) -> tuple[np.ndarray, np.ndarray]:
    """Points (k, 3) that stand for a ball, in radii, and their parts of its light."""
    if spread > STEP:
        return BALL, WEIGHTS
    return (SMALL, np.full(6, 1 / 6)) if spread else (np.zeros((1, 3)), np.ones(1))


def _beside(seen: Sequence[Seen]) -> Seen:
    """All planes, one after another, on the pixels that any of them lights."""
    part = _around([one for one, _ in seen])
    return part, np.concatenate([_placed(one, part) for one in seen])


def _around(parts: Sequence[Part]) -> Part:
    """The part that holds all of them."""
    rows, columns = (
        slice(min(one[k].start for one in parts), max(one[k].stop for one in parts)) for k in (0, 1)
    )
    return rows, columns


def _placed(seen: Seen, part: Part) -> np.ndarray:
    """Planes (k, rows, columns) of a part, where another one holds it."""
    own, planes = seen
    beside = [(a.start - b.start, b.stop - a.stop) for a, b in zip(own, part, strict=True)]
    return np.pad(planes, ((0, 0), *beside))
