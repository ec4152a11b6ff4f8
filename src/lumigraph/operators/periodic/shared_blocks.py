"""Blocks with the lenslets of some states, each computed once and held as long as others need it."""

from collections.abc import Callable, Mapping
from typing import Protocol

import numpy as np

from lumigraph.operators.lenslets.point_images import Line, mirrored
from lumigraph.operators.sampling.border_classes import BorderState
from lumigraph.operators.sampling.cell_axis import Limits
from lumigraph.operators.sampling.cells import Cells


class BlockImages(Protocol):
    """Of points, with the lenslets of one state."""

    def line(self, dy: int) -> Line:
        """Blocks of the cells of one row, by their column."""
        ...


class SharedBlocks:
    """Blocks of one row of cells.

    Parameters
    ----------
    cells
        Of the array.
    folded
        Whether what is on one side along an axis mirrors the other, between limits.
    known
        Images with the lenslets of each state.
    dy
        Rows from the image's cell.
    """

    def __init__(
        self,
        cells: Cells,
        folded: Callable[[int, Limits], bool],
        known: Mapping[BorderState, BlockImages],
        dy: int,
    ) -> None:
        self.cells, self.folded, self.known, self.dy = cells, folded, known, dy
        self.lines: dict[BorderState, Line] = {}
        self.blocks: dict[tuple[BorderState, int], np.ndarray] = {}

    def total(self, signs: dict[BorderState, int], dx: int) -> np.ndarray:
        """Sum of the states' blocks at `dx`, each times its sign."""
        (first, sign), *others = signs.items()
        total = sign * self._block(first, dx)
        for state, sign in others:
            (np.add if sign > 0 else np.subtract)(total, self._block(state, dx), out=total)
        return total

    def forget(self, unwanted: Callable[[BorderState], bool]) -> None:
        """Let go what some states left."""
        self.lines = {s: line for s, line in self.lines.items() if not unwanted(s)}
        self.blocks = {key: block for key, block in self.blocks.items() if not unwanted(key[0])}

    def forget_blocks(self) -> None:
        """Let go all blocks."""
        self.blocks = {}

    def _block(self, state: BorderState, dx: int) -> np.ndarray:
        if (state, dx) not in self.blocks:
            self.blocks[state, dx] = self._computed(state, dx)
        return self.blocks[state, dx]

    def _computed(self, state: BorderState, dx: int) -> np.ndarray:
        cells = self.cells
        other = cells.mirrored(self.dy, dx)
        if dx < other and self.folded(1, state.x):
            block = self._block(state, other)
            return mirrored(mirrored(block, cells.points, False, True).T, cells.samples, False, True).T
        if state not in self.lines:
            self.lines[state] = self.known[state].line(self.dy)
        return self.lines[state](dx)
