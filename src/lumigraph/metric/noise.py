r"""Noise of corners that many lenslets show: each place has its own, and all places of a corner share some.

What they share (blur, print, a board that is not flat) does not average out over lenslets. With variance σ²
of one place and τ² of what n places share, residuals r become independent, of variance 1, as

.. math:: (r - \bar r \, (1 - \sigma / \sqrt{\sigma^2 + n \tau^2})) / \sigma
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array

LEAST_NOISE = 1e-3
"""[px]; places that fit better are too good to be true."""


@dataclass(frozen=True, slots=True, eq=False)
class Noise:
    """Standard deviations along an axis [px].

    Parameters
    ----------
    own
        (kinds,) Of one place, for each kind of lenslet.
    shared
        Of all places of a corner on a picture together.
    """

    own: np.ndarray
    shared: float

    @classmethod
    def of(cls, residual: np.ndarray, sight: np.ndarray, kind: np.ndarray) -> "Noise":
        """Estimated from residuals (n, 2) [px], by the moments of corners with two places or more."""
        count, kinds = np.bincount(sight), int(kind.max()) + 1
        mean = _means(residual, sight)
        inner = np.mean((residual - mean[sight]) ** 2, axis=1)
        own = np.sqrt(np.maximum(_own(inner, sight, kind, kinds), LEAST_NOISE**2))
        expected = np.bincount(sight, own[kind] ** 2) / count**2
        many = count > 1
        shared = np.mean(mean[many] ** 2) - np.mean(expected[many]) if many.any() else 0.0
        return cls(own, float(np.sqrt(max(shared, 0.0))))

    def whitened(self, values: np.ndarray, sight: np.ndarray, kind: np.ndarray) -> np.ndarray:
        """Residuals or their derivatives (n, 2, ...), as independent ones of variance 1."""
        inverse = 1 / self.own[kind]
        scaled = values.reshape(len(values), -1) * inverse[:, None]
        together = csr_array((inverse, (sight, np.arange(len(sight)))))
        weight = together.power(2).sum(axis=1)
        # Along the vector 1/σ of a corner's places the variance is 1 + τ² Σ 1/σ², across it 1.
        less = (1 - 1 / np.sqrt(1 + self.shared**2 * weight)) / weight
        shared = together.T @ (less[:, None] * (together @ scaled))
        return (scaled - shared).reshape(values.shape)


def _own(inner: np.ndarray, sight: np.ndarray, kind: np.ndarray, kinds: int) -> np.ndarray:
    """(kinds,) Variances, of squared distances (n,) from the means of the n places of a corner.

    They are expected to be σ² (1 - 2/n) + Σ σ²/n² over the corner's places.
    """
    each = np.zeros((int(sight.max()) + 1, kinds))
    np.add.at(each, (sight, kind), 1)
    count = each.sum(1)[sight]
    several = count > 1
    table, found = np.zeros((kinds, kinds)), np.zeros(kinds)
    for k in range(kinds):
        mine = several & (kind == k)
        table[k] = (each[sight[mine]] / count[mine, None] ** 2).sum(0)
        table[k, k] += np.sum(1 - 2 / count[mine])
        found[k] = inner[mine].sum()
    return np.linalg.lstsq(table, found, rcond=None)[0]


def _means(values: np.ndarray, sight: np.ndarray) -> np.ndarray:
    """(sights, 2) of (n, 2)."""
    count = np.bincount(sight)
    return np.stack([np.bincount(sight, column) / count for column in values.T], axis=1)
