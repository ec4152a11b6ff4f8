r"""Effects of lenslets that differ from each other on measures, by rays.

Decentre, tilt and form of a lenslet move the centroid of the light behind it. Places of a point behind the
lenslets that see it, each with its share w of the light, then have an additional slope over the lenslets'
places r, by the shifts s:

.. math:: \frac{\sum w (r - \bar r) \cdot s}{\sum w |r - \bar r|^2}

Derivation, and the sum over lenslets (`changes`): docs/theory/tolerance.md.
"""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Protocol

import numpy as np

from lumigraph.core import coverage
from lumigraph.elements import form
from lumigraph.elements.scatter import LensletWarp
from lumigraph.errors import GeometryError
from lumigraph.instruments import LensletCamera, Lenslets
from lumigraph.instruments.capabilities import Rendered
from lumigraph.instruments.tolerances import EACH, FORM, MISSING, TILT

_ACROSS = 128
"""Rays across the stop."""

_NODES = 24
"""Nodes of quadrature across a lenslet."""

Errors = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]
"""Errors of lenslets: factors of focal lengths, decentres along columns and rows [m], and presence."""


class LensletDifferences(Protocol):
    """Differences between lenslets, as `lumigraph.elements.scatter.Scatter` has them."""

    def of(self, i: np.ndarray, j: np.ndarray) -> Errors:
        """Errors of lenslets (i, j)."""
        ...

    def warp(self, i: np.ndarray, j: np.ndarray) -> LensletWarp:
        """Additional paths through lenslets (i, j)."""
        ...


@dataclass(frozen=True, slots=True)
class DifferingLenslet:
    """A single lenslet that differs from all others, which are as described.

    Parameters
    ----------
    index
        Of the lenslet (i, j).
    factor
        Of its focal length.
    down, across
        Decentre of its vertex along columns and rows [m].
    there
        Whether it is.
    turns
        By how much it turns light along columns and rows [rad].
    terms
        Of the path through it, by number: those of `lumigraph.elements.form` [m].
    """

    index: tuple[int, int]
    factor: float = 1.0
    down: float = 0.0
    across: float = 0.0
    there: bool = True
    turns: tuple[float, float] = (0.0, 0.0)
    terms: Mapping[int, float] = field(default_factory=dict)

    def of(self, i: np.ndarray, j: np.ndarray) -> Errors:
        """Errors of lenslets (i, j), as `LensletDifferences.of`."""
        mine = (i == self.index[0]) & (j == self.index[1])
        return (
            np.where(mine, self.factor, 1.0), np.where(mine, self.down, 0.0),
            np.where(mine, self.across, 0.0), np.where(mine, self.there, True),
        )  # fmt: skip

    def warp(self, i: np.ndarray, j: np.ndarray) -> LensletWarp:
        """Additional paths, as `LensletDifferences.warp`."""
        mine = (i == self.index[0]) & (j == self.index[1])
        terms = np.zeros((*mine.shape, len(form.TERMS)))
        for k, size in self.terms.items():
            terms[mine, k] = size
        down, across = (np.where(mine, turn, 0.0) for turn in self.turns)
        return LensletWarp(down, across, terms)


