r"""Transforms over lenslets, as products with cosines and sines.

At ±f_y and ±f_x the parts of cells make four real sums, by cosine or sine along either axis. The matrices of
the frequencies (`microscope_spectrum`) are the same for all four, if even parts are summed by (cos, sin) and
odd ones by (-sin, cos) along that axis: real and imaginary parts of the transform, but for a rotation that
all of them share. Products take less time than a fast transform of such lengths, and whatever is written
between them is real.
"""

import itertools
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from lumigraph.core import arrays
from lumigraph.core.arrays import Array
from lumigraph.core.cache import remembered
from lumigraph.operators.microscope_patterns import PARITIES
from lumigraph.operators.microscope_tiles import Span, Tiling


@dataclass(frozen=True, slots=True, eq=False)
class Piece:
    """Channels of one parity in one tile.

    Parameters
    ----------
    tile
        Its number.
    cells
        Where they are (rows, columns, channels).
    there, back
        Matrices along y and along x: `waves`, and `back`.
    """

    tile: int
    cells: tuple[slice, slice, slice]
    there: tuple[Array, Array]
    back: tuple[Array, Array]

    @property
    def shape(self) -> tuple[int, int, int]:
        """Sums along y, columns, channels."""
        _, columns, channels = self.cells
        return self.there[0].shape[0], columns.stop - columns.start, channels.stop - channels.start


@dataclass(frozen=True, slots=True, eq=False)
class Transforms:
    """Between cells' parts (rows, columns, channels) and their sums at each frequency.

    What lies between are sums along y alone: of each object or image, those of each piece in turn.

    Parameters
    ----------
    told
        Tiles.
    channels
        Of each cell.
    pieces
        Of all tiles and parities.
    """

    told: Tiling
    channels: int
    pieces: Sequence[Piece]

    @classmethod
    def of(cls, told: Tiling, odd: np.ndarray, like: Array, *, of_image: bool) -> "Transforms":
        """For arrays of one library and precision.

        Parameters
        ----------
        odd
            (2, channels): whether they are odd along y and x, in the order of `PARITIES`.
        of_image
            Whether they are those of an image, not of points.
        """

        def piece(tile: int, spans: tuple[Span, Span], parity: tuple[int, int], own: slice) -> Piece:
            cells, at = _places(spans, of_image)
            counts = (one.stop - one.start for one in cells)
            axes = list(zip(told.lengths, at, counts, parity, strict=True))
            y, x = (arrays.like(waves(*one, of_image), like) for one in axes)
            down, across = (arrays.like(back(*one, of_image), like) for one in axes)
            return Piece(tile, (*cells, own), (y, x), (down, across))

        return cls(told, odd.shape[1], [piece(*one) for one in _pieces(told, odd)])

    def along_y(self, parts: Iterable[Array]) -> list[Array]:
        """Sums (2 f_y, columns, channels) of the parts of each object or image."""
        return [_product(one.there[0], cells[one.cells]) for cells in parts for one in self.pieces]

    def columns(self, along_y: Sequence[Array], some: slice) -> Array:
        """Four sums (f_y, objects, f_x, 4 tiles, channels), of some of the frequencies along y.

        They lie in memory so that none of them is copied: those of one frequency stand side by side, those of
        one piece at one distance from each other.
        """
        first, hx = along_y[0], self.told.lengths[1] // 2 + 1
        xp, side, hy = arrays.namespace(first), len(along_y) // len(self.pieces), some.stop - some.start
        shape = hy, side, 2 * hx, self.told.count, 2, self.channels
        found = xp.empty(shape, dtype=first.dtype, device=arrays.device(first))
        for (n, piece), sums in self._each(along_y):
            given = xp.reshape(sums[2 * some.start : 2 * some.stop, ...], (hy, 2, *sums.shape[1:]))
            place = found[:, n, :, piece.tile, :, piece.cells[2]]
            _put_product(xp.permute_dims(place, (0, 2, 1, 3)), piece.there[1], given)
        return xp.reshape(found, (hy, side, hx, 4 * self.told.count, self.channels))

    def room(self, side: int, like: Array) -> list[Array]:
        """Room for the sums along y of so many objects or images."""
        kind = {"dtype": like.dtype, "device": arrays.device(like)}
        return [arrays.namespace(like).empty(one.shape, **kind) for _ in range(side) for one in self.pieces]

    def put(self, along_y: Sequence[Array], columns: Array, some: slice) -> None:
        """Write the sums along y whose `columns` these are, at some of the frequencies along y."""
        xp, (hy, side, hx) = arrays.namespace(columns), columns.shape[:3]
        columns = xp.reshape(columns, (hy, side, 2 * hx, self.told.count, 2, self.channels))
        for (n, piece), sums in self._each(along_y):
            place = xp.reshape(sums[2 * some.start : 2 * some.stop, ...], (hy, 2, *sums.shape[1:]))
            given = columns[:, n, :, piece.tile, :, piece.cells[2]]
            _put_product(place, piece.back[1], xp.permute_dims(given, (0, 2, 1, 3)))

    def add(self, parts: Sequence[Array], along_y: Sequence[Array]) -> None:
        """Add to the parts of cells those whose sums along y these are."""
        for (n, piece), sums in self._each(along_y):
            place = parts[n][piece.cells]
            place += _product(piece.back[0], sums)

    def _each(self, along_y: Sequence[Array]) -> Iterator[tuple[tuple[int, Piece], Array]]:
        """Number of an object and a piece, with its sums along y."""
        return zip(((n, piece) for n in itertools.count() for piece in self.pieces), along_y, strict=False)


