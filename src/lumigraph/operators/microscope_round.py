r"""Light of a window through lenslets that are not square, and on to the sensor.

A field V before them, on the even grid of a window of cells, becomes

.. math:: U = F^{-1} \left( h_y h_x \, F (t V) \right), \quad h = e^{-i \pi \lambda b \nu^2}

with t a lattice of lenslets, each of its Fourier series. t V and h bring no light of one border to the other
where the window is so much wider than what is wanted as light goes on its way.
"""

from dataclasses import dataclass

import numpy as np

from lumigraph.core import arrays


@dataclass(frozen=True, slots=True, eq=False)
class LensletWindow:
    """Lenslets of a window, and the way behind them.

    Parameters
    ----------
    lenslets
        t (n, n), which is even.
    path
        h (n,), of each frequency along an axis.
    margin
        Samples at each border that are not wanted.
    """

    lenslets: np.ndarray
    path: np.ndarray
    margin: int

    @property
    def nbytes(self) -> int:
        """Memory of the arrays [bytes]."""
        return self.lenslets.nbytes + self.path.nbytes

    def forward(self, fields: np.ndarray) -> np.ndarray:
        """Fields (..., n, n) before the lenslets to those on the sensor, without the margins."""
        return self._cut(self._gone(fields * self.lenslets))

    def transposed(self, fields: np.ndarray) -> np.ndarray:
        """The transpose of `forward`, without conjugates."""
        return self._gone(self._whole(fields)) * self.lenslets

    def changed(
        self, before: np.ndarray, lenslets: np.ndarray | float, path: np.ndarray | float
    ) -> np.ndarray:
        """Change of `forward` with the lenslets and the path."""
        waves = arrays.ifft2(before * self.lenslets)
        both = np.multiply.outer(path + 0 * self.path, self.path)
        found = arrays.fft2(waves * (both + both.T))
        return self._cut(found + self._gone(before * lenslets))

    def slopes(self, before: np.ndarray, given: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Slopes of a number by `lenslets` and `path`, from those by `forward` of fields (..., n, n)."""
        seen = arrays.ifft2(self._whole(given))
        each = tuple(range(before.ndim - 2))
        by_path = (seen * arrays.fft2(before * self.lenslets)).sum(each)
        by_lenslets = (before * self._back(seen)).sum(each)
        return by_lenslets, by_path @ self.path + self.path @ by_path

    def _gone(self, fields: np.ndarray) -> np.ndarray:
        return self._back(arrays.ifft2(fields))

    def _back(self, waves: np.ndarray) -> np.ndarray:
        """F (h h W): as h is even, F h F⁻¹ and F⁻¹ h F are the same, and symmetric."""
        waves *= self.path[:, None]
        waves *= self.path
        return arrays.fft2(waves, overwrite=True)

    def _cut(self, fields: np.ndarray) -> np.ndarray:
        inner = slice(self.margin, fields.shape[-1] - self.margin)
        return fields[..., inner, inner]

    def _whole(self, fields: np.ndarray) -> np.ndarray:
        around = [(0, 0)] * (fields.ndim - 2) + [(self.margin, self.margin)] * 2
        return np.pad(fields, around)
