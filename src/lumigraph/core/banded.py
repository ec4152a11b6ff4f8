"""Banded matrices, stored in blocks."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from lumigraph.core import arrays
from lumigraph.core.arrays import Array

_ROWS, _JOINED = 64, 8
"""Rows of a block, and blocks that another device than the processor takes as one: it starts few products."""


@dataclass(frozen=True, eq=False)
class Banded:
    """Matrix (rows, columns) of blocks of rows with few nonzero columns each.

    Parameters
    ----------
    columns
        Number of columns.
    blocks
        (first column, matrix), row after row.
    """

    columns: int
    blocks: tuple[tuple[int, np.ndarray], ...]

    @property
    def nbytes(self) -> int:
        """Memory of the blocks [bytes]."""
        return sum(m.nbytes for _, m in self.blocks)

    @property
    def rows(self) -> int:
        """Number of rows."""
        return sum(len(m) for _, m in self.blocks)

    def _parts(self, like: Array) -> Iterator[tuple[slice, slice, Array]]:
        """Rows, columns and matrix of each block."""
        row = 0
        for first, m in self.blocks if arrays.is_here(like) else self._tall:
            yield slice(row, row + len(m)), slice(first, first + m.shape[1]), arrays.held(m, like)
            row += len(m)

    @cached_property
    def _tall(self) -> tuple[tuple[int, np.ndarray], ...]:
        """The blocks, some after the other as one, with zeros between."""
        starts = range(0, len(self.blocks), _JOINED)
        return tuple(_joined(self.blocks[start : start + _JOINED]) for start in starts)

    def seeing(self, columns: slice) -> tuple[slice, "Banded"]:
        """Rows of all blocks that use some of these columns, and their part of the matrix."""
        rows, blocks, row = [], [], 0
        for first, m in self.blocks:
            start, stop = max(first, columns.start), min(first + m.shape[1], columns.stop)
            if start < stop:
                rows += [row, row + len(m)]
                blocks.append((start - columns.start, m[:, start - first : stop - first]))
            row += len(m)
        seen = slice(min(rows, default=0), max(rows, default=0))
        return seen, Banded(columns.stop - columns.start, tuple(blocks))

    def inner(self, plane: np.ndarray) -> float:
        """Sum of the matrix' entries, each times that of a plane (rows, columns)."""
        return sum(float(np.sum(m * plane[rows, columns])) for rows, columns, m in self._parts(plane))

    def down(self, plane: Array) -> Array:
        """``matrix @ plane``: (columns, n) to (rows, n)."""
        result = _zeros(plane, (self.rows, plane.shape[1]))
        for rows, columns, m in self._parts(plane):
            result[rows, :] = m @ plane[columns, :]
        return result

    def up(self, plane: Array) -> Array:
        """``matrix.T @ plane``: (rows, n) to (columns, n)."""
        xp, result = arrays.namespace(plane), _zeros(plane, (self.columns, plane.shape[1]))
        for rows, columns, m in self._parts(plane):
            result[columns, :] += xp.matrix_transpose(m) @ plane[rows, :]
        return result

    def right(self, plane: Array) -> Array:
        """``plane @ matrix.T``: (n, columns) to (n, rows)."""
        xp, result = arrays.namespace(plane), _zeros(plane, (plane.shape[0], self.rows))
        for rows, columns, m in self._parts(plane):
            result[:, rows] = plane[:, columns] @ xp.matrix_transpose(m)
        return result

    def left(self, plane: Array) -> Array:
        """``plane @ matrix``: (n, rows) to (n, columns)."""
        result = _zeros(plane, (plane.shape[0], self.columns))
        for rows, columns, m in self._parts(plane):
            result[:, columns] += plane[:, rows] @ m
        return result


def _joined(blocks: Sequence[tuple[int, np.ndarray]]) -> tuple[int, np.ndarray]:
    first = min(start for start, _ in blocks)
    last = max(start + m.shape[1] for start, m in blocks)
    row, whole = 0, np.zeros((sum(len(m) for _, m in blocks), last - first), blocks[0][1].dtype)
    for start, m in blocks:
        whole[row : row + len(m), start - first : start - first + m.shape[1]] = m
        row += len(m)
    return first, whole


def banded(
    rows: np.ndarray,
    columns: np.ndarray,
    entries: Callable[[np.ndarray], np.ndarray],
    reach: float,
    height: int = _ROWS,
    dtype: type = np.float64,
) -> Banded:
    """Matrix ``entries(row - column)`` of sorted positions; farther apart than `reach` it is zero.

    Its blocks have `height` rows.
    """
    blocks = []
    for start in range(0, len(rows), height):
        mine = rows[start : start + height]
        first = int(np.searchsorted(columns, mine.min() - reach, "left"))
        last = int(np.searchsorted(columns, mine.max() + reach, "right"))
        offsets = mine[:, None] - columns[first:last]
        near, block = np.abs(offsets) <= reach, np.zeros(offsets.shape, dtype)
        block[near] = entries(offsets[near])
        blocks.append((first, block))
    return Banded(len(columns), tuple(blocks))


def _zeros(like: Array, shape: tuple[int, int]) -> Array:
    return arrays.namespace(like).zeros(shape, dtype=like.dtype, device=arrays.device(like))
