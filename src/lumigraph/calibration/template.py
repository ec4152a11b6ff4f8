"""Centres of micro-images by the mean one: sharper than its first harmonic where light is noisy or uneven."""

import math

import numpy as np
from scipy import ndimage

from lumigraph.calibration.centres import Spots, windows
from lumigraph.core.calibration import Calibration

_SAMPLES = 8  # pixels that fall into one cell of the mean micro-image at least
_CHUNK = 1 << 18  # pixels at a time: as many as a processor's cache holds
_RIDGE = 1e-4
_FINE = 768  # samples of the mean micro-image that the nearest is taken of


def sharpened(picture: np.ndarray, spots: Spots, model: Calibration) -> Spots:
    """Centres from least squares of brightness, slope of brightness and shift of the mean micro-image.

    The mean of all micro-images, made symmetric about its centre, is fitted to each: I = (a + b·d) T(d) -
    s·∇T(d) over its cell, for brightness a, vignetting b and shift s. Dust, gaps and noise count only by what
    they do to the edges.

    Parameters
    ----------
    picture
        Evenly lit white image (y, x).
    spots
        Micro-images to a fraction of a pixel.
    model
        Lattice through them.
    """
    mean = mean_cell(picture, model, symmetric=True)
    centers = spots.centers.copy()
    pitch = model.lattice.pitch
    reach = math.ceil(pitch * (0.5 if model.lattice.layout == "square" else 0.56))
    step = max(1, _CHUNK // (2 * reach + 1) ** 2)
    around, tables = windows(picture, (reach, reach)), _tables(mean, model)
    for k in range(0, len(centers), step):
        part = slice(k, k + step)
        start = model.position(spots.indices[part])
        most = max(0.5, 0.01 * pitch)
        centers[part] = start + np.clip(_moves(around, tables, model, start), -most, most)
    good = np.hypot(*(centers - spots.centers).T) < max(0.75, 0.05 * pitch)
    return spots._replace(centers=np.where(good[:, None], centers, spots.centers))


def mean_cell(picture: np.ndarray, model: Calibration, *, symmetric: bool = False) -> np.ndarray:
    """Mean of all micro-images in coordinates of the lattice's cell (m, m), its centre first."""
    lattice, (ny, nx) = model.lattice, picture.shape
    count = ny * nx
    size = int(np.clip(math.sqrt(count / _SAMPLES), 8, min(192, 4 * lattice.pitch)))
    rows = max(1, (1 << 20) // nx)
    light, weight = np.zeros(size * size), np.zeros(size * size)
    inverse = size * np.linalg.inv(lattice.matrix)
    for first in range(0, ny, rows):
        y, x = np.arange(first, min(first + rows, ny), dtype=float)[:, None], np.arange(nx, dtype=float)
        y, x = model.straightened(y, x)
        dy, dx = y - lattice.origin[0], x - lattice.origin[1]
        u, v = (np.rint(inverse[k, 0] * dy + inverse[k, 1] * dx).astype(np.int64) % size for k in (0, 1))
        place = (u * size + v).ravel()
        light += np.bincount(place, picture[first : first + rows].ravel(), size * size)
        weight += np.bincount(place, minlength=size * size)
    blurred = [ndimage.gaussian_filter(a.reshape(size, size), 0.6, mode="wrap") for a in (light, weight)]
    cell = blurred[0] / np.maximum(blurred[1], 1e-3)
    if symmetric:
        cell = (cell + np.roll(cell[::-1, ::-1], 1, (0, 1))) / 2
    return cell


def _tables(mean: np.ndarray, model: Calibration) -> np.ndarray:
    """The mean micro-image and its slopes along y and x, downwards, finely sampled (m * m, 4).

    Beside each other, and with a fourth number that says nothing: so they are looked up together.
    """
    size, inverse = len(mean), np.linalg.inv(model.lattice.matrix)
    along = [(np.roll(mean, -1, a) - np.roll(mean, 1, a)) * size / 2 for a in (0, 1)]
    slopes = [inverse[0, k] * along[0] + inverse[1, k] * along[1] for k in (0, 1)]
    fine = max(1, round(_FINE / size)) * size
    tables = [_refined(table, fine).ravel() for table in (mean, -slopes[0], -slopes[1])]
    return np.stack([*tables, np.zeros_like(tables[0])], -1)


def _moves(around: np.ndarray, tables: np.ndarray, model: Calibration, centers: np.ndarray) -> np.ndarray:
    """Shifts (k, 2) [px] of micro-images from where they are thought to be."""
    inverse, shape = np.linalg.inv(model.lattice.matrix), np.array(around.shape[:2])
    first, reach = np.rint(centers).astype(np.int64), around.shape[2] // 2
    steps, fine = np.arange(-reach, reach + 1), math.isqrt(len(tables))
    rows, columns = first[:, :1] + steps, first[:, 1:] + steps
    values = around[tuple(np.clip(first, 0, shape - 1).T)]
    dy = (rows - centers[:, :1])[:, :, None].astype(np.float32)
    dx = (columns - centers[:, 1:])[:, None, :].astype(np.float32)
    u, v = (np.float32(inverse[k, 0]) * dy + np.float32(inverse[k, 1]) * dx for k in (0, 1))
    inside = (np.abs(u) < 0.62) & (np.abs(v) < 0.62)
    if ((first < reach) | (first >= shape - reach)).any():
        inside &= ((rows >= 0) & (rows < shape[0]))[:, :, None]
        inside &= ((columns >= 0) & (columns < shape[1]))[:, None, :]
    at = [np.rint(w * np.float32(fine)).astype(np.int32) % fine for w in (u, v)]
    place = at[0] * fine + at[1]
    looked = tables.view(np.complex128).ravel().take(place.ravel()).view(np.float32).reshape(*u.shape, 4)
    terms = np.empty((len(centers), 5, *u.shape[1:]), np.float32)
    for column, k in enumerate((0, 3, 4)):
        np.multiply(looked[..., column], inside, out=terms[:, k])
    np.multiply(terms[:, 0], dy / np.float32(reach), out=terms[:, 1])
    np.multiply(terms[:, 0], dx / np.float32(reach), out=terms[:, 2])
    flat = terms.reshape(len(centers), 5, -1)
    normal = (flat @ flat.transpose(0, 2, 1)).astype(float)
    scale = np.sqrt(np.maximum(np.einsum("kii->ki", normal), 1e-12))
    normal = normal / (scale[:, :, None] * scale[:, None, :]) + _RIDGE * np.eye(5)
    right = (flat @ (values * inside).reshape(len(centers), -1, 1))[..., 0] / scale
    weights = np.linalg.solve(normal, right[..., None])[..., 0] / scale
    bright = weights[:, 0]
    return np.where(bright[:, None] > 0, weights[:, 3:] / np.maximum(bright, 1e-9)[:, None], 0)


def _refined(table: np.ndarray, fine: int) -> np.ndarray:
    """A periodic table with values between its samples, so that the nearest one will do."""
    size = len(table)
    at = np.arange(fine) * (size / fine)
    low = at.astype(int)
    part = (at - low).astype(np.float32)
    table = table.astype(np.float32)
    table = table[low] * (1 - part[:, None]) + table[(low + 1) % size] * part[:, None]
    return table[:, low] * (1 - part) + table[:, (low + 1) % size] * part
