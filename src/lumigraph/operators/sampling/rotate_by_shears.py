"""Planes turned about the axis by three shears: shifts of rows or columns, exact for band-limited planes.

M. Unser, P. Thévenaz and L. Yaroslavsky, "Convolution-based interpolation for fast, high-quality rotation
of images", IEEE Trans. Image Process. 4, 1371 (1995).
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from lumigraph.core import arrays
from lumigraph.core.arrays import Array
from lumigraph.core.grid import Grid
from lumigraph.core.linear import Linear, Shape


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class CroppedPlane(Linear):
    """A plane without its margin.

    Parameters
    ----------
    whole
        Samples (y, x) of the plane.
    margin
        Samples (y, x) that go on each side.
    """

    whole: tuple[int, int]
    margin: tuple[int, int]

    title: ClassVar[str] = "A plane without its margin"

    @property
    def shape(self) -> tuple[Shape, Shape]:
        """Shapes of what is left, and of the plane."""
        y, x = (n - 2 * m for n, m in zip(self.whole, self.margin, strict=True))
        return (y, x), self.whole

    def _forward(self, intensity: Array) -> Array:
        (y, x), (ny, nx) = self.margin, self.whole
        return intensity[y : ny - y, x : nx - x]

    def _adjoint(self, raw: Array) -> Array:
        return arrays.framed(raw, self.margin, self.whole)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class ShearRotation(Linear):
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

    title: ClassVar[str] = "A plane turned by shears"

    @property
    def shape(self) -> tuple[Shape, Shape]:
        """Shapes of the plane, twice."""
        return self.grid.shape, self.grid.shape

    def _forward(self, intensity: Array) -> Array:
        for shifts, axis in self._shears():
            intensity = _shifted(intensity, shifts, axis)
        return intensity

    def _adjoint(self, raw: Array) -> Array:
        for shifts, axis in reversed(list(self._shears())):
            raw = _shifted(raw, -shifts, axis)
        return raw

    def _shears(self) -> Iterator[tuple[np.ndarray, int]]:
        slant = math.tan(self.angle / 2)
        along_x = slant * self.grid.y / self.grid.pitch[1]
        yield along_x, 1
        yield -math.sin(self.angle) * self.grid.x / self.grid.pitch[0], 0
        yield along_x, 1


def turn_margin(size: tuple[float, float], angle: float) -> tuple[float, float]:
    """Margin (y, x) [m] around a plane of a size that `ShearRotation` by an angle needs."""
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