@dataclass(frozen=True, slots=True, eq=False)
class AxisView:
    """Lenslets that see the point on the axis, in the object's plane.

    Parameters
    ----------
    indices
        (k, 2), as (i, j).
    shares
        Of the point's light (k,), by rays; they sum to 1.
    """

    indices: np.ndarray
    shares: np.ndarray

    @classmethod
    def of(cls, camera: LensletCamera) -> "AxisView":
        """Lenslets that see the point in a camera as built.

        Raises
        ------
        GeometryError
            No lenslet sees the point.
        """
        image = camera.image_distance
        side = (2 * np.arange(_ACROSS) + 1) / _ACROSS - 1
        y, x = (part.ravel() for part in np.meshgrid(side, side, indexing="ij"))
        inside = y**2 + x**2 <= 1
        cone = camera.pupil_diameter / 2 * abs(camera.separation - image) / image
        i, j = camera.lattice.index(cone * y[inside], cone * x[inside])
        wide = int(np.ptp(j)) + 1
        counts = np.bincount((i - i.min()) * wide + j - j.min())
        (seen,) = np.nonzero(counts)
        indices, counts = np.stack([seen // wide + i.min(), seen % wide + j.min()], -1), counts[seen]
        there = camera.lenslets.holds(camera.lattice.position(indices))
        if not there.any():
            raise GeometryError("no lenslet sees the point on the axis. Use more lenslets, or less offset.")
        return cls(indices[there], counts[there] / counts[there].sum())


@dataclass(frozen=True, slots=True)
class SingleLensletStudy:
    """Effects of lenslets that differ on measures.

    Parameters
    ----------
    factor
        Of the focal length of the lenslet that gets most of the light of a point on the axis.
    strehl
        Of its form alone: brightness of a point amid the image over that without.
    slope
        Of that point's images behind its lenslets, over the lenslets' places.
    light
        Part of its light that is not lost on missing lenslets.
    corner
        Of the last micro-image (y, x) [m], in physical coordinates.
    """

    factor: float = 1.0
    slope: float = 0.0
    light: float = 1.0
    corner: tuple[float, float] = (0.0, 0.0)
    strehl: float = 1.0

    @classmethod
    def of(
        cls, camera: LensletCamera, differ: LensletDifferences, sight: AxisView | None = None
    ) -> "SingleLensletStudy":
        """Effects in a camera as built.

        Raises
        ------
        GeometryError
            All lenslets but one are missing that see a point.
        """
        sight = AxisView.of(camera) if sight is None else sight
        i, j = sight.indices.T
        factor, *_, there = differ.of(i, j)
        terms = differ.warp(i, j).terms[sight.shares.argmax()]
        corner = _shifts(camera, differ, last(camera.lenslets))[0]
        return cls(
            float(factor[sight.shares.argmax()]), _slope(camera, differ, sight),
            float(sight.shares @ there), (float(corner[0]), float(corner[1])),
            _strehl(terms / camera.wavelength),
        )  # fmt: skip


def _shifts(camera: LensletCamera, differ: LensletDifferences, indices: np.ndarray) -> np.ndarray:
    """Shifts (k, 2), (y, x), of all that is behind lenslets (k, 2) [m]."""
    i, j = indices.T
    factor, down, across, _ = differ.of(i, j)
    sin, cos = coverage.sides(camera.lattice.rotation)
    focal = np.asarray(camera.lenslets.focal_length)
    focal = focal[camera.lattice.kind(i, j) % len(focal)] * factor
    warp, half = differ.warp(i, j), camera.lenslets.pitch * camera.lenslets.fill_factor / 2
    slopes = form.slopes(warp.terms / half)
    down, across = down / focal + warp.down + slopes[0], across / focal + warp.across + slopes[1]
    turns = np.stack([down * cos + across * sin, across * cos - down * sin], -1)
    return turns * camera.lenslet_distance


def _strehl(waves: np.ndarray) -> float:
    """Strehl ratio of a lenslet whose form has these terms [waves]."""
    if not waves.any():
        return 1.0
    at, weight = np.polynomial.legendre.leggauss(_NODES)
    wave = np.exp(2j * np.pi * form.path(waves, at, at))
    return float(abs(weight @ wave @ weight / 4) ** 2)


def _slope(camera: LensletCamera, differ: LensletDifferences, sight: AxisView) -> float:
    if not isinstance(camera, Rendered) or len(sight.indices) < 2:
        return 0.0
    there = differ.of(*sight.indices.T)[3]
    if there.sum() < 2:
        raise GeometryError(
            f"{int(there.sum())} of the {len(there)} lenslets that see a point are there, and one alone "
            "measures no depth. Let fewer be missing."
        )
    places, shares = camera.lattice.position(sight.indices[there]), sight.shares[there][:, None]
    places = places - (shares * places).sum(0) / shares.sum()
    moved = shares * places * _shifts(camera, differ, sight.indices[there])
    return float(moved.sum() / (shares * places**2).sum())


Values = Callable[[LensletDifferences], Mapping[str, float]]
"""Measures of a camera whose lenslets differ so."""


def changes(camera: LensletCamera, name: str, size: float, values: Values) -> dict[str, tuple[float, float]]:
    """Effect and bend of independent errors of all lenslets, by the names of measures.

    Each is the root of the sum of squares over the lenslets. Whether a lenslet is there is no small error,
    but what a point loses with one of them adds up all the same.

    Parameters
    ----------
    camera
        As described.
    name, size
        Of a tolerance below "lenslets.each", and one standard deviation [SI].
    values
        What is measured where one lenslet differs.
    """
    usual = values(DifferingLenslet((0, 0)))
    squares = {key: np.zeros(2) for key in usual}
    for more, less in _pairs(camera, name, size):
        above, below = values(more), usual if less is None else values(less)
        for key, value in usual.items():
            if less is None:  # there or not: the whole difference, by the deviation of a chance
                squares[key] += (size * (above[key] - value)) ** 2, 0.0
            else:
                squares[key] += (
                    ((above[key] - below[key]) / 2) ** 2, ((above[key] + below[key]) / 2 - value) ** 2
                )  # fmt: skip
    return {key: (math.sqrt(effect), math.sqrt(bend)) for key, (effect, bend) in squares.items()}


def _pairs(
    camera: LensletCamera, name: str, size: float
) -> Iterator[tuple[DifferingLenslet, DifferingLenslet | None]]:
    """Lenslets that matter with one deviation either way, one after the other; with each missing."""
    seen = {(int(i), int(j)) for i, j in (*AxisView.of(camera).indices, *last(camera.lenslets))}
    for index in sorted(seen):
        if name == MISSING:
            yield DifferingLenslet(index, there=False), None
        elif name == f"{EACH}focal_length":
            part = size / camera.lenslets.focal_length[0]
            yield DifferingLenslet(index, factor=1 + part), DifferingLenslet(index, factor=1 - part)
        elif name == FORM:
            part = size / math.sqrt(len(form.TERMS))
            for k in range(len(form.TERMS)):
                yield DifferingLenslet(index, terms={k: part}), DifferingLenslet(index, terms={k: -part})
        elif name == TILT:
            turn = size * ((camera.lenslets.index or 1.0) - 1)
            for turns in ((turn, 0.0), (0.0, turn)):
                yield (
                    DifferingLenslet(index, turns=turns),
                    DifferingLenslet(index, turns=(-turns[0], -turns[1])),
                )
        else:
            yield DifferingLenslet(index, down=size), DifferingLenslet(index, down=-size)
            yield DifferingLenslet(index, across=size), DifferingLenslet(index, across=-size)


@lru_cache(maxsize=16)
def last(lenslets: Lenslets) -> np.ndarray:
    """Index of the last lenslet (1, 2)."""
    return lenslets.indices()[-1:]
