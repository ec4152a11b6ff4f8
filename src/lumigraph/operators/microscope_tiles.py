"""Lenslets in tiles whose transforms are as long as light needs, and no longer."""

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import scipy.fft


@dataclass(frozen=True, slots=True)
class Span:
    """A tile along one axis.

    Parameters
    ----------
    image
        Lenslets whose images are followed.
    points
        Lenslets before which objects stand that send light there.
    image_at, points_at
        Where the first of each stands in the transform.
    """

    image: slice
    points: slice
    image_at: int
    points_at: int

    def length(self, reach: int) -> int:
        """Least length of a transform in which no light falls round its end onto the image."""
        image_end = self.image_at + self.image.stop - self.image.start
        points_end = self.points_at + self.points.stop - self.points.start
        return max(points_end, points_end + reach - self.image_at, image_end + reach - self.points_at)


@dataclass(frozen=True)
class Row:
    """Tiles along one axis.

    Parameters
    ----------
    cells
        Lenslets whose images are followed.
    margin
        Lenslets that the object reaches beyond them on each side; below 0 where they reach beyond it.
    reach
        Lenslets to each side that a point lights.
    count
        Tiles.
    """

    cells: int
    margin: int
    reach: int
    count: int

    @cached_property
    def spans(self) -> tuple[Span, ...]:
        """Spans of the tiles."""
        side = math.ceil(self.cells / self.count)
        starts = range(0, self.cells, side)
        return tuple(self._span(start, min(start + side, self.cells)) for start in starts)

    def _span(self, start: int, stop: int) -> Span:
        points = self.cells + 2 * self.margin
        first = min(max(0, start + self.margin - self.reach), points - 1)
        last = max(min(points, stop + self.margin + self.reach), first + 1)
        origin = min(first, start + self.margin)
        return Span(
            slice(start, stop), slice(first, last), start + self.margin - origin, first - origin
        )  # fmt: skip

    @cached_property
    def length(self) -> int:
        """Length of the transforms of all tiles."""
        needed = max(span.length(self.reach) for span in self.spans)
        return int(scipy.fft.next_fast_len(needed, real=True) or needed)


@dataclass(frozen=True)
class Tiling:
    """Tiles along y and x."""

    rows: Row
    columns: Row

    @property
    def count(self) -> int:
        """Tiles."""
        return len(self.rows.spans) * len(self.columns.spans)

    @property
    def cells(self) -> tuple[int, int]:
        """Lenslets (rows, columns) whose images are followed."""
        return self.rows.cells, self.columns.cells

    @property
    def lengths(self) -> tuple[int, int]:
        """Lengths of the transforms along y and x."""
        return self.rows.length, self.columns.length

    @property
    def frequencies(self) -> int:
        """Number of frequencies with separate matrices: those of both signs share one."""
        return math.prod(length // 2 + 1 for length in self.lengths)

    def tiles(self) -> Iterator[tuple[int, tuple[Span, Span]]]:
        """Number and spans (y, x) of each tile."""
        return enumerate(itertools.product(self.rows.spans, self.columns.spans))


def tilings(cells: tuple[int, int], margin: int, reach: int, least: int) -> Iterator[Tiling]:
    """Tilings with tiles of at least `least` lenslets to a side, the largest tiles first.

    >>> [told.lengths for told in tilings((20, 30), 4, 4, 10)]
    [(30, 40), (18, 24), (18, 18)]
    """
    seen = set()
    for parts in range(1, max(1, max(cells) // least) + 1):
        side = math.ceil(max(cells) / parts)
        counts = tuple(math.ceil(n / side) for n in cells)
        if counts not in seen:
            seen.add(counts)
            yield Tiling(*(Row(n, margin, reach, count) for n, count in zip(cells, counts, strict=True)))
