"""A mask in the main lens' stop: phases and openings as smooth surfaces over few control points."""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy

from lumigraph.core import checks
from lumigraph.core.field import Field
from lumigraph.core.grid import Grid
from lumigraph.elements.transmission import transmit
from lumigraph.errors import GeometryError

Points = tuple[tuple[float, ...], ...]

LEAST, MOST = 2, 64
"""Control points along an axis."""


@dataclass(frozen=True)
class PupilMask:
    r"""Phase mask, coded aperture or diffuser in the stop of a main lens.

    Both surfaces are cubic B-splines, whose control points stand evenly over the square around the stop,

    .. math:: t(y, x) = \sum_{jk} a_{jk} B_j(y) B_k(x)\; e^{2\pi i \sum_{jk} w_{jk} B_j(y) B_k(x)}

    so that control points from 0 to 1 make an opening from 0 to 1, and alike ones an even one.

    Parameters
    ----------
    diameter
        Width of the square [m].
    waves
        Control points (n, n) of the phase [waves of the camera's light]; None for none.
    opening
        Control points (n, n) of the amplitude that is let through, 0 to 1; None for all.

    Raises
    ------
    GeometryError
        A table that is not square, has too few or too many points, or numbers out of range.

    Examples
    --------
    >>> mask = PupilMask(2e-3, opening=((0.5, 0.5), (0.5, 0.5)))
    >>> round(float(mask.amplitude(np.zeros(1), np.zeros(1))[0]), 6), round(mask.area, 6)
    (0.5, 0.25)
    """

    diameter: float
    waves: Points | None = None
    opening: Points | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "diameter", checks.positive("diameter", self.diameter))
        for name, field in (("phase", "waves"), ("open", "opening")):
            object.__setattr__(self, field, _table(name, getattr(self, field)))
        if self.opening is not None:
            low, high = min(map(min, self.opening)), max(map(max, self.opening))
            if low < 0 or high > 1 or not high:
                raise GeometryError(
                    f"open goes from {low:g} to {high:g} but amplitudes are from 0 to 1, and somewhere above."
                )

    def phase(self, y: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Phase [rad] at places that broadcast [m]."""
        return 2 * math.pi * self._at(self.waves, y, x, 0.0)

    def amplitude(self, y: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Amplitude that is let through at places that broadcast [m], 0 to 1."""
        return self._at(self.opening, y, x, 1.0)

    def basis(self, at: np.ndarray, count: int) -> np.ndarray:
        """Matrix (places, count) from control points along an axis to places [m]."""
        return self._along(np.eye(count), at)

    def transmission(self, grid: Grid, wavelength: float) -> np.ndarray:
        """Complex factor (ny, nx) of each sample."""
        y, x = grid.y[:, None], grid.x
        return self.amplitude(y, x) * np.exp(1j * self.phase(y, x))

    @cached_property
    def area(self) -> float:
        """Part of even light in the round stop that is let through."""
        at = (np.arange(256) + 0.5) / 128 - 1
        inside = np.hypot(at[:, None], at) < 1
        return float(np.mean(self.amplitude(*np.ix_(*[at * self.diameter / 2] * 2))[inside] ** 2))

    @cached_property
    def steepest(self) -> float:
        """Steepest slope of the phase [waves to half of the diameter]."""
        if self.waves is None:
            return 0.0
        at = np.linspace(-1, 1, 257) * self.diameter / 2
        waves = self.phase(at[:, None], at) / (2 * math.pi)
        return float(max(np.abs(np.diff(waves, axis=k)).max() for k in (0, 1))) * 128

    def _at(self, given: Points | None, y: np.ndarray, x: np.ndarray, none: float) -> np.ndarray:
        if given is None:
            return np.full(np.broadcast_shapes(np.shape(y), np.shape(x)), none)
        points = np.array(given)
        if np.ndim(y) == 2 and np.shape(y)[1] == 1 and np.ndim(x) == 1:  # a grid: one axis after the other
            return self.basis(y[:, 0], len(points)) @ points @ self.basis(x, len(points)).T
        places = np.broadcast_arrays(*(self._number(at, len(points)) for at in (y, x)))
        return scipy.ndimage.map_coordinates(points, places, order=3, prefilter=False, mode="nearest")

    def _along(self, points: np.ndarray, at: np.ndarray) -> np.ndarray:
        """Values (places, n) at places of splines whose control points (k, n) stand along an axis."""
        edged = np.pad(points, ((2, 2), (0, 0)), mode="edge")
        at = np.clip(self._number(at, len(points)), 0, len(points) - 1) + 1
        first = np.minimum(np.floor(at).astype(int), len(points))
        u = (at - first)[:, None]
        weights = (1 - u) ** 3, 3 * u**3 - 6 * u**2 + 4, -3 * u**3 + 3 * u**2 + 3 * u + 1, u**3
        return sum((w * edged[first + k] for k, w in enumerate(weights)), np.zeros(())) / 6

    def _number(self, at: np.ndarray, count: int) -> np.ndarray:
        """Places, counted in control points from the first."""
        return (np.asarray(at) / (self.diameter / 2) + 1) / 2 * (count - 1)

    def __call__(self, field: Field) -> Field:
        """The field just behind the mask."""
        return transmit(self, field)


def _table(name: str, points: object) -> Points | None:
    if points is None:
        return None
    try:
        found = np.array(points, np.float64)
    except (TypeError, ValueError):
        found = np.zeros(0)
    if found.ndim != 2 or len({*found.shape}) != 1 or not LEAST <= len(found) <= MOST:
        raise GeometryError(
            f"{name} has shape {found.shape} but must be a square table of {LEAST} x {LEAST} to "
            f"{MOST} x {MOST} control points."
        )
    if not np.isfinite(found).all():
        raise GeometryError(f"{name} has values that are not finite.")
    return tuple(tuple(float(one) for one in row) for row in found)