def _product(matrix: Array, array: Array) -> Array:
    """Along the first axis of an array."""
    xp = arrays.namespace(array)
    return xp.reshape(matrix @ xp.reshape(array, (array.shape[0], -1)), (-1, *array.shape[1:]))


def _put_product(place: Array, matrix: Array, given: Array) -> None:
    """Write products into a view."""
    if arrays.is_numpy(place):
        np.matmul(matrix, given, out=place)
    else:
        place[...] = matrix @ given


def _pieces(told: Tiling, odd: np.ndarray) -> Iterator[tuple[int, tuple[Span, Span], tuple[int, int], slice]]:
    """Number and spans of each tile, with each parity that there is and its channels."""
    stops = np.searchsorted(2 * odd[0] + odd[1], np.arange(5)).tolist()
    own = [(p, slice(*ends)) for p, ends in zip(PARITIES, itertools.pairwise(stops), strict=True)]
    own = [(p, one) for p, one in own if one.stop > one.start]
    return ((k, spans, *piece) for (k, spans), piece in itertools.product(told.tiles(), own))


def _places(spans: tuple[Span, Span], of_image: bool) -> tuple[tuple[slice, slice], tuple[int, int]]:
    """Cells of a tile, and where the first stands in the transform."""
    y, x = spans
    if of_image:
        return (y.image, x.image), (y.image_at, x.image_at)
    return (y.points, x.points), (y.points_at, x.points_at)


@remembered
def waves(length: int, first: int, count: int, odd: int, of_image: bool) -> np.ndarray:
    """From `count` lenslets, the first one at `first`, to two sums at each frequency f ≥ 0 (2 f, count).

    >>> waves(4, 0, 2, 0, False).round(6).tolist()
    [[1.0, 1.0], [0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, -1.0], [0.0, 0.0]]
    """
    frequencies, places = np.arange(length // 2 + 1)[:, None], first + np.arange(count)
    phase = 2 * np.pi * (frequencies * places % length) / length
    even, other = np.cos(phase), np.sin(phase)
    if odd:
        even, other = (other, -even) if of_image else (-other, even)
    pair = np.stack([even, other], axis=1).reshape(-1, count)
    return np.where(np.abs(pair) < 1e-15, 0.0, pair)  # of π


@remembered
def back(length: int, first: int, count: int, odd: int, of_image: bool) -> np.ndarray:
    """From those sums to the lenslets (count, 2 f), as the frequencies below 0 have the same.

    >>> ((back(5, 1, 3, 1, True) @ waves(5, 1, 3, 1, True)).round(6) + 0.0).tolist()  # no -0.0
    [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    """
    frequencies = np.arange(length // 2 + 1)
    weights = np.where(2 * frequencies % length, 2.0, 1.0) / length
    return (waves(length, first, count, odd, of_image) * np.repeat(weights, 2)[:, None]).T.copy()
