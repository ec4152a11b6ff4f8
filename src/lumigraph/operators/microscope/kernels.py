"""Images of the points of one lenslet's cell in a light-field microscope: what its operator repeats.

A microscope is telecentric: moving a point by a lenslet's pitch over M moves its image by exactly one
lenslet. So the points of one cell are enough; where objective and lenslets look the same after every flip and
transposition, those of an eighth of the cell are.

Cells far from a point's own receive little light, and much the same from all points of its cell: there the
cell counts as one point, and its image as one of a few patterns, by direction (`FarCells`).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from lumigraph.core import memory
from lumigraph.core.threads import single_products
from lumigraph.elements.objective import Objective
from lumigraph.errors import SamplingError
from lumigraph.operators.microscope.bench import LensletBench, bench_bytes, fineness, guard
from lumigraph.operators.microscope.cell import CellSampling, Lenslet
from lumigraph.operators.microscope.far_light import FarCells
from lumigraph.operators.microscope.rays import ray_images
from lumigraph.operators.microscope.waves import SeparableLenslets

SECTORS = 16
"""Directions of the patterns of far cells."""

SHARES = {"near": 0.5, "window": 0.25, "patterns": 0.3, "pixels": 0.5, "rank": 0.1}
"""Of the accuracy, that cells treated as far, those beyond the window, patterns left out and the low rank of
fields may take."""

SPREAD = 8.0
"""How much more of a far lenslet's light than one spot is spread out.

Measured: 60x/1.2 and 20x/0.5, three depths, with it windows are 0 to 4 cells larger than what comes out near.
"""

DENSER = 1.2
"""Factor of the samples of the light where a point lights 8 lenslets to each side; from 2 on there are more.

At 1e-4 twice. Measured at 60x/1.2, 9 µm out of focus, 11 lenslets, pixels from 1.25
times the samples: off by 1.37 times 1e-3 without, by 0.47 with; by 1.34 times 1e-4 with it once, 0.81 twice.
"""

BESIDE = 9.5e-4
"""Relative rms, times k², by what lenslets k beyond `guard` send into a window, where rays light them.

