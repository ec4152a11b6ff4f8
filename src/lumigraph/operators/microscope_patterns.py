r"""Patterns of a cell's points and pixels, even or odd along y and x, as which light is followed.

Points stand as close at all depths as the depth that is seen most finely asks for. At others their images
differ by less: the matrix from a cell's points to the pixels of all cells is of low rank but for a small
rest. Its singular vectors are the few patterns that hold every point's image but for the relative rms that is
allowed. Images are sampled as finely as their steepest places ask for, and pixels average over samples: of a
cell's image, too, fewer patterns than samples hold the light that pixels of all depths see. What is left out
is measured, and counts in the operator's error.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy.linalg import toeplitz

from lumigraph.core import arrays
from lumigraph.core.arrays import Array
from lumigraph.core.cache import ByteCache, remembered
from lumigraph.core.threads import each, single_products
from lumigraph.operators.microscope_cell import parts
from lumigraph.operators.microscope_kernels import SHARES, SliceKernel
from lumigraph.operators.microscope_pixels import b_spline

WORTH = 0.8
"""Part of all patterns: if more are wanted all of them are followed, which leaves nothing out."""

WHOLE = 0.9
"""Of the accuracy, that patterns of the pixels may fill up: the rest is for the sampling of slices."""

SEPARATE, FEW = 8, 300
"""Places along a side of a cell, and patterns, from which on these are taken along y and then along x: below,
one product takes less time (19 × 19 places, 100 patterns: 11 ms a plane instead of 37)."""

PARITIES = (0, 0), (0, 1), (1, 0), (1, 1)
"""Whether patterns are odd along y, and along x."""

_FOUND = ByteCache()


@dataclass(frozen=True, eq=False)
class Patterns:
    """Patterns over the places of a cell, orthonormal as the light that they make.

    Parameters
    ----------
    along
        (n, n), orthonormal rows, first even, then odd: products of two of them, one along y and one along x,
        are all patterns that there can be.
    odd
        (2, r) of 0 and 1: whether a pattern is odd along y, and along x.
    vectors
        Of each parity (0, 0), (0, 1), (1, 0), (1, 1), its patterns (products, r) in terms of the products of
        that parity. None where they are all products. The patterns follow one another in this order.
    left_out
        Relative rms of the image of a point as the sum of its patterns, the worst of all points.
    duals
        Of each parity (products, r): products with an image say how much of each pattern comes nearest to it.
        None where the patterns' own do.
    """

    along: np.ndarray
    odd: np.ndarray
    vectors: tuple[np.ndarray, ...] | None = None
    left_out: float = 0.0
    duals: tuple[np.ndarray, ...] | None = None
    _held: dict = field(default_factory=dict, repr=False)

    @property
    def count(self) -> int:
        """Patterns, r."""
        return self.odd.shape[1]

    @cached_property
    def basis(self) -> np.ndarray:
        """(n², r): each pattern's value at the cell's places."""
        n, (y, x) = len(self.along), _in_order(len(self.along))
        products = np.kron(self.along, self.along)[y * n + x].T
        if self.vectors is None:
            return products
        whole, parities = all_patterns(len(self.along)), zip(PARITIES, self.vectors, strict=True)
        return np.concatenate([products[:, whole.of_parity(*odd)] @ own for odd, own in parities], axis=1)

    @cached_property
    def nearest(self) -> "Patterns":
        """Patterns that an image is `parted` by so that `whole` comes nearest to it."""
        return self if self.duals is None else replace(self, vectors=self.duals, duals=None, _held={})

    @property
    def nbytes(self) -> int:
        """Memory of the arrays [bytes]."""
        return len(self.along) ** 2 * (self.count + 1) * 8

    def held(self, like: Array) -> tuple[Array | None, tuple[Array, ...]]:
        """`along` and `vectors`, none where they are all products, in the library and precision of an array.

        Of small cells, or few patterns, None, and the `basis` alone: one product takes less time there.
        """
        if len(self.along) >= SEPARATE and self.count >= FEW:
            return self.separate(like)
        key = arrays.placement(like), "basis"
        if key not in self._held:
            self._held[key] = None, (arrays.like(self.basis, like),)
        return self._held[key]

    def separate(self, like: Array) -> tuple[Array, tuple[Array, ...]]:
        """`along` and `vectors` of any number of patterns."""
        key = arrays.placement(like), "along"
        if key not in self._held:
            vectors = tuple(arrays.like(one, like) for one in self.vectors or ())
            self._held[key] = arrays.like(self.along, like), vectors
        return self._held[key]

    def places(self) -> list[tuple[slice, slice]]:
        """Places (y, x) of the products of each parity among (n, n)."""
        n, half = len(self.along), (len(self.along) + 1) // 2
        sides = slice(0, half), slice(half, n)
        return [(sides[y], sides[x]) for y, x in PARITIES]

    def of_parity(self, odd_y: int, odd_x: int) -> np.ndarray:
        """Numbers of the patterns of a parity."""
        return np.flatnonzero((self.odd[0] == odd_y) & (self.odd[1] == odd_x))


@remembered
def all_patterns(n: int) -> Patterns:
    """All patterns of a cell of n × n places.

    >>> all_patterns(3).count, all_patterns(3).of_parity(0, 1).tolist()
    (9, [4, 5])
    """
    one, (y, x) = parts(n), _in_order(n)
    half = (n + 1) // 2
    return Patterns(one, np.stack([y >= half, x >= half]).astype(np.int8))


def _in_order(n: int) -> np.ndarray:
    """Numbers along y and x of all products (2, n²): parity after parity."""
    y, x = np.divmod(np.arange(n * n), n)
    half = (n + 1) // 2
    return np.stack([y, x])[:, np.argsort(2 * (y >= half) + (x >= half), kind="stable")]


def patterns(kernels: Sequence[SliceKernel], left_out: float) -> list[Patterns]:
    """Patterns of each depth's points, so few that no point's image loses more than an rms `left_out`.

    Parameters
    ----------
    kernels
        Symmetric ones.
    left_out
        0 for all patterns.
    """
    if left_out <= 0:
        return [all_patterns(kernel.sampling.points) for kernel in kernels]

    def found(kernel: SliceKernel) -> Patterns:
        return _FOUND.get((kernel, left_out), lambda: few_patterns(kernel, left_out))

    return list(each(found, kernels))


def pixel_patterns(kernels: Sequence[SliceKernel], left_out: float, points: Sequence[Patterns]) -> Patterns:
    """Patterns of the image's samples, for all depths.

    They leave out what they may, `SHARES`, or less where the kernels' own errors and `points` leave less of
    `WHOLE` of what the operator was asked for.
    """
    accuracy = WHOLE * left_out / SHARES["patterns"]
    spent = max(
        math.hypot(kernel.error, one.left_out, SHARES["rank"] * accuracy)
        for kernel, one in zip(kernels, points, strict=True)
    )
    if not spent < accuracy:
        return all_patterns(kernels[0].sampling.pixels)
    allowed = min(SHARES["pixels"] * accuracy, math.sqrt(accuracy**2 - spent**2))
    return _FOUND.get((*kernels, allowed, "pixels"), lambda: few_of_pixels(kernels, allowed))


@single_products()
def few_patterns(kernel: SliceKernel, left_out: float) -> Patterns:
    """The strongest patterns of a depth: singular vectors of each parity (C. Eckart & G. Young, 1936)."""
    whole, (blocks, weights) = all_patterns(kernel.sampling.points), quadrant(kernel)
    rows = whole.basis.T.astype(np.float32) @ blocks
    found, shares = [], []
    for places in map(whole.of_parity, *zip(*PARITIES, strict=True)):
        part = rows[:, places].astype(np.float64)
        energy, vectors = np.linalg.eigh(np.tensordot(weights, part @ part.transpose(0, 2, 1), 1))
        found.append((energy, vectors))
        shares.append(np.square(whole.basis[:, places] @ vectors) * np.maximum(energy, 0))
    return _strongest(whole, found, np.concatenate(shares, axis=1), left_out)


@single_products()
def few_of_pixels(kernels: Sequence[SliceKernel], left_out: float) -> Patterns:
    """The strongest patterns of a cell's image, by what pixels see of it; each depth counts as much."""
    whole = all_patterns(kernels[0].sampling.pixels)
    roots = _roots(whole, kernels[0].sampling.degree)

    def light(kernel: SliceKernel) -> list[np.ndarray]:
        """ΣwIIᵀ of each parity, of a depth's images I, over their light²."""
        parts, weights = _images(kernel, whole, roots)
        found = [np.tensordot(weights, part.transpose(0, 2, 1) @ part, 1) for part in parts]
        power = sum(float(np.trace(one)) for one in found)
        return [one / power for one in found]

    def shares(kernel: SliceKernel) -> np.ndarray:
        """Shares of each point's image (s², N²)."""
        parts = _images(kernel, whole, roots)[0]
        own = (np.square(part @ vectors) for part, (_, vectors) in zip(parts, found, strict=True))
        return np.concatenate([_of_all_cells(one, kernel) for one in own], axis=1)

    found = [np.linalg.eigh(sum(one)) for one in zip(*each(light, kernels), strict=True)]
    energies = np.sort(np.concatenate([energy for energy, _ in found]))
    needed = (np.cumsum(energies) > left_out**2 * len(kernels)).sum()  # if all points lost as much
    if needed > WORTH * whole.count:
        return whole
    few = _strongest(whole, found, np.concatenate([shares(one) for one in kernels]), left_out)
    if few.vectors is None:
        return few
    pairs = list(zip(roots, few.vectors, strict=True))
    vectors, duals = zip(*((np.linalg.solve(root, v), root @ v) for root, v in pairs), strict=True)
    return replace(few, vectors=vectors, duals=duals, _held={})


