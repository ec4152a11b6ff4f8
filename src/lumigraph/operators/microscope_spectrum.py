r"""A microscope's operator between spectra over its lenslets: each frequency has one small real matrix.

Over lenslets the operator is a convolution. Its blocks are symmetric under flips, so that between parts that
are even or odd over a cell (along y and along x), of the points c as of the pixels q, the transform of the
blocks over the offsets d is real but for a factor, and the four frequencies (±f_y, ±f_x) share it:

.. math:: \hat y_q = (-i)^{|q|} R\, (-i)^{|c|} \hat x_c, \quad
          R = (-1)^{q \cdot c} \sum_d K_{qc}(d)\, \mathrm{tr}(2\pi f_y d_y)\, \mathrm{tr}(2\pi f_x d_x)

with tr the cosine where q and c have the same parity along that axis, the sine where not. It takes the same
time however many lenslets a point lights. Large arrays of lenslets are treated in tiles that overlap.
"""

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.fft

from lumigraph.core import arrays
from lumigraph.core.arrays import Array
from lumigraph.core.cache import remembered
from lumigraph.core.threads import single_products
from lumigraph.operators.microscope_kernels import SliceKernel

TILE = 40
"""Lenslets along each side of a tile, at most."""

WEIGHT = 24
"""Multiply-adds of a matrix product in the time of reading one number of `R` from memory."""


