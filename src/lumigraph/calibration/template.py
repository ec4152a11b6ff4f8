"""Centres of micro-images by the mean one: sharper than its first harmonic where light is noisy or uneven."""

import math

import numpy as np
from scipy import ndimage

from lumigraph.calibration.centres import Spots, windows
from lumigraph.core.calibration import Calibration

_SAMPLES = 8  # pixels that fall into one cell of the mean micro-image at least
_CHUNK = 1 << 18  # pixels at a time: as many as a processor's cache holds
_RIDGE = 1e-4
_PHASES = 64  # of a pixel: on whole ones stand many micro-images of a picture, before they are shifted
_FILLED = (
    0.7  # of the mean micro-image's samples: fewer leave steps between them, which the shift would follow
)
_FINE = 768  # samples of the mean micro-image that the nearest is taken of


def sharpened(picture: np.ndarray, spots: Spots, model: Calibration) -> Spots:
    """Centres from least squares of brightness, slope of brightness and shift of the mean micro-image.

    The mean of all micro-images, made symmetric about its centre, is fitted to each: I = (a + b·d) T(d) -
    s·∇T(d) over its cell, for brightness a, vignetting b and shift s. Dust, gaps and noise count only by what
    they do to the edges. Where all micro-images lie alike between the pixels, as behind a pitch of whole
    pixels without noise, their mean is no finer than one of them, and the spots stay as they are.

    Parameters
    ----------
    picture
        Evenly lit white image (y, x).
    spots
        Micro-images to a fraction of a pixel.
    model
        Lattice through them.
    """
    mean, filled = _mean_and_filled(picture, model)
    if filled < _FILLED:
        return spots
    tables = _tables((mean + np.roll(mean[::-1, ::-1], 1, (0, 1))) / 2, model)
    start = model.position(spots.indices)
    if len(start) > _PHASES**2:
        start = np.rint(start * _PHASES) / _PHASES
    most = max(0.5, 0.01 * model.lattice.pitch)
    centers = start + np.clip(_moves(picture, tables, model, start), -most, most)
    good = np.hypot(*(centers - spots.centers).T) < max(0.75, 0.05 * model.lattice.pitch)
    return spots._replace(centers=np.where(good[:, None], centers, spots.centers))


def mean_cell(picture: np.ndarray, model: Calibration) -> np.ndarray:
    """Mean of all micro-images in coordinates of the lattice's cell (m, m), its centre first."""
    return _mean_and_filled(picture, model)[0]


def _mean_and_filled(picture: np.ndarray, model: Calibration) -> tuple[np.ndarray, float]:
    """The mean of all micro-images (m, m), and the part of its samples on which pixels lie."""
    lattice, (ny, nx) = model.lattice, picture.shape
    count = ny * nx
    size = int(np.clip(math.sqrt(count / _SAMPLES), 8, min(192, 4 * min(lattice.pitches))))
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
    return blurred[0] / np.maximum(blurred[1], 1e-3), np.count_nonzero(weight) / len(weight)


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


def _moves(picture: np.ndarray, tables: np.ndarray, model: Calibration, centers: np.ndarray) -> np.ndarray:
    """Shifts (k, 2) [px] of micro-images from where they are thought to be.

    Those that lie alike between the pixels share the rows that make brightness and shifts of their pixels.
    """
    first, reach = np.rint(centers).astype(np.int64), _reach(model)
    clear = np.clip(np.concatenate([first, np.array(picture.shape) - 1 - first], -1), 0, reach)
    one, order, ends = _alike(np.concatenate([centers - first, clear], -1))
    around, found = windows(picture, (reach, reach)), np.zeros((len(centers), 3))
    step, begin = max(1, _CHUNK // (2 * reach + 1) ** 2), 0
    for k in range(0, len(one), step):
        these = one[k : k + step]
        rows = _rows(tables, model, (centers - first)[these], clear[these])
        for row, end in zip(rows, ends[k : k + step], strict=True):
            group = order[begin:end]
            found[group] = around[tuple(first[group].T)].reshape(len(group), -1) @ row.T
            begin = end
    bright = found[:, :1]
    return np.where(bright > 0, found[:, 1:] / np.maximum(bright, 1e-9), 0)


def _alike(rows: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """One of each group of like rows (k, n), the rows by groups, and where each group ends."""
    order = np.lexsort(rows.T)
    starts = np.flatnonzero((np.diff(rows[order], axis=0, prepend=np.nan) != 0).any(-1))
    return order[starts], order, np.append(starts[1:], len(rows))


def _reach(model: Calibration) -> int:
    """Pixels around a centre that hold its micro-image."""
    return math.ceil(max(model.lattice.pitches) * (0.56 if model.lattice.layout == "hex" else 0.5))


def _rows(tables: np.ndarray, model: Calibration, away: np.ndarray, clear: np.ndarray) -> np.ndarray:
    """Rows (k, 3, n) that make brightness and brightness times shift (y, x) of the n pixels around a centre.

    Parameters
    ----------
    tables
        Integral tables of the mean micro-image.
    model
        Lattice.
    away
        Centres (k, 2) from the middle pixel [px].
    clear
        Number of pixels there are above, left, below and right (k, 4).
    """
    inverse, reach, fine = np.linalg.inv(model.lattice.matrix), _reach(model), math.isqrt(len(tables))
    steps = np.arange(-reach, reach + 1)
    dy = (steps - away[:, :1])[:, :, None].astype(np.float32)
    dx = (steps - away[:, 1:])[:, None, :].astype(np.float32)
    u, v = (np.float32(inverse[k, 0]) * dy + np.float32(inverse[k, 1]) * dx for k in (0, 1))
    there = [(steps >= -clear[:, k : k + 1]) & (steps <= clear[:, k + 2 : k + 3]) for k in (0, 1)]
    inside = (np.abs(u) < 0.62) & (np.abs(v) < 0.62) & there[0][:, :, None] & there[1][:, None, :]
    at = [np.rint(w * np.float32(fine)).astype(np.int32) % fine for w in (u, v)]
    place = at[0] * fine + at[1]
    looked = tables.view(np.complex128).ravel().take(place.ravel()).view(np.float32).reshape(*u.shape, 4)
    terms = np.empty((len(away), 5, *u.shape[1:]), np.float32)
    for column, k in enumerate((0, 3, 4)):
        np.multiply(looked[..., column], inside, out=terms[:, k])
    np.multiply(terms[:, 0], dy / np.float32(reach), out=terms[:, 1])
    np.multiply(terms[:, 0], dx / np.float32(reach), out=terms[:, 2])
    flat = terms.reshape(len(away), 5, -1)
    normal = (flat @ flat.transpose(0, 2, 1)).astype(float)
    scale = np.sqrt(np.maximum(np.einsum("kii->ki", normal), 1e-12))
    normal = normal / (scale[:, :, None] * scale[:, None, :]) + _RIDGE * np.eye(5)
    wanted = np.linalg.inv(normal)[:, [0, 3, 4]] / (scale[:, [0, 3, 4], None] * scale[:, None])
    return wanted.astype(np.float32) @ flat


def _refined(table: np.ndarray, fine: int) -> np.ndarray:
    """A periodic table with values between its samples, so that the nearest one will do."""
    size = len(table)
    at = np.arange(fine) * (size / fine)
    low = at.astype(int)
    part = (at - low).astype(np.float32)
    table = table.astype(np.float32)
    table = table[low] * (1 - part[:, None]) + table[(low + 1) % size] * part[:, None]
    return table[:, low] * (1 - part) + table[:, (low + 1) % size] * part