def _roots(every: Patterns, degree: int) -> list[np.ndarray]:
    """S of each parity (products, products): |Sp|² is the light² that pixels make of samples p.

    It is that of B-splines of a degree, whose coefficients samples are, the mean over all places of pixels.
    """
    n = len(every.along)
    gram = every.along @ toeplitz(b_spline(np.arange(float(n)), 2 * degree + 1)) @ every.along.T
    half = (n + 1) // 2
    along = []
    for side in (slice(0, half), slice(half, n)):
        energy, vectors = np.linalg.eigh(gram[side, side])
        along.append((vectors * np.sqrt(energy)) @ vectors.T)
    return [np.kron(along[y], along[x]) for y, x in PARITIES]


def _images(
    kernel: SliceKernel, every: Patterns, roots: Sequence[np.ndarray]
) -> tuple[list[np.ndarray], np.ndarray]:
    """Light (n, s², products) of each parity, of points in cells above and left; and their weights."""
    blocks, weights = quadrant(kernel)
    products = of_images(blocks, every)
    places = map(every.of_parity, *zip(*PARITIES, strict=True))
    return [products[..., own] @ root for own, root in zip(places, roots, strict=True)], weights


def _of_all_cells(energy: np.ndarray, kernel: SliceKernel) -> np.ndarray:
    """Sums (s², r) over all cells of the light² (n, s², r) in those below and right of a point's own.

    In the other cells flipped points have the same: a pattern's square does not tell.
    """
    s, offsets = kernel.sampling.points, kernel.offsets
    whole = energy.reshape(len(energy), s, s, -1)
    for axis, places in enumerate(offsets[(offsets >= 0).all(1)].T):
        whole = whole + np.flip(whole, axis + 1) * (places > 0)[:, None, None, None]
    return whole.sum(0).reshape(s * s, -1)


