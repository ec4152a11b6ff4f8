"""Light far from a point's image: the main lens' diffraction, which falls as the cube of the distance.

It hardly depends on where in its cell a point stands, and its picture in a cell on the direction alone. So
each cell of the object counts as one, and the pictures at the end of the kernels' reach are taken farther.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from lumigraph.core import arrays
from lumigraph.core.arrays import Array
from lumigraph.operators.cells import Cells

Offset = tuple[int, int]

Means = dict[Offset, np.ndarray]


@dataclass(frozen=True, slots=True, eq=False)
class Glare:
    """Matrix from the light of an object's cells to an image's.

    Parameters
    ----------
    spectra
        (q, M, N) complex: how much of each picture an offset between cells gives, transformed.
    pictures
        (kinds, q, samples) of a cell, for one point of intensity 1.
    cells
        Of the image.
    margin
        Cells of the object beyond those of the image, on each side.
    everywhere
        Whether the light of all of the object's cells counts; else that of those in front of lenslets, which
        arrives in all of the image's. Light that has passed the main lens only arrives where lenslets are.
    """

    spectra: np.ndarray
    pictures: np.ndarray
    cells: Cells
    margin: Offset
    everywhere: bool = True

    def forward(self, cells: Array) -> Array:
        """Light of the object's cells (rows, columns), to the image's (rows, columns, samples)."""
        xp = arrays.namespace(cells)
        spectra = arrays.held(self.spectra, arrays.as_complex(cells))
        if not self.everywhere:
            cells = self._in_array(cells, self.margin)
        window = arrays.framed(self._apart(cells, self.margin), (0, 0), self._window)
        spread = arrays.ifft2(arrays.fft2(arrays.as_complex(window)) * spectra)
        inside = self._inside()
        parts = xp.permute_dims(xp.real(spread)[:, inside[0], inside[1]], (1, 2, 0))
        if not self.cells.staggered:
            image = parts @ arrays.held(self.pictures, cells, 0)
        else:
            size = (*self.cells.image, self.pictures.shape[2])
            image = xp.zeros(size, dtype=parts.dtype, device=arrays.device(parts))
            for rows, columns, seen, kind in self._alike():
                image[rows, columns, :] = parts[rows, seen, :] @ arrays.held(self.pictures, cells, kind)
        return self._in_array(image) if self.everywhere else image

    def adjoint(self, image: Array) -> Array:
        """Transpose of `forward`: (rows, columns, samples) to (rows, columns)."""
        xp = arrays.namespace(image)
        parts = self._parts(self._in_array(image) if self.everywhere else image)
        parts = arrays.framed(xp.permute_dims(parts, (2, 0, 1)), self._before, self._window)
        spectra = xp.conj(arrays.held(self.spectra, arrays.as_complex(parts)))
        spread = xp.sum(arrays.fft2(arrays.as_complex(parts)) * spectra, axis=0)
        rows, columns = (n + 2 * m for n, m in zip(self.cells.image, self.margin, strict=True))
        cells = self._together(xp.real(arrays.ifft2(spread)), (rows, columns))
        return cells if self.everywhere else self._in_array(cells, self.margin)

    def _in_array(self, cells: Array, margin: Offset = (0, 0)) -> Array:
        """Cells (rows, columns, ...) of the image, or of the object with a margin: 0 beyond the array."""
        y, x = (
            slice(m + r, m + r + n) for m, r, n in zip(margin, self.cells.ring, self.cells.count, strict=True)
        )
        within = arrays.namespace(cells).zeros_like(cells)
        within[y, x, ...] = cells[y, x, ...]
        return within

    def widened(self, more: Offset) -> "Glare":
        """The same for so many more cells of the object on each side."""
        reach = self.margin[0], self.margin[1] - self.cells.staggered
        margin = self.margin[0] + more[0], self.margin[1] + more[1]
        return replace(self, spectra=_spectra(self.cells, reach, margin), margin=margin)

    def _parts(self, image: Array) -> Array:
        """The transpose of what `forward` does with the pictures: (rows, places along x, q)."""
        xp = arrays.namespace(image)
        if not self.cells.staggered:
            return image @ xp.matrix_transpose(arrays.held(self.pictures, image, 0))
        size = (self.cells.image[0], 2 * self.cells.image[1] + 1, self.pictures.shape[1])
        parts = xp.zeros(size, dtype=image.dtype, device=arrays.device(image))
        for rows, columns, seen, kind in self._alike():
            pictures = arrays.held(self.pictures, image, kind)
            parts[rows, seen, :] = image[rows, columns, :] @ xp.matrix_transpose(pictures)
        return parts

    def _alike(self) -> Iterator[tuple[slice, slice, slice, int]]:
        """Rows and columns of the image's cells of a parity and a kind, their places, and the kind."""
        height, width = self.cells.image
        for parity in self.cells.parities:
            rows = self.cells.rows(0, height, parity)
            for kind in range(len(self.pictures)):
                columns = self.cells.columns(0, width, parity, kind)
                seen = slice(2 * columns.start + parity, 2 * width + parity, 2 * columns.step)
                yield slice(rows.start, None, 2), slice(columns.start, None, columns.step), seen, kind

    def _apart(self, cells: Array, margin: Offset) -> Array:
        """Staggered cells at their places along x, half a cell apart, between zeros."""
        if not self.cells.staggered:
            return cells
        xp, (rows, columns) = arrays.namespace(cells), cells.shape
        places = xp.zeros((rows, 2 * columns + 1), dtype=cells.dtype, device=arrays.device(cells))
        for parity in (0, 1):
            first = (self.cells.ring[0] + margin[0] + parity) % 2
            places[first::2, parity : 2 * columns + parity : 2] = cells[first::2, :]
        return places

    def _together(self, places: Array, shape: Offset) -> Array:
        """The transpose of `_apart`, of the object's cells."""
        rows, columns = shape
        if not self.cells.staggered:
            return places[:rows, :columns]
        cells = arrays.namespace(places).zeros(shape, dtype=places.dtype, device=arrays.device(places))
        for parity in (0, 1):
            first = (self.cells.ring[0] + self.margin[0] + parity) % 2
            cells[first::2, :] = places[first:rows:2, parity : 2 * columns + parity : 2]
        return cells

    @property
    def _before(self) -> Offset:
        """Places of the object's cells before those of the image."""
        return self.margin[0], self.margin[1] * (2 if self.cells.staggered else 1)

    def _inside(self) -> tuple[slice, slice]:
        y, x = (
            slice(m, m + n) for n, m in zip(_places(self.cells, self.cells.image), self._before, strict=True)
        )
        return y, x

    @property
    def _window(self) -> Offset:
        return self.spectra.shape[1], self.spectra.shape[2]


