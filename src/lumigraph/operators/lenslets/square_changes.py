r"""How the matrices of square lenslets change from a camera to another close by, and the transpose.

A matrix is a sum over lenslets l and their nodes w, of light u there,

.. math:: M = \sum_l \sum_w g_w \, B_l(s, w) \, e^{i \varphi_l(s, w)} \, u_l(w)

with weights g. Seen in cells, nodes and light stay where they are, while phases φ and what is beside them, B,
change by what is smooth over a cell and a lenslet: by their values at few places of both. Where lenslets
become wider, the light at their edges comes in.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from lumigraph.operators.lenslets.cell_response import CellLenslets, LensletNodes, times_real
from lumigraph.operators.lenslets.exact_lenslets import between, interpolated
from lumigraph.operators.sampling.cell_axis import Box

FEWEST = 8
"""Places along a cell, and along a lenslet, that changes follow from at least."""

TAIL = 3e-3
"""Coefficient of the last polynomial that such places hold, of what matrices are at most.

Behind lenslets of f/10 changes by the wavelength are 4e-6 off with 5e-2, 1e-7 with 6e-4; of f/4, 2e-3 with
5e-2, 8e-7 with 4e-3.
"""


class CellNumbers(NamedTuple):
    """What the matrices of a cell follow from, as far as cameras close by differ by it.

    Parameters
    ----------
    phase
        (lenslets, places along the cell, places along a lenslet) [rad].
    beside
        (lenslets, terms, places along the cell, places along a lenslet), for nodes of the camera's own cell.
    half
        (1,), of a lenslet's side, in a cell as large as the camera's own [m].
    """

    phase: np.ndarray
    beside: np.ndarray
    half: np.ndarray


@dataclass(frozen=True, slots=True, eq=False)
class CellNeighbourhood:
    """A cell along an axis, and lenslets that send light to it.

    Parameters
    ----------
    lenslets, which
        What they do to light, and the axis.
    middles
        Of the lenslets, from the cell's centre [m].
    place, box
        As of `CellLenslets.along`.
    count
        Places along the cell and along each lenslet that changes follow from.
    """

    lenslets: CellLenslets
    which: int
    middles: np.ndarray
    place: float
    box: Box
    count: int = FEWEST

    def resolved(self) -> "CellNeighbourhood":
        """With as many places as tell what the matrices are."""
        to, beside = interpolated(self.count)[1], self.numbers(self).beside
        found = np.abs(to @ beside @ to.T)
        tail = max(found[..., -1, :].max(), found[..., -1].max())
        if tail <= TAIL * np.abs(beside).max() or self.count >= self.lenslets.axes[self.which].samples:
            return self
        return replace(self, count=self.count * 4 // 3).resolved()

    def numbers(self, like: "CellNeighbourhood") -> CellNumbers:
        """At places of the cell of another camera that hardly differs."""
        (nodes, _), size = interpolated(self.count), self.lenslets.axes[self.which].size
        larger, half = size / like.lenslets.axes[self.which].size, self.lenslets.half(self.which)
        off = larger * like.lenslets.half(self.which) * nodes
        places = size / 2 * nodes[:, None], larger * like.middles[:, None, None] + off, off
        phase, beside = self.lenslets.kernel(self.which, places, self.place, self.box)
        beside = np.broadcast_to(larger * beside, (len(beside), *phase.shape)).swapaxes(0, 1).astype(complex)
        return CellNumbers(phase, beside, np.array([half / larger]))

    def changed(self, by: CellNumbers, there: Iterable[int]) -> np.ndarray:
        """Change of a matrix (terms, samples, window) with numbers, of lenslets that are there."""
        found = 0.0
        for k in there:
            light, turn, beside = self._light(k)
            down, across = self._smooth
            phase, more = (down @ one[k] @ across.T for one in (by.phase, by.beside))
            one = (more + 1j * phase * beside) * (turn * light.weight)
            one[..., -2:] += by.half * light.edge * (beside * turn)[..., -2:]
            found = found + times_real(one, light.light)
        return times_real(np.asarray(found), self.lenslets.coefficients[self.which])

    def back(self, by: Mapping[int, np.ndarray]) -> CellNumbers:
        """Slopes by the numbers, of those (terms, samples, window) by what each lenslet brings."""
        found = CellNumbers(*map(np.zeros_like, self.numbers(self)))
        for k, slopes in by.items():
            light, turn, beside = self._light(k)
            down, across = self._smooth
            seen = times_real(slopes, self.lenslets.coefficients[self.which].T)
            seen = times_real(seen, light.light.T) * turn
            edges = np.real(seen[..., -2:] * beside[..., -2:]) @ light.edge
            seen *= light.weight
            found.beside[k] = down.T @ seen @ across
            found.phase[k] = down.T @ -np.imag((seen * beside).sum(0)) @ across
            found.half[0] += edges.sum()
        return found

    def _light(self, k: int) -> tuple[LensletNodes, np.ndarray, np.ndarray]:
        """At the nodes of a lenslet, what light turns by there, and B (terms, samples, nodes)."""
        axis, middle = self.lenslets.axes[self.which], float(self.middles[k])
        one = self.lenslets.on_nodes(self.which, middle)
        places = axis.image[:, None], middle + one.off, one.off
        phase, beside = self.lenslets.kernel(self.which, places, self.place, self.box)
        return one, np.exp(1j * phase), beside

    @property
    def _smooth(self) -> tuple[np.ndarray, np.ndarray]:
        """From numbers to the samples of the cell and to the nodes of a lenslet."""
        axis, one = self.lenslets.axes[self.which], self.lenslets.on_nodes(self.which, float(self.middles[0]))
        down = between(2 / axis.size * axis.image, self.count)
        return down, between(one.off / self.lenslets.half(self.which), self.count)
