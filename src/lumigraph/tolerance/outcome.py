r"""`Outcome`: the effect of tolerances on one measure, to first order and by Monte Carlo.

With one standard deviation of error i either way the measure is y+ and y-, and without error y0:

.. math:: e_i = \frac{y_+ - y_-}{2}, \quad \sigma = \sqrt{\sum_i e_i^2}, \quad h_i = \frac{y_+ + y_-}{2} - y_0

Mean and deviation of random cameras have the statistical errors s/√n and √((m4 - s⁴)/n)/(2 s), with the
fourth central moment m4.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from lumigraph.core.brief import brief

PERCENTS = (2.5, 50.0, 97.5)
"""Percentiles that are reported."""

_SURE = 3.0  # statistical errors beyond which two deviations differ
_LINEAR = 0.1  # part by which they may differ where errors count as small


@dataclass(frozen=True, eq=False)
class Outcome:
    """Effect of tolerances on one measure.

    Parameters
    ----------
    name, unit
        Of the measure.
    nominal
        Of the camera as described.
    effects
        Change by one standard deviation of each tolerance, to first order.
    bends
        Change by one standard deviation of each, either way alike: what first order leaves out.
    sample
        Of the cameras drawn (n,), those that there can be.
    """

    name: str
    unit: str
    nominal: float
    effects: np.ndarray
    bends: np.ndarray
    sample: np.ndarray

    __repr__ = brief

    @property
    def first_order(self) -> float:
        """Standard deviation by the sum of the squared effects."""
        return float(np.sqrt(np.sum(self.effects**2)))

    @property
    def shares(self) -> np.ndarray:
        """Part of the variance that each tolerance makes, to first order; 0 where nothing changes."""
        total = float(np.sum(self.effects**2))
        return self.effects**2 / total if total else np.zeros(len(self.effects))

    @property
    def halved(self) -> np.ndarray:
        """Standard deviation if one tolerance were half as wide, for each, to first order."""
        return np.sqrt(np.maximum(np.sum(self.effects**2) - 0.75 * self.effects**2, 0))

    @property
    def mean(self) -> float:
        """Mean over the cameras drawn."""
        return float(np.mean(self.sample))

    @property
    def mean_error(self) -> float:
        """Standard error of the mean."""
        return self.deviation / math.sqrt(len(self.sample))

    @cached_property
    def deviation(self) -> float:
        """Standard deviation of the cameras drawn."""
        return float(np.std(self.sample, ddof=1))

    @property
    def deviation_error(self) -> float:
        """Standard error of the standard deviation."""
        fourth, square = float(np.mean((self.sample - self.mean) ** 4)), self.deviation**2
        if square == 0:
            return 0.0
        return math.sqrt(max(fourth - square**2, 0) / len(self.sample)) / (2 * self.deviation)

    def percentile(self, percent: float) -> tuple[float, tuple[float, float]]:
        """A percentile of the cameras drawn and its 95 % interval, by order statistics."""
        ordered, n, part = np.sort(self.sample), len(self.sample), percent / 100
        half = 1.96 * math.sqrt(n * part * (1 - part))
        low, high = (int(np.clip(round(n * part + side * half), 0, n - 1)) for side in (-1, 1))
        return float(np.percentile(ordered, percent)), (float(ordered[low]), float(ordered[high]))

    @property
    def is_linear(self) -> bool:
        """True if first order explains the deviation: to 10 % by second order, and by the cameras drawn.

        By these beyond three statistical errors; second order adds 2 h² to the variance of a normal error.
        """
        second = math.sqrt(self.first_order**2 + 2 * float(np.sum(self.bends**2)))
        slack = _LINEAR * self.deviation + _SURE * self.deviation_error
        by_chance = abs(self.first_order - self.deviation) <= slack
        return by_chance and second <= (1 + _LINEAR) * self.first_order

    @property
    def changes(self) -> bool:
        """True if any tolerance changes the measure by more than rounding."""
        least = 1e-9 * max(abs(self.nominal), abs(self.mean))
        return max(self.first_order, self.deviation) > least

    def ranked(self, names: Sequence[str]) -> list[tuple[str, float]]:
        """Names of tolerances with their shares, the largest first."""
        pairs = zip(names, self.shares.tolist(), strict=True)
        return sorted(pairs, key=lambda pair: -pair[1])
