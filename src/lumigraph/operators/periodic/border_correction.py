"""Light of missing lenslets in the images of a cell's points, where two axes are not apart.

Images are computed of those points from which all others follow (`few_points.Chosen`). The lenslets that
exist lie between limits, so that their light is a difference of sums from one side: each lenslet is followed
once for all states of a cell, each row of them once for all that differ along y.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import TypeVar

import numpy as np

from lumigraph.core.threads import each
from lumigraph.operators.lenslets.cell_response import CellLenslets
from lumigraph.operators.lenslets.lenslet_light import LensletLight
from lumigraph.operators.lenslets.point_images import intensity
from lumigraph.operators.lenslets.point_subset import ChosenPoints
from lumigraph.operators.periodic.factors import FoundFactors, strongest
from lumigraph.operators.sampling.border_classes import BorderState
from lumigraph.operators.sampling.cell_axis import INFINITE, Limits
from lumigraph.operators.sampling.cells import Cells, Offset

AT_A_TIME = 64
"""Points that a thread works on."""

HELD = 2**27
"""Numbers of images that are held at a time, but for those of one offset."""

Images = Mapping[BorderState, np.ndarray]

_T = TypeVar("_T")


class BorderCorrection:
    """Images of the chosen points around a cell of one kind.

    Parameters
    ----------
    lenslets, light
        Of the array, and behind one of them.
    cells
        Of the array.
    chosen
        Points of the cell at each offset.
    states
        Lenslets that exist, around a cell of one kind.
    workers
        Threads.
    """

    def __init__(
        self,
        lenslets: CellLenslets,
        light: LensletLight,
        cells: Cells,
        chosen: Mapping[Offset, ChosenPoints],
        states: Iterable[BorderState],
        workers: int,
    ) -> None:
        self.light, self.cells, self.chosen, self.workers = light, cells, chosen, workers
        self.states = sorted(states)
        self.slack = 1e-9 * lenslets.array.lattice.pitch
        self.rows = list(lenslets.rows(cells.middle(self.states[0].kind), (INFINITE, INFINITE)))
        self.samples = math.prod(axis.samples for axis in light.axes)
        light.prepare(self.rows, workers)

    def groups(self) -> Iterator[list[Offset]]:
        """Offsets whose images are held at a time."""
        mine, held = [], 0
        for offset, points in self.chosen.items():
            size = len(points.numbers) * self.samples * len(self.states)
            if mine and held + size > HELD:
                yield mine
                mine, held = [], 0
            mine, held = [*mine, offset], held + size
        if mine:
            yield mine

    def images(self, offsets: Sequence[Offset]) -> dict[BorderState, np.ndarray]:
        """Images of the chosen points at some offsets, one after the other: (n, samples) for each state."""
        numbers = np.concatenate([self._numbers(offset) for offset in offsets])
        found = {state: np.empty((len(numbers), self.samples), np.float32) for state in self.states}

        def fill(mine: slice) -> None:
            stacks = self._stacks(numbers[mine])
            for x in {state.x for state in self.states}:
                states = [state for state in self.states if state.x == x]
                fields = self._fields(self._between(stacks, x), [state.y for state in states])
                for state in states:
                    intensity(self._between(fields, state.y), found[state][mine])

        some = (slice(k, k + AT_A_TIME) for k in range(0, len(numbers), AT_A_TIME))
        for _ in each(fill, some, self.workers):
            pass
        return found

    def _numbers(self, offset: Offset) -> np.ndarray:
        """Numbers (n, 2) of the chosen points at an offset, counted from the image's cell."""
        points, (dy, dx) = self.cells.points, offset
        step = self.cells.shift(dy) * self.cells.step(points)
        y, x = np.divmod(self.chosen[offset].numbers, points[1])
        return np.stack([dy * points[0] + y, dx * points[1] + step + x], axis=1)

    def _stacks(self, numbers: np.ndarray) -> dict[float, np.ndarray]:
        """Light (n, rows, modes, samples along x) behind the lenslets up to each cut along x."""
        n, m = len(numbers), self.light.modes[0].shape[1]
        cuts = self._cuts([state.x for state in self.states])
        shape = n, len(self.rows), m, self.light.axes[1].samples
        result = {cut: np.empty(shape, np.complex64) for cut in cuts}
        for k, (y, members) in enumerate(self.rows):
            total = np.zeros((n, *shape[2:]), np.complex64)
            for cut, some in _up_to(cuts, members, lambda member: member[0]):
                if some and (seen := self.light.across(numbers, (y, some))) is not None:
                    total += seen
                result[cut][:, k] = total
        return result

    def _fields(self, stack: np.ndarray, limits: Sequence[Limits]) -> dict[float, np.ndarray]:
        """Amplitudes (n, samples) of the rows up to each cut along y."""
        result, total = {}, np.zeros((len(stack), self.samples), np.complex64)
        numbers = range(len(self.rows))
        for cut, some in _up_to(self._cuts(limits), numbers, lambda k: self.rows[k][0]):
            if some:
                down = np.hstack([self.light.carried(0, self.rows[k][0]) for k in some])
                rows = stack[:, some[0] : some[-1] + 1].reshape(len(stack), down.shape[1], -1)
                total = total + (down @ rows).reshape(total.shape)
            result[cut] = total
        return result

    def _cuts(self, limits: Sequence[Limits]) -> list[float]:
        """Places where the lenslets between some limits begin and end, in order."""
        return sorted({cut for pair in limits for cut in self._ends(pair) if cut > -math.inf})

    def _ends(self, limits: Limits) -> Limits:
        return limits[0] - self.slack, limits[1] + self.slack

    def _between(self, sums: Mapping[float, np.ndarray], limits: Limits) -> np.ndarray:
        """Sum of the lenslets between limits; a copy."""
        low, high = self._ends(limits)
        return sums[high] - sums[low] if low in sums else sums[high].copy()

    def factors(
        self, offsets: Sequence[Offset], images: Images, least: float
    ) -> Callable[[dict[BorderState, int], Offset], FoundFactors]:
        """Factors of sums of some states' images, each times its sign, of the points at an offset."""
        ends = np.cumsum([len(self.chosen[offset].numbers) for offset in offsets])
        places = {
            offset: slice(end - len(self.chosen[offset].numbers), end)
            for offset, end in zip(offsets, ends.tolist(), strict=True)
        }
        # Weights of the chosen points as an orthonormal matrix (points, n) and a triangle (n, n).
        weights = [self.chosen[offset].weights for offset in offsets]
        bases = dict(zip(offsets, each(np.linalg.qr, weights, self.workers), strict=True))

        def found(signs: dict[BorderState, int], offset: Offset) -> FoundFactors:
            mine, (basis, triangle) = places[offset], bases[offset]
            (first, sign), *others = signs.items()
            rows = sign * images[first][mine]
            for state, sign in others:
                (np.add if sign > 0 else np.subtract)(rows, images[state][mine], out=rows)
            left, right, strength = strongest(rows, triangle, least)
            return FoundFactors(left, right, strength, 1, basis)

        return found


def _up_to(
    cuts: Sequence[float], members: Iterable[_T], place: Callable[[_T], float]
) -> Iterator[tuple[float, list[_T]]]:
    """Each cut, and the members beyond the one before."""
    rest = sorted(members, key=place)
    for cut in cuts:
        count = sum(place(member) <= cut for member in rest)
        yield cut, rest[:count]
        rest = rest[count:]
