"""Matrices between the cells of a lenslet array, in factors.

Inside the array all cells have the same blocks. Near its border light of lenslets beyond it is missing:

.. math:: B(a, b) = B + [B(a, ∞) - B] + [B(∞, b) - B] + [B(a, b) - B(a, ∞) - B(∞, b) + B]

for a cell at a from the border along y and b along x; the last bracket is left out far from corners. Singular
values are kept until the accuracy is reached; inside the array the light of what is left out is given to all
points of its cell alike, so that an even object stays exact. See docs/theory/periodic.md.
"""

import math
from collections import ChainMap
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain

import numpy as np

from lumigraph.core import memory
from lumigraph.core.arrays import WORKERS
from lumigraph.core.progress import Progress, within
from lumigraph.core.threads import each
from lumigraph.operators.lenslets.exact_lenslets import lenslets_of
from lumigraph.operators.lenslets.lenslet_light import LensletLight, windows
from lumigraph.operators.lenslets.point_images import (
    IlluminatedCells,
    SquareLensletImages,
    lit,
    mirrored,
    wave,
)
from lumigraph.operators.lenslets.point_subset import ChosenPoints, PointSubset, chosen, few
from lumigraph.operators.periodic.border_correction import BorderCorrection
from lumigraph.operators.periodic.factors import Factors, FoundFactors, factors, narrowed, together, weakest
from lumigraph.operators.periodic.shared_blocks import SharedBlocks
from lumigraph.operators.periodic.sizes import build_bytes, states_of, symmetric
from lumigraph.operators.sampling import cells as _cells
from lumigraph.operators.sampling.border_classes import (
    INSIDE,
    BorderClass,
    BorderState,
    Turn,
    alike,
    flipped,
    inside,
    places,
    terms,
)
from lumigraph.operators.sampling.cell_axis import INFINITE, Limits
from lumigraph.operators.sampling.optics import Optics

Offset = tuple[int, int]

Blocks = dict[Offset, Factors]

Means = dict[Offset, np.ndarray]

SHARE = 2.0
"""How much more of a row's blocks factors may leave out than of those inside."""

BORDER = 4.0
"""How much stronger than elsewhere factors are that are looked at in the border's blocks."""

CHOSEN = 3.0, 10.0
"""The same of what the points that are chosen for the border leave out: at 1e-2, and from 1e-3 on."""

Job = tuple[int, tuple[int, ...]]


@dataclass(frozen=True, slots=True, eq=False)
class MatrixPart:
    """Part of the matrix between an object's cells and an image's.

    Parameters
    ----------
    rows, columns
        Cells of the image, counted from the outermost ring around the array.
    offsets
        (dy, dx, rank): cells from the image's to the object's, row by row, and the factors' columns for it;
        in a row, those that are as many columns apart as the image's cells follow one another.
    left
        (points, R) with the ranks side by side; None for one offset whose block `right` is.
    right
        (R, samples).
    """

    rows: range
    columns: range
    offsets: tuple[tuple[int, int, int], ...]
    left: np.ndarray | None
    right: np.ndarray

    @property
    def factor(self) -> np.ndarray:
        """The left one, of a part in factors."""
        assert self.left is not None  # a single block
        return self.left


@dataclass(frozen=True, slots=True)
class BuiltParts:
    """All parts, the periodic one first.

    Parameters
    ----------
    ranks
        Columns of the factors of all parts together.
    parts
        One after the other: those that mirror another one are copies, made when they are asked for.
    means
        Mean images (samples,) of a cell's points at each offset, for each kind of the image's cells.
    """

    ranks: int
    parts: Iterator[MatrixPart]
    means: list[Means]


def build(optics: Optics, progress: Progress | None = None) -> BuiltParts:
    """All parts of one depth.

    As many threads work at it as there are processors and as half of the memory that is free allows.
    """
    free, workers = memory.available() or math.inf, WORKERS
    while workers > 1 and build_bytes(optics, workers) > free / 2:
        workers -= 1
    builder = BlockBuilder(optics, progress or (lambda _: None), workers)
    found, means = builder.periodic()
    groups = [([place for place in inside(optics) if place.kind == k], found[k]) for k in range(len(found))]
    whole = (part for mine, blocks in groups for part in _parts(optics.cells, mine, blocks))
    ranks, border = builder.border()
    builder.forget()
    return BuiltParts(sum(map(_ranks, found)) + ranks, chain(whole, border), means)


