"""Resampling of views of lenslets in rows, square or hexagonal, to a square grid of any fineness."""

from dataclasses import dataclass

import numpy as np

from lumigraph.core.arrays import Array, like, namespace
from lumigraph.core.lattice import Lattice
from lumigraph.rendering.interpolate import Interpolation, neighbours, take


@dataclass(frozen=True, slots=True)
class Squared:
    """Places of the samples of views between the lenslets of a rectangle.

    Of a square lattice, `samples` per lenslet along both axes, the first on the first lenslet. Of a
    hexagonal lattice the rows stay as they are, √3/2 of a pitch apart, and each is sampled once along itself
    at that same distance: pixels are square, finer than the lenslets along s, and no light is mixed across
    rows. Samples finer than that are filled in along both axes.
    """

    t: np.ndarray  # rows of lenslets (n,)
    s: np.ndarray  # pitches along the rows, from the first lenslet of an even row (m,)
    odd: np.ndarray  # whether each row of lenslets stands half a pitch further along (rows,)

    @classmethod
    def of(cls, lattice: Lattice, indices: np.ndarray, samples: int, row_spacing: float) -> "Squared":
        """Samples for lenslets of index (rows, cols, 2), whose rows are `row_spacing` pitches apart."""
        rows, columns = indices.shape[:2]
        t = np.arange((rows - 1) * samples + 1) / samples
        if lattice.layout != "hex":
            return cls(t, np.arange((columns - 1) * samples + 1) / samples, np.zeros(rows, bool))
        step = row_spacing / samples
        count = int(np.floor((columns - 0.5) / step + 1e-9)) + 1
        return cls(t, np.arange(count) * step, indices[:, 0, 0] % 2 == 1)

    @property
    def is_plain(self) -> bool:
        """True if every sample stands on a lenslet."""
        on_lenslets = bool(np.all(self.t % 1 == 0) and np.all(self.s % 1 == 0))
        return on_lenslets and not self.odd.any() and len(self.t) == len(self.odd)

    def apply(self, data: Array, interpolation: Interpolation) -> Array:
        """Light field (v, u, t, s[, c]) of the lenslets, at the samples."""
        if self.is_plain:
            return data
        even, odd = np.flatnonzero(~self.odd), np.flatnonzero(self.odd)
        parts, xp = [], namespace(data)
        for rows, start in ((even, 0.0), (odd, 0.5)):
            if len(rows):
                parts.append(_resampled(take(data, rows, 2), 3, self.s - start, interpolation))
        order = np.argsort(np.concatenate([even, odd]))
        data = parts[0] if len(parts) == 1 else take(xp.concat(parts, axis=2), order, 2)
        return data if len(self.t) == len(self.odd) else _resampled(data, 2, self.t, interpolation)


def _resampled(data: Array, axis: int, places: np.ndarray, interpolation: Interpolation) -> Array:
    """Data at fractional indices along one axis; the edges are repeated."""
    shape, total = [1] * data.ndim, None
    shape[axis] = len(places)
    for index, weight in neighbours(places, data.shape[axis], interpolation):
        term = take(data, index, axis) * like(weight.reshape(shape), data)
        total = term if total is None else total + term
    return total
