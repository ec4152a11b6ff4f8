"""Views of a light field for depth estimation: few, even, and on a common scale."""

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import convolve

from lumigraph.core import checks, memory
from lumigraph.core.arrays import to_numpy
from lumigraph.core.lightfield import LightField
from lumigraph.depth import vignetted
from lumigraph.depth.quantities import disparity_per_alpha
from lumigraph.depth.volume import box
from lumigraph.errors import GeometryError, SamplingWarning

MOST_VIEWS = 9
"""Along one axis: views between these look much the same, and cost as much."""

LEAST_NOISE = 2e-3
"""Least noise of a picture from 0 to 1: that of rounding to eight bits."""

FEWEST_VIEWS, LEAST_SIDE = 2, 8
"""Along one axis, and lenslets across a view: fewer show no lines."""

_WINDOW, _SMOOTH = 4, 0.1  # px; part of the windows that show nothing but noise
_NEAR = 32  # px across, of blocks that have a noise of their own
_OF_NOISE = 0.81  # of its mean: how rough the smoothest tenth of the windows of noise alone is
_LIT = 0.1  # of a picture from 0 to 1: what is darker may be cut off
_BRIGHT, _GLARING = 0.999, 1e6  # part of the middle view; times as bright is no light
_NEGATIVE, _USUAL = 0.05, 1e30  # of the light; what single precision holds
_DARK = 0.05  # views darker than this part of the middle one lie outside the aperture


def measurable(views: LightField) -> bool:
    """True if a light field has the two views of 8 x 8 lenslets or more that `epi` needs."""
    return min(views.lenslets.shape) >= LEAST_SIDE and max(views.aperture.shape) >= FEWEST_VIEWS