def _strongest(
    whole: Patterns, found: Sequence[tuple[np.ndarray, np.ndarray]], shares: np.ndarray, left_out: float
) -> Patterns:
    """The strongest of the patterns found, by light² and vectors of each parity.

    `shares` (points, patterns) are the patterns' of each point's light².
    """
    order = np.argsort(-np.concatenate([energy for energy, _ in found]), kind="stable")
    left = np.cumsum(shares[:, order[::-1]], 1)[:, ::-1]  # without that pattern and all weaker ones
    missing = np.sqrt(np.max(left / np.maximum(left[:, :1], np.finfo(float).tiny), axis=0))
    kept = int((missing > left_out).sum())
    if kept > WORTH * whole.count:
        return whole
    chosen = np.zeros(len(order), bool)
    chosen[order[:kept]] = True
    parts = np.split(chosen, np.cumsum([len(energy) for energy, _ in found])[:-1])
    vectors = tuple(one[:, own] for (_, one), own in zip(found, parts, strict=True))
    odd = np.repeat(np.array(PARITIES, np.int8).T, [one.shape[1] for one in vectors], axis=1)
    return Patterns(whole.along, odd, vectors, float(missing[kept]))


def quadrant(kernel: SliceKernel) -> tuple[np.ndarray, np.ndarray]:
    """Images (n, s², N²) in cells below and right of a point's own, and for how many cells each stands."""
    first = np.asarray((kernel.offsets >= 0).all(1))  # the other quadrants follow by parity
    n, s, N = len(first), kernel.sampling.points, kernel.sampling.pixels
    weights = np.where(kernel.offsets[first] > 0, 2.0, 1.0).prod(1)
    return kernel.matrix().reshape(n, s * s, N * N)[first], weights


