"""Repeating textures: the errors of a place that would remain unseen."""

import math

import numpy as np
from scipy.interpolate import make_interp_spline

from lumigraph.depth.micro_images import MicroImages
from lumigraph.depth.pictures import Pictures
from lumigraph.depth.volume import box

_BLOCK, _FINE = 16, 0.1  # px across, of a picture in which places are compared; px between movements
_COARSE, _SHARED = 0.5, 1.3  # px between movements of micro-images; the farthest, of their radius
_WINDOW = 1  # blocks to each side that decide together
_SLOW = 8  # px to each side: what varies over more is shading as well as texture
_ALIKE, _HILL = 0.05, 0.3  # part of the texture's variance that views differ by: where alike, and between
_TEXTURE = 1.0  # variance of the texture over that of the noise: below, all places look alike


def repeats(pictures: Pictures, farthest: float) -> np.ndarray:
    """The least movement (y, x) [px in the outermost view] that no view of the cross distinguishes from none.

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
    first = first_alike(left / sum(map(len, arms)), moves, variance, noise)
    rows, columns = (np.minimum(np.arange(n) // _BLOCK, n // _BLOCK - 1) for n in shape)
    return first[np.ix_(rows, columns)]


def first_alike(left: np.ndarray, moves: np.ndarray, variance: np.ndarray, noise: float) -> np.ndarray:
    """The least of the moves (n,) by which what is moved looks alike, after it has looked different; or 0.

    Parameters
    ----------
    left
        Half the mean square (n, ...) by which what is moved differs, noise and all.
    variance, noise
        Of its texture (...), and of the noise.
    """
    left = (left - noise) / np.maximum(variance, noise)
    alike = (left < _ALIKE) & (np.maximum.accumulate(left, 0) > _HILL) & (variance > _TEXTURE * noise)
    alike[:-1] &= left[:-1] <= left[1:]
    return np.where(alike.any(0), moves[alike.argmax(0)], 0).astype(np.float32)


def _arms(pictures: Pictures) -> tuple[np.ndarray, np.ndarray]:
    """Distances of the cross's views from the middle one, along y and x, over the outermost's."""
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


def of_micro_images(micro: MicroImages, farthest: float, noise: float) -> np.ndarray:
    """The least change (rows, cols) of patches [px] up to `farthest` that no neighbour shows.

    0 where there is none. Micro-images are compared with themselves, moved as their neighbours would show
    them if the patch were larger: those of all others follow, which stand at sums of these steps.
    """
    farthest = min(farthest, _SHARED * micro.radius)
    coarse = np.arange(0, farthest + _COARSE, _COARSE)
    left = [[box(one, _WINDOW) for one in part] for part in micro.differences(coarse)]
    moves = np.arange(_FINE, coarse[-1], _FINE)
    left = make_interp_spline(coarse, np.max(left, 0))(moves)
    variance = box(np.square(micro.data).mean(1).reshape(micro.indices.shape[:2]), _WINDOW) - noise**2
    return first_alike(left, moves, variance, noise**2)


def _pooled(image: np.ndarray) -> np.ndarray:
    """Means over blocks, and the blocks around each."""
    rows, columns = (n // _BLOCK for n in image.shape)
    cut = image[: rows * _BLOCK, : columns * _BLOCK].astype(float)
    return box(cut.reshape(rows, _BLOCK, columns, _BLOCK).mean((1, 3)), _WINDOW)
