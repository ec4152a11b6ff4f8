"""Nodes of the field at which coefficients stand, and their prior."""

import math
from dataclasses import dataclass, replace

import numpy as np

from lumigraph.core.grid import Grid
from lumigraph.scene import Points

PRIOR = 1.0
"""Standard deviation that is expected of a coefficient [waves rms]."""

ALIKE = 0.3
"""Standard deviation that is expected, at first, of its difference between neighbouring nodes [waves rms]."""

LEAST = 1e-3
"""Least value of `alike` [waves rms]."""

LEARNT = 30
"""Steps to the expectation that explains a fit best."""


@dataclass(frozen=True, slots=True, eq=False)
class Nodes:
    """Nodes (rows, columns) in the middles of a field's regions; between them coefficients are linear.

    Parameters
    ----------
    y, x
        Places of the rows and columns [m].
    terms
        How many coefficients each has.
    alike
        Standard deviation that is expected of a coefficient's difference between neighbours [waves rms].
    """

    y: np.ndarray
    x: np.ndarray
    terms: int
    alike: float = ALIKE

    @classmethod
    def of(cls, grid: Grid, regions: tuple[int, int], terms: int) -> "Nodes":
        """Nodes of a field's samples, in so many regions along y and x."""
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
        """Information of the prior (nodes terms, nodes terms) [1/waves²]: small values, alike neighbours."""
        even = np.eye(len(self)) / PRIOR**2 / len(self)
        return np.kron(even + self._rough / self.alike**2, np.eye(self.terms))

    @property
    def _rough(self) -> np.ndarray:
        """Sum of squares (nodes, nodes) of differences between neighbours, as a form."""
        row, column = np.divmod(np.arange(len(self)), len(self.x))
        beside = np.abs(row[:, None] - row) + np.abs(column[:, None] - column) == 1
        return np.diag(beside.sum(1)) - beside

    def learnt(self, coefficients: np.ndarray, covariance: np.ndarray) -> "Nodes":
        """Nodes whose likeness makes a fit's coefficients (nodes, terms) the likeliest; at most `ALIKE`.

        From the fit's covariance, by MacKay's fixed point. Neighbours that are as far apart as noise alone
        puts them are drawn together.

        References
        ----------
        D. J. C. MacKay, Neural Comput. 4, 415 (1992), section 4.
        """
        rough = np.kron(self._rough, np.eye(self.terms))
        whole, found = np.linalg.inv(covariance), self
        seen, right = whole - self.information, whole @ coefficients.ravel()
        for _ in range(LEARNT):
            own = np.linalg.inv(seen + found.information)
            x = own @ right
            told = (len(self) - 1) * self.terms - float((own * rough).sum()) / found.alike**2
            alike = math.sqrt(float(x @ rough @ x) / max(told, 1e-9))
            found = replace(found, alike=min(max(alike, LEAST), ALIKE))
        return found


def _hats(at: np.ndarray, nodes: np.ndarray) -> np.ndarray:
    return np.stack([np.interp(at, nodes, one) for one in np.eye(len(nodes))], axis=1)