Measured at 60x/1.2, 9 µm out of focus, windows of one and seven lenslets, in all, over 1e-4: 3.7 and 1.8 with
k = 0 (and `DENSER` once), 1.3 and 0.8 with 2, 0.55 with 3, 0.49 from 4 on.
"""

BESIDE_MOST = 4
"""Lenslets beyond `guard` that send light into a window: with more, images change by less than 3e-6."""

RAYS = 0.95
"""Part of the rays that aberrations leave within a window: beyond it they are few, and treated as far."""


@dataclass(frozen=True, slots=True)
class KernelAccuracy:
    """Accuracy and extent of the wanted images.

    Parameters
    ----------
    accuracy
        Relative rms.
    limit
        Cells to each side that are wanted at all.
    """

    accuracy: float
    limit: int

    @property
    def margin(self) -> float:
        """Samples of the light, over what its band without diffraction at lenslets asks for.

        Measured at 20x/0.5 and 60x/1.2, three depths, against 10, relative rms: 5e-4 to 1e-2 with 2, 2e-4 to
        6e-3 with 2.4, 7e-5 to 5e-4 with 3.2 (1.4e-3 on 16 pixels), 1e-5 to 7e-5 with 4.5. With 3.4 and 4.8
        points at 1e-3 and 1e-4 of 20x/0.5 keep below what is asked for (`benchmarks.accuracy`).
        """
        digits, most = (0.5, 1, 2, 3, 4, 5), (1.45, 1.8, 2.4, 3.4, 4.8, 8)
        return float(np.interp(-math.log10(self.accuracy), digits, most))


@dataclass(frozen=True, slots=True, eq=False)
class SliceKernel:
    """Images of a cell's points at one depth.

    Parameters
    ----------
    offsets
        (n, 2): the cells (dy, dx) that receive light, relative to the points' own.
    blocks
        (m, n, N²) float32: of each stored point, in each of those cells.
    sampling
        Of the cell.
    symmetric
        Whether only the points of an eighth of the cell are stored (`octant`).
    far
        What the other cells receive; None for nothing.
    error
        Estimated relative rms of a point's image; NaN where it is not known.
    passed
        Part of an even plane's light that the lenslets let through.
    """

    offsets: np.ndarray
    blocks: np.ndarray
    sampling: CellSampling
    symmetric: bool
    far: FarCells | None = None
    error: float = math.nan
    passed: float = 1.0

    def white(self) -> np.ndarray:
        """Image (N²,) of an even plane of 1 that goes on beyond all lenslets."""
        near = self.matrix().sum(0, dtype=np.float64)
        if self.far is None:
            return near
        far = self.far.weights.sum(0, dtype=np.float64) @ self.far.images
        return near + far * max(self.passed * len(near) - near.sum(), 0) / far.sum()

    def matrix(self) -> np.ndarray:
        """(n s², N²) float32: the images of all points, offset by offset."""
        s, n, N = self.sampling.points, len(self.offsets), self.sampling.pixels
        if not self.symmetric:
            return np.ascontiguousarray(self.blocks.transpose(1, 0, 2)).reshape(n * s * s, N * N)
        whole, blocks = np.empty((n, s * s, N * N), np.float32), np.asarray(self.blocks)  # not a memmap
        for place, (flip_y, flip_x, swap), row in _expansion(s):
            moved = self._moved(flip_y, flip_x, swap)
            block = blocks[row].reshape(n, N, N)
            block = block.transpose(0, 2, 1) if swap else block
            block = block[:, ::-1] if flip_y else block
            block = block[:, :, ::-1] if flip_x else block
            whole[moved, place] = block.reshape(n, N * N)
        return whole.reshape(n * s * s, N * N)

    def _moved(self, flip_y: bool, flip_x: bool, swap: bool) -> np.ndarray:
        """Place of each offset after a transposition and flips."""
        dy, dx = (self.offsets[:, ::-1] if swap else self.offsets).T
        dy, dx = (-dy if flip_y else dy), (-dx if flip_x else dx)
        reach = int(np.abs(self.offsets).max())
        index = np.zeros((2 * reach + 1, 2 * reach + 1), np.int64)
        index[tuple((self.offsets + reach).T)] = np.arange(len(self.offsets))
        return index[dy + reach, dx + reach]


def octant(s: int) -> list[tuple[int, int]]:
    """Points (ky, kx) of an eighth of a cell of s × s, from which flips and transposition make all.

    >>> octant(5)
    [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)]
    """
    half = (s + 1) // 2
    return [(ky, kx) for ky in range(half) for kx in range(ky, half)]


@lru_cache(maxsize=16)
def _expansion(s: int) -> list[tuple[int, tuple[bool, bool, bool], int]]:
    """Origin of each point of a cell: place, (flip y, flip x, transpose first), stored point."""
    rows = {point: row for row, point in enumerate(octant(s))}
    found = []
    for ky in range(s):
        for kx in range(s):
            y, x = min(ky, s - 1 - ky), min(kx, s - 1 - kx)
            steps = (ky != y, kx != x, y > x)
            found.append((ky * s + kx, steps, rows[min(y, x), max(y, x)]))
    return found


def reach_of(objective: Objective, lenslet: Lenslet, dz: float, demand: KernelAccuracy) -> int:
    """Cells to each side of a point's own that hold its image but for a share of the accuracy, rms.

    Beyond what rays light, the part of a point's light that is farther than R falls as 1/R. A lenslet there
    makes a small spot of it, where one that the whole aperture lights spreads its own over all directions.
    """
    size = lenslet.pitch / lenslet.magnification
    rays = _ray_radius(objective, dz, min(RAYS, 1 - demand.accuracy**2))
    if objective.model == "rays":
        return max(1, math.ceil(rays / size))
    nearest = objective.wavelength / objective.numerical_aperture
    slope = objective.numerical_aperture / lenslet.magnification * lenslet.distance / lenslet.pitch
    resolved = lenslet.pitch**2 / (objective.wavelength * lenslet.distance)
    lit = max(math.pi * (rays / size) ** 2, 1.0)
    spots = max((2 * slope * resolved) ** 2 / lit, 1.0)
    wanted = SHARES["window"] * demand.accuracy
    # Part of the light beyond R: λ/(π² NA (R - r)); of a cell at R: its slope over a ring of cells.
    for reach in range(max(1, math.ceil(rays / size)), demand.limit):
        at = np.arange(reach + 0.5, 8 * reach + 9)
        away = np.maximum(at * size - rays, nearest / 4)
        cell = nearest * size / (math.pi**2 * away**2) / (2 * np.pi * at)
        if np.square(cell).dot(2 * np.pi * at) * spots * lit < SPREAD * wanted**2:
            return reach
    return max(demand.limit, 1)


def margin_of(objective: Objective, lenslet: Lenslet, dz: float, demand: KernelAccuracy) -> float:
    """Margin of `KernelAccuracy`, more by powers of `DENSER` where a point lights many lenslets."""
    most = DENSER ** float(np.clip(-math.log10(demand.accuracy) - 2, 1, 2))
    return demand.margin * float(np.interp(_lit(objective, lenslet, dz), (2, 8), (1, most)))


def _lit(objective: Objective, lenslet: Lenslet, dz: float) -> float:
    """Lenslets to each side that rays light."""
    return _ray_radius(objective, dz) * lenslet.magnification / lenslet.pitch


def _ray_radius(objective: Objective, dz: float, part: float = RAYS) -> float:
    """Radius of what rays light, for this part of those that aberrations bend, in object space [m]."""
    spread = objective.aperture / math.sqrt(objective.medium**2 - objective.aperture**2)
    straight = abs(dz) * spread + abs(objective.image_defocus) * objective.numerical_aperture
    return straight + objective.spread(part)


@single_products()
def slice_kernel(
    objectives: Sequence[Objective],
    lenslet: Lenslet,
    sampling: CellSampling,
    dz: float,
    demand: KernelAccuracy = KernelAccuracy(1e-2, 64),
) -> SliceKernel:
    """Images of a cell's points at depth dz, so that an even plane of intensity 1 gives an image of 1.

    Parameters
    ----------
    objectives
        One for each wavelength, whose images are averaged.
    lenslet, sampling
        The rest of the microscope and how its cells are sampled.
    dz
        Depth from the focused plane [m].
    demand
        How exactly, and how far.
    """
    symmetric, s = all(one.is_round for one in objectives), sampling.points
    points = octant(s) if symmetric else [(ky, kx) for ky in range(s) for kx in range(s)]
    cells, lost = _images(objectives, lenslet, sampling, points, (dz, demand))
    T = math.isqrt(cells.shape[1])
    offsets = np.stack(np.divmod(np.arange(T * T), T), 1) - T // 2
    counts = np.bincount([row for *_, row in _expansion(s)]) if symmetric else np.ones(len(points))
    average = np.tensordot(counts / s**2, cells, 1)
    average = _symmetrised(average, T) if symmetric else average
    if objectives[0].model == "rays":
        kept = average.sum(1) > 0
        return SliceKernel(
            offsets[kept], np.ascontiguousarray(cells[:, kept]), sampling, symmetric, None, lost
        )
    patterns, weights = _patterns(average, offsets)
    guessed = (weights * average.sum(1)[:, None]) @ patterns
    off = np.stack([np.square(own - guessed).sum(1, dtype=np.float64) for own in cells])
    off /= np.square(cells).sum((1, 2), dtype=np.float64)[:, None]
    kept, cut = _near(counts @ off / s**2, T, SHARES["near"] * demand.accuracy, symmetric)
    passed = sampling.light * (lenslet.width / lenslet.pitch) ** 2 * (math.pi / 4 if lenslet.is_round else 1)
    beyond = max(passed * sampling.pixels**2 / s**2 - float(average.sum(dtype=np.float64)), 0.0)
    places, light = _far(average.sum(1) * ~kept, beyond, (objectives[0], lenslet, dz), demand)
    return SliceKernel(
        offsets[kept], np.ascontiguousarray(cells[:, kept]), sampling, symmetric,
        FarCells(places, light[:, None] * _sectors(places), patterns), math.hypot(lost, cut), passed,
    )  # fmt: skip


def _symmetrised(average: np.ndarray, T: int) -> np.ndarray:
    """Mean over flips and transposition of cells (T², N²)."""
    N = math.isqrt(average.shape[1])
    whole = average.reshape(T, T, N, N)
    whole = (whole + whole.transpose(1, 0, 3, 2)) / 2
    whole = (whole + whole[::-1, :, ::-1]) / 2
    return ((whole + whole[:, ::-1, :, ::-1]) / 2).reshape(average.shape)


def _sectors(offsets: np.ndarray) -> np.ndarray:
    """Part (n, SECTORS) of each offset that belongs to each direction: linear between two."""
    at = np.arctan2(offsets[:, 0], offsets[:, 1]) * SECTORS / (2 * np.pi)
    first, rows = np.floor(at).astype(int), np.arange(len(at))
    found = np.zeros((len(at), SECTORS), np.float32)
    found[rows, first % SECTORS] = 1 - (at - first)
    found[rows, (first + 1) % SECTORS] = at - first
    return found


def _patterns(average: np.ndarray, offsets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Patterns (SECTORS, N²) of light 1 in the outer cells of a window, and weights (n, SECTORS)."""
    weights = _sectors(offsets)
    distance = np.hypot(*offsets.T)
    outer = distance > 0.6 * offsets.max()
    found = weights[outer].T @ average[outer]
    return found / np.maximum(found.sum(1, keepdims=True), np.finfo(np.float32).tiny), weights