def _places(cells: Cells, shape: Offset) -> Offset:
    """Number of places of so many cells: half a cell apart along x where they are staggered."""
    return (shape[0], 2 * shape[1] + 1) if cells.staggered else shape


def glare(means: Sequence[Means], cells: Cells, even: np.ndarray | None = None) -> Glare:
    """Glare of cells beyond the offsets of `means`.

    At the end of the reach light may not fall as the cube yet. So what all pictures add up to is made right
    for an endless even object, in all directions alike.

    Parameters
    ----------
    means
        Mean picture (samples,) of a cell's points at each offset (dy, dx) of a rectangle, for each kind of
        the image's cells.
    cells
        Of the image.
    even
        (kinds, samples) of such an object of intensity 1, where it is known; then `means` are of all offsets.
    """
    reach = max(dy for dy, _ in means[0]), max(dx for _, dx in means[0])
    pictures = np.array([[mine[key] for key in _ring(cells, reach)] for mine in means], np.float32)
    margin = reach[0], reach[1] + cells.staggered
    if even is not None:
        near = np.array([np.sum(list(mine.values()), axis=0) for mine in means])
        missing = (
            even / math.prod(cells.points) - near - np.einsum("q,kqs->ks", _totals(cells, reach), pictures)
        )
        pictures += (missing[:, None] * _shares(cells, reach)[:, None]).astype(np.float32)
    return Glare(_spectra(cells, reach, margin), pictures, cells, margin)


def _ring(cells: Cells, reach: Offset) -> list[Offset]:
    """Offsets at the end of the reach."""
    rows = range(-reach[0], reach[0] + 1)
    sides = {(dy, dx) for dy in rows for dx in (cells.mirrored(dy, reach[1]), reach[1])}
    ends = {
        (dy, dx) for dy in (rows[0], rows[-1]) for dx in range(cells.mirrored(dy, reach[1]), reach[1] + 1)
    }
    return sorted(sides | ends)


