"""What lenslets that are missing take from the images of a cell's points, where two axes are not apart.

Images are computed of those points from which all others follow (`few_points.Chosen`), from sums over the
rows of lenslets that exist.
"""

import math
from collections.abc import Callable, Iterator
from functools import cached_property

import numpy as np

from lumigraph.core.threads import each
from lumigraph.operators.cell_response import INFINITE, Lenslets, Limits
from lumigraph.operators.cells import Cells, Offset
from lumigraph.operators.factors import Found, strongest
from lumigraph.operators.few_points import AT_A_TIME, Chosen
from lumigraph.operators.lenslet_light import LensletLight
from lumigraph.operators.places import State
from lumigraph.operators.point_images import intensity


class Missing:
    """Images of the chosen points around a cell of one kind.

    Parameters
    ----------
    lenslets, light
        Of the array, and behind one of them.
    cells
        Of the array.
    chosen
        Points of the cell at each offset.
    kind
        Of the image's cell.
    workers
        Threads.
    """

    def __init__(
        self,
        lenslets: Lenslets,
        light: LensletLight,
        cells: Cells,
        chosen: dict[Offset, Chosen],
        kind: int,
        workers: int,
    ) -> None:
        self.lenslets, self.light, self.cells = lenslets, light, cells
        self.kind, self.workers = kind, workers
        self.chosen, self.slices, first = chosen, {}, 0
        for offset, points in chosen.items():
            self.slices[offset] = slice(first, first + len(points.numbers))
            first += len(points.numbers)
        self._rows: dict[Limits, tuple[list[float], np.ndarray]] = {}
        self._images: dict[State, np.ndarray] = {}

    @cached_property
    def numbers(self) -> np.ndarray:
        """Of all chosen points (n, 2), counted from the image's cell."""
        points, found = self.cells.points, [np.zeros((0, 2), int)]
        for (dy, dx), chosen in self.chosen.items():
            step = self.cells.shift(dy) * self.cells.step(points)
            y, x = np.divmod(chosen.numbers, points[1])
            found.append(np.stack([dy * points[0] + y, dx * points[1] + step + x], axis=1))
        return np.concatenate(found)

    @cached_property
    def bases(self) -> dict[Offset, tuple[np.ndarray, np.ndarray]]:
        """Weights of the chosen points as an orthonormal matrix (points, n) and a triangle (n, n)."""
        return {offset: np.linalg.qr(chosen.weights) for offset, chosen in self.chosen.items()}

    def total(self, signs: dict[State, int]) -> np.ndarray:
        """Sum of the states' images (n, samples), each times its sign."""
        (first, sign), *others = signs.items()
        total = sign * self._image(first)
        for state, sign in others:
            (np.add if sign > 0 else np.subtract)(total, self._image(state), out=total)
        self._images = {state: image for state, image in self._images.items() if INFINITE in state[:2]}
        return total

    def factors(self, signs: dict[State, int], least: float) -> Callable[[Offset], Found]:
        """Of the blocks of such a sum, by their offset."""
        total = self.total(signs)

        def found(offset: Offset) -> Found:
            rows, (basis, triangle) = total[self.slices[offset]], self.bases[offset]
            left, right, strength = strongest(triangle @ rows, least)
            mean = self.chosen[offset].weights.mean(0, dtype=np.float64) @ rows
            return Found(basis @ left, right, strength, 1, mean)

        return found

    def _image(self, state: State) -> np.ndarray:
        if state not in self._images:
            self._images = {s: image for s, image in self._images.items() if s.x in (INFINITE, state.x)}
            self._images[state] = self._computed(state)
        return self._images[state]

    def _computed(self, state: State) -> np.ndarray:
        places, stack = self._behind(state.x)
        here = {y for y, _ in self.lenslets.rows(self.cells.middle(state.kind), (state.y, state.x))}
        seen = [k for k, y in enumerate(places) if y in here]
        axes = self.light.axes
        image = np.zeros((len(self.numbers), axes[0].samples * axes[1].samples), np.float32)
        if not seen:
            return image
        down = np.hstack([self.light.carried(0, places[k]) for k in seen])

        def fill(mine: slice) -> None:
            rows = stack[mine, seen[0] : seen[-1] + 1]
            field = down @ rows.reshape(len(rows), down.shape[1], -1)
            intensity(field.reshape(len(rows), -1), image[mine])

        for _ in each(fill, self._some(), self.workers):
            pass
        return image

    def _behind(self, limits: Limits) -> tuple[list[float], np.ndarray]:
        """Rows of lenslets between limits along x, and the light behind them (n, row, modes, samples)."""
        if limits not in self._rows:
            self._rows = {key: kept for key, kept in self._rows.items() if key == INFINITE}
            rows = list(self.lenslets.rows(self.cells.middle(self.kind), (INFINITE, limits)))
            shape = len(self.numbers), len(rows), self.light.modes[0].shape[1], self.light.axes[1].samples
            stack = np.zeros(shape, np.complex64)

            def fill(mine: slice) -> None:
                for k, row in enumerate(rows):
                    if (seen := self.light.across(self.numbers[mine], row)) is not None:
                        stack[mine, k] = seen

            for _ in each(fill, self._some(), self.workers):
                pass
            self._rows[limits] = [y for y, _ in rows], stack
        return self._rows[limits]

    def _some(self) -> Iterator[slice]:
        """Points that are worked on at a time."""
        step = max(1, AT_A_TIME // math.prod(axis.samples for axis in self.light.axes))
        return (slice(k, k + step) for k in range(0, len(self.numbers), step))
