"""Misfit of an object to its raw image, in units of noise, and a warning where it is large."""

import warnings
from typing import NamedTuple

import numpy as np

from lumigraph.errors import SamplingWarning

SURE = 5.0
"""Standard deviations of noise above which a misfit is none of noise."""

SMALL = 0.05
"""Variances of noise by which residuals may exceed 1: models to 1e-2 leave as much in 600 electrons."""


class Misfit(NamedTuple):
    """Mean square of the pixels' residuals, in variances of noise.

    Parameters
    ----------
    pearson
        Mean of (r - m)²/m, electrons: 1 where only noise is left.
    deviation
        Its standard deviation by noise.
    """

    pearson: float
    deviation: float

    @classmethod
    def of(cls, weights: np.ndarray, gain: float, data: np.ndarray, shown: np.ndarray) -> "Misfit":
        """Misfit of data and a model (ny, nx), whose units count for weights (ny, nx) of electrons.

        (r - m)²/m of Poisson's noise has the variance 2 + 1/m.
        """
        counted = float(weights.sum())
        pearson = gain * float((weights * (data - shown) ** 2 / shown).sum()) / counted
        variance = float((weights**2 * (2 + 1 / (gain * shown))).sum())
        return cls(pearson, variance**0.5 / counted)

    @property
    def explained(self) -> bool:
        """True if noise, and errors of models of bright images, may leave as much."""
        return self.pearson <= 1 + max(SURE * self.deviation, SMALL)

    def warn(self, what: str, remedy: str) -> None:
        """Warn if the misfit is too large; `what` leaves it, and `remedy` says what helps."""
        if not self.explained:
            warnings.warn(
                f"{what} {self.pearson:.3g} times the variance of noise in the raw image, where noise leaves "
                f"1 ± {self.deviation:.2g}: it shows more than that. {remedy} Or the gain is wrong.",
                SamplingWarning,
                stacklevel=3,
            )
