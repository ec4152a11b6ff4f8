"""Sub-pixel centre of every micro-image, where a lattice says that one should be."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy import ndimage

from lumigraph.core.calibration import Calibration
from lumigraph.core.lattice import Lattice

_CHUNK = 1 << 18  # pixels gathered at a time: as many as a processor's cache holds
_ITERATIONS = 4
_FOLLOWED = 0.9  # pitches: sigma of the window over which gaps are followed
_UPRIGHT = 0.1  # rad by which the cells of a rectangular lattice may be turned before boxes hold two
_BLOCKS = 6.0  # blocks in the standard deviation of a window: averages over them differ by 0.2 %
_SOFT = 0.2  # of the cell: over how much its window fades, so that pixels do not jump in and out


class Spots(NamedTuple):
    """Measured micro-images: `indices` (k, 2) as (i, j), `centers` (k, 2) as (y, x) [px], `light` (k,)."""

    indices: np.ndarray
    centers: np.ndarray
    light: np.ndarray


class TriedSpots(NamedTuple):
    """Spots that may be unlit or far off: `light` (k, 3), and whether they are `near` their place (k,)."""

    indices: np.ndarray
    centers: np.ndarray
    light: np.ndarray
    near: np.ndarray


def lit(*tried: TriedSpots) -> Spots:
    """Spots near their expected place that are bright and have dark edges, of all parts of a picture."""
    indices, centers, light, near = (np.concatenate(column) for column in zip(*tried, strict=True))
    keep = _lit(light) & near
    return Spots(indices[keep], centers[keep], light[keep, 0])


def measure(picture: np.ndarray, model: Calibration, *, part: float = 1.0) -> Spots:
    """Lit micro-images by `measured`."""
    return lit(measured(picture, model, part=part))


def followed(picture: np.ndarray, model: Calibration, *, part: float = 1.0) -> Spots:
    """Lit micro-images by `traced`."""
    return lit(traced(picture, model, part=part))


def measured(
    picture: np.ndarray, model: Calibration, *, part: float = 1.0, rounds: int = _ITERATIONS
) -> TriedSpots:
    """Centres of the micro-images that lie wholly inside the picture.

    The centre is where the phase of the first harmonic over one cell vanishes along y and along x:
    unbiased for every micro-image that is symmetric about its centre, round or square, ringed or flat,
    well separated or with only a thin gap, and linear in the pixel values.

    Parameters
    ----------
    picture
        Flattened white image (y, x), zero in the dark.
    model
        Approximate positions of the micro-images, to a third of a pitch [px].
    part
        Central part of the picture's height and width to look at.
    rounds
        Number of rounds in which the window follows the centre.
    """
    cell = _cell(model.lattice)
    ny, nx = picture.shape
    ranges = [
        (
            max((n - 1) * (1 - part) / 2, size / 2 - 0.5) - 1e-6,
            min((n - 1) * (1 + part) / 2, n - 0.5 - size / 2) + 1e-6,
        )
        for n, size in zip((ny, nx), cell, strict=True)
    ]
    indices = model.indices_within(ranges[0], ranges[1])
    guess = model.position(indices)
    around = windows(picture, [_reach(size, rounds) for size in cell])
    step = max(1, _CHUNK // math.prod(around.shape[2:]))
    parts = [_centre(around, guess[k : k + step], cell, rounds) for k in range(0, len(guess), step)]
    centers = np.concatenate([p[0] for p in parts]) if parts else guess
    light = np.concatenate([p[1] for p in parts]) if parts else np.zeros((0, 3))
    return TriedSpots(
        indices, centers, light, np.all(np.abs(centers - guess) < 0.35 * np.array(cell), axis=-1)
    )


def placed(model: Calibration) -> TriedSpots:
    """Whole micro-images of a picture at the places where they should be, taken to be lit."""
    margin, (ny, nx) = model.lattice.pitch / 2, model.shape
    indices = model.indices_within((margin, ny - 1 - margin), (margin, nx - 1 - margin))
    return TriedSpots(
        indices, model.position(indices), np.ones((len(indices), 3)), np.ones(len(indices), bool)
    )


def traced(
    picture: np.ndarray,
    model: Calibration,
    *,
    part: float = 1.0,
    width: float = _FOLLOWED,
    reach: float = 2.5,
) -> TriedSpots:
    """Centres by the phases of the lattice's first harmonics, each over a few lenslets around.

    For raw images: what the scene adds to one micro-image differs from the next, the gaps do not.

    Parameters
    ----------
    picture, model, part
        As for `measured`.
    width, reach
        Standard deviation [pitches] of the normal window, and how many of them it extends.
    """
    lattice, (ny, nx) = model.lattice, picture.shape
    orders = [(1, 0), (0, 1)]
    if lattice.layout == "hex":
        orders.append((1, -1) if float(np.dot(*lattice.basis)) < 0 else (1, 1))
    sigma = width * lattice.pitch
    ranges = [((n - 1) * (1 - part) / 2, (n - 1) * (1 + part) / 2) for n in (ny, nx)]
    indices = model.indices_within(ranges[0], ranges[1])
    guess = model.position(indices)
    whole = ((guess > lattice.pitch / 2) & (guess < np.array([ny, nx]) - 1 - lattice.pitch / 2)).all(-1)
    indices, guess = indices[whole], guess[whole]
    area = _around(guess, math.ceil(reach * sigma) + 1, (ny, nx))
    even = np.asarray(picture[area] - picture.mean(), np.float32)
    corner = np.array([side.start for side in area])
    angles, sizes = [], []
    for order in orders:
        turned = even * _carrier(model, order, area)
        local = _averaged(turned, guess - corner, sigma, reach)
        angles.append(np.angle(local) / (2 * np.pi))
        sizes.append(np.abs(local))
    steps = np.stack(angles[:2], -1)
    if len(orders) == 3:  # three phases for two unknowns: their least squares
        sign = orders[2][1]
        rest = angles[2] - angles[0] - sign * angles[1]
        rest = (rest - np.rint(rest)) / 3
        steps = steps + np.stack([rest, sign * rest], -1)
    light = np.stack([np.sum(sizes, 0), *sizes[:2]], -1)
    return TriedSpots(indices, guess + steps @ lattice.matrix.T, light, np.all(np.abs(steps) < 0.35, axis=-1))


def _around(places: np.ndarray, reach: int, shape: tuple[int, ...]) -> tuple[slice, slice]:
    """Part of a picture that holds the surroundings of places (k, 2)."""
    if not len(places):
        return slice(0, shape[0]), slice(0, shape[1])
    first, last = np.floor(places.min(0)).astype(int) - reach, np.ceil(places.max(0)).astype(int) + reach
    rows, columns = (
        slice(max(0, int(k)), min(n, int(e) + 1)) for k, e, n in zip(first, last, shape, strict=True)
    )
    return rows, columns


def _carrier(model: Calibration, order: tuple[int, int], area: tuple[slice, slice]) -> np.ndarray:
    """Harmonic (y, x) of a lattice on an area of the picture, 1 at its points."""
    wave = np.array(order) @ np.linalg.inv(model.lattice.matrix)
    y, x = (np.arange(side.start, side.stop, dtype=float) for side in area)
    if model.warp is None:
        down = np.exp(2j * np.pi * wave[0] * (y - model.lattice.origin[0])).astype(np.complex64)
        across = np.exp(2j * np.pi * wave[1] * (x - model.lattice.origin[1])).astype(np.complex64)
        return down[:, None] * across
    flat_y, flat_x = model.straightened(y[:, None], x[None])
    away = wave[0] * (flat_y - model.lattice.origin[0]) + wave[1] * (flat_x - model.lattice.origin[1])
    return np.exp((2j * np.pi * away).astype(np.complex64))


def _averaged(turned: np.ndarray, places: np.ndarray, sigma: float, reach: float) -> np.ndarray:
    """Normal averages (k,) of a picture (y, x) around places (k, 2), over blocks small beside them."""
    step = max(1, int(sigma / _BLOCKS))
    if step > 1:
        pad = [(0, -n % step) for n in turned.shape]
        wide = np.pad(turned, pad, mode="symmetric")
        ny, nx = (n // step for n in wide.shape)
        turned = wide.reshape(ny, step, nx, step).mean((1, 3))
    local = ndimage.gaussian_filter(turned, sigma / step, truncate=reach)
    at = (places.T - (step - 1) / 2) / step
    return sum(
        unit * ndimage.map_coordinates(part, at, order=1, mode="nearest")
        for unit, part in ((1, local.real), (1j, local.imag))
    )


def _cell(lattice: Lattice) -> tuple[float, float]:
    """Height and width of the box around a centre that holds one micro-image [px]."""
    down, along = lattice.pitches
    if lattice.layout == "rectangular" and abs(lattice.rotation) > _UPRIGHT:
        return min(down, along), min(down, along)
    if lattice.layout != "hex":
        return down, along
    rows = lattice.pitch * math.sqrt(3) / 2
    return (rows, along) if abs(lattice.rotation) < math.pi / 12 else (lattice.pitch, rows)


def windows(picture: np.ndarray, reach: Sequence[int]) -> np.ndarray:
    """The surroundings (y, x, 2 ry + 1, 2 rx + 1) of every pixel, a view; the border goes on outwards."""
    wide = np.pad(picture, [(r, r) for r in reach], mode="edge")
    return sliding_window_view(wide, [2 * r + 1 for r in reach])


def _fade(size: float) -> float:
    """Over how many pixels the window of a cell falls to 0."""
    return max(_SOFT * size, 1)


def _reach(size: float, rounds: int) -> int:
    """Pixels around a centre that the window of a cell covers, which moves where it follows the centre."""
    if rounds == 1:
        return math.ceil((size + _fade(size) + 1) / 2) - 1
    return math.ceil(size * (0.5 + _SOFT / 2)) + 2


def _centre(
    around: np.ndarray, guess: np.ndarray, cell: tuple[float, float], rounds: int
) -> tuple[np.ndarray, np.ndarray]:
    """Centres (k, 2) and light (k, 3): mean of the cell, first harmonic along y and along x."""
    first = np.rint(guess).astype(np.int64)
    patches = around[tuple(np.clip(first, 0, np.array(around.shape[:2]) - 1).T)]
    offsets = [np.arange(n) - n // 2 for n in around.shape[2:]]
    angles = [2 * math.pi * o / size for o, size in zip(offsets, cell, strict=True)]
    waves = [np.stack([np.cos(angle), np.sin(angle)], -1) for angle in angles]
    shift = guess - first
    light = np.zeros((len(guess), 3))
    limit = 0.45 * np.array(cell)
    for _ in range(rounds):
        window = [
            np.clip((size / 2 - np.abs(o - s[:, None])) / _fade(size) + 0.5, 0, 1)
            for o, s, size in zip(offsets, shift.T, cell, strict=True)
        ]
        profile_y = np.matmul(patches, window[1].astype(np.float32)[:, :, None])[..., 0]
        profile_x = np.matmul(window[0].astype(np.float32)[:, None, :], patches)[:, 0]
        light[:, 0] = (profile_y * window[0]).sum(-1)
        move = np.empty_like(shift)
        for axis, profile in enumerate((profile_y, profile_x)):
            turn = 2 * math.pi * shift[:, axis] / cell[axis]  # of the harmonic, to the centre so far
            real, imaginary = ((profile * window[axis]) @ waves[axis]).T
            cosine = real * np.cos(turn) + imaginary * np.sin(turn)
            sine = imaginary * np.cos(turn) - real * np.sin(turn)
            move[:, axis] = np.arctan2(sine, cosine) * cell[axis] / (2 * math.pi)
            light[:, axis + 1] = cosine
        shift = np.clip(shift + move, guess - first - limit, guess - first + limit)
    return first + shift, light


def _lit(light: np.ndarray) -> np.ndarray:
    """True for micro-images that are bright and have dark edges; a tenth of a good one is enough."""
    if not len(light):
        return np.zeros(0, bool)
    good = np.percentile(light, 80, axis=0)
    return np.all(light > 0.1 * np.maximum(good, 1e-12), axis=-1)
