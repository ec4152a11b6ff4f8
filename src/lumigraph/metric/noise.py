r"""Noise of corners that many lenslets show: an independent part, and one shared by all places of a corner.

With variance σ² of one place and τ² of what n places share, residuals r become independent, of variance 1, as

.. math:: (r - \bar r \, (1 - \sigma / \sqrt{\sigma^2 + n \tau^2})) / \sigma

σ² of each kind of lenslet changes with the magnification m = b/a as (m/m_0)^k: docs/theory/metric.md.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize
from scipy.sparse import csr_array

LEAST_NOISE = 1e-3
"""[px]; places that fit better are too good to be true."""

_TREND = 1.0
"""Power of m by which σ² may be expected to change."""


@dataclass(frozen=True, slots=True, eq=False)
class Noise:
    """Standard deviations along an axis [px].

    Parameters
    ----------
    own
        (kinds,) Of one place, for each kind of lenslet.
    shared
        Of all places of a corner on a picture together.
    sway
        Of how far a corner in views moves with the view [px/px]: samples of views pull corners towards them,
        and a corner passes slowly from one sample to the next.
    trend
        (kinds,) Power of the lenslets' magnification m by which σ² grows. None for not at all.
    seen
        Least, middle and greatest |m| that `own` and `trend` were found at.
    """

    own: np.ndarray
    shared: float
    sway: float = 0.0
    trend: np.ndarray | None = None
    seen: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def each(self, kind: np.ndarray, magnification: np.ndarray | None = None) -> np.ndarray:
        """(n,) Standard deviations of places behind lenslets of a kind (n,), at their magnification (n,)."""
        own = self.own[kind]
        if self.trend is None or magnification is None:
            return own
        low, middle, high = self.seen
        return own * (np.clip(np.abs(magnification), low, high) / middle) ** (self.trend[kind] / 2)

    def is_like(self, other: "Noise", part: float) -> bool:
        """True if variances differ by no more than a part of a place's own."""
        mine, others = (np.append(one.own, (one.shared, one.sway)) ** 2 for one in (self, other))
        scale = np.append(self.own, (self.own.min(), self.sway)) ** 2
        return bool((np.abs(mine - others) <= part * scale).all())

    @classmethod
    def of(
        cls, residual: np.ndarray, sight: np.ndarray, kind: np.ndarray, way: np.ndarray | None = None,
        magnification: np.ndarray | None = None,
    ) -> "Noise":  # fmt: skip
        """Estimated from residuals (n, 2) or (n, 2, k) [px], by moments of corners with two places or more.

        `way` (n, 2) [px], from centres to places, are given for corners in views; the lenslets'
        `magnification` (n,) for others, if noise may change with it. Of residuals (n, 2, k) squares are
        summed over k: the first are those left over, the others' outer products are the covariance of what
        an adjustment took out of the noise. Without them noise of few corners is taken for too small.
        """
        columns = residual.reshape(*residual.shape[:2], -1)
        count, kinds = np.bincount(sight), int(kind.max()) + 1
        mean, many, rest = _means(columns, sight), count > 1, 0.0
        trend, seen, part = None, (0.0, 0.0, 0.0), np.ones(len(kind))
        if way is None:
            inner = _square(columns - mean[sight])
            if magnification is not None:
                low, middle, high = np.quantile(np.abs(magnification), (0, 0.5, 1)).tolist()
                seen, away = (low, middle, high), np.log(np.abs(magnification) / middle)
                trend = _trend(inner, sight, kind, away)
                part = np.exp(trend[kind] * away)
            own = _own(inner, sight, kind, part)
        else:
            ways, spread = centred(way, sight)
            sway = sums(np.einsum("na,nak->nk", ways, columns), sight) / spread[:, None]
            inner = _square(columns - mean[sight] - sway[sight, None] * ways[..., None])
            # Slopes and means are taken out of the 2 n numbers of a corner.
            own = np.full(kinds, 2 * inner[many[sight]].sum() / max(np.sum(2 * count[many] - 3), 1))
            rest = np.mean((sway[many] ** 2).sum(1) - own[0] / spread[many]) if many.any() else 0.0
        own = np.sqrt(np.maximum(own, LEAST_NOISE**2))
        expected = np.bincount(sight, own[kind] ** 2 * part) / count**2
        shared = np.mean(_square(mean[many]) - expected[many]) if many.any() else 0.0
        return cls(own, float(np.sqrt(max(shared, 0.0))), float(np.sqrt(max(rest, 0.0))), trend, seen)

    def whitened(
        self, values: np.ndarray, sight: np.ndarray, own: np.ndarray, way: np.ndarray | None = None
    ) -> np.ndarray:
        """Residuals or their derivatives (n, 2, ...), as independent ones of variance 1.

        `own` (n,) is as `each` gives it, `way` as `of` takes it.
        """
        inverse = 1 / own
        scaled = values.reshape(len(values), -1) * inverse[:, None]
        together = csr_array((inverse, (sight, np.arange(len(sight)))))
        weight = together.power(2).sum(axis=1)
        # Along the vector 1/σ of a corner's places the variance is 1 + τ² Σ 1/σ², across it 1.
        less = (1 - 1 / np.sqrt(1 + self.shared**2 * weight)) / weight
        shared = together.T @ (less[:, None] * (together @ scaled))
        white = (scaled - shared).reshape(values.shape)
        if way is None or not self.sway:
            return white
        # Along a corner's ways from their middle, which what it shares does not touch.
        inner, spread = centred(way, sight)
        less = (1 - 1 / np.sqrt(1 + (self.sway / self.own[0]) ** 2 * spread)) / spread
        along = sums(np.einsum("na,na...->n...", inner, white), sight)
        taken = (less.reshape(-1, *[1] * (along.ndim - 1)) * along)[sight]
        return white - np.einsum("na,n...->na...", inner, taken)


