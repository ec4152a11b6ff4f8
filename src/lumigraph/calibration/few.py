"""A few large micro-images, such as a Fourier microscope's: the lattice through the centres of edges."""

import math
from typing import NamedTuple

import numpy as np
from scipy import ndimage

from lumigraph.calibration.autocorrelation import reduced
from lumigraph.calibration.centres import Spots
from lumigraph.calibration.fitting import Fitted, recentred
from lumigraph.calibration.period import Request
from lumigraph.calibration.vectors import UNEQUAL, Vectors
from lumigraph.core.lattice import Lattice

_SIDE = 400  # px of the reduced picture in which discs are looked for
_SMALLEST, _FULL = 8.0, 10.0  # px of a disc's radius there, and on the picture itself
_FEWEST, _MOST = 7, 40  # discs
_WHOLE = 0.75  # of the largest disc's radius that fits into one: less is cut
_COVERED = 1.35  # of the discs' area may be lit: more are squares, or no discs
_SPAN = np.linspace(0.72, 1.25, 161)  # radii that the edge is looked for between, over the disc's
_CONTRAST = 0.35  # of a disc's brightness must an edge fall by
_SMOOTHED, _MORE = 0.012, 0.02  # radii: standard deviation that pictures are smoothed by, noisy ones more
_NOISE = 0.04  # of the range of brightness: a noisy picture's
_GROUND = 0.12  # of its fall may remain beyond an edge that is measured
_PAST = 1.1  # radii that must lie on the picture
_SEEN, _ON = 0.4, 0.8  # of a disc's edge must be seen, and of that on its circle
_PARTLY = 0.5  # the same of a disc that stands on the lattice of whole ones
_ROUND = 0.015  # of the radius: rms of a circle's edge
_SAME = 0.03  # of the radius in which whole discs differ
_STRAIGHT = 0.02  # of the pitch: rms of centres from their lattice
_RIGHT, _SIXTY = 4.0, 4.0  # degrees that a layout may differ by


class _Disc(NamedTuple):
    """Circle through an edge: centre (y, x) and radius [px], rms [px], parts seen and on it, light."""

    centre: np.ndarray
    radius: float
    rms: float
    seen: float
    on: float
    light: float


class Few(NamedTuple):
    """The lattice through whole discs, and their diameter over its pitch."""

    fitted: Fitted
    fill: float


def few_discs(picture: np.ndarray, request: Request) -> Few | None:
    """The lattice of 7 to 40 bright discs (y, x); None where the picture shows something else.

    Each disc's centre is that of a circle through the places where its edge falls to half its brightness, as
    far as no other disc is near: discs may touch, and those that a field stop or the border of the picture
    cuts are left out.
    """
    places, radius = _found(picture)
    if not _FEWEST <= len(places) <= 2 * _MOST:
        return None
    smooth = _smoothed(picture, radius)
    dark = float(np.percentile(smooth[::4, ::4], 1))
    for _ in range(3):
        tried = (_circle(smooth, place, radius, dark) for place in places)
        discs = [disc for disc in tried if disc is not None]
        if len(discs) < _FEWEST:
            return None
        places, radius = np.array([d.centre for d in discs]), float(np.median([d.radius for d in discs]))
    whole = [d for d in discs if _is_whole(d, radius)]
    if not _FEWEST <= len(whole) <= _MOST or len(whole) < len(discs) / 3:
        return None
    lattice = _lattice(np.array([d.centre for d in whole]))
    if lattice is None or not request.allows(_vectors(lattice)):
        return None
    spots = _on(lattice, discs, dark)
    shape = (picture.shape[0], picture.shape[1])
    return Few(recentred(Fitted(spots, lattice, None), shape), 2 * radius / lattice.pitch)


def _smoothed(picture: np.ndarray, radius: float) -> np.ndarray:
    """Picture smoothed by a small part of a radius, which moves edges alike on all sides of a disc."""
    bent = np.abs(np.diff(picture[::4], 2, axis=1))
    noise = float(np.median(bent)) / 0.6745 / math.sqrt(6)
    low, high = np.percentile(picture[::4, ::4], (1, 99))
    part = _MORE if noise > _NOISE * float(high - low) else _SMOOTHED
    return ndimage.gaussian_filter(np.asarray(picture, np.float32), max(0.7, part * radius))


