r"""A microscope's operator between spectra over its lenslets: each frequency has one small real matrix.

Over lenslets the operator is a convolution. Its blocks are symmetric under flips, so that between parts that
are even or odd over a cell (along y and along x), of the points c as of the pixels q, the transform of the
blocks over the offsets d is real but for a factor, and the four frequencies (±f_y, ±f_x) share it:

.. math:: \hat y_q = (-i)^{|q|} R\, (-i)^{|c|} \hat x_c, \quad
          R = (-1)^{q \cdot c} \sum_d K_{qc}(d)\, \mathrm{tr}(2\pi f_y d_y)\, \mathrm{tr}(2\pi f_x d_x)

with tr the cosine where q and c have the same parity along that axis, the sine where not. It takes the same
time however many lenslets a point lights. Large arrays of lenslets are treated in tiles (`microscope_tiles`).
"""

import itertools
import math
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from lumigraph.core import arrays
from lumigraph.core.arrays import Array
from lumigraph.core.cache import remembered
from lumigraph.core.threads import each, single_products
from lumigraph.operators.microscope_kernels import SliceKernel
from lumigraph.operators.microscope_tiles import Span, Tiling, tilings

LEAST = 8
"""Lenslets along each side of a tile, at least, where there are so many."""

MOST = 2**32
"""Bytes of all matrices, at most; with smaller tiles there are fewer."""

READ, PASSED = 24, 150
"""Multiply-adds of a matrix product in the time of reading one number of `R` from memory, and of what is done
to one number of a tile (transforms, parts and copies). The former was measured, the latter is a guess."""

GROUP = 2**26
"""Numbers of the transforms of all tiles that are held at a time, at most, if one depth has fewer."""


def tiling(kernels: Sequence[SliceKernel], cells: tuple[int, int], margin: int) -> Tiling:
    """The fastest whose matrices are at most `MOST`; the fewest matrices where none is.

    Parameters
    ----------
    kernels
        Of each depth.
    cells
        Lenslets (rows, columns) whose images are followed.
    margin
        Lenslets that the object reaches beyond them on each side.
    """
    reach = max(int(np.abs(kernel.offsets).max()) for kernel in kernels)
    least = min(LEAST, *cells)
    found = list(tilings(cells, margin, reach, least))
    fitting = [told for told in found if 4 * matrix_numbers(kernels, told) <= MOST]
    if not fitting:
        return min(found, key=lambda told: told.frequencies)
    return min(fitting, key=lambda told: cost(kernels, told))


def matrix_numbers(kernels: Sequence[SliceKernel], told: Tiling) -> int:
    """How many `matrices` has."""
    sampling = kernels[0].sampling
    return told.frequencies * len(kernels) * sampling.classes * sampling.pixels**2


def cost(kernels: Sequence[SliceKernel], told: Tiling) -> float:
    """Of one application of the operator or of its transpose [multiply-adds]."""
    sampling = kernels[0].sampling
    channels = len(kernels) * sampling.classes + sampling.pixels**2
    passed = told.count * math.prod(told.lengths) * channels
    return matrix_numbers(kernels, told) * (READ + 4.0 * told.count) + PASSED * passed


def is_faster(kernels: Sequence[SliceKernel], told: Tiling) -> bool:
    """Whether it takes less time than the products over all offsets."""
    if not all(kernel.symmetric for kernel in kernels):
        return False
    sampling = kernels[0].sampling
    products = sum(len(kernel.offsets) for kernel in kernels) * math.prod(told.cells) * sampling.classes
    return products * sampling.pixels**2 > cost(kernels, told)


@single_products()
def matrices(kernels: Sequence[SliceKernel], told: Tiling) -> np.ndarray:
    """R (frequencies, depths s², N²) float32; the parts that are even over a cell come first."""
    sampling = kernels[0].sampling
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
    s = volume.shape[1] // (told.rows.cells + 2 * told.rows.margin)
    xp, columns = arrays.namespace(volume), 0.0

    def lit(depths: slice) -> Array:
        cells = _channels(volume[depths, ...], s)
        held = _columns(cells, told, s, of_image=False)
        return held @ matrix[:, depths.start * s * s : depths.stop * s * s, :]

    for part in _all(lit, told, volume.shape[0], s):
        columns = columns + part
    image = xp.zeros((*told.cells, pixels**2), dtype=volume.dtype, device=arrays.device(volume))
    _add_cells(image, columns, told, pixels, of_image=True)
    return _planes(image, pixels)[0, ...]


