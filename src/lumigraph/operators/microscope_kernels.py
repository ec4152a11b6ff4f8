"""Images of the points of one lenslet's cell in a light-field microscope: what its operator repeats.

A microscope is telecentric: moving a point by a lenslet's pitch over M moves its image by exactly one
lenslet. So the points of one cell are enough; where objective and lenslets look the same after every flip and
transposition, those of an eighth of the cell are.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from lumigraph.core import arrays, memory
from lumigraph.core.threads import single_products
from lumigraph.elements.objective import Objective
from lumigraph.errors import SamplingError
from lumigraph.operators.microscope_cell import CellSampling, Lenslet
from lumigraph.operators.microscope_rays import ray_images

MARGIN = 1.15
"""Samples of a lenslet, over what its light asks for."""

DROPPED = 0.01
"""Part of the light in the faintest offsets between cells, which are left out."""

TAILS = 1.5
"""Relative rms error of an image over the part of the light that is left out.

Measured at NA 0.5, 20x, f/20 lenslets, sparse points: 1.3 for a hundredth in focus, 1.0 at 20 um out of it.
"""


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
    """

    offsets: np.ndarray
    blocks: np.ndarray
    sampling: CellSampling
    symmetric: bool

    def matrix(self) -> np.ndarray:
        """(n s², N²) float32: the images of all points, offset by offset."""
        s, n, N = self.sampling.points, len(self.offsets), self.sampling.pixels
        if not self.symmetric:
            return np.ascontiguousarray(self.blocks.transpose(1, 0, 2)).reshape(n * s * s, N * N)
        whole = np.empty((n, s * s, N * N), np.float32)
        for place, (flip_y, flip_x, swap), row in _expansion(s):
            moved = self._moved(flip_y, flip_x, swap)
            block = self.blocks[row].reshape(n, N, N)
            block = block.transpose(0, 2, 1) if swap else block
            block = block[:, ::-1] if flip_y else block
            block = block[:, :, ::-1] if flip_x else block
            whole[moved, place] = block.reshape(n, N * N)
        return whole.reshape(n * s * s, N * N)

    def _moved(self, flip_y: bool, flip_x: bool, swap: bool) -> np.ndarray:
        """Where each offset stands after a transposition and flips."""
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
    """For each point of a cell: place, (flip y, flip x, transpose first), stored point."""
    rows = {point: row for row, point in enumerate(octant(s))}
    found = []
    for ky in range(s):
        for kx in range(s):
            y, x = min(ky, s - 1 - ky), min(kx, s - 1 - kx)
            steps = (ky != y, kx != x, y > x)
            found.append((ky * s + kx, steps, rows[min(y, x), max(y, x)]))
    return found


def reach_of(objective: Objective, lenslet: Lenslet, dz: float, dropped: float) -> int:
    """Cells to each side of a point's own that hold all of its light but `dropped`."""
    radius = objective.radius_of(1 - dropped, dz) * lenslet.magnification
    return max(1, math.ceil(radius / lenslet.pitch))