def _on(lattice: Lattice, discs: list[_Disc], dark: float) -> Spots:
    """Discs that stand on a lattice, whole ones or not."""
    centers = np.array([d.centre for d in discs])
    indices = np.stack(lattice.index(*centers.T), -1)
    near = np.hypot(*(centers - lattice.position(indices)).T) < _STRAIGHT * lattice.pitch
    keep = np.flatnonzero(near & np.array([d.on > _PARTLY for d in discs]))
    return Spots(indices[keep], centers[keep], np.array([discs[k].light - dark for k in keep]))


def _is_whole(disc: _Disc, radius: float) -> bool:
    return (
        disc.seen > _SEEN
        and disc.on > _ON
        and disc.rms < max(_ROUND * radius, 0.3)
        and abs(disc.radius / radius - 1) < _SAME
    )


def _found(picture: np.ndarray) -> tuple[np.ndarray, float]:
    """Places (k, 2) of bright discs, and the radius of the largest [px]; none where others are there."""
    step = max(1, math.ceil(max(picture.shape) / _SIDE))
    ny, nx = (n // step for n in picture.shape)
    small = picture[: ny * step, : nx * step].reshape(ny, step, nx, step).mean((1, 3))
    small = ndimage.gaussian_filter(np.asarray(small, float), 1.0)
    lit = small > _level(small)
    room = ndimage.distance_transform_edt(np.pad(lit, 1))[1:-1, 1:-1]
    radius = float(room.max())
    if radius < max(_SMALLEST, _FULL / step):
        return np.zeros((0, 2)), 0.0
    peaks = (room == ndimage.maximum_filter(room, 2 * int(0.7 * radius) + 1)) & (room > _WHOLE * radius)
    labels, count = ndimage.label(ndimage.binary_dilation(peaks, iterations=2))
    if not 0 < count <= 2 * _MOST or lit.sum() > _COVERED * math.pi * radius**2 * (
        count + 4 * math.sqrt(count)
    ):
        return np.zeros((0, 2)), 0.0
    places = np.array(ndimage.center_of_mass(peaks, labels, range(1, count + 1)))
    return places * step + (step - 1) / 2, radius * step


def _level(picture: np.ndarray) -> float:
    """Brightness half-way between the mean of what is above it and the mean of what is below."""
    level = (float(picture.min()) + float(picture.max())) / 2
    for _ in range(30):
        above = picture > level
        if not above.any() or above.all():
            break
        level = (float(picture[above].mean()) + float(picture[~above].mean())) / 2
    return level


def _circle(picture: np.ndarray, place: np.ndarray, radius: float, dark: float) -> _Disc | None:
    """Circle through the edge around a place; None without an edge.

    An edge counts where it falls to the ground around the disc: not where another disc is too near.
    """
    count = int(np.clip(2 * math.pi * radius, 90, 720))
    angles = np.arange(count) * (2 * math.pi / count)
    ways = np.stack([np.sin(angles), np.cos(angles)], -1)
    radii = _SPAN * radius
    at = place[:, None, None] + ways.T[:, :, None] * radii
    profiles = ndimage.map_coordinates(picture, at, order=1, mode="nearest")
    inside = np.array([(a >= 0) & (a <= n - 1) for a, n in zip(at, picture.shape, strict=True)]).all(0)
    bright = profiles[:, radii < 0.9 * radius].mean(-1)
    beyond = np.where(inside, profiles, np.inf).min(-1)
    light, ground = float(np.median(bright)), float(np.percentile(beyond, 20))
    if not light - ground > _CONTRAST * (light - dark) > 0:
        return None
    edge = _crossings(profiles, radii, (bright + ground) / 2)
    seen = (beyond < ground + _GROUND * (light - ground)) & (bright - ground > (light - ground) / 2)
    seen &= inside[:, radii < _PAST * radius].all(-1)
    return _fitted(place, ways[seen], edge[seen], float(seen.mean()), light) if seen.sum() >= 30 else None


def _crossings(profiles: np.ndarray, radii: np.ndarray, level: np.ndarray) -> np.ndarray:
    """Radii (k,) at which profiles (k, n) first fall below their level."""
    below = profiles < level[:, None]
    below[:, 0] = False
    k, row = np.maximum(below.argmax(-1), 1), np.arange(len(profiles))
    before, after = profiles[row, k - 1], profiles[row, k]
    share = np.clip((before - level) / np.maximum(before - after, 1e-12), 0, 1)
    return radii[k - 1] + share * (radii[k] - radii[k - 1])


def _fitted(place: np.ndarray, ways: np.ndarray, edge: np.ndarray, seen: float, light: float) -> _Disc:
    """Circle by least squares through edges at distances (k,), those that lie off it left out."""
    design = np.concatenate([np.ones((len(ways), 1)), ways], -1)
    keep = np.abs(edge - np.median(edge)) < 0.12 * np.median(edge)
    for _ in range(12):
        terms = np.linalg.lstsq(design[keep], edge[keep], rcond=None)[0]
        # The distance from a centre that is off by (y, x) has a second order, too.
        bent = np.square(ways @ np.array([terms[2], -terms[1]])) / (2 * max(terms[0], 1e-9))
        rest = edge - design @ terms + bent
        spread = 1.4826 * float(np.median(np.abs(rest[keep])))
        closer = np.abs(rest) < max(3 * spread, 0.3)
        if closer.sum() < 12 or np.array_equal(closer, keep):
            break
        keep = closer
    rms = float(np.sqrt(np.mean(rest[keep] ** 2)))
    return _Disc(place + terms[1:], float(terms[0]), rms, seen, float(keep.mean()), light)


def _lattice(centers: np.ndarray) -> Lattice | None:
    """The lattice through centres (k, 2); None where they stand on none."""
    basis = _steps(centers)
    if basis is None:
        return None
    matrix, origin = np.stack(basis[::-1], -1), centers[np.argmin(np.hypot(*(centers - centers.mean(0)).T))]
    for _ in range(3):
        steps = np.linalg.solve(matrix, (centers - origin).T).T
        indices = np.rint(steps).astype(np.int64)
        if np.abs(steps - indices).max() > 0.2 or len(np.unique(indices, axis=0)) < len(centers):
            return None
        design = np.concatenate([np.ones((len(indices), 1)), indices], -1)
        if np.linalg.matrix_rank(design) < 3 or min(len(np.unique(k)) for k in indices.T) < 3:
            return None
        terms = np.linalg.lstsq(design, centers, rcond=None)[0]
        origin, matrix = terms[0], terms[1:].T
    lattice = _of(matrix, origin)
    rms = math.sqrt(float(np.square(centers - design @ terms).sum(-1).mean()))
    return None if lattice is None or rms > _STRAIGHT * min(lattice.pitches) else lattice


def _steps(centers: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """Shortest row and column vector between centres, each the mean of those alike."""
    ways = (centers[:, None] - centers)[~np.eye(len(centers), dtype=bool)]
    ways = ways[np.argsort(np.hypot(*ways.T))]
    first = _mean_near(ways, ways[0])
    sine = np.abs(ways[:, 0] * first[1] - ways[:, 1] * first[0]) / (np.hypot(*ways.T) * np.hypot(*first))
    rest = ways[sine > 0.5]
    if not len(rest):
        return None
    vectors = Vectors.any_of(*reduced(first, _mean_near(rest, rest[0])))
    return None if vectors is None else (vectors.row, vectors.column)


def _mean_near(ways: np.ndarray, one: np.ndarray) -> np.ndarray:
    return ways[np.hypot(*(ways - one).T) < 0.15 * np.hypot(*one)].mean(0)


def _of(matrix: np.ndarray, origin: np.ndarray) -> Lattice | None:
    """Lattice of steps in i and j in columns (2, 2); None where it is neither square, hexagonal nor so."""
    (down, along), (y, x) = matrix.T, origin
    first, second = float(np.hypot(*down)), float(np.hypot(*along))
    angle = math.degrees(math.acos(float(down @ along) / (first * second)))
    alike = max(first, second) < UNEQUAL * min(first, second)
    if alike and min(abs(angle - 60), abs(angle - 120)) < _SIXTY:
        layout = "hex"
    elif abs(angle - 90) < _RIGHT:
        layout = "square" if alike else "rectangular"
    else:
        return None
    basis = (float(along[0]), float(along[1])), (float(down[0]), float(down[1]))
    return Lattice(basis, (float(y), float(x)), layout)


def _vectors(lattice: Lattice) -> Vectors:
    column, row = lattice.matrix.T
    return Vectors(row, column, lattice.layout)
