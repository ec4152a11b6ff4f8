"""Weights of an object's samples: the share of each that counts."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from lumigraph.core import arrays
from lumigraph.core.arrays import Array
from lumigraph.core.linear import Linear, Shape


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class SampleWeights(Linear):
    """Samples (y, x), each times how much of it is let through."""

    through: np.ndarray

    title: ClassVar[str] = "What is let through"

    @property
    def shape(self) -> tuple[Shape, Shape]:
        """Shape of the samples, twice."""
        return self.through.shape, self.through.shape

    def _forward(self, intensity: Array) -> Array:
        return intensity * arrays.held(self.through, intensity)

    def _adjoint(self, raw: Array) -> Array:
        return self._forward(raw)

    @property
    def memory_bytes(self) -> float:
        """Memory of the shares [bytes]."""
        return self.through.nbytes