def _own(inner: np.ndarray, sight: np.ndarray, kind: np.ndarray, part: np.ndarray) -> np.ndarray:
    """(kinds,) Variances, of squared distances (n,) from the means of the n places of a corner.

    They are expected to be σ² (1 - 2/n) + Σ σ²/n² over the corner's places; each σ² is that of its kind
    times `part` (n,).
    """
    kinds = int(kind.max()) + 1
    each = np.zeros((int(sight.max()) + 1, kinds))
    np.add.at(each, (sight, kind), part)
    count = np.bincount(sight)[sight]
    several = count > 1
    table, found = np.zeros((kinds, kinds)), np.zeros(kinds)
    for k in range(kinds):
        mine = several & (kind == k)
        table[k] = (each[sight[mine]] / count[mine, None] ** 2).sum(0)
        table[k, k] += np.sum(part[mine] * (1 - 2 / count[mine]))
        found[k] = inner[mine].sum()
    return np.linalg.lstsq(table, found, rcond=None)[0]


def _trend(inner: np.ndarray, sight: np.ndarray, kind: np.ndarray, away: np.ndarray) -> np.ndarray:
    """(kinds,) By how much the logarithm of variances grows with `away` (n,): the likeliest, near 0."""
    count, trends = np.bincount(sight)[sight], np.zeros(int(kind.max()) + 1)
    for k in range(len(trends)):
        mine = (kind == k) & (count > 1)
        if not mine.any():
            continue
        variance, at = np.maximum((inner * count)[mine] / (count[mine] - 1), LEAST_NOISE**2), away[mine]

        def unlikely(trend: np.ndarray, variance: np.ndarray = variance, at: np.ndarray = at) -> float:
            level = np.mean(variance * np.exp(-trend[0] * at))
            rest = len(at) * (np.log(level) + trend[0] * np.mean(at))
            return float(rest + (trend[0] / _TREND) ** 2 / 2)

        trends[k] = minimize(unlikely, np.zeros(1), bounds=[(-5 * _TREND, 5 * _TREND)]).x[0]
    return trends


def _square(values: np.ndarray) -> np.ndarray:
    """(n,) Mean over both axes of squares of (n, 2, k), summed over k."""
    return np.einsum("nak,nak->n", values, values) / 2


def sums(values: np.ndarray, sight: np.ndarray) -> np.ndarray:
    """Sums (sights, ...) of (n, ...)."""
    together = csr_array((np.ones(len(sight)), (sight, np.arange(len(sight)))))
    return (together @ values.reshape(len(values), -1)).reshape(-1, *values.shape[1:])


def centred(way: np.ndarray, sight: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Ways (n, 2) from the middle of their corner's, and the sums of their squares (sights,)."""
    inner = way - _means(way, sight)[sight]
    return inner, np.maximum(np.bincount(sight, np.sum(inner**2, axis=1)), 1e-9)


def _means(values: np.ndarray, sight: np.ndarray) -> np.ndarray:
    """(sights, ...) of (n, ...)."""
    return sums(values, sight) / np.bincount(sight).reshape(-1, *[1] * (values.ndim - 1))
