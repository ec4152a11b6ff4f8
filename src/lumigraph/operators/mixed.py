"""Operators of several wavelengths as one: images add up."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lumigraph.core.arrays import Array


@dataclass(frozen=True, slots=True, eq=False)
class Mixed:
    """Operator of a channel: those of several wavelengths, weighted and added up.

    Parameters
    ----------
    operators
        Of one shape, with ``forward`` and ``adjoint``.
    weights
        One for each.
    """

    operators: Sequence[Any]
    weights: Sequence[float]

    @property
    def shape(self) -> tuple[tuple[int, int], tuple[int, ...]]:
        """Of the raw image and of the object."""
        return self.operators[0].shape

    @property
    def object_grid(self) -> Any:
        """Samples of the object."""
        return self.operators[0].object_grid

    @property
    def depths(self) -> tuple[float, ...] | None:
        """Of the object's planes [m]; None for one plane."""
        return getattr(self.operators[0], "depths", None)

    def forward(self, intensity: Array, /) -> Array:
        """Raw image (ny, nx) of an object's intensity, the same at all wavelengths."""
        images = [w * a.forward(intensity) for w, a in zip(self.weights, self.operators, strict=True)]
        return sum(images[1:], images[0])

    def adjoint(self, raw: Array, /) -> Array:
        """Transpose of `forward`."""
        objects = [w * a.adjoint(raw) for w, a in zip(self.weights, self.operators, strict=True)]
        return sum(objects[1:], objects[0])

    def psf(self, index: tuple[int, ...], /) -> Array:
        """Raw image (ny, nx), float32, of one object sample of intensity 1."""
        point = np.zeros(self.shape[1], np.float32)
        point[index] = 1
        return self.forward(point)
