"""Mapping of a raw image's pixels to patterns of the lenslets' cells, and back."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from lumigraph.core import arrays
from lumigraph.core.arrays import Array
from lumigraph.core.banded import Banded
from lumigraph.core.linear import Linear
from lumigraph.operators.microscope_patterns import PARITIES, SEPARATE, Patterns, parted, whole
from lumigraph.operators.resampling import Resampling

Pieces = Sequence[tuple[slice, Array]]


class Sensor(Protocol):
    """Mapping of cells' patterns to pixels."""

    def parted(self, raw: Array) -> Array:
        """Transpose of `whole`: patterns (rows, columns, r) of each cell."""
        ...

    def whole(self, parts: Array) -> Array:
        """Pixels (ny, nx)."""
        ...


def sensor(patterns: Patterns, placement: Linear | None, like: Array) -> Sensor:
    """Mapping for arrays of one library and precision."""
    if isinstance(placement, Resampling) and len(patterns.along) >= SEPARATE:
        y, x = (_pieces(axis, patterns.along, like) for axis in (placement.y, placement.x))
        return Straight(patterns, y, x, placement.shape[0])
    return Samples(patterns, placement)


@dataclass(frozen=True, slots=True, eq=False)
class Samples:
    """Mapping by samples of the cells, and a placement from them to pixels; None where they are pixels."""

    patterns: Patterns
    placement: Linear | None

    def parted(self, raw: Array) -> Array:
        """Patterns of each cell; see `Sensor`."""
        return parted(raw if self.placement is None else self.placement._adjoint(raw), self.patterns)

    def whole(self, parts: Array) -> Array:
        """Pixels (ny, nx); see `Sensor`."""
        plane = whole(parts, self.patterns)
        return plane if self.placement is None else self.placement._forward(plane)


@dataclass(frozen=True, slots=True, eq=False)
class Straight:
    """Mapping by one matrix for each cell along y and one along x, where a straight lattice has such.

    They lead from pixels to even and odd sums along an axis, whose products patterns consist of: there are no
    samples between them.

    Parameters
    ----------
    patterns
        Of the image's samples.
    y, x
        Of each cell its pixels and the matrix (n, pixels).
    shape
        Pixels (ny, nx).
    """

    patterns: Patterns
    y: Pieces
    x: Pieces
    shape: Sequence[int]

    def parted(self, raw: Array) -> Array:
        """Patterns of each cell; see `Sensor`."""
        xp, n, rows = arrays.namespace(raw), len(self.patterns.along), len(self.y)
        down = xp.concat([m @ raw[pixels, :] for pixels, m in self.y])
        sides = self._sides(raw)
        for k, (pixels, m) in enumerate(self.x):
            products = xp.reshape(down[:, pixels] @ xp.matrix_transpose(m), (rows, n, n))
            for side, own in zip(sides, self._along_x(), strict=True):
                side[:, k, ...] = products[..., own]
        found = [one if v is None else one @ v for one, v in self._flat(sides, raw)]
        return xp.reshape(xp.concat(found, axis=-1), (rows, len(self.x), -1))

    def whole(self, parts: Array) -> Array:
        """Pixels (ny, nx); see `Sensor`."""
        xp, n, rows = arrays.namespace(parts), len(self.patterns.along), len(self.y)
        flat, first, sides = xp.reshape(parts, (-1, self.patterns.count)), 0, self._sides(parts)
        for one, v in self._flat(sides, parts):
            count = one.shape[1] if v is None else v.shape[1]
            own = flat[:, first : first + count]
            one[...] = own if v is None else own @ xp.matrix_transpose(v)
            first += count
        wide = _zeros(parts, (rows * n, self.shape[1]))
        for k, (pixels, m) in enumerate(self.x):
            for side, own in zip(sides, self._along_x(), strict=True):
                wide[:, pixels] += xp.reshape(side[:, k, ...], (rows * n, -1)) @ m[own, :]
        image = _zeros(parts, self.shape)
        for k, (pixels, m) in enumerate(self.y):
            image[pixels, :] += xp.matrix_transpose(m) @ wide[k * n : (k + 1) * n, :]
        return image

    def _along_x(self) -> tuple[slice, slice]:
        """Even and odd sums."""
        n = len(self.patterns.along)
        return slice(0, (n + 1) // 2), slice((n + 1) // 2, n)

    def _sides(self, like: Array) -> list[Array]:
        """Room for products (rows, columns, n, some) that are even along x, and for odd ones."""
        n, shape = len(self.patterns.along), (len(self.y), len(self.x))
        return [_empty(like, (*shape, n, own.stop - own.start)) for own in self._along_x()]

    def _flat(self, sides: Sequence[Array], like: Array) -> list[tuple[Array, Array | None]]:
        """Products (cells, products) of each parity, as views, and its vectors."""
        xp, found = arrays.namespace(like), []
        vectors = self.patterns.separate(like)[1] or (None,) * 4
        rows = [xp.reshape(side, (len(self.y) * len(self.x), -1)) for side in sides]
        for (odd_y, odd_x), v in zip(PARITIES, vectors, strict=True):
            own, width = self._along_x()[odd_y], sides[odd_x].shape[-1]
            found.append((rows[odd_x][:, own.start * width : own.stop * width], v))
        return found


def _pieces(axis: Banded, along: np.ndarray, like: Array) -> Pieces:
    """Pixels that see each cell, and the matrix (n, pixels) from them to its products."""
    n, ends = len(along), np.cumsum([len(m) for _, m in axis.blocks])
    first = np.array([start for start, _ in axis.blocks])
    last = first + [m.shape[1] for _, m in axis.blocks]
    found = []
    for start in range(0, axis.columns, n):
        near = np.flatnonzero((first < start + n) & (last > start))
        if not len(near):
            found.append((slice(0, 0), arrays.like(np.zeros((n, 0)), like)))
            continue
        top = int(ends[near[0]]) - len(axis.blocks[near[0]][1])
        weights = np.zeros((int(ends[near[-1]]) - top, n))
        for k in near:
            at, m = axis.blocks[k]
            some = slice(max(at, start), min(at + m.shape[1], start + n))
            rows = slice(int(ends[k]) - len(m) - top, int(ends[k]) - top)
            weights[rows, some.start - start : some.stop - start] = m[:, some.start - at : some.stop - at]
        lit = np.flatnonzero(weights.any(1))
        own = slice(int(lit[0]), int(lit[-1]) + 1) if len(lit) else slice(0, 0)
        pixels = slice(top + own.start, top + own.stop)
        found.append((pixels, arrays.like(np.ascontiguousarray(along @ weights[own].T), like)))
    return found


def _zeros(like: Array, shape: Sequence[int]) -> Array:
    return arrays.namespace(like).zeros(tuple(shape), dtype=like.dtype, device=arrays.device(like))


def _empty(like: Array, shape: Sequence[int]) -> Array:
    return arrays.namespace(like).empty(tuple(shape), dtype=like.dtype, device=arrays.device(like))
