"""Images of the points of a cell behind lenslets of any shape, from few of the points.

A field is band-limited in the point's place too, so that those of some points give those of all. What is
faint besides, as where lenslets are missing, follows from the intensities of still fewer (`ChosenPoints`).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
import scipy.linalg

from lumigraph.core.threads import each
from lumigraph.operators.lenslets.lenslet_light import LensletLight, Row
from lumigraph.operators.lenslets.point_images import Line, intensity, mirrored
from lumigraph.operators.sampling.cell_axis import CellAxis

AT_A_TIME = 2**20
"""Numbers worked on at a time."""

TOLD = 0.7
"""Of the numbers of a sketch, as many points as they can choose."""

FOLDS = 4
"""Numbers of a sketch that each sample is in."""


@dataclass(frozen=True, slots=True, eq=False)
class PointSubset:
    """Images of points behind lenslets of any shape, from the fields of few of the points.

    Parameters
    ----------
    fields
        (few along y, few along x, samples).
    down, across
        (points, few) along y and x, for the points of all cells.
    cells
        Of the points, along y and x, counted from the image's.
    staggered
        Whether odd rows of cells stand half a cell towards larger x.
    """

    fields: np.ndarray
    down: np.ndarray
    across: np.ndarray
    cells: tuple[range, range]
    staggered: bool = False

    def line(self, dy: int) -> Line:
        """As `point_images.Apart.line`."""
        y, x = (len(m) // len(c) for m, c in zip((self.down, self.across), self.cells, strict=True))
        parts, samples = self.fields.view(np.float32), self.fields.shape[2]
        down = self.down[(dy - self.cells[0].start) * y :][:y]
        rows = (down @ parts.reshape(len(parts), -1)).reshape(y, *parts.shape[1:])
        first = dy % 2 * x // 2 if self.staggered else 0

        def block(dx: int) -> np.ndarray:
            across = self.across[first + (dx - self.cells[1].start) * x :][:x]
            result = np.empty((y, x, samples), np.float32)
            for row, image in zip(rows, result, strict=True):
                intensity((across @ row).view(np.complex64), image)
            return result.reshape(y * x, samples)

        return block


def few(
    light: LensletLight, lenslets: Sequence[Row], cells: tuple[range, range], workers: int, *, staggered: bool
) -> PointSubset:
    """For the points of some cells along y and x."""
    (rows, along_y), (columns, along_x) = map(_skeleton, light.axes, cells)
    samples = light.axes[0].samples * light.axes[1].samples
    fields = np.empty((len(rows), len(columns), samples), np.complex64)

    light.prepare(lenslets, workers)
    step = max(1, AT_A_TIME // (len(columns) * samples))

    def fill(first: int) -> None:
        mine = fields[first : first + step]
        numbers = np.stack(np.meshgrid(rows[first : first + step], columns, indexing="ij"), axis=-1)
        mine[:] = light.amplitudes(numbers.reshape(-1, 2), lenslets).reshape(mine.shape)

    for _ in each(fill, range(0, len(rows), step), workers):
        pass
    return PointSubset(fields, along_y, along_x, cells, staggered)


@cache
def _skeleton(axis: CellAxis, cells: range) -> tuple[np.ndarray, np.ndarray]:
    """Numbers of few points of some cells, and the matrix (points, few) from them to all.

    Discrete prolate sequences hold what the band lets through; rows of theirs that are far from dependent
    are found by a pivoted QR decomposition.
    """
    points = np.arange(cells.start * axis.points, cells.stop * axis.points)
    at = points * (axis.size / axis.points)
    strength, vectors = np.linalg.eigh(np.sinc(2 * axis.band * (at[:, None] - at)))
    basis = vectors[:, strength > 1e-10 * strength[-1]]
    chosen = np.asarray(scipy.linalg.qr(basis.T, mode="r", pivoting=True)[-1])
    chosen = np.sort(chosen[: basis.shape[1]])
    matrix = np.linalg.solve(basis[chosen].T, basis.T).T
    return points[chosen], matrix.astype(np.float32)


@dataclass(frozen=True, slots=True, eq=False)
class ChosenPoints:
    """Some points of a cell, from whose images those of all follow.

    Parameters
    ----------
    numbers
        (n,), of the cell's points.
    weights
        (points, n).
    """

    numbers: np.ndarray
    weights: np.ndarray

    def turned(self, shape: tuple[int, int], up: bool, left: bool) -> "ChosenPoints":
        """In the mirrored cell of (y, x) points."""
        numbers = np.arange(len(self.weights)).reshape(shape)
        numbers = numbers[:: -1 if up else 1, :: -1 if left else 1].ravel()
        return ChosenPoints(numbers[self.numbers], mirrored(self.weights, shape, up, left))


def chosen(block: np.ndarray, least: float) -> ChosenPoints:
    """Points of a block (points, samples) that give the others but for `least`.

    A pivoted QR decomposition of a sketch takes point after point that those before tell least of. So many
    points need a sketch of more numbers than there are of them.
    """
    points, samples = block.shape
    count = max(64, points // 2)
    while True:
        seen = _folded(block, count)
        found = scipy.linalg.qr(seen.T, mode="r", pivoting=True)
        triangle, order = np.asarray(found[0]), np.asarray(found[-1])
        rank = int((np.abs(np.diag(triangle)) > least).sum())
        if rank <= TOLD * count or count >= samples:
            break
        count *= 2
    weights = np.empty((points, rank), np.float32)
    if rank:
        weights[order] = scipy.linalg.solve_triangular(triangle[:rank, :rank], triangle[:rank]).T
    return ChosenPoints(order[:rank], weights)


def _folded(block: np.ndarray, count: int) -> np.ndarray:
    """Sums (points, count) of a block's samples, each sample in `FOLDS` of them with a sign by chance.

    A choice of samples would miss what stands at the edge of a cell. Samples keep their neighbours, so that
    they are read in order; of `count` that follow one another no two are in one sum.
    """
    points, samples = block.shape
    if count >= samples:
        return block
    rng, sums = np.random.default_rng(0), np.zeros((points, count), np.float32)
    for first in range(0, samples, count):
        part = block[:, first : first + count]
        for _ in range(FOLDS):
            signs, start = rng.choice((-1, 1), part.shape[1]).astype(np.float32), int(rng.integers(count))
            signed, end = part * signs, count - start
            sums[:, start : start + signed.shape[1]] += signed[:, :end]
            sums[:, : max(0, signed.shape[1] - end)] += signed[:, end:]
    return sums / math.sqrt(FOLDS)
