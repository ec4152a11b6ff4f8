r"""The paraxial kernel between two lines of points as a matrix product of even and odd halves.

About the middles of both lines, whose distance is δ, the kernel is a product

.. math:: e^{i\pi (u - x + \delta)^2 / a} = e^{i\pi ((u + \delta)^2 - \delta^2) / a}
          \; e^{-2\pi i u x / a} \; e^{i\pi (x - \delta)^2 / a}, \quad a = \lambda z,

whose middle factor turns even data by real cosines into even, and odd data by real sines into odd. Half of
the points on either side and real matrices: a quarter of the arithmetic of the whole complex matrix.
"""

import math
from dataclasses import dataclass

import numpy as np

from lumigraph.core import arrays
from lumigraph.core.mirrored import by_halves


@dataclass(frozen=True, slots=True, eq=False)
class Halves:
    """Kernel from n points to m, without the factor of the wave's own phase.

    Parameters
    ----------
    before, after
        Chirps (n,) and (m,), the points' distance over sqrt(iλz) among them.
    cosine, sine
        Matrices (m - m // 2, n - n // 2) from the upper half of the points to that of the others.
    """

    before: np.ndarray
    after: np.ndarray
    cosine: np.ndarray
    sine: np.ndarray

    @classmethod
    def of(cls, axes: tuple[np.ndarray, np.ndarray], pitch: float, area: float, like: np.ndarray) -> "Halves":
        """Factors for evenly spaced points, from others `pitch` apart [m], λz [m²]; precision of `like`."""
        there, here = axes
        middles = (there[0] + there[-1]) / 2, (here[0] + here[-1]) / 2
        u, x, off = there - middles[0], here - middles[1], middles[0] - middles[1]
        turns = np.outer(u[len(u) // 2 :], x[len(x) // 2 :]) / area % 1
        cosine, sine = np.cos(2 * math.pi * turns), np.sin(2 * math.pi * turns)
        if len(x) % 2:
            cosine[:, 0] /= 2  # the point in the middle is its own mirror image
        before = np.exp(1j * math.pi * ((x - off) ** 2 / area % 2)) * pitch / np.sqrt(1j * area)
        after = np.exp(1j * math.pi * (((u + off) ** 2 - off**2) / area % 2))
        parts = (before, after, cosine, sine)
        return cls(*(np.ascontiguousarray(arrays.like(part, like)) for part in parts))

    @property
    def nbytes(self) -> int:
        """Memory of all four arrays [bytes]."""
        return self.before.nbytes + self.after.nbytes + self.cosine.nbytes + self.sine.nbytes

    def down(self, data: np.ndarray) -> np.ndarray:
        """The kernel along the last axis but one of (..., n, k): (..., m, k)."""
        data = np.multiply(data, self.before[:, None], order="C")
        found = by_halves(
            data,
            len(self.after),
            lambda half: _real(self.cosine, half),
            lambda half: -1j * _real(self.sine, half),
            axis=-2,
        )
        found *= self.after[:, None]
        return found


def _real(matrix: np.ndarray, data: np.ndarray) -> np.ndarray:
    """A real matrix times complex data, as one real product."""
    return (matrix @ data.view(matrix.dtype)).view(data.dtype)


def both(rows: Halves, data: np.ndarray, columns: Halves) -> np.ndarray:
    """The kernels along both axes of (..., y, x), in the cheaper order."""
    (my, ny), (mx, nx) = ((len(part.after), len(part.before)) for part in (rows, columns))
    if my * nx * (ny + mx) <= ny * mx * (nx + my):
        return _swapped(columns.down(_swapped(rows.down(data))))
    return rows.down(_swapped(columns.down(_swapped(data))))


def _swapped(data: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(np.swapaxes(data, -1, -2))