@dataclass(frozen=True, slots=True)
class Pictures:
    """Views on a scale of 0 to 1, even in noise: square roots, matched in brightness to the middle view.

    Views that vignette, as without a white image behind most lenses, are matched in windows of a tenth of the
    picture; where their light is cut off, they show what the middle one does, and are not `seen`.

    Parameters
    ----------
    data
        (v, u, c, y, x) float32.
    down, right
        Where the views stand: how far a point of disparity 1 moves along y (v,) and x (u,) from the middle
        view to each, over `reach`; within -1 ... 1.
    lit
        Which views (v, u) are not dark.
    noise
        Standard deviation of the pixels' noise, estimated from the middle view.
    reach
        Views from the middle one to the outermost: disparities times reach are the engine's unit.
    seen
        Which places (v, u, y, x) are not cut off in a view; None for all.
    """

    data: np.ndarray
    down: np.ndarray
    right: np.ndarray
    lit: np.ndarray
    noise: float
    reach: float
    seen: np.ndarray | None = None

    @property
    def middle(self) -> tuple[int, int]:
        """Index (v, u) of the view that the map belongs to."""
        return int(np.argmin(np.abs(self.down))), int(np.argmin(np.abs(self.right)))

    @property
    def center(self) -> np.ndarray:
        """The middle view (c, y, x)."""
        return self.data[self.middle]

    def sees(self, view: tuple[int, int], at: Sequence[np.ndarray]) -> np.ndarray:
        """Mask of places (...), along y and x, that a view shows: within it, and not cut off."""
        ends = [n - 1 for n in self.data.shape[-2:]]
        inside = (at[0] >= 0) & (at[0] <= ends[0]) & (at[1] >= 0) & (at[1] <= ends[1])
        if self.seen is None:
            return inside
        nearest = [np.clip(np.rint(k), 0, end).astype(np.intp) for k, end in zip(at, ends, strict=True)]
        return inside & self.seen[view][tuple(nearest)]

    @classmethod
    def of(cls, views: LightField) -> "Pictures":
        """Pictures of at most `MOST_VIEWS` squared views of a light field, evenly chosen about the middle.

        Raises
        ------
        GeometryError
            Not a light field, NaN, one view only, or pictures of less than 8 x 8.
        """
        checks.instance("views", views, LightField)
        shape = views.lenslets.shape
        if not measurable(views):
            raise GeometryError(
                f"the light field has {views.aperture.shape[0]} x {views.aperture.shape[1]} views of "
                f"{shape[0]} x {shape[1]} lenslets but depth needs two views of {LEAST_SIDE} x {LEAST_SIDE} "
                "at least."
            )
        chosen = [_chosen(n) for n in views.aperture.shape]
        channels = views.data.shape[4] if views.data.ndim == 5 else 1
        memory.require(
            12.0 * len(chosen[0]) * len(chosen[1]) * channels * shape[0] * shape[1],
            f"depth from {len(chosen[0])} x {len(chosen[1])} views",
            "Use {factor:.1f}x fewer pixels.",
        )
        data = to_numpy(views.data)[np.ix_(*chosen)]
        checks.finite_array("the light field", data, GeometryError)
        center = len(chosen[0]) // 2, len(chosen[1]) // 2
        data = _checked(data, center)
        data = data[:, :, None] if data.ndim == 4 else np.moveaxis(data, 4, 2)
        data, lit = _even(data, center)
        seen = vignetted.even(data, lit, center)
        (per_t, per_s), middle = disparity_per_alpha(views), [n // 2 for n in views.aperture.shape]
        down = (chosen[0] - middle[0]) * (per_t / per_s)
        right = (chosen[1] - middle[1]).astype(float)
        reach = float(max(np.abs(down).max(), np.abs(right).max()))
        noise = noise_of(data[center].mean(0))
        return cls(data, down / reach, right / reach, lit, noise, reach, seen)


def _checked(data: np.ndarray, middle: tuple[int, int]) -> np.ndarray:
    """Views (v, u, t, s[, c]) as float32, none much brighter than the middle one, or less than nothing."""
    bright, most = float(np.quantile(np.abs(data[middle]), _BRIGHT)), float(data.max())
    if most > _GLARING * bright > 0:
        broken = int((data > _GLARING * bright).sum())
        raise GeometryError(
            f"the light field holds {most:.3g} where {_BRIGHT:.1%} of the middle view are at most "
            f"{bright:.3g}. Replace the {broken} broken values by what is around them."
        )
    lit, below = (abs(float(data.sum(where=part, dtype=float))) for part in (data > 0, data < 0))
    if below > _NEGATIVE * lit:
        told = f"{below / (below + lit):.0%} of the light field are negative light, down to {data.min():.3g}"
        if below > lit:
            raise GeometryError(f"{told}. Subtract it from its white level if it is inverted.")
        warnings.warn(f"{told}, and count as 0. Subtract less from it.", SamplingWarning, stacklevel=4)
    unit = bright if bright and not 1 / _USUAL < bright < _USUAL else 1
    return data.astype(np.float32) if unit == 1 else (data / unit).astype(np.float32)


def _chosen(count: int) -> np.ndarray:
    """Indices, evenly spaced about count // 2."""
    half = MOST_VIEWS // 2
    step = max(1, math.ceil((count - 1 - count // 2) / half))
    below, above = min(half, (count // 2) // step), min(half, (count - 1 - count // 2) // step)
    return count // 2 + step * np.arange(-below, above + 1)


def _even(data: np.ndarray, middle: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    """Square roots of the views (v, u, c, y, x), each as bright as the middle one; and which are lit."""
    np.maximum(data, 0, out=data)
    white = float(np.quantile(data[middle], 0.999)) or 1.0
    level = data.mean((2, 3, 4))
    lit = level > _DARK * level[middle]
    if not level[middle] > 0:
        v, u = middle
        raise GeometryError(
            f"the middle view, {v}/{u} of {data.shape[0]} x {data.shape[1]}, is dark or missing, but "
            "the map is made for it. Add its picture, leave out a row or column so that another one is in "
            "the middle, or decode a lit raw image."
        )
    gain = np.where(lit, level[middle] / np.where(lit, level, 1), 0) / white
    for v, u in np.ndindex(lit.shape):
        data[v, u] = np.sqrt(data[v, u] * np.float32(gain[v, u])) if lit[v, u] else 0
    return data, lit


def noise_of(picture: np.ndarray) -> float:
    """Standard deviation of the noise of a picture (y, x), by its smoothest lit parts: the rest is texture.

    References
    ----------
    Immerkær, "Fast noise variance estimation", Comput. Vis. Image Underst. 64, 300 (1996), in windows.
    """
    return _noise(_rough(picture), picture)


def noise_near(picture: np.ndarray) -> np.ndarray:
    """Noise of each block of a picture, at its places (y, x)."""
    rough, out = _rough(picture), np.empty_like(picture)
    for start in np.ndindex(*(max(n // _NEAR, 1) for n in picture.shape)):
        ends = [
            n if n < (k + 2) * _NEAR else (k + 1) * _NEAR for k, n in zip(start, picture.shape, strict=True)
        ]
        block = tuple(slice(k * _NEAR, end) for k, end in zip(start, ends, strict=True))
        out[block] = _noise(rough[block], picture[block])
    return out


def _rough(picture: np.ndarray) -> np.ndarray:
    kernel = np.array([[1.0, -2, 1], [-2, 4, -2], [1, -2, 1]])
    return box(np.abs(convolve(picture, kernel)), _WINDOW)


def _noise(rough: np.ndarray, picture: np.ndarray) -> float:
    lit = rough[box(picture, _WINDOW) > _LIT]
    smooth = float(np.quantile(lit if lit.size else rough, _SMOOTH)) / _OF_NOISE
    return max(smooth * math.sqrt(np.pi / 2) / 6, LEAST_NOISE)
