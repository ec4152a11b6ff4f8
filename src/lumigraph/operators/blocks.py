"""Matrices between the cells of a lenslet array, in factors.

Inside the array all cells have the same blocks. Near its border light is missing that lenslets beyond it
would have brought: from all cells of a row alike, from all of a column, and in the corners from both, which
is not the sum of the two where the missing lenslets are near. So

.. math:: B(a, b) = B + [B(a, ∞) - B] + [B(∞, b) - B] + [B(a, b) - B(a, ∞) - B(∞, b) + B]

for a cell at a from the border along y and b along x, and the last bracket is left out far from corners.
Cells of the ring around the array have only what is brought there.

Singular values are kept until the accuracy is reached; inside the array the light of what is left out is
given to all points of its cell alike, so that an even object stays exact. Blocks that mirror each other are
computed once.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain, product

import numpy as np

from lumigraph.core import memory
from lumigraph.core.arrays import WORKERS
from lumigraph.core.progress import Progress
from lumigraph.core.threads import each
from lumigraph.elements import LensletArray
from lumigraph.operators import cells as _cells
from lumigraph.operators.cell_response import INFINITE, Lenslets, Limits
from lumigraph.operators.optics import Optics
from lumigraph.operators.point_images import Apart, Few, Line, Lit, factors, few, lit, mirrored, wave

State = tuple[Limits, Limits]
"""Limits of the lenslets that exist, along y and along x."""

INSIDE: State = (INFINITE, INFINITE)
"""Far from all borders."""

Offset = tuple[int, int]

Factors = tuple[np.ndarray, np.ndarray]

Blocks = dict[Offset, Factors]

BORDER = 3.0
"""How much stronger than elsewhere factors are that are looked at in the border's blocks."""

Job = tuple[int, tuple[int, ...]]


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """Part of the matrix between an object's cells and an image's.

    Parameters
    ----------
    rows, columns
        Cells of the image, counted from the outermost ring around the array.
    offsets
        (dy, dx, rank): cells from the image's to the object's, row by row, and the factors' columns for it.
    left
        (points, R) with the ranks side by side; None for one offset whose block `right` is.
    right
        (R, samples).
    """

    rows: tuple[int, int]
    columns: tuple[int, int]
    offsets: tuple[tuple[int, int, int], ...]
    left: np.ndarray | None
    right: np.ndarray

    @property
    def factor(self) -> np.ndarray:
        """The left one, of a part in factors."""
        assert self.left is not None  # a single block
        return self.left


@dataclass(frozen=True, slots=True)
class Band:
    """Rows or columns of cells with the same lenslets around them.

    Parameters
    ----------
    cells
        The first and the one after the last, from the outermost ring around the array.
    limits
        Of the lenslets' centres, from a cell's centre [m]; infinite where the border is far.
    ring
        Whether it is of a ring.
    close
        Whether what is missing counts in corners too.
    """

    cells: tuple[int, int]
    limits: Limits
    ring: bool = False
    close: bool = False


def bands(optics: Optics, axis: int) -> list[Band]:
    """Along y (0) or x (1); the first is all of the array's cells, as if it had no border."""
    cells, extent = optics.cells, optics.array.extent
    size, n, pitch = cells.size[axis], cells.count[axis], optics.array.lattice.pitch
    first = cells.ring[axis]
    result = [Band((first, first + n), INFINITE)]
    if extent is None:
        return result
    fineness, fresnel = optics.fineness, _cells.fresnel_number(optics.camera)
    far, close = (
        size / 2 + border * pitch * (1 + 1e-9) + optics.spill
        for border in (fineness.border(fresnel), fineness.corner(fresnel))
    )
    for row in range(cells.image[axis]):
        middle = cells.edge[axis] + (row - first + 0.5) * size
        low, high = -extent[axis] / 2 - middle, extent[axis] / 2 - middle
        ring = not first <= row < first + n
        limits = _near(low, far), _near(high, far)
        if limits == INFINITE and not ring:
            continue
        result.append(Band((row, row + 1), limits, ring, ring or min(abs(low), abs(high)) < close))
    return result


