"""Copies of a raw image, blurred as lenslets of several kinds should show a place."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter

from lumigraph.core import memory

_SIGMA = 0.25  # standard deviation of a disc along an axis, over its diameter
_COUNTS = 0.1  # weight of the kinds of lenslets whose blur the others are given, too
_STEP = 0.02  # px: between the standard deviations that are kept


@dataclass(frozen=True)
class Blurred:
    """Raw image (levels, y, x), blurred by 0, 1, 2 ... steps; for `focus` see `Sightings`.

    A lenslet spreads a point over a disc as wide as the patch differs from that at which it is sharp. So
    another patch also shows in micro-images that are not blurred as they should be.
    """

    images: np.ndarray
    focus: np.ndarray | None

    @classmethod
    def of(
        cls, image: np.ndarray, focus: np.ndarray | None, trusts: Sequence[tuple[float, np.ndarray]]
    ) -> "Blurred":
        """Copies blurred as far as kinds of lenslets need it, for patches [px] and weights (kinds,)."""
        if focus is None:
            return cls(image[None], None)
        count = 1 + max(int(_levels(size, trust, focus).max()) for size, trust in trusts)
        memory.require(
            4.0 * count * image.size,
            f"{count} blurred copies of the raw image",
            "Crop the raw image to a part {factor:.1f}x smaller.",
        )
        return cls(np.stack([gaussian_filter(image, k * _STEP) for k in range(count)]), focus)

    def read(
        self, at: Sequence[np.ndarray], kind: np.ndarray, size: float, trust: np.ndarray | None
    ) -> np.ndarray:
        """Values at places (...) along y and x, as lenslets of a kind (...) show them if patches have a size.

        Linearly between pixels; what lies beyond the image is undefined.
        """
        ny, nx = self.images.shape[1:]
        start = [np.floor(place) for place in at]
        py, px = (place - below for place, below in zip(at, start, strict=True))
        number = start[0].astype(np.int32) * nx + start[1].astype(np.int32)
        if trust is not None and self.focus is not None:
            number = number + (_levels(size, trust, self.focus) * ny * nx).take(kind)
        flat = self.images.ravel()
        a, b, c, d = (flat[k:].take(number, mode="clip") for k in (0, 1, nx, nx + 1))
        upper, lower = a + px * (b - a), c + px * (d - c)
        return upper + py * (lower - upper)


def _levels(size: float, trust: np.ndarray, focus: np.ndarray) -> np.ndarray:
    """Number of steps by which each kind of lenslets (kinds,) is blurred further, at a patch size."""
    blur = _SIGMA * np.abs(size - focus)
    more = np.sqrt(np.maximum(blur[trust >= _COUNTS].max() ** 2 - blur**2, 0))
    return np.rint(more / _STEP).astype(np.int64)