@single_products()
def slice_kernel(
    objectives: Sequence[Objective],
    lenslet: Lenslet,
    sampling: CellSampling,
    dz: float,
    dropped: float = DROPPED,
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
    dropped
        Part of the light that the faintest cells may hold, and the window in which images are computed may
        miss; what is kept is scaled up to all of it.
    """
    symmetric, s, N = all(one.is_round for one in objectives), sampling.points, sampling.pixels
    points = octant(s) if symmetric else [(ky, kx) for ky in range(s) for kx in range(s)]
    cells, passed = _images(objectives, lenslet, sampling, points, (dz, dropped))
    T = math.isqrt(cells.shape[1])
    kept = _bright(cells, points, (s, T), dropped, symmetric)
    cells = np.ascontiguousarray(cells[:, kept])
    cells *= (N * N / s**2 * passed / cells.sum((1, 2), dtype=np.float64)).astype(np.float32)[:, None, None]
    offsets = np.stack(np.divmod(kept, T), 1) - T // 2
    return SliceKernel(offsets, cells, sampling, symmetric)


def point_cells(
    objectives: Sequence[Objective],
    lenslet: Lenslet,
    sampling: CellSampling,
    point: tuple[float, float],
    told: tuple[float, float],
) -> np.ndarray:
    """Image (T, T, N, N), in T × T cells around its own, of one point that need not be a sample.

    Parameters
    ----------
    objectives, lenslet, sampling
        As in `slice_kernel`.
    point
        Place in its cell (ky, kx), in samples from 0 to s - 1.
    told
        Depth [m], and the part of the light that the window may miss.
    """
    cells, passed = _images(objectives, lenslet, sampling, [point], told)
    T, N = math.isqrt(cells.shape[1]), sampling.pixels
    scale = N * N / sampling.classes * float(passed[0]) / float(cells.sum(dtype=np.float64))
    return cells.reshape(T, T, N, N) * np.float32(scale)


def _images(
    objectives: Sequence[Objective],
    lenslet: Lenslet,
    sampling: CellSampling,
    points: Sequence[tuple[float, float]],
    told: tuple[float, float],
) -> tuple[np.ndarray, np.ndarray]:
    """Images (points, cells, N²) at (dz, dropped), and the part of their light that passes (points,)."""
    if objectives[0].model == "rays":  # which have no wavelength
        return ray_images(objectives[0], lenslet, sampling, points, told[0])
    (dz, dropped), N = told, sampling.pixels
    reach = max(reach_of(one, lenslet, dz, dropped) for one in objectives)
    T = 2 * reach + 1
    cells = np.zeros((len(points), T * T, N * N), np.float32)
    passed = np.zeros(len(points))
    for objective in objectives:
        bench = _Bench(objective, lenslet, sampling, reach)
        for row, point in enumerate(points):
            image = bench.image(point, dz)
            cells[row] += image.reshape(T, N, T, N).transpose(0, 2, 1, 3).reshape(T * T, N * N)
            passed[row] += bench.open / len(objectives)
    return cells, passed


def require_window(objective: Objective, lenslet: Lenslet, sampling: CellSampling, dz: float) -> None:
    """Refuse a depth at which the window of a point's image does not fit in memory.

    Raises
    ------
    SamplingError
        The depth, and how many lenslets its light is wide there.
    """
    spread = abs(dz) * objective.aperture / math.sqrt(objective.medium**2 - objective.aperture**2)
    cells = 2 * math.ceil(spread * lenslet.magnification / lenslet.pitch) + 5
    side = cells * _fineness(objective, lenslet, sampling) * sampling.pixels
    what = f"the image of a point at {dz * 1e6:.4g} µm, which lights {cells} lenslets across,"
    memory.require(
        (16.0 * objective.modes + 64) * side**2,
        what,
        "Use depths nearer to the focused plane.",
        SamplingError,
    )


def _fineness(objective: Objective, lenslet: Lenslet, sampling: CellSampling) -> int:
    """Samples of the light along an image sample."""
    steepest = objective.numerical_aperture / lenslet.magnification
    steepest += lenslet.pitch / (2 * abs(lenslet.focal_length))
    return math.ceil(lenslet.pitch * 2 * MARGIN * steepest / objective.wavelength / sampling.pixels)


def kernel_bytes(
    objective: Objective, lenslet: Lenslet, sampling: CellSampling, dz: float, dropped: float = DROPPED
) -> float:
    """Upper bound of what the kernel of a depth takes in memory, expanded to all points [bytes]."""
    cells = 2 * reach_of(objective, lenslet, dz, dropped) + 1
    return 4.0 * cells**2 * sampling.classes * sampling.pixels**2


def _bright(
    cells: np.ndarray,
    points: list[tuple[int, int]],
    sides: tuple[int, int],
    dropped: float,
    symmetric: bool,
) -> np.ndarray:
    """Offsets that hold all of the light but `dropped`, the same after every flip and transposition."""
    s, T = sides
    light = cells.sum(2, dtype=np.float64)
    count = np.ones(len(points)) if not symmetric else np.bincount([row for *_, row in _expansion(s)])
    total = (light * count[:, None]).sum(0).reshape(T, T)
    if symmetric:
        total = total + total.T
        total = total + total[::-1]
        total = total + total[:, ::-1]
        total = np.round(total / total.max(), 12)
    order = np.argsort(total, axis=None)
    faint = np.cumsum(total.ravel()[order]) <= dropped * total.sum()
    threshold = total.ravel()[order][faint].max(initial=-1.0)
    return np.flatnonzero(total.ravel() > threshold)


class _Bench:
    """The lenslets around a point's own, and the way from there to the pixels."""

    def __init__(self, objective: Objective, lenslet: Lenslet, sampling: CellSampling, reach: int) -> None:
        self.objective, self.lenslet, self.sampling = objective, lenslet, sampling
        wave, p = objective.wavelength, lenslet.pitch
        self.over = _fineness(objective, lenslet, sampling)
        self.fine = self.over * sampling.pixels
        self.cells = 2 * reach + 3  # a lenslet more on each side, for what diffracts outward
        self.step = p / self.fine
        n = self.cells * self.fine
        self.at = (np.arange(n) - (n - 1) / 2) * self.step
        self.phase, self.mask = self._lenslets(wave)
        f2 = np.fft.fftfreq(n, self.step) ** 2
        self.transfer = np.exp(-1j * np.pi * wave * lenslet.distance * f2).astype(np.complex64)
        self.open = 1.0

    def _lenslets(self, wave: float) -> tuple[np.ndarray, np.ndarray]:
        own = (np.arange(self.fine) - (self.fine - 1) / 2) * self.step
        phase = np.exp(-1j * np.pi * own**2 / (wave * self.lenslet.focal_length)).astype(np.complex64)
        half = self.lenslet.width / 2
        inside = np.clip((half - np.abs(own)) / self.step + 0.5, 0, 1)
        mask = np.outer(inside, inside)
        if self.lenslet.is_round:
            mask = np.clip((half - np.hypot(own[:, None], own)) / self.step + 0.5, 0, 1)
        return np.tile(phase, self.cells), np.tile(mask, (self.cells, self.cells)).astype(np.float32)

    def image(self, point: tuple[float, float], dz: float) -> np.ndarray:
        """Intensity ((2 reach + 1) N, the same) of a point (ky, kx) of the middle cell [samples]."""
        s, p, M = self.sampling.points, self.lenslet.pitch, self.lenslet.magnification
        y, x = ((self.at - ((k - (s - 1) / 2) / s) * p) / M for k in point)
        fields = self.objective.fields(y[:, None], x[None, :], dz).astype(np.complex64)
        whole, passed, image = 0.0, 0.0, np.zeros((len(self.at),) * 2, np.float32)
        for field in fields:
            whole += float(np.square(np.abs(field)).sum(dtype=np.float64))
            field = field * self.phase[:, None] * self.phase * self.mask
            passed += float(np.square(np.abs(field)).sum(dtype=np.float64))
            spectrum = arrays.fft2(field, overwrite=True)
            spectrum *= self.transfer[:, None]
            spectrum *= self.transfer
            field = arrays.ifft2(spectrum, overwrite=True)
            image += np.square(field.real) + np.square(field.imag)
        self.open = passed / whole
        return self._pixels(image)

    def _pixels(self, image: np.ndarray) -> np.ndarray:
        """Samples of the cells but for the outermost, each averaged over its square."""
        n, N, edge = len(self.at), self.sampling.pixels, self.sampling.pixels
        if abs(self.sampling.width * N - 1) < 1e-9:
            shape = (n // self.over, self.over, n // self.over, self.over)
            image = image.reshape(shape).mean((1, 3))
        else:
            f = np.fft.fftfreq(n)
            # Half a fine sample: the middle of an even number of them lies between two.
            shift = np.exp(-1j * np.pi * f) if self.over % 2 == 0 else np.ones(n)
            spread = (np.sinc(f * self.sampling.width * self.fine) * shift).astype(np.complex64)
            spectrum = arrays.fft2(image) * spread[:, None] * spread
            image = arrays.ifft2(spectrum, overwrite=True).real
            start = self.over // 2
            image = np.maximum(image[start :: self.over, start :: self.over], 0)
        return image[edge:-edge, edge:-edge]
