"""Changes of a place's brightness from view to view: gloss, and lamps that are out of focus.

No surface is quite matt. Over a range of views the change is nearly linear in where the view stands, and it
varies slowly over the picture, as texture does not: a part of a hundredth, which moves nothing where texture
is strong, and is all there is to see where it is weak.
"""

from dataclasses import dataclass

import numpy as np

from lumigraph.depth.volume import box

WINDOW = 16
"""Radius [px] over which shading is taken to be even."""

_USUAL = 0.03  # of white: how much shading there may be
_UNSURE = (
    0.4  # px in the outermost view: how far places may be off, which is no shading where they have contrast
)


@dataclass(frozen=True, slots=True)
class Shading:
    """Brightness (y, x) that a place gains in a view at 1 along y, and along x."""

    down: np.ndarray
    right: np.ndarray

    def at(self, down: float, right: float) -> np.ndarray:
        """Additional brightness (y, x) in a view that stands there."""
        return np.float32(down) * self.down + np.float32(right) * self.right

    @classmethod
    def none(cls, shape: tuple[int, ...]) -> "Shading":
        """Matt surfaces (y, x)."""
        return cls(np.zeros(shape, np.float32), np.zeros(shape, np.float32))


class Fit:
    """Weighted least squares of residuals (y, x) on the places of their views, one view after the other."""

    def __init__(self, shape: tuple[int, ...], noise: float) -> None:
        self._sums = np.zeros((5, *shape), np.float32)
        self._noise = noise

    def add(
        self, residual: np.ndarray, weight: np.ndarray, gradient: np.ndarray, down: float, right: float
    ) -> None:
        """Take in a view at (down, right), where a place that is off by 1 px errs by `gradient`."""
        weight = weight / (1 + (gradient * np.float32(_UNSURE / self._noise)) ** 2)
        seen = weight * residual
        for total, part in zip(self._sums, (down * down, down * right, right * right), strict=False):
            if part:
                total += np.float32(part) * weight
        self._sums[3] += np.float32(down) * seen
        self._sums[4] += np.float32(right) * seen

    def solved(self, radius: int) -> Shading:
        """The change over windows of (2 radius + 1)² places."""
        yy, yx, xx, y, x = (box(total, radius) for total in self._sums)
        least = np.float32((self._noise / _USUAL) ** 2)
        yy, xx = yy + least, xx + least
        scale = yy * xx - yx * yx
        return Shading((xx * y - yx * x) / scale, (yy * x - yx * y) / scale)