def adjoint(matrix: Array, told: Tiling, image: Array, points: int) -> Array:
    """Transpose of `forward`: (z, rows s, columns s)."""
    xp, s, N = arrays.namespace(image), points, image.shape[0] // told.rows.cells
    columns = _columns(_channels(image[None, ...], N), told, N, of_image=True)
    shape = tuple(row.cells + 2 * row.margin for row in (told.rows, told.columns))

    def seen(depths: slice) -> Array:
        rows = slice(depths.start * s * s, depths.stop * s * s)
        held = columns @ xp.matrix_transpose(matrix[:, rows, :])
        cells = xp.zeros((*shape, rows.stop - rows.start), dtype=image.dtype, device=arrays.device(image))
        _add_cells(cells, held, told, s, of_image=False)
        return _planes(cells, s)

    return xp.concat(list(_all(seen, told, matrix.shape[1] // s**2, s)), axis=0)


def _all(function: Callable[[slice], Array], told: Tiling, depths: int, s: int) -> Iterator[Array]:
    """The function of all depths, of some at a time."""
    step = max(1, GROUP // (4 * told.frequencies * told.count * s * s))
    groups = [slice(k, min(k + step, depths)) for k in range(0, depths, step)]
    return each(function, groups) if len(groups) > 1 else map(function, groups)


def _places(spans: tuple[Span, Span], of_image: bool) -> tuple[tuple[slice, slice], tuple[int, int]]:
    """Cells of a tile, and where the first stands in the transform."""
    y, x = spans
    if of_image:
        return (y.image, x.image), (y.image_at, x.image_at)
    return (y.points, x.points), (y.points_at, x.points_at)


def _columns(cells: Array, told: Tiling, n: int, *, of_image: bool) -> Array:
    """Real and imaginary parts at f_y and at -f_y of all tiles (frequencies, 4 tiles, channels)."""
    xp, (ly, lx), channels = arrays.namespace(cells), told.lengths, cells.shape[-1]
    half, turn, sign = ly // 2 + 1, *_turns(n, channels // n**2, cells, back=of_image)
    shape = (half, lx // 2 + 1, told.count, 4, channels)
    found = xp.empty(shape, dtype=cells.dtype, device=arrays.device(cells))
    for k, spans in told.tiles():
        (rows, columns), (y, x) = _places(spans, of_image)
        spectrum = _along_y(_along_x(cells[rows, columns, :], x, lx) * turn, y, ly)
        below = xp.concat([spectrum[:1, ...], xp.flip(spectrum[ly - half + 1 :, ...], axis=0)])
        above = spectrum[:half, ...]
        found[:, :, k, 0, :], found[:, :, k, 1, :] = xp.real(above), xp.imag(above)
        found[:, :, k, 2, :], found[:, :, k, 3, :] = xp.real(below) * sign, xp.imag(below) * sign
    return xp.reshape(found, (told.frequencies, 4 * told.count, channels))


def _along_x(cells: Array, first: int, length: int) -> Array:
    """Transform of cells (rows, columns, channels) whose first column stands at `first`."""
    if first:
        xp, (rows, columns, channels) = arrays.namespace(cells), cells.shape
        wide = xp.zeros((rows, first + columns, channels), dtype=cells.dtype, device=arrays.device(cells))
        wide[:, first:, :] = cells
        cells = wide
    return arrays.rfft(cells, length, axis=1)


def _along_y(spectrum: Array, first: int, length: int) -> Array:
    if first:
        xp, (rows, columns, channels) = arrays.namespace(spectrum), spectrum.shape
        shape = (length, columns, channels)
        wide = xp.zeros(shape, dtype=spectrum.dtype, device=arrays.device(spectrum))
        wide[first : first + rows, ...] = spectrum
        spectrum = wide
    return arrays.fft(spectrum, length, axis=0, overwrite=True)


def _add_cells(cells: Array, columns: Array, told: Tiling, n: int, *, of_image: bool) -> None:
    """Add to cells (rows, columns, channels) what `_columns` of all tiles say of them."""
    xp, (ly, lx), channels = arrays.namespace(cells), told.lengths, cells.shape[-1]
    half, turn, sign = ly // 2 + 1, *_turns(n, channels // n**2, cells, back=not of_image)
    columns = xp.reshape(columns, (half, lx // 2 + 1, told.count, 4, channels))
    for k, spans in told.tiles():
        (rows, places), (y, x) = _places(spans, of_image)
        height, width = rows.stop - rows.start, places.stop - places.start
        spectrum = xp.empty((ly, lx // 2 + 1, channels), dtype=turn.dtype, device=arrays.device(cells))
        parts = [columns[:, :, k, part, :] for part in range(4)]
        below = [xp.flip(part[1 : ly - half + 1, ...] * sign, axis=0) for part in parts[2:]]
        arrays.put_complex(spectrum[:half, ...], *parts[:2])
        arrays.put_complex(spectrum[half:, ...], *below)
        spectrum = arrays.ifft(spectrum, axis=0, overwrite=True)[y : y + height, ...] * turn
        place = cells[rows, places, :]
        place += arrays.irfft(spectrum, lx, axis=1)[:, x : x + width, :]


def _turns(n: int, planes: int, like: Array, *, back: bool) -> tuple[Array, Array]:
    turn, sign = _factors(n, planes)
    return arrays.like(turn.conj() if back else turn, like), arrays.like(sign, like)


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
