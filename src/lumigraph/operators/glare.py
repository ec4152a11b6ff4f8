"""Light far from a point's image: the main lens' diffraction, which falls as the cube of the distance.

It hardly depends on where in its cell a point stands, and its picture in a cell on the direction alone. So
each cell of the object counts as one, and the pictures at the end of the kernels' reach are taken farther.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

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
    """

    spectra: np.ndarray
    pictures: np.ndarray
    cells: Cells
    margin: Offset

    def forward(self, cells: Array) -> Array:
        """Light of the object's cells (rows, columns), to the image's (rows, columns, samples)."""
        xp = arrays.namespace(cells)
        spectra = arrays.like(self.spectra, arrays.as_complex(cells))
        window = arrays.framed(self._apart(cells, self.margin), (0, 0), self._window)
        spread = arrays.ifft2(arrays.fft2(arrays.as_complex(window)) * spectra)
        inside = self._inside()
        parts = xp.permute_dims(xp.real(spread)[:, inside[0], inside[1]], (1, 2, 0))
        if not self.cells.staggered:
            return parts @ arrays.like(self.pictures[0], cells)
        size = (*self.cells.image, self.pictures.shape[2])
        image = xp.zeros(size, dtype=parts.dtype, device=arrays.device(parts))
        for rows, columns, seen, pictures in self._alike():
            image[rows, columns, :] = parts[rows, seen, :] @ arrays.like(pictures, cells)
        return image

    def adjoint(self, image: Array) -> Array:
        """Transpose of `forward`: (rows, columns, samples) to (rows, columns)."""
        xp = arrays.namespace(image)
        parts = self._parts(image)
        parts = arrays.framed(xp.permute_dims(parts, (2, 0, 1)), self._before, self._window)
        spectra = arrays.like(np.conj(self.spectra), arrays.as_complex(parts))
        spread = xp.sum(arrays.fft2(arrays.as_complex(parts)) * spectra, axis=0)
        rows, columns = (n + 2 * m for n, m in zip(self.cells.image, self.margin, strict=True))
        return self._together(xp.real(arrays.ifft2(spread)), (rows, columns))

    def _parts(self, image: Array) -> Array:
        """The transpose of what `forward` does with the pictures: (rows, places along x, q)."""
        xp = arrays.namespace(image)
        if not self.cells.staggered:
            return image @ xp.matrix_transpose(arrays.like(self.pictures[0], image))
        size = (self.cells.image[0], 2 * self.cells.image[1] + 1, self.pictures.shape[1])
        parts = xp.zeros(size, dtype=image.dtype, device=arrays.device(image))
        for rows, columns, seen, pictures in self._alike():
            parts[rows, seen, :] = image[rows, columns, :] @ xp.matrix_transpose(arrays.like(pictures, image))
        return parts

    def _alike(self) -> Iterator[tuple[slice, slice, slice, np.ndarray]]:
        """Rows and columns of the image's cells of a parity and a kind, their places, and their pictures."""
        height, width = self.cells.image
        for parity in self.cells.parities:
            rows = self.cells.rows(0, height, parity)
            for kind, pictures in enumerate(self.pictures):
                columns = self.cells.columns(0, width, parity, kind)
                seen = slice(2 * columns.start + parity, 2 * width + parity, 2 * columns.step)
                yield slice(rows.start, None, 2), slice(columns.start, None, columns.step), seen, pictures

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
    """Of so many cells: half a cell apart along x where they are staggered."""
    return (shape[0], 2 * shape[1] + 1) if cells.staggered else shape


def glare(means: Sequence[Means], cells: Cells) -> Glare:
    """Beyond the offsets of `means`.

    Parameters
    ----------
    means
        Mean picture (samples,) of a cell's points at each offset (dy, dx) of a rectangle, for each kind of
        the image's cells.
    cells
        Of the image.
    """
    known, image, size = means[0], cells.image, cells.size
    reach = max(dy for dy, _ in known), max(dx for _, dx in known)
    margin = reach[0], reach[1] + cells.staggered
    widest = max(dx + cells.shift(dy) / 2 for dy, dx in known)
    last = {dy: max(dx for row, dx in known if row == dy) for dy, _ in known}
    ring = sorted(
        key for key in known if abs(key[0]) == reach[0] or last[key[0]] in (key[1], cells.mirrored(*key))
    )
    number = {key: k for k, key in enumerate(ring)}
    whole = _places(cells, (image[0] + 2 * margin[0], image[1] + 2 * margin[1]))
    shape = tuple(n + m for n, m in zip(_places(cells, image), whole, strict=True))
    weights, step = np.zeros((len(ring), *shape)), 2 if cells.staggered else 1
    for dy in range(-image[0] - margin[0] + 1, image[0] + margin[0]):
        shift = cells.shift(dy)
        for dx in range(-image[1] - margin[1] + 1 - shift, image[1] + margin[1]):
            across = dx + shift / 2
            out = max(abs(dy) / reach[0], abs(across) / widest)
            if out > 1:
                row = round(dy / out)
                limit = last[row]
                column = min(
                    max(round(across / out - cells.shift(row) / 2), cells.mirrored(row, limit)), limit
                )
                nearest = column + cells.shift(row) / 2
                law = math.hypot(row * size[0], nearest * size[1]) / math.hypot(
                    dy * size[0], across * size[1]
                )
                weights[number[row, column], dy % shape[0], (step * dx + shift) % shape[1]] = law**3
    spectra = np.conj(np.fft.fft2(weights)).astype(np.complex64)
    pictures = np.array([[mine[key] for key in ring] for mine in means], np.float32)
    return Glare(spectra, pictures, cells, margin)