def _ranks(blocks: Blocks) -> int:
    return sum(left.shape[1] for left, _ in blocks.values())


def _parts(cells: _cells.Cells, mine: Iterable[BorderClass], blocks: Blocks) -> Iterator[MatrixPart]:
    """Parts of places that have the same blocks: their factors are the same arrays."""
    lit = (key for key, (left, _) in blocks.items() if left.shape[1])
    order = sorted(lit, key=lambda key: (key[0], key[1] % cells.kinds, key[1]))
    left = np.concatenate([blocks[key][0].T for key in order], axis=0, dtype=np.float32).T
    right = np.concatenate([blocks[key][1] for key in order], axis=0)
    for place in mine:
        offsets = [(*cells.seen_from(place.parity, *key), blocks[key][0].shape[1]) for key in order]
        yield MatrixPart(place.rows, place.columns, tuple(offsets), left, right)


class BlockBuilder:
    """Blocks of one depth."""

    def __init__(self, optics: Optics, progress: Progress, workers: int) -> None:
        self.optics, self.axes, self.progress, self.workers = optics, optics.axes, progress, workers
        self.lenslets = lenslets_of(optics)
        axes, cells = self.axes, optics.margin(optics.reach)
        accuracy = optics.fineness.accuracy
        if not optics.straight:
            axes = windows(self.lenslets, accuracy)
            cells = [math.ceil(optics.lit / axis.size) for axis in axes]
        light = wave(optics.camera, optics.distance, axes, cells, optics.place)
        self.light = light.dimmed(optics.image_scale)
        self.apart = None
        if not optics.straight:
            self.apart = LensletLight(self.lenslets, self.light, optics.lit, accuracy)
        up, left = self.light.even
        self.even = up, left and symmetric(optics.array)
        y, x = self.axes
        self.square = y == x and bool(np.allclose(self.light.data, self.light.data.T))
        self.norm = self.least = 0.0
        self.chosen: dict[int, dict[Offset, ChosenPoints]] = {}

    def periodic(self) -> tuple[list[Blocks], list[Means]]:
        """Blocks inside the array, and the mean images (samples,) of a cell's points, for each kind."""
        found, kinds = [], self.optics.cells.kinds
        for kind in range(kinds):
            found.append(self._completed(*self._inside(BorderState(INFINITE, INFINITE, kind))))
            memory.give_back()
            self.progress(0.1 * (kind + 1) / kinds)
        blocks, means = zip(*found, strict=True)
        return list(blocks), list(means)

    def _inside(self, state: BorderState) -> tuple[dict[Offset, FoundFactors], Means, float]:
        """Factors of all offsets, more than needed, mean images, and the blocks' squared norm."""
        reach = self.optics.reach
        images, (up, left) = self.images([state], reach, folded=True)[state], self.even
        if not self.least:
            own = images.line(0)(0)
            self.least = 0.02 * self.optics.fineness.rank * float(np.linalg.norm(own))

        def piece(job: Job) -> tuple[float, dict[Offset, FoundFactors], Means]:
            (dy, across), found, means, norm = job, {}, {}, 0.0
            line = images.line(dy)
            for dx in across if left else self.signed(dy, across):
                block, copies = line(dx), 2 if up and dy else 1
                copies *= 2 if left and self.optics.cells.mirrored(dy, dx) != dx else 1
                norm += copies * float(np.linalg.norm(block)) ** 2
                found[dy, dx] = self._factored(block, copies)
                means[dy, dx] = block.mean(0, dtype=np.float64)
                if self.apart is not None:
                    self._choose(state.kind, (dy, dx), block)
            return norm, found, means

        norms, found, means = zip(*each(piece, self.jobs(up, reach), self.workers), strict=True)
        self.norm += sum(norms) / self.optics.cells.kinds
        return dict(ChainMap(*found)), dict(ChainMap(*means)), sum(norms)

    def _choose(self, kind: int, offset: Offset, block: np.ndarray) -> None:
        """Points for the border, of a cell and those that it mirrors."""
        coarse, fine = CHOSEN
        least = min(fine, coarse * (1e-2 / self.optics.fineness.accuracy) ** 0.52) * self.least
        found, (dy, dx), shape = chosen(block, least), offset, self.optics.cells.points
        for up in {False, self.even[0]}:
            for left in {False, self.even[1]}:
                side = self.optics.cells.mirrored(dy, dx) if left else dx
                known = self.chosen.setdefault(kind, {})
                known.setdefault((-dy if up else dy, side), found.turned(shape, up, left))

    def jobs(self, folded: bool, reach: tuple[int, int]) -> list[Job]:
        """Offsets that share work, those of dx and -dx together."""
        rows, across = self._columns(folded, reach[0]), tuple(range(reach[1] + 1))
        if self.optics.straight:
            return [(dy, (dx,)) for dy in rows for dx in across]
        return [(dy, across) for dy in rows]

    def signed(self, dy: int, across: Sequence[int]) -> list[int]:
        """Columns on both sides, `dy` rows away."""
        others = ((dx, self.optics.cells.mirrored(dy, dx)) for dx in across)
        return [*across, *(other for dx, other in others if other != dx)]

    def means_at_the_end(self) -> Means:
        """Mean images (samples,) of the points of the cells that are farthest, without any other block."""
        reach, found = self.optics.reach, {}
        images = self.images([INSIDE], reach)[INSIDE]
        for dy, across in self.jobs(self.even[0], reach):
            line = images.line(dy)
            for dx in across if self.even[1] else self.signed(dy, across):
                if abs(dy) == reach[0] or abs(dx) == reach[1]:
                    found[dy, dx] = line(dx).mean(0, dtype=np.float64)
        return self._unfolded_means(found)

    def _unfolded_means(self, means: Means) -> Means:
        none = np.zeros((math.prod(self.optics.cells.points), 1))
        blocks = {key: (none, mean[None]) for key, mean in means.items()}
        return {key: mean[0] for key, (_, mean) in self._unfolded(blocks, self.even).items()}

    def _completed(self, found: dict[Offset, FoundFactors], some: Means, norm: float) -> tuple[Blocks, Means]:
        """The factors that are strong enough, and the light of what is left out."""
        least = weakest(found.values(), self.optics.fineness.rank**2 * norm)
        even = np.ones((math.prod(self.optics.cells.points), 1), np.float32)
        blocks = self._unfolded({key: f.cut(least) for key, f in found.items()}, self.even)
        means = self._unfolded_means(some)
        for key, (left, right) in blocks.items():
            left_out = means[key] - left.mean(0, keepdims=True) @ right.astype(np.float32, copy=False)
            rest = narrowed(even, left_out, self.optics.precision)
            blocks[key] = np.hstack([left, rest[0]]), np.vstack([right, rest[1]])
        return blocks, means

    def border(self) -> tuple[int, Iterator[MatrixPart]]:
        """Ranks and parts of what differs where lenslets are missing, and of all in the ring."""
        sources = alike(places(self.optics), self.even, self.square)
        blocks = self._border_blocks([place for place, source, _ in sources if place is source])
        alike_to: dict[BorderClass, list[tuple[BorderClass, Turn]]] = {source: [] for source in blocks}
        for place, source, turn in sources:
            alike_to[source].append((place, turn))
        ranks = sum(len(mine) * _ranks(blocks[source]) for source, mine in alike_to.items())

        def parts() -> Iterator[MatrixPart]:
            for source, mine in alike_to.items():
                found = blocks.pop(source)  # let go as soon as all parts of it are taken
                if _ranks(found):
                    for place, turn in mine:
                        yield from _parts(self.optics.cells, [place], self._copied(found, *turn))

        return ranks, parts()

    def forget(self) -> None:
        """Release the arrays that only computing needs."""
        self.apart, self.chosen = None, {}
        memory.give_back()

    def _border_blocks(self, wanted: Sequence[BorderClass]) -> dict[BorderClass, Blocks]:
        """Blocks of some places: row after row of cells, so that what they share is computed once."""
        # A row of cells is a small part of the picture: its error may be larger.
        budget = (SHARE * self.optics.fineness.rank) ** 2 * self.norm
        result, pieces = {}, self._row_by_row if self.apart is None else self._kind_by_kind
        for place, blocks in pieces(wanted):
            least = weakest(blocks.values(), budget)
            cut = each(lambda found, least=least: found.cut(least), blocks.values(), self.workers)
            mine = dict(zip(blocks, cut, strict=True))
            result[place] = together(self._unfolded(mine, self._folds(place)))
        return result

    def _row_by_row(
        self, wanted: Sequence[BorderClass]
    ) -> Iterator[tuple[BorderClass, dict[Offset, FoundFactors]]]:
        found: dict[BorderClass, dict[Offset, FoundFactors]] = {place: {} for place in wanted}
        jobs, known = self.jobs(False, self.optics.near), self.images(states_of(wanted), self.optics.near)
        for done, part in enumerate(each(self._border_piece(wanted, known), jobs, self.workers)):
            for (place, offset), block in part.items():
                found[place][offset] = block
            self.progress(0.1 + 0.9 * (done + 1) / len(jobs))
        for place in wanted:
            yield place, found.pop(place)

    def _kind_by_kind(
        self, wanted: Sequence[BorderClass]
    ) -> Iterator[tuple[BorderClass, dict[Offset, FoundFactors]]]:
        jobs, kinds = self.jobs(False, self.optics.near), self.optics.cells.kinds
        near = [(dy, dx) for dy, across in jobs for dx in self.signed(dy, across)]
        for kind in range(kinds):
            mine = [place for place in wanted if place.kind == kind]
            if mine:
                chosen = {offset: self.chosen[kind][offset] for offset in near}
                report = within(self.progress, 0.1 + 0.9 * kind / kinds, 0.1 + 0.9 * (kind + 1) / kinds)
                yield from self._missing(mine, chosen, report)
                memory.give_back()

    def _missing(
        self, wanted: Sequence[BorderClass], chosen: dict[Offset, ChosenPoints], progress: Progress
    ) -> Iterator[tuple[BorderClass, dict[Offset, FoundFactors]]]:
        """Blocks of places of one kind: images of some offsets with all sets of missing lenslets."""
        assert self.apart is not None  # asked by the caller
        cells, lit = self.optics.cells, {key: points for key, points in chosen.items() if len(points.numbers)}
        missing = BorderCorrection(self.lenslets, self.apart, cells, lit, states_of(wanted), self.workers)
        found: dict[BorderClass, dict[Offset, FoundFactors]] = {place: {} for place in wanted}
        for done, offsets in enumerate(groups := list(missing.groups())):
            factors = missing.factors(offsets, missing.images(offsets), BORDER * self.least)

            def piece(job: tuple[BorderClass, Offset], of: Callable = factors) -> FoundFactors:
                return of(terms(job[0]), job[1]).narrowed(self.optics.precision)

            pairs = [(place, offset) for place in wanted for offset in offsets if self._own(place, offset)]
            for (place, offset), block in zip(pairs, each(piece, pairs, self.workers), strict=True):
                found[place][offset] = block
            progress((done + 1) / len(groups))
        for place in wanted:
            yield place, found.pop(place)

    def _own(self, place: BorderClass, offset: Offset) -> bool:
        """True if a place's block is not found in a mirror."""
        (up, left), (dy, dx) = self._folds(place), offset
        return not (up and dy < 0) and not (left and dx < self.optics.cells.mirrored(dy, dx))

    def _border_piece(
        self, wanted: Sequence[BorderClass], known: dict[BorderState, SquareLensletImages | PointSubset]
    ) -> Callable[[Job], dict[tuple[BorderClass, Offset], FoundFactors]]:
        def piece(job: Job) -> dict[tuple[BorderClass, Offset], FoundFactors]:
            (dy, across), found = job, {}
            shared = SharedBlocks(self.optics.cells, self.folded, known, dy)
            for dx in across:
                for place in wanted:
                    up, left = self._folds(place)
                    for mine in [] if up and dy < 0 else [dx] if left else self.signed(dy, (dx,)):
                        block = shared.total(terms(place), mine)
                        found[place, (dy, mine)] = self._factored(block, 1, BORDER)
                    shared.forget(lambda s: INFINITE not in s)  # those of corners serve once
                shared.forget_blocks()
            return found

        return piece

    def images(
        self, states: Iterable[BorderState], reach: tuple[int, int], *, folded: bool = False
    ) -> dict[BorderState, SquareLensletImages | PointSubset]:
        """Images of points of `reach` cells to all sides, or some if folded, with each state's lenslets."""
        states = list(states)
        if self.apart is not None:
            folds = self.even if folded else (False, False)
            return {state: self._few(self.apart, state, reach, folds) for state in states}
        behind: dict[Limits, IlluminatedCells] = {}

        def of(state: BorderState) -> SquareLensletImages:
            response = self.lenslets.response(
                self.optics.cells.middle(state.kind), (state.y, state.x), self.optics.place
            )
            if state.x not in behind:
                columns = self._columns(self.folded(1, state.x), reach[1])
                behind[state.x] = lit(self.light, response.across, self.axes[1], columns)
            return SquareLensletImages(behind[state.x], response.down, self.axes)

        return dict(zip(states, each(of, states, self.workers), strict=True))

    def _few(
        self, light: LensletLight, state: BorderState, reach: tuple[int, int], folds: tuple[bool, bool]
    ) -> PointSubset:
        # Any cell of the kind: only the border makes a difference.
        cells, margin = self.optics.cells, self.optics.margin(reach)
        rows = list(self.lenslets.rows(cells.middle(state.kind), (state.y, state.x)))
        y, x = (range(0 if fold else -m, m + 1) for m, fold in zip(margin, folds, strict=True))
        return few(light, rows, (y, x), self.workers, staggered=cells.staggered)

    def _columns(self, folded: bool, reach: int) -> range:
        return range(0 if folded else -reach, reach + 1)

    def folded(self, axis: int, limits: Limits) -> bool:
        """True if one side mirrors the other."""
        return self.even[axis] and flipped(limits) == limits

    def _folds(self, place: BorderClass) -> tuple[bool, bool]:
        return self.folded(0, place.y.limits), self.folded(1, place.x.limits)

    def _copied(self, blocks: Blocks, across: bool, up: bool, left: bool) -> Blocks:
        result = {}
        for (dy, dx), pair in blocks.items():
            (i, j), factor = ((dx, dy), self._crossed(pair)) if across else ((dy, dx), pair)
            side = self.optics.cells.mirrored(i, j) if left else j
            result[-i if up else i, side] = self._turned(factor, up, left)
        return result

    def _crossed(self, pair: Factors) -> Factors:
        points, samples = self.optics.cells.points, self.optics.cells.samples
        left = pair[0].reshape(*points, -1).transpose(1, 0, 2).reshape(pair[0].shape)
        return left, pair[1].reshape(-1, *samples).transpose(0, 2, 1).reshape(pair[1].shape)

    def _turned(self, pair: Factors, up: bool, left: bool) -> Factors:
        points, samples = self.optics.cells.points, self.optics.cells.samples
        return mirrored(pair[0], points, up, left), mirrored(pair[1].T, samples, up, left).T

    def _unfolded(self, blocks: Blocks, folds: tuple[bool, bool]) -> Blocks:
        result = dict(blocks)
        for (dy, dx), pair in blocks.items():
            for up in {False, folds[0]}:
                for left in {False, folds[1]}:
                    key = (-dy if up else dy, self.optics.cells.mirrored(dy, dx) if left else dx)
                    if key not in result:
                        result[key] = self._turned(pair, up, left)
        return result

    def _factored(self, block: np.ndarray, copies: int, coarser: float = 1.0) -> FoundFactors:
        left, right, strength = factors(block, coarser * self.least)
        return FoundFactors(left, right, strength, copies).narrowed(self.optics.precision)
