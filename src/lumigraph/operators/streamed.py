"""Matrices that are too large to hold: block after block computed, applied and let go.

The blocks are those that `blocks` factors, all of each: there is nothing to keep, and nothing is left out.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from lumigraph.core.arrays import WORKERS
from lumigraph.core.progress import Progress
from lumigraph.core.progress import part as part_of
from lumigraph.core.threads import each
from lumigraph.operators.blocks import Builder, Job, Offset, Part
from lumigraph.operators.glare import Glare, glare
from lumigraph.operators.optics import Optics
from lumigraph.operators.places import INSIDE, State, Turn, alike, inside, places, terms
from lumigraph.operators.sizes import LEAST, glare_bytes

Cells = tuple[range, range]


@dataclass(frozen=True, slots=True)
class Use:
    """Cells that take the blocks of a state, mirrored and times a sign, of offsets up to `reach`."""

    cells: Cells
    turn: Turn
    sign: int
    reach: Offset


@dataclass(frozen=True, slots=True, eq=False)
class Streamed:
    """Matrix with parts that are computed on demand, as `kernels.Matrix`.

    Parameters
    ----------
    builder
        Of the blocks.
    glare, margin
        As of a `kernels.Matrix`.
    progress
        Told how many of the blocks have been computed, every time.
    """

    builder: Builder
    glare: tuple[Glare, ...]
    margin: Offset
    progress: Progress | None

    @property
    def nbytes(self) -> float:
        """Memory that it takes while it is applied [bytes]."""
        return stream_bytes(self.builder.optics)

    @property
    def parts(self) -> Iterator[Part]:
        """One for each block and the cells that it is of."""
        found = uses(self.builder)
        for k, (state, mine) in enumerate(found.items()):
            yield from self._parts(state, mine, part_of(self.progress, k, len(found)))

    def _parts(self, state: State, mine: Sequence[Use], progress: Progress) -> Iterator[Part]:
        builder, reach = self.builder, max(use.reach for use in mine)
        images = builder.images([state], reach)[state]
        folds = builder.folded(0, state.y), builder.folded(1, state.x)
        jobs = builder.jobs(folds[0], reach)

        def piece(job: Job) -> dict[Offset, np.ndarray]:
            (dy, across), line = job, images.line(job[0])
            return {(dy, dx): line(dx) for dx in (across if folds[1] else builder.signed(dy, across))}

        for done, blocks in enumerate(each(piece, jobs, WORKERS)):
            for offset, block in blocks.items():
                for use in mine:
                    yield from self._turned(block, offset, folds, use)
            progress((done + 1) / len(jobs))

    def _turned(
        self, block: np.ndarray, offset: Offset, folds: tuple[bool, bool], use: Use
    ) -> Iterator[Part]:
        """The block, and those that it mirrors, where they are used."""
        if any(abs(k) > r for k, r in zip(offset, use.reach, strict=True)):
            return
        per = self.builder.optics.cells
        cube = block.reshape(*per.points, *per.samples)
        for y in (1, -1) if folds[0] and offset[0] else (1,):
            for x in (1, -1) if folds[1] and offset[1] else (1,):
                (dy, dx), turned = (y * offset[0], x * offset[1]), cube[::y, ::x, ::y, ::x]
                across, up, left = use.turn
                if across:
                    (dy, dx), turned = (dx, dy), turned.transpose(1, 0, 3, 2)
                v, h = (-1 if up else 1), (-1 if left else 1)
                right = use.sign * turned[::v, ::h, ::v, ::h].reshape(block.shape)
                yield Part(*use.cells, ((v * dy, h * dx, len(block)),), None, right)


def streamed(optics: Optics, progress: Progress | None = None) -> Streamed:
    """Streamed matrix of one depth."""
    builder = Builder(optics, lambda _: None, WORKERS)
    means = builder.means_at_the_end()
    return Streamed(builder, (glare([means], optics.cells),), optics.reach, progress)


def uses(builder: Builder) -> dict[State, list[Use]]:
    """Uses of the blocks of each state; those that mirror others' are not among the states."""
    optics = builder.optics
    (everywhere,) = ((place.rows, place.columns) for place in inside(optics))
    result: dict[State, list[Use]] = {INSIDE: [Use(everywhere, (False, False, False), 1, optics.reach)]}
    for place, source, turn in alike(places(optics), builder.even, builder.square):
        for state, sign in terms(source).items():
            use = Use((place.rows, place.columns), turn, sign, optics.near)
            result.setdefault(state, []).append(use)
    return result


def stream_bytes(optics: Optics, workers: int = WORKERS) -> float:
    """Memory that `Streamed.parts` takes while they are applied one after the other [bytes]."""
    points, samples = math.prod(optics.cells.points), math.prod(optics.cells.samples)
    # Those computed ahead, the one that is applied, what it is turned to, and products with it.
    blocks = 4.0 * points * samples * (2 * workers + 3)
    return blocks + optics.images_bytes(optics.reach) + glare_bytes(optics) + LEAST
