"""Lenslets that are displaced from the points of their lattice."""

from dataclasses import dataclass

import numpy as np

from lumigraph.core.short_repr import brief
from lumigraph.errors import CalibrationError


@dataclass(frozen=True, slots=True, eq=False)
class LatticeOffsets:
    """Offsets of the micro-images of some lenslets from a regular lattice.

    Parameters
    ----------
    indices
        Indices of the lenslets (k, 2), as (i, j).
    ways
        Offsets of their micro-images from the lattice (k, 2), as (y, x) [px].

    Raises
    ------
    CalibrationError
        Other shapes, or ways that are not finite.

    Examples
    --------
    >>> LatticeOffsets(np.array([[0, 1]]), np.array([[0.5, -0.25]])).of(np.array([[0, 0], [0, 1]])).tolist()
    [[0.0, 0.0], [0.5, -0.25]]
    """

    indices: np.ndarray
    ways: np.ndarray

    __repr__ = brief

    def __post_init__(self) -> None:
        if self.indices.shape != self.ways.shape or self.ways.shape[1:] != (2,):
            raise CalibrationError(
                f"lenslets aside have indices of shape {self.indices.shape} and ways of shape "
                f"{self.ways.shape}: both must be (k, 2), one row for each lenslet."
            )
        if not np.isfinite(self.ways).all():
            raise CalibrationError("ways of lenslets aside must be finite [px].")

    def of(self, indices: np.ndarray) -> np.ndarray:
        """Offsets (..., 2) of lenslets (..., 2); 0 for those that are not named."""
        found = np.zeros(np.shape(indices))
        for index, way in zip(self.indices, self.ways, strict=True):
            found[(indices == index).all(-1)] = way
        return found

    def transposed(self) -> "LatticeOffsets":
        """The same for a picture with y and x exchanged."""
        return LatticeOffsets(self.indices[:, ::-1], self.ways[:, ::-1])
