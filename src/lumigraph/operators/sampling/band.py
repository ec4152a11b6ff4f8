"""Band-limited samples along one axis: points brought onto them, and their integrals over pixels.

The image of a lens has no frequency above D/(λL). Samples `OVERSAMPLING` times closer than that asks for
leave room for a short kernel, a sinc in a Kaiser window, that is 1 up to there and 0 where the spectrum
repeats, to 1e-5. A point anywhere becomes that kernel's values on the samples around it; what stands between
the samples is the sum of their kernels, whose integrals over pixels are differences of one function.
"""

import math
from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.interpolate import CubicSpline, PPoly
from scipy.sparse import csr_array
from scipy.special import i0

OVERSAMPLING = 1.5
"""How much closer samples stand than the band asks for."""

HALF_WIDTH = 10
"""Of the kernel [samples]."""

KAISER_BETA = 10.5
"""Of its window: 104 dB."""


@dataclass(frozen=True, slots=True)
class Span:
    """Samples ``pitch * k`` [m] for k from `first`, `count` of them."""

    first: int
    count: int
    pitch: float

    @classmethod
    def around(cls, low: float, high: float, pitch: float) -> "Span":
        """All samples whose kernels reach between two places [m]."""
        first = math.floor(low / pitch) - HALF_WIDTH
        return cls(first, math.ceil(high / pitch) + HALF_WIDTH + 1 - first, pitch)

    @property
    def positions(self) -> np.ndarray:
        """Positions of the samples (count,) [m]."""
        return (self.first + np.arange(self.count)) * self.pitch

    @property
    def last(self) -> int:
        """Number of the last sample."""
        return self.first + self.count - 1


def placed(positions: np.ndarray, span: Span) -> csr_array:
    """Matrix (samples, points) of points as band-limited points: a sum of sinc functions, cut short.

    Parameters
    ----------
    positions
        (points,) [m], all of them between those that `span` was made around.
    """
    at = positions / span.pitch - span.first
    nearest = np.floor(at).astype(int)
    rows = nearest[:, None] + np.arange(1 - HALF_WIDTH, HALF_WIDTH + 1)
    values = kernel(at[:, None] - rows)
    columns = np.broadcast_to(np.arange(len(positions))[:, None], rows.shape)
    entries = (values.ravel(), (rows.ravel(), columns.ravel()))
    return csr_array(entries, shape=(span.count, len(positions)))


def kernel(offset: np.ndarray, half_width: float = HALF_WIDTH) -> np.ndarray:
    """Interpolation kernel at offsets [samples]: a sinc in a Kaiser window of a half width [samples]."""
    inside = np.clip(1 - (offset / half_width) ** 2, 0, None)
    window = np.where(np.abs(offset) <= half_width, i0(KAISER_BETA * np.sqrt(inside)) / i0(KAISER_BETA), 0)
    return np.sinc(offset) * window


def integral(offset: np.ndarray) -> np.ndarray:
    """Integral of the kernel from far below up to an offset [samples]."""
    return _antiderivative()(np.clip(offset, -HALF_WIDTH, HALF_WIDTH))


@cache
def _antiderivative() -> PPoly:
    places = np.linspace(-HALF_WIDTH, HALF_WIDTH, 200 * HALF_WIDTH + 1)
    return CubicSpline(places, kernel(places)).antiderivative()