def _near(off: np.ndarray, T: int, wanted: float, symmetric: bool) -> tuple[np.ndarray, float]:
    """Cells (T²,) that are not far, the same after every flip and transposition; the rms of the others."""
    if symmetric:
        off = _symmetrised(off.reshape(T * T, 1), T)[:, 0]
        off = np.round(off / off.max(), 12) * off.max()
    order = np.argsort(off)
    needed = off[order][np.cumsum(off[order]) > wanted**2]
    kept = off >= needed.min(initial=np.inf)  # with all that are as strong, as flipped cells are
    return kept, math.sqrt(off[~kept].sum())


def _far(
    inside: np.ndarray, beyond: float, told: tuple[Objective, Lenslet, float], demand: KernelAccuracy
) -> tuple[np.ndarray, np.ndarray]:
    """Offsets (n, 2) of far cells and their light, given that of those in the window and all beyond it."""
    (objective, lenslet, dz), T = told, math.isqrt(len(inside))
    size, rays = lenslet.pitch / lenslet.magnification, _ray_radius(objective, dz)

    def falling(distance: np.ndarray) -> np.ndarray:
        r = np.maximum(distance * size, 1e-3 * size)
        return (1 / np.maximum(r - rays, size / 2) ** 2 + 1 / (r + rays) ** 2) / r

    farthest = max(demand.limit, T // 2)
    at = np.arange(-farthest, farthest + 1)
    offsets = np.stack(np.meshgrid(at, at, indexing="ij"), -1).reshape(-1, 2)
    outside = np.abs(offsets).max(1) > T // 2
    light = falling(np.hypot(*offsets.T)) * outside
    rings = np.arange(farthest + 1, 64 * (farthest + 1))
    whole = light.sum() + (8 * rings * falling(1.12 * rings)).sum()
    light *= beyond / whole
    light[~outside] = inside
    return offsets[light > 0], light[light > 0].astype(np.float32)


def point_cells(
    objectives: Sequence[Objective],
    lenslet: Lenslet,
    sampling: CellSampling,
    point: tuple[float, float],
    told: tuple[float, KernelAccuracy],
) -> tuple[np.ndarray, float]:
    """Image (T, T, N, N) in T × T cells of one point, which need not be a sample, and its rms error.

    Parameters
    ----------
    objectives, lenslet, sampling
        As in `slice_kernel`.
    point
        Place in its cell (ky, kx), in samples from 0 to s - 1.
    told
        Depth [m], and how exactly.
    """
    cells, lost = _images(objectives, lenslet, sampling, [point], told)
    T, N = math.isqrt(cells.shape[1]), sampling.pixels
    return cells.reshape(T, T, N, N), lost


def _images(
    objectives: Sequence[Objective],
    lenslet: Lenslet,
    sampling: CellSampling,
    points: Sequence[tuple[float, float]],
    told: tuple[float, KernelAccuracy],
) -> tuple[np.ndarray, float]:
    """Images (points, cells, N²) at (dz, demand), and the relative rms that their samples do not hold."""
    (dz, demand), N = told, sampling.pixels
    if objectives[0].model == "rays":  # which have no wavelength
        cells = ray_images(objectives[0], lenslet, sampling, points, dz)
        return cells * np.float32(sampling.light * N * N / sampling.classes), 0.0
    reach = max(reach_of(one, lenslet, dz, demand) for one in objectives)
    T, lost = 2 * reach + 1, 0.0
    cells = np.zeros((len(points), T * T, N * N), np.float32)
    for objective in objectives:
        bench = _bench(objective, lenslet, sampling, reach, (dz, demand))
        for row, (image, missed) in enumerate(bench.images(dz, points)):
            parted = image.reshape(T, N, T, N).transpose(0, 2, 1, 3).reshape(T * T, N * N)
            cells[row] += sampling.light / len(objectives) * parted
            lost = max(lost, missed)
    return cells, lost


def _bench(
    objective: Objective,
    lenslet: Lenslet,
    sampling: CellSampling,
    reach: int,
    told: tuple[float, KernelAccuracy],
) -> LensletBench | SeparableLenslets:
    margin = margin_of(objective, lenslet, *told)
    more, asked = 0, told[1].accuracy
    if _lit(objective, lenslet, told[0]) > reach:
        more = min(int(math.sqrt(BESIDE / asked)), BESIDE_MOST)
    if lenslet.is_round:
        return LensletBench(objective, lenslet, sampling, reach, margin, more, asked)
    return SeparableLenslets(objective, lenslet, sampling, reach, margin, SHARES["rank"] * asked, more, asked)


def require_window(
    objective: Objective,
    lenslet: Lenslet,
    sampling: CellSampling,
    dz: float,
    demand: KernelAccuracy,
    points: int = 1,
) -> None:
    """Refuse a depth at which the windows of points' images, one in each thread, do not fit in memory.

    Of points on so many lines along y and along x.

    Raises
    ------
    SamplingError
        The depth, and how many lenslets its light is wide there.
    """
    margin = margin_of(objective, lenslet, dz, demand)
    reach = max(reach_of(objective, lenslet, dz, demand), math.ceil(_lit(objective, lenslet, dz)))
    cells = 2 * (reach + guard(objective, lenslet)) + 1
    what = f"the image of a point at {dz * 1e6:.4g} µm, which lights {cells} lenslets across,"
    if lenslet.is_round:
        held = bench_bytes(objective.modes, cells, fineness(objective, lenslet, margin, points), points)
    else:
        bench = SeparableLenslets(objective, lenslet, sampling, reach, margin, accuracy=demand.accuracy)
        held = bench.held_bytes(points)
    memory.require(held, what, "Use depths nearer to the focused plane.", SamplingError)


def kernel_bytes(
    objective: Objective, lenslet: Lenslet, sampling: CellSampling, dz: float, demand: KernelAccuracy
) -> float:
    """Upper bound of what the kernel of a depth takes in memory, expanded to all points [bytes]."""
    cells = 2 * reach_of(objective, lenslet, dz, demand) + 1
    return 4.0 * cells**2 * sampling.classes * sampling.pixels**2
