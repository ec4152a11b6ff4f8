r"""A microscope's operator between spectra over its lenslets: each frequency has one small real matrix.

.. math:: \hat y_q = (-i)^{|q|} R\, (-i)^{|c|} \hat x_c, \quad
          R = (-1)^{q \cdot c} \sum_d K_{qc}(d)\, \mathrm{tr}(2\pi f_y d_y)\, \mathrm{tr}(2\pi f_x d_x)

for parts c of the points and q of the pixels that are even or odd over a cell; tr is the cosine where their
parities along an axis agree, else the sine (docs/theory/microscope.md). Few patterns of them are followed
(`patterns`), in tiles of large arrays (`tiles`).
"""

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from lumigraph.core import arrays
from lumigraph.core.arrays import Array
from lumigraph.core.linear import Linear
from lumigraph.core.threads import each, single_products
from lumigraph.operators.microscope.far_light import FarLight
from lumigraph.operators.microscope.kernels import SliceKernel
from lumigraph.operators.microscope.patterns import Patterns, of_images, parted, quadrant, whole
from lumigraph.operators.microscope.sensor import PatternSensor, sensor
from lumigraph.operators.microscope.tiles import Tiling, tilings
from lumigraph.operators.microscope.transforms import add_cells, columns

LEAST = 8
"""Lenslets along each side of a tile, at least, where there are so many."""

MOST = 2**32
"""Bytes of all matrices, at most; with smaller tiles there are fewer."""

READ, PASSED = 24, 150
"""Multiply-adds of a matrix product in the time of reading one number of `R` from memory, and of what is done
to one number of a tile (transforms, parts and copies). The former was measured, the latter is a guess."""

SIDE = 4
"""Objects that go through a matrix one after the other, at most: with more, their columns leave the cache."""

BLOCK = 2**18
"""Numbers of the sums at some frequencies that are added up at a time, if one frequency has fewer."""

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
    """Numbers that `matrices` holds, for patterns of the points of all depths and of the image."""
    return told.frequencies * points * pixels