def _near(border: float, far: float) -> float:
    """A border at a distance from a cell's centre; infinite where it is far."""
    return round(border, 12) if abs(border) < far else math.copysign(math.inf, border)


def _flipped(limits: Limits) -> Limits:
    return -limits[1], -limits[0]


Place = tuple[Band, Band]

Turn = tuple[bool, bool, bool]


def places(optics: Optics) -> list[Place]:
    """Where blocks are added: along the borders and, where both are close, in the corners."""
    along_y, along_x = bands(optics, 0), bands(optics, 1)
    edges = [(y, along_x[0]) for y in along_y[1:]] + [(along_y[0], x) for x in along_x[1:]]
    return edges + [(y, x) for y in along_y[1:] for x in along_x[1:] if y.close and x.close]


def terms(place: Place) -> dict[State, int]:
    """What is added at a place: a sum of blocks with the lenslets of a state."""
    y, x = place
    if INFINITE in (y.limits, x.limits):  # along a border
        inside = {} if y.ring or x.ring else {(INFINITE, INFINITE): -1}
        return {(y.limits, x.limits): 1, **inside}
    result = {(y.limits, x.limits): 1}
    if not x.ring:
        result[y.limits, INFINITE] = -1
    if not y.ring:
        result[INFINITE, x.limits] = -1
    if not (x.ring or y.ring):
        result[INFINITE, INFINITE] = 1
    return result


def build_bytes(optics: Optics, workers: int = 1) -> float:
    """Memory that building all parts takes [bytes], from their sizes and the usual number of factors."""
    cells, near = optics.cells, optics.near
    even = _symmetric(optics.array) and _cells.mirrored(optics.camera)
    square = even and cells.size[0] == cells.size[1]
    wanted = [place for place, source, _ in alike(places(optics), even, square) if place is source]
    states = {(INFINITE, INFINITE)} | {state for place in wanted for state in terms(place)}
    kept = 1 + sum(INFINITE in state for state in states)
    points, samples = math.prod(cells.points), math.prod(cells.samples)
    block = 4.0 * points * samples
    rows = workers * (2 * kept + 4) * block
    factors = (1.3 * len(wanted) + 0.7 * len(places(optics))) * math.sqrt(points)  # of a block
    factors /= optics.array.fill_factor  # small lenslets diffract more widely
    rows += factors * math.prod(2 * n + 1 for n in near) * 4.0 * (points + samples)
    images = {state[1] for state in states} if optics.straight else states
    return rows + len(images) * optics.images_bytes(near)


@dataclass(slots=True)
class _Found:
    """Factors of one block, more of them than needed at first."""

    left: np.ndarray
    right: np.ndarray
    strength: np.ndarray
    copies: int
    mean: np.ndarray

    def cut(self, least: float) -> Factors:
        kept = self.strength > least
        return self.left[:, kept], self.right[kept]


@dataclass(frozen=True, slots=True)
class Built:
    """All parts, the periodic one first.

    Parameters
    ----------
    ranks
        Columns of the factors of all parts together.
    parts
        One after the other: those that mirror another one are copies, made when they are asked for.
    means
        Mean images (samples,) of a cell's points at each offset.
    """

    ranks: int
    parts: Iterator[Part]
    means: dict[Offset, np.ndarray]


def build(optics: Optics, progress: Progress | None = None) -> Built:
    """All parts of one depth.

    As many threads work at it as there are processors and as half of the memory that is free allows.
    """
    free, workers = memory.available() or math.inf, WORKERS
    while workers > 1 and build_bytes(optics, workers) > free / 2:
        workers -= 1
    builder = Builder(optics, progress or (lambda _: None), workers)
    inside, means = builder.periodic()
    rows, columns = (band[0].cells for band in (bands(optics, 0), bands(optics, 1)))
    ranks, border = builder.border()
    return Built(_ranks(inside) + ranks, chain([_part(rows, columns, inside)], border), means)