def _totals(cells: Cells, reach: Offset) -> np.ndarray:
    """Amount of each picture (q,) that all cells out of reach, to infinity, give together."""
    near, far = (
        np.bincount(which, law, len(_ring(cells, reach)))
        for which, _, _, law in (_law(cells, reach, (n, n)) for n in (8 * max(reach), 16 * max(reach)))
    )
    return 2 * far - near  # what is farther than n falls as 1/n


def _shares(cells: Cells, reach: Offset) -> np.ndarray:
    """Parts (q,) of a picture that the pictures take, which falls alike in all directions and is 1 in all."""
    y, x = np.array(_ring(cells, reach)).T
    law = np.hypot(y * cells.size[0], (x + y % 2 * cells.staggered / 2) * cells.size[1]) ** -3
    return law / (_totals(cells, reach) @ law)


def aside(cells: Cells, margin: Offset, share: float, farther: float) -> Glare:
    """Even light that lenslets send far aside: a share of each one's light, to `farther` [m] and beyond.

    Opaque rims do; it falls as the cube too, and comes from where there are lenslets only.
    """
    whole = cells.image[0] + margin[0], cells.image[1] + margin[1]
    dy, across = _offsets(cells, whole)
    away = np.hypot(dy * cells.size[0], across * cells.size[1])
    law = share * fallen(away, farther) * math.prod(cells.size)
    x = np.round((1 + cells.staggered) * across).astype(int)
    spectra = _transformed(cells, margin, 1, (np.zeros_like(dy), dy, x, law))
    even = np.full((cells.kinds, 1, math.prod(cells.samples)), 1 / math.prod(cells.points), np.float32)
    return Glare(spectra, even, cells, margin, everywhere=False)


def fallen(away: np.ndarray, farther: float) -> np.ndarray:
    """Light to the area at some distances, of 1 that goes beyond `farther` in all, as the cube [1/m²]."""
    return np.where(away > farther, farther / (2 * np.pi * np.maximum(away, farther) ** 3), 0.0)


def _offsets(cells: Cells, farthest: Offset) -> tuple[np.ndarray, np.ndarray]:
    """Rows and columns between cells that are less than `farthest` apart; halves where rows are staggered."""
    staggered = int(cells.staggered)
    dy, dx = np.mgrid[1 - farthest[0] : farthest[0], 1 - farthest[1] - staggered : farthest[1]]
    shift = dy % 2 * staggered
    kept = dx >= 1 - farthest[1] - shift
    return dy[kept], (dx + shift / 2)[kept]


def _law(cells: Cells, reach: Offset, farthest: Offset) -> tuple[np.ndarray, ...]:
    """Picture number, rows, places along x and amount of offsets out of reach, less than `farthest`."""
    staggered = int(cells.staggered)
    dy, across = _offsets(cells, farthest)
    out = np.maximum(np.abs(dy) / reach[0], np.abs(across) / (reach[1] + staggered / 2))
    dy, across, out = (a[out > 1] for a in (dy, across, out))
    row = np.round(dy / out).astype(int)
    odd = row % 2 * staggered
    column = np.clip(np.round(across / out - odd / 2).astype(int), -reach[1] - odd, reach[1])
    near = np.hypot(row * cells.size[0], (column + odd / 2) * cells.size[1])
    law = (near / np.hypot(dy * cells.size[0], across * cells.size[1])) ** 3
    number = {key: k for k, key in enumerate(_ring(cells, reach))}
    which = np.array([number[key] for key in zip(row.tolist(), column.tolist(), strict=True)], int)
    return which, dy, np.round((1 + staggered) * across).astype(int), law


def _spectra(cells: Cells, reach: Offset, margin: Offset) -> np.ndarray:
    """(q, M, N): how much of each picture an offset between cells gives, transformed."""
    found = _law(cells, reach, (cells.image[0] + margin[0], cells.image[1] + margin[1]))
    return _transformed(cells, margin, len(_ring(cells, reach)), found)


def _transformed(cells: Cells, margin: Offset, count: int, found: tuple[np.ndarray, ...]) -> np.ndarray:
    """(count, M, N) of which picture, rows, places and how much."""
    image, (which, y, x, law) = cells.image, found
    whole = _places(cells, (image[0] + 2 * margin[0], image[1] + 2 * margin[1]))
    shape = tuple(n + m for n, m in zip(_places(cells, image), whole, strict=True))
    weights = np.zeros((count, *shape))
    weights[which, y % shape[0], x % shape[1]] = law
    return np.conj(np.fft.fft2(weights)).astype(np.complex64)