def held_numbers(told: Tiling, points: Sequence[Patterns], pixels: Patterns) -> int:
    """Numbers that one application holds at most, in addition to `matrices`, the object and the image."""
    counts = [sum(one.count for one in points[depths]) for depths in groups(points, told)]
    threads, columns = min(arrays.WORKERS, len(counts)), 4 * told.frequencies * told.count
    cells = max(math.prod(row.cells + 2 * max(row.margin, 0) for row in (told.rows, told.columns)), 1)
    transformed = 6 * told.lengths[0] * (told.lengths[1] // 2 + 1)  # three times real and imaginary parts
    of_groups = threads * max(counts) * (2 * cells + transformed) + columns * (sum(counts) + pixels.count)
    blocks = arrays.WORKERS * max(BLOCK, 4 * told.count * pixels.count)
    of_image = pixels.count * (2 * columns + transformed) + 3 * len(pixels.along) ** 2 * math.prod(told.cells)
    return max(of_groups + blocks, of_image)


def cost(told: Tiling, points: int, pixels: int) -> float:
    """Cost of one application of the operator or of its transpose [multiply-adds]."""
    passed = told.count * math.prod(told.lengths) * (points + pixels)
    return matrix_numbers(told, points, pixels) * (READ + 4.0 * told.count) + PASSED * passed


def is_faster(kernels: Sequence[SliceKernel], told: Tiling, counts: tuple[int, int]) -> bool:
    """True if it takes less time than the products over all offsets."""
    sampling = kernels[0].sampling
    products = sum(len(kernel.offsets) for kernel in kernels) * math.prod(told.cells) * sampling.classes
    return products * sampling.pixels**2 > cost(told, *counts)


def sharing(told: Tiling) -> int:
    """Objects by whose products reading `R` counts for little: at most `SIDE`.

    >>> from lumigraph.operators.microscope.tiles import TileRow
    >>> [sharing(Tiling(*[TileRow(29, 0, 4, n)] * 2)) for n in (1, 2, 3)]
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
    sensor
        From patterns of the image to the image.
    far
        Light that goes farther than those follow it; None where there is none.
    """

    told: Tiling
    points: Sequence[Patterns]
    pixels: Patterns
    matrices: Sequence[Array]
    sensor: PatternSensor
    far: FarLight | None = None

    @classmethod
    @single_products()
    def of(
        cls,
        kernels: Sequence[SliceKernel],
        patterns: tuple[Sequence[Patterns], Patterns],
        told: Tiling,
        like: Array,
        placement: Linear | None = None,
        far: FarLight | None = None,
    ) -> "Spectra":
        """Spectra in the library and precision of an array, for patterns of each depth and of the image."""
        points, pixels = patterns

        def found(depths: slice) -> Array:
            chosen = points[depths]
            shape = told.frequencies, sum(one.count for one in chosen), pixels.count
            matrix = np.empty(shape, np.float32)
            for kernel, one, places in zip(kernels[depths], chosen, _places(chosen), strict=True):
                _fill(matrix, places, kernel, (one, pixels), told)
            return arrays.like(matrix, like)

        matrices = list(each(found, groups(points, told)))
        return cls(told, points, pixels, matrices, sensor(pixels, placement, like), far)

    def forward(self, volumes: Sequence[Array]) -> list[Array]:
        """Images (ny, nx) of volumes (z, rows s, columns s), which are those of each alone bit for bit."""
        told, side = self.told, len(volumes)

        def lit(depths: slice) -> Array:
            chosen = self.points[depths]

            def cells(volume: Array) -> Array:
                found = [parted(volume[k + depths.start, ...], one) for k, one in enumerate(chosen)]
                return _ordered(found, chosen)

            return columns(map(cells, volumes), side, told, _odd(chosen), of_image=False)

        sums = self._summed(list(each(lit, groups(self.points, told))))
        images = [self._far_image(volume) for volume in volumes]
        add_cells(images, sums, told, self.pixels.odd, of_image=True)
        return [self.sensor.whole(image) for image in images]

    def _summed(self, given: Sequence[Array]) -> Array:
        """Sums (frequencies, objects, 4 tiles, channels) of the image, of those of the points of `groups`.

        All depths of some frequencies before the next ones: what they add up to stays in the cache.
        """
        xp, like = arrays.namespace(given[0]), {"dtype": given[0].dtype, "device": arrays.device(given[0])}
        sums = xp.empty((*given[0].shape[:-1], self.pixels.count), **like)

        def put(some: slice) -> None:
            pairs = zip(given, self.matrices, strict=True)
            parts = (_times(part[some, ...], matrix[some, ...]) for part, matrix in pairs)
            total = next(parts)
            for part in parts:
                total += part
            sums[some, ...] = total

        step = max(BLOCK // math.prod(sums.shape[1:]), 1) if arrays.is_numpy(sums) else sums.shape[0]
        for _ in each(put, (slice(start, start + step) for start in range(0, sums.shape[0], step))):
            pass
        return sums

    def _far_image(self, volume: Array) -> Array:
        """Patterns (rows, columns, r) of far light."""
        if self.far is not None:
            return self.far.forward(volume, self._points)
        xp, shape = arrays.namespace(volume), (*self.told.cells, self.pixels.count)
        return xp.zeros(shape, dtype=volume.dtype, device=arrays.device(volume))

    @property
    def _points(self) -> int:
        """Number of points along a side of a cell."""
        return math.isqrt(len(self.points[0].basis))

    def adjoint(self, images: Sequence[Array]) -> list[Array]:
        """Transpose of `forward`: volumes (z, rows s, columns s)."""
        xp, told, n, evens = arrays.namespace(images[0]), self.told, len(images), []

        def parts() -> Iterator[Array]:
            for image in images:
                yield (part := self.sensor.parted(image))
                evens.append(None if self.far is None else self.far.adjoint(part))

        sums = columns(parts(), n, told, self.pixels.odd, of_image=True)
        shape, s = tuple(row.cells + 2 * row.margin for row in (told.rows, told.columns)), self._points
        like = {"dtype": images[0].dtype, "device": arrays.device(images[0])}
        volumes = [xp.empty((len(self.points), shape[0] * s, shape[1] * s), **like) for _ in images]

        def seen(group: tuple[slice, Array]) -> None:
            depths, matrix = group
            chosen = self.points[depths]
            cells = [xp.zeros((*shape, matrix.shape[1]), **like) for _ in range(n)]
            product = _times(sums, xp.matrix_transpose(matrix))
            add_cells(cells, product, told, _odd(chosen), of_image=False)
            for volume, own, even in zip(volumes, cells, evens, strict=True):
                _put_planes(volume, own, even, chosen, depths.start)

        for _ in each(seen, zip(groups(self.points, told), self.matrices, strict=True)):
            pass
        return volumes


def _times(sums: Array, matrix: Array) -> Array:
    """Sums (frequencies, objects, 4 tiles, channels) times matrices (frequencies, channels, others).

    Each object has a product of its own: the bits of one row may depend on the others of a product, and on
    its place among them (OpenBLAS, processors without AVX-512). NumPy does all of a frequency before the
    next, while its matrix is in the processor's cache.
    """
    if arrays.is_numpy(sums):
        return sums @ matrix[:, None]
    each_one = [sums[:, k, ...] @ matrix for k in range(sums.shape[1])]
    return arrays.namespace(sums).stack(each_one, axis=1)


def _put_planes(
    volume: Array, cells: Array, even: Array | None, chosen: Sequence[Patterns], start: int
) -> None:
    """Write depths of a volume, from `start` on, whose patterns in cells stand one after the other."""
    xp = arrays.namespace(cells)
    for k, one, places in zip(itertools.count(start), chosen, _places(chosen)):
        own = xp.take(cells, xp.asarray(places, device=arrays.device(cells)), axis=-1)
        plane, (rows, columns) = whole(own, one), cells.shape[:2]
        if even is not None:
            cut = xp.reshape(plane, (rows, plane.shape[0] // rows, columns, plane.shape[1] // columns))
            plane = xp.reshape(cut + even[k, :, None, :, None], plane.shape)
        volume[k, ...] = plane


def groups(points: Sequence[Patterns], told: Tiling) -> list[slice]:
    """Depths that are treated together: some with few patterns, one with many."""
    most, found, start, held = GROUP // (4 * told.frequencies * told.count), [], 0, 0
    for k, one in enumerate(points):
        if k > start and held + one.count > most:
            found.append(slice(start, k))
            start, held = k, 0
        held += one.count
    return [*found, slice(start, len(points))]


def _fill(
    matrix: np.ndarray,
    places: np.ndarray,
    kernel: SliceKernel,
    patterns: tuple[Patterns, Patterns],
    told: Tiling,
) -> None:
    """Write R (frequencies, patterns of the points, those of the image) of a depth at its places."""
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
        matrix[:, places[rows][:, None], columns] = product.reshape(told.frequencies, *part.shape[1:])


def _waves(length: int, offsets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Cosine and sine (frequencies, n) of 2π f d for d and -d together, d from 0 on."""
    phase = 2 * np.pi * (np.arange(length // 2 + 1)[:, None] * offsets % length) / length
    both = np.where(offsets > 0, 2.0, 1.0)
    return (both * np.cos(phase)).astype(np.float32), (both * np.sin(phase)).astype(np.float32)


def _odd(points: Sequence[Patterns]) -> np.ndarray:
    """Parities (2, r) of patterns of several depths, in `_order`."""
    return np.concatenate([one.odd for one in points], axis=1)[:, _order(points)]


def _order(points: Sequence[Patterns]) -> np.ndarray:
    """Order of the patterns of several depths: parity after parity, and in each depth after depth."""
    odd = np.concatenate([one.odd for one in points], axis=1)
    return np.argsort(2 * odd[0] + odd[1], kind="stable")


def _places(points: Sequence[Patterns]) -> Iterator[np.ndarray]:
    """Places of each depth's patterns in `_order`."""
    stops = np.cumsum([one.count for one in points])
    return iter(np.split(np.argsort(_order(points)), stops[:-1]))


def _ordered(parts: Sequence[Array], points: Sequence[Patterns]) -> Array:
    """Parts (rows, columns, r) of several depths in `_order`."""
    if len(parts) == 1:
        return parts[0]
    xp = arrays.namespace(parts[0])
    order = xp.asarray(_order(points), device=arrays.device(parts[0]))
    return xp.take(xp.concat(list(parts), axis=-1), order, axis=-1)
