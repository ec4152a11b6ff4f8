"""Planes turned about the axis by three shears: shifts of rows or columns, exact for band-limited planes.

M. Unser, P. Thévenaz and L. Yaroslavsky, "Convolution-based interpolation for fast, high-quality rotation
of images", IEEE Trans. Image Process. 4, 1371 (1995).
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from lumigraph.core import arrays
from lumigraph.core.arrays import Array
from lumigraph.core.grid import Grid


class Linear(Protocol):
    """A linear map of planes (y, x), and its transpose."""

    def forward(self, plane: Array) -> Array:
        """The map."""
        ...

    def adjoint(self, plane: Array) -> Array:
        """Its transpose."""
        ...


@dataclass(frozen=True, slots=True)
class Chain:
    """Linear maps one after the other."""

    maps: tuple[Linear, ...]

    def forward(self, plane: Array) -> Array:
        """From the first to the last."""
        for part in self.maps:
            plane = part.forward(plane)
        return plane

    def adjoint(self, plane: Array) -> Array:
        """The transpose: from the last to the first."""
        for part in reversed(self.maps):
            plane = part.adjoint(plane)
        return plane


@dataclass(frozen=True, slots=True)
class Crop:
    """The plane without a margin of (y, x) samples on each side; `outward`: with zeros around it instead."""

    margin: tuple[int, int]
    outward: bool = False

    def forward(self, plane: Array) -> Array:
        """(y, x) to what is left, or to what it becomes."""
        return self._wider(plane) if self.outward else self._narrower(plane)

    def adjoint(self, plane: Array) -> Array:
        """The other of the two."""
        return self._narrower(plane) if self.outward else self._wider(plane)

    def _narrower(self, plane: Array) -> Array:
        y, x = self.margin
        return plane[y : plane.shape[0] - y, x : plane.shape[1] - x]

    def _wider(self, plane: Array) -> Array:
        xp, (y, x) = arrays.namespace(plane), self.margin
        shape = (plane.shape[0] + 2 * y, plane.shape[1] + 2 * x)
        result = xp.zeros(shape, dtype=plane.dtype, device=plane.device)
        result[y : y + plane.shape[0], x : x + plane.shape[1]] = plane
        return result


@dataclass(frozen=True, slots=True)
class Turn:
    """A plane seen in coordinates that are turned by `angle` [rad], from +x towards +y, about (0, 0).

    The value at (y', x') is that of the plane at x = x' cos - y' sin, y = x' sin + y' cos.

    Parameters
    ----------
    grid
        Samples of the plane, with enough of a margin for its corners: what leaves on one side comes back on
        the other.
    angle
        Up to 45 degrees either way.
    """

    grid: Grid
    angle: float

    def forward(self, plane: Array) -> Array:
        """The plane (y, x), turned."""
        for shifts, axis in self._shears():
            plane = _shifted(plane, shifts, axis)
        return plane

    def adjoint(self, plane: Array) -> Array:
        """Transpose of `forward`."""
        for shifts, axis in reversed(list(self._shears())):
            plane = _shifted(plane, -shifts, axis)
        return plane

    def _shears(self) -> Iterator[tuple[np.ndarray, int]]:
        slant = math.tan(self.angle / 2)
        along_x = slant * self.grid.y / self.grid.pitch[1]
        yield along_x, 1
        yield -math.sin(self.angle) * self.grid.x / self.grid.pitch[0], 0
        yield along_x, 1


def turn_margin(size: tuple[float, float], angle: float) -> tuple[float, float]:
    """Margin (y, x) [m] around a plane of a size that `Turn` by an angle needs."""
    sin, slant = abs(math.sin(angle)), abs(math.tan(angle / 2))
    return size[1] / 2 * sin * 1.1, size[0] / 2 * (sin + 2 * slant) * 1.1


def _shifted(plane: Array, shifts: np.ndarray, axis: int) -> Array:
    """Rows (axis 1) or columns (axis 0) moved by so many samples towards larger coordinates."""
    xp, n = arrays.namespace(plane), plane.shape[axis]
    angles = (
        np.multiply.outer(shifts, np.fft.fftfreq(n)) if axis else np.multiply.outer(np.fft.fftfreq(n), shifts)
    )
    spectrum = arrays.fft(arrays.as_complex(plane), axis=axis)
    phase = arrays.like(np.exp(-2j * np.pi * angles), spectrum)
    return xp.real(arrays.ifft(spectrum * phase, axis=axis))
