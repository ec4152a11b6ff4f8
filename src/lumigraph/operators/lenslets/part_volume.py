"""Raw images of several planes that shine at once, and how they change with an instrument's parts."""

from dataclasses import dataclass

import numpy as np

from lumigraph.core.grid import Grid
from lumigraph.errors import GeometryError
from lumigraph.operators.lenslets.whole_planes import PlaneImages


@dataclass(frozen=True, eq=False)
class PartVolume:
    """Images of planes through each other, with derivatives by what differs in pairs of instruments.

    Parameters
    ----------
    planes
        (nz,), by depth.
    grid
        Samples of each.
    """

    planes: tuple[PlaneImages, ...]
    grid: Grid

    @property
    def shape(self) -> tuple[tuple[int, int], tuple[int, int, int]]:
        """Shapes of a raw image and of an object."""
        raw, samples = self.planes[0].shape
        return raw, (len(self.planes), *samples)

    def forward(self, x: np.ndarray) -> np.ndarray:
        """Raw image (ny, nx) of an object (nz, y, x); of several (k, nz, y, x) theirs (k, ny, nx)."""
        return sum(
            (plane.forward(one) for plane, one in zip(self.planes, self._each(x), strict=True)), np.zeros(())
        )

    def derivative(self, x: np.ndarray, change: np.ndarray) -> np.ndarray:
        """Change (ny, nx) of `forward`, so many times (n,) from the first to the last of each pair."""
        both = zip(self.planes, self._each(x), strict=True)
        return sum((plane.derivative(one, change) for plane, one in both), np.zeros(()))

    def gradient(self, x: np.ndarray, weights: np.ndarray) -> np.ndarray:
        """Transpose of `derivative`: (n,) from weights (ny, nx) of the raw image's pixels.

        Of several objects (k, nz, y, x) and weights (k, ny, nx) their sum, at hardly more cost.
        """
        both = zip(self.planes, self._each(x), strict=True)
        return sum((plane.gradient(one, weights) for plane, one in both), np.zeros(()))

    def _each(self, x: np.ndarray) -> np.ndarray:
        """(nz, ...), what shines at each depth."""
        if np.ndim(x) not in (3, 4) or np.shape(x)[-3:] != self.shape[1]:
            raise GeometryError(f"the object has shape {np.shape(x)} but the planes {self.shape[1]}.")
        return np.moveaxis(np.asarray(x), -3, 0)
