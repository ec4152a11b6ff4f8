r"""A microscope's operator between spectra over its lenslets: each frequency has one small real matrix.

Over lenslets the operator is a convolution. Its blocks are symmetric under flips, so that between parts that
are even or odd over a cell (along y and along x), of the points c as of the pixels q, the transform of the
blocks over the offsets d is real but for a factor, and the four frequencies (±f_y, ±f_x) share it:

.. math:: \hat y_q = (-i)^{|q|} R\, (-i)^{|c|} \hat x_c, \quad
          R = (-1)^{q \cdot c} \sum_d K_{qc}(d)\, \mathrm{tr}(2\pi f_y d_y)\, \mathrm{tr}(2\pi f_x d_x)

with tr the cosine where q and c have the same parity along that axis, the sine where not. Of the points and
of the pixels few patterns are followed where they hold all images (`microscope_patterns`). It takes the same
time however many lenslets a point lights. Large arrays of lenslets are treated in tiles (`microscope_tiles`).
"""

import itertools
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from lumigraph.core import arrays
from lumigraph.core.arrays import Array
from lumigraph.core.threads import each, single_products
from lumigraph.operators.microscope_far import FarLight
from lumigraph.operators.microscope_kernels import SliceKernel
from lumigraph.operators.microscope_patterns import Patterns, of_images, parted, quadrant, whole
from lumigraph.operators.microscope_tiles import Span, Tiling, tilings

LEAST = 8
"""Lenslets along each side of a tile, at least, where there are so many."""

MOST = 2**32
"""Bytes of all matrices, at most; with smaller tiles there are fewer."""

READ, PASSED = 24, 150
"""Multiply-adds of a matrix product in the time of reading one number of `R` from memory, and of what is done
to one number of a tile (transforms, parts and copies). The former was measured, the latter is a guess."""

SIDE = 4
"""Objects that share a product, at most: with more of them their columns leave the cache."""

GROUP = 2**22
"""Numbers of the transforms of all tiles that are treated at a time, at most, if one depth has fewer: they
should stay in the processor's cache."""


def tiling(
    kernels: Sequence[SliceKernel], cells: tuple[int, int], margin: int, counts: tuple[int, int]
) -> Tiling:
    """The fastest whose matrices are at most `MOST`; the fewest matrices where none is.

    Parameters
    ----------
    kernels
        Of each depth.
    cells
        Lenslets (rows, columns) whose images are followed.
    margin
        Lenslets that the object reaches beyond them on each side.
    counts
        Patterns of the points of all depths, and of the image.
    """
    reach = max(int(np.abs(kernel.offsets).max()) for kernel in kernels)
    least = min(LEAST, *cells)
    found = list(tilings(cells, margin, reach, least))
    fitting = [told for told in found if 4 * matrix_numbers(told, *counts) <= MOST]
    if not fitting:
        return min(found, key=lambda told: told.frequencies)
    return min(fitting, key=lambda told: cost(told, *counts))


def matrix_numbers(told: Tiling, points: int, pixels: int) -> int:
    """How many `matrices` has, for patterns of the points of all depths and of the image."""
    return told.frequencies * points * pixels