def of_images(blocks: np.ndarray, patterns: Patterns) -> np.ndarray:
    """Images (n, k, N²) to the nearest sums of patterns (n, k, r)."""
    N = len(patterns.along)
    return parted(blocks.reshape(-1, N), patterns.nearest).reshape(*blocks.shape[:2], -1)


def parted(plane: Array, patterns: Patterns) -> Array:
    """Plane (rows n, columns n) to patterns of each cell (rows, columns, r)."""
    xp, n, (along, vectors) = arrays.namespace(plane), len(patterns.along), patterns.held(plane)
    shape = plane.shape[0] // n, plane.shape[1] // n
    if along is None:
        cells = xp.reshape(arrays.tiled(plane, (n, n)), (-1, n * n))
        return xp.reshape(cells @ vectors[0], (*shape, patterns.count))
    products = _turned(plane, along)
    products = arrays.tiled(products, (n, n))
    own = [xp.reshape(products[..., y, x], (math.prod(shape), -1)) for y, x in patterns.places()]
    if vectors:
        own = [one @ v for one, v in zip(own, vectors, strict=True)]
    return xp.reshape(xp.concat(own, axis=-1), (*shape, patterns.count))


def whole(parts: Array, patterns: Patterns) -> Array:
    """Transpose of `parted`, its inverse where all patterns are there: a plane (rows n, columns n)."""
    xp, n, (along, vectors) = arrays.namespace(parts), len(patterns.along), patterns.held(parts)
    shape, flat = parts.shape[:2], xp.reshape(parts, (-1, patterns.count))
    if along is None:
        return arrays.untiled(xp.reshape(flat @ xp.matrix_transpose(vectors[0]), (*shape, n, n)))
    products, first = xp.empty((*shape, n, n), dtype=parts.dtype, device=arrays.device(parts)), 0
    for k, (y, x) in enumerate(patterns.places()):
        size = y.stop - y.start, x.stop - x.start
        count = vectors[k].shape[1] if vectors else math.prod(size)
        own = flat[:, first : first + count]
        own = own @ xp.matrix_transpose(vectors[k]) if vectors else own
        products[..., y, x] = xp.reshape(own, (*shape, *size))
        first += count
    return _turned(arrays.untiled(products), xp.matrix_transpose(along))


def _turned(plane: Array, along: Array) -> Array:
    """Each cell (n, n) of a plane, times a matrix (n, n) along both axes: products of few large matrices."""
    xp, n, shape = arrays.namespace(plane), along.shape[0], plane.shape
    down = along @ xp.reshape(plane, (-1, n, shape[1]))
    return xp.reshape(xp.reshape(down, (-1, n)) @ xp.matrix_transpose(along), shape)
