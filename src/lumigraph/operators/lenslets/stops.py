"""The stop of a lens of glass as places of the lenslets see it: an ellipse that changes over the field."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.special import j1

from lumigraph.elements.field_plate import VignettedPupil
from lumigraph.operators.sampling import cells as _cells
from lumigraph.operators.sampling import field_lenses
from lumigraph.operators.sampling.optics import Optics

COUNTS = (3, 5, 7, 9)
"""Places along each axis whose stops are taken."""

SHARE = 0.3
"""Part of the accuracy that stops between them may be off by."""

Transform = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""At frequencies (y, x) [1/m], of the stop's image behind a lenslet, over the round one's area."""


@dataclass(frozen=True, slots=True)
class StopEllipse:
    """The image of a stop behind a lenslet.

    Parameters
    ----------
    along, across
        Half widths along a direction and across it [m].
    direction
        From +x towards +y [rad].
    middle
        From where a round stop has it, along the direction [m].
    round
        Half width of the round stop's [m].
    """

    along: float
    across: float
    direction: float
    middle: float
    round: float

    @property
    def area(self) -> float:
        """Area of the ellipse over the round stop's."""
        return self.along * self.across / self.round**2

    def transform(self, y: np.ndarray, x: np.ndarray) -> np.ndarray:
        """A `Transform`; light of a place u of the stop arrives at -u."""
        sin, cos = math.sin(self.direction), math.cos(self.direction)
        along, across = x * cos + y[:, None] * sin, y[:, None] * cos - x * sin
        turns = 2 * math.pi * np.hypot(self.along * along, self.across * across)
        disc = np.where(turns == 0, 1, 2 * j1(turns) / np.where(turns == 0, 1, turns))
        return self.area * disc * np.exp(2j * np.pi * self.middle * along)


def disc_of(radius: float) -> Transform:
    """Fourier transform of a round stop's image of a radius [m], 1 in the middle."""

    def transform(y: np.ndarray, x: np.ndarray) -> np.ndarray:
        turns = 2 * np.pi * radius * np.hypot(y[:, None], x)
        return np.where(turns == 0, 1, 2 * j1(turns) / np.where(turns == 0, 1, turns))

    return transform


@dataclass(frozen=True, slots=True, eq=False)
class Stops:
    """Ellipses whose images, weighed, are those of all cells.

    Parameters
    ----------
    ellipses
        At some places; none of a stop that is the same from everywhere.
    weights
        Of each (n, rows, columns) in the cells of the image.
    area
        Of the stops that cells see (rows, 1, columns, 1), over the round one's.
    left
        How far off cells between the places are, relative rms.
    """

    ellipses: tuple[StopEllipse, ...] = ()
    weights: tuple[np.ndarray, ...] = ()
    area: np.ndarray | float = 1.0
    left: float = 0.0


def of(optics: Optics) -> Stops:
    """Stops of a camera's cells; those of a lens of glass before pixels that respond to angles are round."""
    camera = optics.camera
    plate = field_lenses.plate_of(camera)
    if plate is None or plate.openings is None or _cells.accepted(camera) is not None:
        return Stops()
    round_one = camera.pupil_diameter / 2 * _cells.telecentric_distance(camera) / camera.separation
    seen = _StopView(plate.openings, camera.wavelength, camera.separation, round_one)
    places = _places(optics)
    half = [max(abs(at[0]), abs(at[-1]), 1e-9) for at in places]
    tried = [seen.at(half[0] * y, half[1] * x) for y, x in field_lenses.TRIED]
    found, left = Stops(), math.inf
    for count in COUNTS:
        nodes = field_lenses.nodes(count)
        ellipses = tuple(seen.at(half[0] * y, half[1] * x) for y in nodes for x in nodes)
        left = _left(ellipses, tried, count, round_one)
        rows, columns = (field_lenses.lagrange(count, at / far) for at, far in zip(places, half, strict=True))
        weights = np.einsum("iy,jx->ijyx", rows, columns).reshape(-1, len(places[0]), len(places[1]))
        area = np.tensordot([one.area for one in ellipses], weights, 1)[:, None, :, None]
        found = Stops(ellipses, tuple(weights), area, left)
        if left <= SHARE * optics.fineness.accuracy:
            break
    return found


def _places(optics: Optics) -> tuple[np.ndarray, np.ndarray]:
    """Middles of the image's cells along y and x [m]."""
    cells = optics.cells
    y, x = (
        edge + (np.arange(n + 2 * ring) - ring + 0.5) * size
        for edge, size, n, ring in zip(cells.edge, cells.size, cells.count, cells.ring, strict=True)
    )
    return y, x


@dataclass(frozen=True, slots=True)
class _StopView:
    """A stop so far away, as places of the lenslets see it; `round`, its image's half width if round."""

    openings: VignettedPupil
    wavelength: float
    separation: float
    round: float

    def at(self, y: float, x: float) -> StopEllipse:
        """Stop seen from a place [m], where objects appear whose images lie on the other side of the axis."""
        field = math.hypot(y, x) / self.separation
        along, across = self.openings.at(field, self.wavelength)
        middle = self.openings.middle(field) * self.round
        return StopEllipse(along * self.round, across * self.round, math.atan2(-y, -x), middle, self.round)


def _left(ellipses: tuple[StopEllipse, ...], tried: list[StopEllipse], count: int, radius: float) -> float:
    """Relative rms error of stops between others, at the worst of those tried."""
    worst = 0.0
    for (y, x), one in zip(field_lenses.TRIED, tried, strict=True):
        down, across = (field_lenses.lagrange(count, np.array([at]))[:, 0] for at in (y, x))
        worst = max(worst, _off(ellipses, np.outer(down, across).ravel(), one, radius))
    return worst


def _off(ellipses: tuple[StopEllipse, ...], shares: np.ndarray, one: StopEllipse, radius: float) -> float:
    """Rms difference of transforms, over the frequencies that the stop passes."""
    at = np.linspace(-1.5, 1.5, 25) / radius
    found = sum(share * each.transform(at, at) for share, each in zip(shares, ellipses, strict=True))
    expected = one.transform(at, at)
    return float(np.linalg.norm(found - expected) / np.linalg.norm(expected))
