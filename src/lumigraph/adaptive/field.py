"""Nodes of the field at which coefficients stand, and what is expected of them before anything is seen."""

from dataclasses import dataclass

import numpy as np

from lumigraph.core.grid import Grid
from lumigraph.scene import Points

PRIOR = 1.0
"""Standard deviation that is expected of a coefficient [waves rms]."""

ALIKE = 0.3
"""Standard deviation that is expected of its difference between neighbouring nodes [waves rms]."""


@dataclass(frozen=True, slots=True, eq=False)
class Nodes:
    """Nodes (rows, columns) in the middles of a field's regions; between them coefficients are linear.

    Parameters
    ----------
    y, x
        Places of the rows and columns [m].
    terms
        How many coefficients each has.
    """

    y: np.ndarray
    x: np.ndarray
    terms: int

    @classmethod
    def of(cls, grid: Grid, regions: tuple[int, int], terms: int) -> "Nodes":
        """Of a field's samples, in so many regions along y and x."""
        places = []
        for along, pitch, n in zip((grid.y, grid.x), grid.pitch, regions, strict=True):
            low, high = along[0] - pitch / 2, along[-1] + pitch / 2
            places.append(low + (np.arange(n) + 0.5) * (high - low) / n)
        return cls(places[0], places[1], terms)

    def __len__(self) -> int:
        return len(self.y) * len(self.x)

    def at(self, points: Points) -> np.ndarray:
        """Weights (points, nodes) of the nodes at some points; beyond the outermost it stays as there."""
        rows, columns = (
            _hats(points.positions[:, axis], nodes) for axis, nodes in enumerate((self.y, self.x))
        )
        return (rows[:, :, None] * columns[:, None, :]).reshape(len(rows), len(self))

    @property
    def information(self) -> np.ndarray:
        """Of the prior (nodes terms, nodes terms) [1/waves²]: values are small, neighbours alike."""
        row, column = np.divmod(np.arange(len(self)), len(self.x))
        beside = np.abs(row[:, None] - row) + np.abs(column[:, None] - column) == 1
        rough = np.diag(beside.sum(1)) - beside
        return np.kron(np.eye(len(self)) / PRIOR**2 / len(self) + rough / ALIKE**2, np.eye(self.terms))


def _hats(at: np.ndarray, nodes: np.ndarray) -> np.ndarray:
    return np.stack([np.interp(at, nodes, one) for one in np.eye(len(nodes))], axis=1)