@dataclass(frozen=True, slots=True)
class Tiling:
    """How lenslets are parted for transforms.

    Parameters
    ----------
    cells
        Lenslets (rows, columns).
    reach
        Lenslets to each side that a point lights.
    """

    cells: tuple[int, int]
    reach: int

    @property
    def counts(self) -> tuple[int, int]:
        """Tiles along y and x."""
        return math.ceil(self.cells[0] / TILE), math.ceil(self.cells[1] / TILE)

    @property
    def sides(self) -> tuple[int, int]:
        """Lenslets of a tile along y and x."""
        rows, columns = self.counts
        return math.ceil(self.cells[0] / rows), math.ceil(self.cells[1] / columns)

    @property
    def lengths(self) -> tuple[int, int]:
        """Of the transforms: what is lit beyond the array may fall on itself, what is read may not be met."""
        y, x = (
            int(scipy.fft.next_fast_len(side + self.reach * (2 if count > 1 else 1)) or side)
            for side, count in zip(self.sides, self.counts, strict=True)
        )
        return y, x

    @property
    def frequencies(self) -> int:
        """With matrices of their own."""
        return math.prod(length // 2 + 1 for length in self.lengths)

    def tiles(self) -> Iterator[tuple[tuple[slice, slice], tuple[slice, slice]]]:
        """Lenslets (rows, columns) of each tile, and those that its points light."""
        axes = []
        for count, side, n in zip(self.counts, self.sides, self.cells, strict=True):
            own = [slice(k * side, min((k + 1) * side, n)) for k in range(count)]
            lit = [slice(max(0, a.start - self.reach), min(n, a.stop + self.reach)) for a in own]
            axes.append(list(zip(own, lit, strict=True)))
        for (y, lit_y), (x, lit_x) in itertools.product(*axes):
            yield (y, x), (lit_y, lit_x)


def tiling(kernels: Sequence[SliceKernel], cells: tuple[int, int]) -> Tiling:
    """For the widest of the kernels."""
    return Tiling(cells, max(int(np.abs(kernel.offsets).max()) for kernel in kernels))


def matrix_numbers(kernels: Sequence[SliceKernel], cells: tuple[int, int]) -> int:
    """How many `matrices` has."""
    sampling = kernels[0].sampling
    return tiling(kernels, cells).frequencies * len(kernels) * sampling.classes * sampling.pixels**2


def is_faster(kernels: Sequence[SliceKernel], cells: tuple[int, int]) -> bool:
    """Whether reading the matrices takes less time than the products over all offsets."""
    if not all(kernel.symmetric for kernel in kernels):
        return False
    sampling = kernels[0].sampling
    products = sum(len(kernel.offsets) for kernel in kernels) * math.prod(cells) * sampling.classes
    tiles = math.prod(tiling(kernels, cells).counts)
    return products * sampling.pixels**2 > WEIGHT * tiles * matrix_numbers(kernels, cells)


@single_products()
def matrices(kernels: Sequence[SliceKernel], cells: tuple[int, int]) -> np.ndarray:
    """R (frequencies, depths s², N²) float32; the parts that are even over a cell come first."""
    told, sampling = tiling(kernels, cells), kernels[0].sampling
    s, N = sampling.points, sampling.pixels
    found = np.empty((told.frequencies, len(kernels), s, s, N, N), np.float32)
    for k, kernel in enumerate(kernels):
        first = np.asarray((kernel.offsets >= 0).all(1))  # the other quadrants follow by parity
        whole = _in_parts(kernel, first)
        waves = [_waves(length, kernel.offsets[first, axis]) for axis, length in enumerate(told.lengths)]
        for cy, cx, qy, qx in itertools.product((0, 1), repeat=4):
            place = (_part(s, cy), _part(s, cx), _part(N, qy), _part(N, qx))
            trigonometric = waves[0][cy ^ qy][:, None] * waves[1][cx ^ qx]
            part = whole[:, *place]
            product = trigonometric.reshape(told.frequencies, -1) @ part.reshape(
                len(part), math.prod(part.shape[1:])
            )
            sign = -1 if cy * qy ^ cx * qx else 1
            found[:, k, *place] = sign * product.reshape(told.frequencies, *part.shape[1:])
    return found.reshape(told.frequencies, len(kernels) * s * s, N * N)


def _in_parts(kernel: SliceKernel, chosen: np.ndarray) -> np.ndarray:
    """Blocks (n, s, s, N, N) of the chosen offsets, between parts that are even and odd."""
    s, N, n = kernel.sampling.points, kernel.sampling.pixels, int(chosen.sum())
    points, pixels = (parts(k).astype(np.float32) for k in (s, N))
    whole = kernel.matrix().reshape(len(chosen), s * s, N, N)[chosen]
    whole = pixels @ whole.reshape(n * s * s, N, N) @ pixels.T
    whole = points @ whole.reshape(n * s, s, N * N)
    return (points @ whole.reshape(n, s, s * N * N)).reshape(n, s, s, N, N)


def _waves(length: int, offsets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Cosine and sine (frequencies, n) of 2π f d for d and -d together, d from 0 on."""
    phase = 2 * np.pi * (np.arange(length // 2 + 1)[:, None] * offsets % length) / length
    both = np.where(offsets > 0, 2.0, 1.0)
    return (both * np.cos(phase)).astype(np.float32), (both * np.sin(phase)).astype(np.float32)


def _part(n: int, odd: int) -> slice:
    half = (n + 1) // 2
    return slice(half, n) if odd else slice(0, half)


@remembered
def parts(n: int) -> np.ndarray:
    """Orthonormal matrix (n, n) from n samples to their even parts, then their odd ones.

    >>> (parts(3) @ [1.0, 0.0, -1.0]).round(6).tolist()
    [0.0, 0.0, 1.414214]
    """
    found, half = np.zeros((n, n)), (n + 1) // 2
    for k in range(half):
        found[k, k] += 1
        found[k, n - 1 - k] += 1
    for k in range(n // 2):
        found[half + k, k], found[half + k, n - 1 - k] = 1, -1
    return found / np.linalg.norm(found, axis=1, keepdims=True)


def forward(matrix: Array, told: Tiling, volume: Array, pixels: int) -> Array:
    """Samples (rows N, columns N) of a volume (z, rows s, columns s), by `matrices`."""
    xp, s, N, image = arrays.namespace(volume), volume.shape[1] // told.cells[0], pixels, None
    for (y, x), (lit_y, lit_x) in told.tiles():
        part = volume[:, y.start * s : y.stop * s, x.start * s : x.stop * s]
        spread = _applied(matrix, told.lengths, part, (s, N), back=False)
        plane = _planes(_window(spread, (y, x), (lit_y, lit_x)), N)[0, ...]
        if math.prod(told.counts) == 1:
            return plane
        if image is None:
            shape = tuple(n * N for n in told.cells)
            image = xp.zeros(shape, dtype=volume.dtype, device=arrays.device(volume))
        place = image[lit_y.start * N : lit_y.stop * N, lit_x.start * N : lit_x.stop * N]
        place += plane
    return image


def adjoint(matrix: Array, told: Tiling, image: Array, points: int) -> Array:
    """Transpose of `forward`: (z, rows s, columns s)."""
    xp, s, N = arrays.namespace(image), points, image.shape[0] // told.cells[0]
    rows: dict[int, list[Array]] = {}
    for (y, x), (lit_y, lit_x) in told.tiles():
        part = image[None, lit_y.start * N : lit_y.stop * N, lit_x.start * N : lit_x.stop * N]
        gathered = _applied(matrix, told.lengths, part, (N, s), back=True)
        rows.setdefault(y.start, []).append(_planes(_window(gathered, (lit_y, lit_x), (y, x)), s))
    return xp.concat([xp.concat(line, axis=2) for line in rows.values()], axis=1)


def _applied(
    matrix: Array, lengths: tuple[int, int], planes: Array, sides: tuple[int, int], *, back: bool
) -> Array:
    """Convolution (Ly, Lx, channels) of planes (z, rows n, columns n) with the blocks, or its transpose.

    `sides` are those of the cells that come in and go out.
    """
    xp, axes = arrays.namespace(planes), (2, 1) if back else (1, 2)
    own, other = (_factors(n, matrix.shape[k] // n**2) for n, k in zip(sides, axes, strict=True))
    turns = [arrays.like(turn.conj() if back else turn, planes) for turn, _ in (own, other)]
    signs = [arrays.like(sign, planes) for _, sign in (own, other)]
    spectrum = arrays.rfft2(_channels(planes, sides[0]), lengths, axes=(0, 1)) * turns[0]
    columns = _folded(spectrum, signs[0])
    shape = columns.shape[:2]
    columns = xp.reshape(columns, (matrix.shape[0], -1, 4))
    product = (matrix if back else xp.matrix_transpose(matrix)) @ columns
    spectrum = _unfolded(xp.reshape(product, (*shape, -1, 4)), signs[1], lengths[0]) * turns[1]
    return arrays.irfft2(spectrum, lengths, axes=(0, 1))


def _folded(spectrum: Array, signs: Array) -> Array:
    """Real and imaginary parts at f_y and -f_y (half, frequencies along x, channels, 4)."""
    xp, length = arrays.namespace(spectrum), spectrum.shape[0]
    half = length // 2 + 1
    above = spectrum[:half, ...]
    below = xp.concat([spectrum[:1, ...], xp.flip(spectrum[length - half + 1 :, ...], axis=0)]) * signs
    return xp.stack([xp.real(above), xp.imag(above), xp.real(below), xp.imag(below)], axis=-1)


def _unfolded(columns: Array, signs: Array, length: int) -> Array:
    """Inverse of `_folded` (Ly, frequencies along x, channels)."""
    xp, mirrored = arrays.namespace(columns), columns[1 : (length + 1) // 2, ...]
    above = columns[..., 0] + 1j * columns[..., 1]
    below = (mirrored[..., 2] + 1j * mirrored[..., 3]) * signs
    return xp.concat([above, xp.flip(below, axis=0)])


@remembered
def _factors(n: int, planes: int) -> tuple[np.ndarray, np.ndarray]:
    """(-i)^|c| and (-1)^c_y of each channel: planes of parts (even, odd) along y and x."""
    odd = np.arange(n) >= (n + 1) // 2
    turn = np.array([1, -1j, -1])[odd[:, None] * 1 + odd]
    sign = np.where(odd, -1.0, 1.0)[:, None] * np.ones(n)
    return np.tile(turn.ravel(), planes), np.tile(sign.ravel(), planes)


def _channels(planes: Array, n: int) -> Array:
    """Planes (z, rows n, columns n) to even and odd parts of each cell (rows, columns, z n²)."""
    xp, basis = arrays.namespace(planes), arrays.like(parts(n), planes)
    cells = xp.permute_dims(arrays.tiled(planes, (n, n)), (1, 2, 0, 3, 4))
    return xp.reshape(basis @ cells @ xp.matrix_transpose(basis), (*cells.shape[:2], -1))


def _planes(cells: Array, n: int) -> Array:
    """Inverse of `_channels`."""
    xp, (rows, columns, channels) = arrays.namespace(cells), cells.shape
    basis, z = arrays.like(parts(n), cells), channels // n**2
    whole = xp.matrix_transpose(basis) @ xp.reshape(cells, (rows, columns, z, n, n)) @ basis
    return arrays.untiled(xp.permute_dims(whole, (2, 0, 1, 3, 4)))


def _window(values: Array, at: tuple[slice, slice], wanted: tuple[slice, slice]) -> Array:
    """Cells `wanted` of values (Ly, Lx, ...) that begin `at` a cell and are periodic."""
    xp, first = arrays.namespace(values), tuple(w.start - a.start for w, a in zip(wanted, at, strict=True))
    if any(first):
        values = xp.roll(values, (-first[0], -first[1]), axis=(0, 1))
    return values[: wanted[0].stop - wanted[0].start, : wanted[1].stop - wanted[1].start, ...]
