r"""Transforms over lenslets, as products with cosines and sines.

At ±f_y and ±f_x the parts of cells make four real sums, by cosine or sine along either axis. The matrices of
the frequencies (`spectrum`) are the same for all four, if even parts are summed by (cos, sin) and
odd ones by (-sin, cos) along that axis: real and imaginary parts of the transform, but for a rotation that
all of them share. Products take less time than a fast transform of such lengths, and whatever is written
between them is real.
"""

import itertools
from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from lumigraph.core import arrays
from lumigraph.core.arrays import Array
from lumigraph.core.cache import remembered
from lumigraph.operators.microscope.patterns import PARITIES
from lumigraph.operators.microscope.tiles import TileSpan, Tiling


def columns(parts: Iterable[Array], side: int, told: Tiling, odd: np.ndarray, *, of_image: bool) -> Array:
    """Four sums (frequencies, side, 4 tiles, channels) of cells' parts (rows, columns, channels).

    Parameters
    ----------
    parts
        Of `side` objects or images.
    odd
        (2, channels): whether they are odd along y and x, in the order of `PARITIES`.
    of_image
        Whether they are those of an image, not of points.
    """
    parts = iter(parts)
    first = next(parts)
    hy, hx = _halves(told)
    shape = hy, hx, side, told.count, 2, 2, first.shape[-1]
    xp = arrays.namespace(first)
    found = xp.empty(shape, dtype=first.dtype, device=arrays.device(first))
    for n, cells in enumerate(itertools.chain([first], parts)):
        for k, (spans, parity, own) in _pieces(told, odd):
            (rows, places), at = _places(spans, of_image)
            tile = cells[rows, places, own]
            y, x = _sums(told, at, tile.shape, parity, of_image, tile)
            down = xp.reshape(y @ xp.reshape(tile, (tile.shape[0], -1)), (2 * hy, *tile.shape[1:]))
            four = xp.reshape(x @ down, (hy, 2, hx, 2, -1))
            found[:, :, n, k, :, :, own] = xp.permute_dims(four, (0, 2, 1, 3, 4))
    return xp.reshape(found, (told.frequencies, side, 4 * told.count, first.shape[-1]))


def add_cells(parts: Sequence[Array], sums: Array, told: Tiling, odd: np.ndarray, *, of_image: bool) -> None:
    """Add to cells' parts (rows, columns, channels) those whose `columns` these are."""
    xp, (hy, hx) = arrays.namespace(sums), _halves(told)
    sums = xp.reshape(sums, (hy, hx, len(parts), told.count, 2, 2, -1))
    for (n, cells), (k, (spans, parity, own)) in itertools.product(
        enumerate(parts), list(_pieces(told, odd))
    ):
        (rows, places), at = _places(spans, of_image)
        place = cells[rows, places, own]
        four = xp.permute_dims(sums[:, :, n, k, :, :, own], (0, 2, 1, 3, 4))
        y, x = _backs(told, at, place.shape, parity, of_image, place)
        across = x @ xp.reshape(four, (2 * hy, 2 * hx, -1))
        place += xp.reshape(y @ xp.reshape(across, (2 * hy, -1)), place.shape)


def _halves(told: Tiling) -> tuple[int, int]:
    """Frequencies from 0 on, along y and x."""
    y, x = told.lengths
    return y // 2 + 1, x // 2 + 1


def _pieces(
    told: Tiling, odd: np.ndarray
) -> Iterator[tuple[int, tuple[tuple[TileSpan, TileSpan], tuple[int, int], slice]]]:
    """Number and spans of each tile, with each parity that there is and its channels."""
    stops = np.searchsorted(2 * odd[0] + odd[1], np.arange(5)).tolist()
    own = [(p, slice(*ends)) for p, ends in zip(PARITIES, itertools.pairwise(stops), strict=True)]
    own = [(p, one) for p, one in own if one.stop > one.start]
    return ((k, (spans, *piece)) for (k, spans), piece in itertools.product(told.tiles(), own))


def _places(spans: tuple[TileSpan, TileSpan], of_image: bool) -> tuple[tuple[slice, slice], tuple[int, int]]:
    """Cells of a tile, and where the first stands in the transform."""
    y, x = spans
    if of_image:
        return (y.image, x.image), (y.image_at, x.image_at)
    return (y.points, x.points), (y.points_at, x.points_at)


def _sums(
    told: Tiling, at: tuple[int, int], shape: Sequence[int], odd: tuple[int, int], of_image: bool, like: Array
) -> tuple[Array, Array]:
    """`waves` along y and x."""
    y, x = (waves(*one, of_image) for one in zip(told.lengths, at, shape[:2], odd, strict=True))
    return arrays.like(y, like), arrays.like(x, like)


def _backs(
    told: Tiling, at: tuple[int, int], shape: Sequence[int], odd: tuple[int, int], of_image: bool, like: Array
) -> tuple[Array, Array]:
    """`back` along y and x."""
    y, x = (back(*one, of_image) for one in zip(told.lengths, at, shape[:2], odd, strict=True))
    return arrays.like(y, like), arrays.like(x, like)


@remembered
def waves(length: int, first: int, count: int, odd: int, of_image: bool) -> np.ndarray:
    """Matrix (2 f, count) from lenslets, the first one at `first`, to two sums at each frequency f ≥ 0.

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
    """Matrix (count, 2 f) from those sums to the lenslets, as the frequencies below 0 have the same.

    >>> ((back(5, 1, 3, 1, True) @ waves(5, 1, 3, 1, True)).round(6) + 0.0).tolist()  # no -0.0
    [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    """
    frequencies = np.arange(length // 2 + 1)
    weights = np.where(2 * frequencies % length, 2.0, 1.0) / length
    return (waves(length, first, count, odd, of_image) * np.repeat(weights, 2)[:, None]).T.copy()