def held_numbers(told: Tiling, points: Sequence[Patterns], pixels: Patterns) -> int:
    """How many one application holds at most, beside `matrices`, the object and the image."""
    counts = [sum(one.count for one in points[depths]) for depths in groups(points, told)]
    threads, columns = min(arrays.WORKERS, len(counts)), 4 * told.frequencies * told.count
    cells = max(math.prod(row.cells + 2 * max(row.margin, 0) for row in (told.rows, told.columns)), 1)
    transformed = 6 * told.lengths[0] * (told.lengths[1] // 2 + 1)  # three times real and imaginary parts
    ahead = min(2 * threads, len(counts)) + 1
    of_groups = threads * max(counts) * (2 * cells + columns + transformed) + ahead * columns * pixels.count
    of_image = pixels.count * (2 * columns + transformed) + 3 * len(pixels.along) ** 2 * math.prod(told.cells)
    return max(of_groups, of_image)


def cost(told: Tiling, points: int, pixels: int) -> float:
    """Of one application of the operator or of its transpose [multiply-adds]."""
    passed = told.count * math.prod(told.lengths) * (points + pixels)
    return matrix_numbers(told, points, pixels) * (READ + 4.0 * told.count) + PASSED * passed


def is_faster(kernels: Sequence[SliceKernel], told: Tiling, counts: tuple[int, int]) -> bool:
    """Whether it takes less time than the products over all offsets."""
    sampling = kernels[0].sampling
    products = sum(len(kernel.offsets) for kernel in kernels) * math.prod(told.cells) * sampling.classes
    return products * sampling.pixels**2 > cost(told, *counts)


def sharing(told: Tiling) -> int:
    """Objects whose tiles fill a product, so that reading `R` counts for little: at most `SIDE`.

    >>> from lumigraph.operators.microscope_tiles import Row
    >>> [sharing(Tiling(*[Row(29, 0, 4, n)] * 2)) for n in (1, 2, 3)]
    [4, 2, 1]
    """
    return max(min(round(READ / (4 * told.count)), SIDE), 1)


@dataclass(frozen=True, slots=True, eq=False)
class Spectra:
    """The operator between patterns of points and of pixels.

    Parameters
    ----------
    told
        Tiles of lenslets.
    points
        Patterns of each depth.
    pixels
        Patterns of the image.
    matrices
        R (frequencies, patterns of some depths, those of the image), of the depths of each of `groups`.
    far
        Light that goes farther than those follow it; None where there is none.
    """

    told: Tiling
    points: Sequence[Patterns]
    pixels: Patterns
    matrices: Sequence[Array]
    far: FarLight | None = None

    @classmethod
    @single_products()
    def of(
        cls,
        kernels: Sequence[SliceKernel],
        patterns: tuple[Sequence[Patterns], Patterns],
        told: Tiling,
        like: Array,
        far: FarLight | None = None,
    ) -> "Spectra":
        """In the library and precision of an array, for patterns of each depth and of the image."""
        points, pixels = patterns

        def found(depths: slice) -> Array:
            chosen = points[depths]
            shape = told.frequencies, sum(one.count for one in chosen), pixels.count
            matrix, first = np.empty(shape, np.float32), 0
            for kernel, one in zip(kernels[depths], chosen, strict=True):
                _fill(matrix[:, first : first + one.count], kernel, (one, pixels), told)
                first += one.count
            return arrays.like(matrix, like)

        return cls(told, points, pixels, list(each(found, groups(points, told))), far)

    def forward(self, volumes: Sequence[Array], side: int = 1) -> list[Array]:
        """Samples (rows N, columns N) of volumes (z, rows s, columns s), at most `side` of them.

        They share each product. It has rows for `side` volumes, be they there or not: the bits of a sum may
        depend on how many there are.
        """
        xp, told, columns = arrays.namespace(volumes[0]), self.told, 0.0

        def lit(group: tuple[slice, Array]) -> Array:
            depths, matrix = group
            chosen = self.points[depths]

            def cells(volume: Array) -> Array:
                found = [parted(volume[k + depths.start, ...], one) for k, one in enumerate(chosen)]
                return found[0] if len(found) == 1 else xp.concat(found, axis=-1)

            return _columns(map(cells, volumes), side, told, _odd(chosen), of_image=False) @ matrix

        for part in each(lit, zip(groups(self.points, told), self.matrices, strict=True)):
            columns = columns + part
        images = [self._far_image(volume) for volume in volumes]
        _add_cells(images, columns, side, told, self.pixels.odd, of_image=True)
        return [whole(image, self.pixels) for image in images]

    def _far_image(self, volume: Array) -> Array:
        """Patterns (rows, columns, r) of far light."""
        if self.far is not None:
            return self.far.forward(volume, self._points)
        xp, shape = arrays.namespace(volume), (*self.told.cells, self.pixels.count)
        return xp.zeros(shape, dtype=volume.dtype, device=arrays.device(volume))

    @property
    def _points(self) -> int:
        """Along a side of a cell."""
        return math.isqrt(len(self.points[0].basis))

    def adjoint(self, images: Sequence[Array], side: int = 1) -> list[Array]:
        """Transpose of `forward`: volumes (z, rows s, columns s)."""
        xp, told, n, evens = arrays.namespace(images[0]), self.told, len(images), []

        def parts() -> Iterator[Array]:
            for image in images:
                yield (part := parted(image, self.pixels))
                evens.append(None if self.far is None else self.far.adjoint(part))

        columns = _columns(parts(), side, told, self.pixels.odd, of_image=True)
        shape, s = tuple(row.cells + 2 * row.margin for row in (told.rows, told.columns)), self._points
        like = {"dtype": images[0].dtype, "device": arrays.device(images[0])}
        volumes = [xp.empty((len(self.points), shape[0] * s, shape[1] * s), **like) for _ in images]

        def seen(group: tuple[slice, Array]) -> None:
            depths, matrix = group
            chosen = self.points[depths]
            cells = [xp.zeros((*shape, matrix.shape[1]), **like) for _ in range(n)]
            product = columns @ xp.matrix_transpose(matrix)
            _add_cells(cells, product, side, told, _odd(chosen), of_image=False)
            for volume, own, even in zip(volumes, cells, evens, strict=True):
                _put_planes(volume, own, even, chosen, depths.start)

        for _ in each(seen, zip(groups(self.points, told), self.matrices, strict=True)):
            pass
        return volumes


def _put_planes(
    volume: Array, cells: Array, even: Array | None, chosen: Sequence[Patterns], start: int
) -> None:
    """Write depths of a volume, from `start` on, whose patterns in cells stand one after the other."""
    first = 0
    for k, one in enumerate(chosen, start):
        plane, s = whole(cells[..., first : first + one.count], one), math.isqrt(len(one.basis))
        if even is not None:
            plane = arrays.untiled(arrays.tiled(plane, (s, s)) + even[k, ..., None, None])
        volume[k, ...] = plane
        first += one.count


def groups(points: Sequence[Patterns], told: Tiling) -> list[slice]:
    """Depths that are treated together: some with few patterns, one with many."""
    most, found, start, held = GROUP // (4 * told.frequencies * told.count), [], 0, 0
    for k, one in enumerate(points):
        if k > start and held + one.count > most:
            found.append(slice(start, k))
            start, held = k, 0
        held += one.count
    return [*found, slice(start, len(points))]


def _fill(matrix: np.ndarray, kernel: SliceKernel, patterns: tuple[Patterns, Patterns], told: Tiling) -> None:
    """Write R (frequencies, patterns of the points, those of the image) of a depth."""
    (points, pixels), blocks = patterns, quadrant(kernel)[0]
    images = points.basis.T.astype(np.float32) @ blocks
    parts = of_images(images, pixels)
    steps = kernel.offsets[(kernel.offsets >= 0).all(1)]
    waves = [_waves(length, steps[:, axis]) for axis, length in enumerate(told.lengths)]
    for cy, cx, qy, qx in itertools.product((0, 1), repeat=4):
        rows, columns = points.of_parity(cy, cx), pixels.of_parity(qy, qx)
        sign = np.float32(-1 if cy * qy ^ cx * qx else 1)
        trigonometric = sign * waves[0][cy ^ qy][:, None] * waves[1][cx ^ qx]
        part = parts[:, rows[:, None], columns]
        product = trigonometric.reshape(told.frequencies, -1) @ part.reshape(len(part), -1)
        matrix[:, rows[:, None], columns] = product.reshape(told.frequencies, *part.shape[1:])


def _waves(length: int, offsets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Cosine and sine (frequencies, n) of 2π f d for d and -d together, d from 0 on."""
    phase = 2 * np.pi * (np.arange(length // 2 + 1)[:, None] * offsets % length) / length
    both = np.where(offsets > 0, 2.0, 1.0)
    return (both * np.cos(phase)).astype(np.float32), (both * np.sin(phase)).astype(np.float32)


def _places(spans: tuple[Span, Span], of_image: bool) -> tuple[tuple[slice, slice], tuple[int, int]]:
    """Cells of a tile, and where the first stands in the transform."""
    y, x = spans
    if of_image:
        return (y.image, x.image), (y.image_at, x.image_at)
    return (y.points, x.points), (y.points_at, x.points_at)


def _odd(points: Sequence[Patterns]) -> np.ndarray:
    """Parities (2, r) of patterns of several depths, one after the other."""
    return np.concatenate([one.odd for one in points], axis=1)


def _columns(parts: Iterable[Array], side: int, told: Tiling, odd: np.ndarray, *, of_image: bool) -> Array:
    """Real and imaginary parts at f_y and at -f_y (frequencies, side · 4 tiles, channels) of cells' parts."""
    parts = iter(parts)
    first = next(parts)
    xp, (ly, lx), channels = arrays.namespace(first), told.lengths, first.shape[-1]
    half, turn, sign = ly // 2 + 1, *_turns(odd, first, back=of_image)
    shape, n = (half, lx // 2 + 1, side, told.count, 4, channels), 0
    found = xp.empty(shape, dtype=first.dtype, device=arrays.device(first))
    for n, cells in enumerate(itertools.chain([first], parts)):
        for k, spans in told.tiles():
            (rows, columns), (y, x) = _places(spans, of_image)
            spectrum = _along_y(_along_x(cells[rows, columns, :], x, lx) * turn, y, ly)
            below = xp.concat([spectrum[:1, ...], xp.flip(spectrum[ly - half + 1 :, ...], axis=0)])
            above, place = spectrum[:half, ...], found[:, :, n, k, ...]
            place[:, :, 0, :], place[:, :, 1, :] = xp.real(above), xp.imag(above)
            place[:, :, 2, :], place[:, :, 3, :] = xp.real(below) * sign, xp.imag(below) * sign
    found[:, :, n + 1 :, ...] = 0
    return xp.reshape(found, (told.frequencies, side * 4 * told.count, channels))


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


def _add_cells(
    parts: Sequence[Array], columns: Array, side: int, told: Tiling, odd: np.ndarray, *, of_image: bool
) -> None:
    """Add to cells' parts (rows, columns, channels) what `_columns` say of them."""
    xp, (ly, lx), channels = arrays.namespace(columns), told.lengths, columns.shape[-1]
    half, turn, sign = ly // 2 + 1, *_turns(odd, columns, back=not of_image)
    columns = xp.reshape(columns, (half, lx // 2 + 1, side, told.count, 4, channels))
    for (n, cells), (k, spans) in itertools.product(enumerate(parts), told.tiles()):
        (rows, places), (y, x) = _places(spans, of_image)
        height, width = rows.stop - rows.start, places.stop - places.start
        spectrum = xp.empty((ly, lx // 2 + 1, channels), dtype=turn.dtype, device=arrays.device(cells))
        four = [columns[:, :, n, k, part, :] for part in range(4)]
        below = [xp.flip(part[1 : ly - half + 1, ...] * sign, axis=0) for part in four[2:]]
        arrays.put_complex(spectrum[:half, ...], *four[:2])
        arrays.put_complex(spectrum[half:, ...], *below)
        spectrum = arrays.ifft(spectrum, axis=0, overwrite=True)[y : y + height, ...] * turn
        place = cells[rows, places, :]
        place += arrays.irfft(spectrum, lx, axis=1)[:, x : x + width, :]


def _turns(odd: np.ndarray, like: Array, *, back: bool) -> tuple[Array, Array]:
    """(-i)^|c| and (-1)^c_y of channels of these parities."""
    turn, sign = np.array([1, -1j, -1])[odd.sum(0)], np.where(odd[0], -1.0, 1.0)
    return arrays.like(turn.conj() if back else turn, like), arrays.like(sign, like)