def _ranks(blocks: Blocks) -> int:
    return sum(left.shape[1] for left, _ in blocks.values())


def _part(rows: tuple[int, int], columns: tuple[int, int], blocks: Blocks) -> Part:
    order = sorted(key for key, (left, _) in blocks.items() if left.shape[1])
    offsets = tuple((dy, dx, blocks[dy, dx][0].shape[1]) for dy, dx in order)
    left = np.concatenate([blocks[key][0].T for key in order], axis=0, dtype=np.float32).T
    right = np.concatenate([blocks[key][1] for key in order], axis=0, dtype=np.float32)
    return Part(rows, columns, offsets, left, right)


class Builder:
    """Blocks of one depth."""

    def __init__(self, optics: Optics, progress: Progress, workers: int) -> None:
        self.optics, self.axes, self.progress, self.workers = optics, optics.axes, progress, workers
        distance = _cells.telecentric_distance(optics.camera)
        self.lenslets = Lenslets(self.axes, optics.array, optics.camera.wavelength, distance)
        self.light = wave(optics.camera, optics.distance, self.axes, optics.reach).dimmed(optics.image_scale)
        self.even = self.light.even and _symmetric(optics.array)
        y, x = self.axes
        self.square = y == x and bool(np.allclose(self.light.data, self.light.data.T))
        self.norm = self.least = 0.0

    def periodic(self) -> tuple[Blocks, dict[Offset, np.ndarray]]:
        """Blocks inside the array, and the mean images (samples,) of a cell's points."""
        inside, reach = (INFINITE, INFINITE), self.optics.reach
        images = self.images([inside], reach)[inside]
        own = images.line(0)(0)
        self.least = 0.02 * self.optics.fineness.rank * float(np.linalg.norm(own))

        def piece(job: Job) -> tuple[float, dict[Offset, _Found]]:
            (dy, across), found, norm = job, {}, 0.0
            line = images.line(dy)
            for dx in across if self.even else signed(across):
                block, copies = line(dx), 2 ** ((dy != 0) + (dx != 0)) if self.even else 1
                norm += copies * float(np.linalg.norm(block)) ** 2
                found[dy, dx] = self._factored(block, copies)
            return norm, found

        pieces = list(each(piece, self.jobs(self.even, reach), self.workers))
        self.norm = sum(norm for norm, _ in pieces)
        found = {key: f for _, part in pieces for key, f in part.items()}
        self.progress(0.1)
        return self._completed(found)

    def jobs(self, folded: bool, reach: tuple[int, int]) -> list[Job]:
        """Offsets that share work, those of dx and -dx together."""
        rows, across = self._columns(folded, reach[0]), tuple(range(reach[1] + 1))
        if self.optics.straight:
            return [(dy, (dx,)) for dy in rows for dx in across]
        return [(dy, across) for dy in rows]

    def means_at_the_end(self) -> dict[Offset, np.ndarray]:
        """Mean images (samples,) of the points of the cells that are farthest, without any other block."""
        reach, found = self.optics.reach, {}
        images = self.images([INSIDE], reach)[INSIDE]
        for dy, across in self.jobs(self.even, reach):
            line = images.line(dy)
            for dx in across if self.even else signed(across):
                if abs(dy) == reach[0] or abs(dx) == reach[1]:
                    found[dy, dx] = line(dx).mean(0, dtype=np.float64)
        return self._unfolded_means(found)

    def _unfolded_means(self, means: dict[Offset, np.ndarray]) -> dict[Offset, np.ndarray]:
        none = np.zeros((math.prod(self.optics.cells.points), 1))
        blocks = {key: (none, mean[None]) for key, mean in means.items()}
        return {key: mean[0] for key, (_, mean) in self._unfolded(blocks, (self.even, self.even)).items()}

    def _completed(self, found: dict[Offset, _Found]) -> tuple[Blocks, dict[Offset, np.ndarray]]:
        least = _least(found.values(), self.optics.fineness.rank**2 * self.norm)
        folds = (self.even, self.even)
        result = self._unfolded({key: f.cut(least) for key, f in found.items()}, folds)
        means = self._unfolded_means({key: f.mean for key, f in found.items()})
        even = np.ones((math.prod(self.optics.cells.points), 1), np.float32)
        for key, (left, right) in result.items():
            left_out = means[key] - left.mean(0, keepdims=True) @ right
            result[key] = np.hstack([left, even]), np.vstack([right, left_out])
        return result, means

    def border(self) -> tuple[int, Iterator[Part]]:
        """Ranks and parts of what differs where lenslets are missing, and of all in the ring."""
        sources = alike(places(self.optics), self.even, self.square)
        blocks = self._border_blocks([place for place, source, _ in sources if place is source])
        lit = [found for found in sources if _ranks(blocks[found[1]])]

        def parts() -> Iterator[Part]:
            for (y, x), source, turn in lit:
                yield _part(y.cells, x.cells, self._copied(blocks[source], *turn))

        return sum(_ranks(blocks[source]) for _, source, _ in lit), parts()

    def _border_blocks(self, wanted: Sequence[Place]) -> dict[Place, Blocks]:
        """Of some places: row after row of cells, so that what they share is computed once."""
        reach = self.optics.near
        known = self.images({state for place in wanted for state in terms(place)}, reach)

        def piece(job: Job) -> dict[tuple[Place, Offset], _Found]:
            (dy, across), found = job, {}
            shared = _Shared(self, known, dy)
            for dx in across:
                for place in wanted:
                    up, left = self._folds(place)
                    for mine in [] if up and dy < 0 else [dx] if left else signed((dx,)):
                        block = shared.total(terms(place), mine)
                        found[place, (dy, mine)] = self._factored(block, 1, BORDER)
                    shared.forget(lambda s: INFINITE not in s)  # those of corners serve once
                shared.forget_blocks()
            return found

        found: dict[Place, dict[Offset, _Found]] = {place: {} for place in wanted}
        jobs = self.jobs(False, reach)
        for done, part in enumerate(each(piece, jobs, self.workers)):
            for (place, offset), block in part.items():
                found[place][offset] = block
            self.progress(0.1 + 0.9 * (done + 1) / len(jobs))
        # A row of cells is a small part of the picture: its error may be larger.
        budget = (2 * self.optics.fineness.rank) ** 2 * self.norm
        result = {}
        for place in wanted:
            blocks = found.pop(place)
            least = _least(blocks.values(), budget)
            cut = {key: f.cut(least) for key, f in blocks.items()}
            result[place] = self._unfolded(cut, self._folds(place))
        return result

    def images(self, states: Iterable[State], reach: tuple[int, int]) -> dict[State, Apart | Few]:
        """Of points of `reach` cells to all sides, with the lenslets of each state."""
        cells, light = self.optics.cells, self.light
        middle = [  # of any cell: only the border, as it is told, makes a difference
            e + (n // 2 + 0.5) * s for e, n, s in zip(cells.edge, cells.count, cells.size, strict=True)
        ]
        behind: dict[Limits, Lit] = {}

        def of(state: State) -> Apart | Few:
            response = self.lenslets.response((middle[0], middle[1]), state)
            if response.core is not None:
                return few(light, response, self.axes, reach)
            if state[1] not in behind:
                columns = self._columns(self.folded(state[1]), reach[1])
                behind[state[1]] = lit(light, response.across, self.axes[1], columns)
            return Apart(behind[state[1]], response.down, self.axes)

        states = list(states)
        return dict(zip(states, each(of, states, self.workers), strict=True))

    def _columns(self, folded: bool, reach: int) -> range:
        return range(0 if folded else -reach, reach + 1)

    def folded(self, limits: Limits) -> bool:
        """Whether what is on one side mirrors what is on the other."""
        return self.even and _flipped(limits) == limits

    def _folds(self, place: Place) -> tuple[bool, bool]:
        return self.folded(place[0].limits), self.folded(place[1].limits)

    def _copied(self, blocks: Blocks, across: bool, up: bool, left: bool) -> Blocks:
        result = {}
        for (dy, dx), pair in blocks.items():
            (i, j), factor = ((dx, dy), self._crossed(pair)) if across else ((dy, dx), pair)
            result[-i if up else i, -j if left else j] = self._turned(factor, up, left)
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
                    key = (-dy if up else dy, -dx if left else dx)
                    if key not in result:
                        result[key] = self._turned(pair, up, left)
        return result

    def _factored(self, block: np.ndarray, copies: int, coarser: float = 1.0) -> _Found:
        left, right, strength = factors(block, coarser * self.least)
        return _Found(left, right, strength, copies, block.mean(0, dtype=np.float64))


class _Shared:
    """Blocks of one row of cells with the lenslets of some states, each computed once."""

    def __init__(self, builder: Builder, known: dict[State, Apart | Few], dy: int) -> None:
        self.builder, self.known, self.dy = builder, known, dy
        self.lines: dict[State, Line] = {}
        self.blocks: dict[tuple[State, int], np.ndarray] = {}

    def total(self, signs: dict[State, int], dx: int) -> np.ndarray:
        """Sum of the states' blocks at `dx`, each times its sign."""
        (first, sign), *others = signs.items()
        total = sign * self._block(first, dx)
        for state, sign in others:
            (np.add if sign > 0 else np.subtract)(total, self._block(state, dx), out=total)
        return total

    def forget(self, unwanted: Callable[[State], bool]) -> None:
        """Let go what some states left."""
        self.lines = {s: line for s, line in self.lines.items() if not unwanted(s)}
        self.blocks = {key: block for key, block in self.blocks.items() if not unwanted(key[0])}

    def forget_blocks(self) -> None:
        """Let go all blocks."""
        self.blocks = {}

    def _block(self, state: State, dx: int) -> np.ndarray:
        if (state, dx) not in self.blocks:
            self.blocks[state, dx] = self._computed(state, dx)
        return self.blocks[state, dx]

    def _computed(self, state: State, dx: int) -> np.ndarray:
        if dx < 0 and self.builder.folded(state[1]):
            cells, block = self.builder.optics.cells, self._block(state, -dx)
            return mirrored(mirrored(block, cells.points, False, True).T, cells.samples, False, True).T
        if state not in self.lines:
            self.lines[state] = self.known[state].line(self.dy)
        return self.lines[state](dx)


def signed(across: Sequence[int]) -> list[int]:
    """Both signs of each number that is not 0."""
    return [*across, *(-dx for dx in across if dx)]


def alike(wanted: Sequence[Place], even: bool, square: bool) -> list[tuple[Place, Place, Turn]]:
    """Each place, the first that it mirrors, and how: across the diagonal, up and down, left and right."""
    both, first, result = (False, True) if even else (False,), {}, []
    for place in wanted:
        for turn in product(both if square else (False,), both, both):
            if (key := _turned_key(place, *turn)) in first:
                break
        else:
            turn = (False, False, False)
            first[key := _turned_key(place, *turn)] = place
        result.append((place, first[key], turn))
    return result


def _turned_key(place: Place, across: bool, up: bool, left: bool) -> tuple:
    """What the blocks of the mirrored place depend on."""
    y, x = (
        (_flipped(band.limits) if flip else band.limits, band.ring)
        for band, flip in zip(place, (up, left), strict=True)
    )
    return (x, y) if across else (y, x)


def _symmetric(array: LensletArray) -> bool:
    """Whether a lenslet's surroundings are the same in a mirror."""
    return array.lattice.kinds == 1 or isinstance(array.focal_length, float)


def _least(found: Iterable[_Found], budget: float) -> float:
    """The strength up to which all factors together stay within a squared norm."""
    strengths = np.concatenate([f.strength for f in found])
    copies = np.concatenate([np.full(len(f.strength), f.copies) for f in found])
    order = np.argsort(strengths)
    spent = np.cumsum(copies[order] * strengths[order] ** 2)
    k = int(np.searchsorted(spent, budget))
    return float(strengths[order[k - 1]]) if k else 0.0
