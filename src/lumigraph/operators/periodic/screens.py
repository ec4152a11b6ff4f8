"""Opaque screens before the main lens, and what is left in the lens of the light of points behind them.

A point's light spreads to the lens as a cone, so that in the Fresnel approximation a screen multiplies its
amplitude there by a factor that depends on one place of the screen only (docs/theory/periodic.md). Several
screens multiply, which is exact unless edges of two of them stand within some Fresnel zones of each other as
a point sees them. Samples of an opacity are small rectangles; what edges send farther than `FARTHEST` fades
out.
"""

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import product

import numpy as np
from scipy.ndimage import map_coordinates

from lumigraph.core.grid import Grid

FARTHEST = 6.0
"""From an edge to where its diffraction is followed [√(λq/2)]."""

BESIDE = 3.0
"""Points whose cone passes edges at more than this [√(λq/2)] are hidden in full, or not at all."""

HELD = 2048
"""Coordinates of points whose light along an axis is held."""

OPEN, PARTLY, HIDDEN = 0, 1, 2
"""How a point's cone passes the screens."""


@dataclass(frozen=True, slots=True, eq=False)
class Screen:
    """An opaque sheet across the axis.

    Parameters
    ----------
    opacity
        (y, x), 0 to 1: the part of a sample's area that is covered. Beside the grid there is nothing.
    grid
        Its samples [m].
    distance
        To the main lens [m].
    """

    opacity: np.ndarray
    grid: Grid
    distance: float

    def turned(self, angle: float) -> "Screen":
        """Screen in a frame turned about the axis, as lenslets are [rad]; samples get their area's share."""
        if not angle:
            return self
        sin, cos = math.sin(angle), math.cos(angle)
        (cy, cx), (dy, dx), (height, width) = self.grid.center, self.grid.pitch, self.grid.size
        across = max(height, width)
        pitch = max(min(dy / 3, dx / 3, across / 512), across / 1024)
        ny, nx = (
            math.ceil((abs(a * cos) + abs(b * sin)) / pitch) for a, b in ((height, width), (width, height))
        )
        grid = Grid((ny, nx), (pitch, pitch), (cy * cos - cx * sin, cy * sin + cx * cos))
        total = np.zeros(grid.shape)
        for off_y, off_x in product((-0.375, -0.125, 0.125, 0.375), repeat=2):
            v, u = grid.y[:, None] + off_y * pitch, grid.x + off_x * pitch
            at = [(v * cos + u * sin - self.grid.y[0]) / dy, (u * cos - v * sin - self.grid.x[0]) / dx]
            total += map_coordinates(self.opacity, at, order=0, mode="grid-constant")
        return replace(self, opacity=(total / 16).astype(np.float32), grid=grid)


class Shadow:
    """Shadow of a screen in the light of a plane behind it.

    Parameters
    ----------
    screen
        In the frame of the lenslets.
    distance
        Of the plane to the main lens [m].
    wavelength
        [m]
    pupil
        Samples along the main lens, the same for y and x [m].
    """

    def __init__(self, screen: Screen, distance: float, wavelength: float, pupil: np.ndarray) -> None:
        self.opacity, self.pupil = screen.opacity.astype(np.float32), pupil
        self._share, self._widening = screen.distance / distance, 1 - screen.distance / distance
        self._zone = math.sqrt(wavelength * screen.distance * self._widening / 2)
        self._reach = min(FARTHEST, self._zone / (self._widening * (pupil[1] - pupil[0])))
        grid = screen.grid
        self._edges = [
            np.append(c - p / 2, c[-1] + p / 2) for c, p in zip((grid.y, grid.x), grid.pitch, strict=True)
        ]
        self._known: dict[tuple[int, float], tuple[slice, np.ndarray]] = {}

    def passes(self, y: np.ndarray, x: np.ndarray) -> np.ndarray:
        """`OPEN`, `PARTLY` or `HIDDEN` for points at all (y, x) of a grid [m]."""
        half = self._widening * (self.pupil[-1] - self.pupil[0]) / 2 + min(BESIDE, self._reach) * self._zone
        covered = np.pad(self.opacity.cumsum(0, np.float64).cumsum(1), ((1, 0), (1, 0)))
        ends, whole = [], []
        for edges, at in zip(self._edges, (y, x), strict=True):
            low, high = self._share * at - half, self._share * at + half
            first = np.clip(np.searchsorted(edges, low, "right") - 1, 0, len(edges) - 1)
            last = np.clip(np.searchsorted(edges, high), 0, len(edges) - 1)
            ends.append((first, last))
            whole.append((low >= edges[0]) & (high <= edges[-1]))
        (top, bottom), (left, right) = ends
        sums = covered[np.ix_(bottom, right)] - covered[np.ix_(top, right)]
        sums += covered[np.ix_(top, left)] - covered[np.ix_(bottom, left)]
        most = np.outer(bottom - top, right - left)
        hidden = (sums > most - 1e-6) & np.outer(*whole)
        return np.where(hidden, HIDDEN, np.where(sums < 1e-6, OPEN, PARTLY)).astype(np.uint8)

    def amplitude(self, y: float, x: float) -> np.ndarray:
        """Factor (pupil, pupil), complex64, of the amplitude of a point at (y, x) [m]."""
        (rows, down), (columns, across) = self._along(0, y), self._along(1, x)
        covered = self.opacity[rows, columns]
        return 1 - (np.real(down) @ covered + 1j * (np.imag(down) @ covered)) @ across.T

    def _along(self, axis: int, at: float) -> tuple[slice, np.ndarray]:
        """Samples of the opacity, and the amplitude (pupil, samples) that reaches the pupil from them."""
        key = axis, at
        if (found := self._known.get(key)) is None:
            edges, seen = self._edges[axis], self._share * at + self._widening * self.pupil
            far = self._reach * self._zone
            first = int(np.clip(np.searchsorted(edges, seen[0] - far) - 1, 0, len(edges) - 1))
            last = int(np.clip(np.searchsorted(edges, seen[-1] + far) + 1, first + 1, len(edges)))
            t = (edges[first:last] - seen[:, None]) / self._zone
            found = slice(first, last - 1), np.diff(_integral(t, self._reach), axis=1)
            if len(self._known) >= HELD:
                self._known.clear()
            self._known[key] = found
        return found


def _integral(t: np.ndarray, reach: float) -> np.ndarray:
    """Fresnel's integral C + iS over its value at both ends, faded out towards ± reach; complex64."""
    at, real, imaginary = _table(round(reach, 3))
    return (np.interp(t, at, real) + 1j * np.interp(t, at, imaginary)).astype(np.complex64)


@lru_cache(maxsize=64)
def _table(reach: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    at = np.linspace(-reach, reach, 2 * math.ceil(40 * reach * (1 + reach)) + 1)
    fade = np.cos(np.pi / 2 * np.clip(2 * np.abs(at) / reach - 1, 0, 1)) ** 2
    wave = fade * np.exp(0.5j * np.pi * at**2)
    total = np.append(0, np.cumsum(wave[1:] + wave[:-1]))
    total /= total[-1]
    return at, np.real(total), np.imag(total)
