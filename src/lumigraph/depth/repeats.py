"""Pictures that repeat: by how much a place could be off, and nobody would see it."""

import math

import numpy as np
from scipy.interpolate import make_interp_spline

from lumigraph.depth.pictures import Pictures
from lumigraph.depth.volume import box

_BLOCK, _FINE = 16, 0.1  # px across, of a picture in which places are compared; px between movements
_WINDOW = 1  # blocks to each side that decide together
_SLOW = 8  # px to each side: what varies over more is shading as well as texture
_ALIKE, _HILL = 0.05, 0.3  # part of the texture's variance that views differ by: where alike, and between
_TEXTURE = 1.0  # variance of the texture over that of the noise: below, all places look alike


def repeats(pictures: Pictures, farthest: float) -> np.ndarray:
    """The least movement (y, x) [px in the outermost view] that no view of the cross can tell from none.

    0 where there is none up to `farthest`. The middle view is compared with itself, moved as each view would
    see it: as different as noise makes it, after it has looked different for less.
    """
    shape = pictures.center.shape[1:]
    most = min(farthest, min(shape) - _BLOCK)
    if min(shape) < 2 * _BLOCK or most < 2:
        return np.zeros(shape, np.float32)
    picture = pictures.center.mean(0)
    picture = picture - box(picture, _SLOW)
    moves, noise = np.arange(_FINE, most, _FINE), pictures.noise**2
    variance = _pooled(picture**2) - noise
    left = np.zeros((len(moves), *variance.shape))
    arms = _arms(pictures)
    for axis, places in enumerate(arms):
        if len(places):
            spline = make_interp_spline(
                np.arange(math.ceil(most) + 1), _differences(picture, axis, noise, most)
            )
            left += sum(spline(moves * place) for place in places)
    left = (left / sum(map(len, arms)) - noise) / np.maximum(variance, noise)
    alike = (left < _ALIKE) & (np.maximum.accumulate(left, 0) > _HILL) & (variance > _TEXTURE * noise)
    alike[:-1] &= left[:-1] <= left[1:]
    first = np.where(alike.any(0), moves[alike.argmax(0)], 0).astype(np.float32)
    rows, columns = (np.minimum(np.arange(n) // _BLOCK, n // _BLOCK - 1) for n in shape)
    return first[np.ix_(rows, columns)]


def _arms(pictures: Pictures) -> tuple[np.ndarray, np.ndarray]:
    """How far from the middle view the others of the cross stand, along y and x, of the outermost."""
    v, u = pictures.middle
    down, right = pictures.down[pictures.lit[:, u]], pictures.right[pictures.lit[v]]
    return np.abs(down[down != 0]), np.abs(right[right != 0])


def _differences(picture: np.ndarray, axis: int, noise: float, most: float) -> np.ndarray:
    """Half the mean square (lag, rows, columns) by which blocks differ from what lies `lag` px to both sides.

    Without a lag, that of two pictures of the same, which differ in noise.
    """
    count = picture.shape[axis]
    out = []
    for lag in range(1, math.ceil(most) + 1):
        ahead = [slice(None)] * 2
        back = [slice(None)] * 2
        ahead[axis], back[axis] = slice(lag, None), slice(0, count - lag)
        square = 0.5 * (picture[tuple(ahead)] - picture[tuple(back)]) ** 2
        total, seen = np.zeros_like(picture), np.zeros_like(picture)
        for side in (ahead, back):
            total[tuple(side)] += square
            seen[tuple(side)] += 1
        out.append(_pooled(total) / np.maximum(_pooled(seen), 1e-6))
    return np.stack([np.full_like(out[0], noise), *out])


def _pooled(image: np.ndarray) -> np.ndarray:
    """Means over blocks, and the blocks around each."""
    rows, columns = (n // _BLOCK for n in image.shape)
    cut = image[: rows * _BLOCK, : columns * _BLOCK].astype(float)
    return box(cut.reshape(rows, _BLOCK, columns, _BLOCK).mean((1, 3)), _WINDOW)
