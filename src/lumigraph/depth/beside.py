"""The lenslets around places of a plenoptic 2.0 picture, the nearest first, and how they differ."""

from dataclasses import dataclass

import numpy as np

_MIDDLE = 0.15  # pitches: lenslets this near to a place stand on both of its sides
_UNKNOWN, _FEW = 0.8, 0.05  # part of the most that lenslets differ by where no two see a place, its weight
_BEYOND = 1.1  # of the reach, where nothing is seen
_COMPARED = 8  # nearest lenslets, one of which is the sharpest near a place

Pair = tuple[np.ndarray, np.ndarray]


@dataclass(frozen=True)
class Beside:
    """Lenslets around n places, k each by their distance, independent of the places' patches.

    Parameters
    ----------
    distance
        Of the lenslet from the place (k, n), in pitches.
    away
        From the lenslet to the place, along y and x (k, n), in pitches.
    center
        Of its micro-image on the sensor, along y and x (k, n) [px].
    kind
        Of the lenslet (k, n).
    sides
        1 for a lenslet that stands above, below, left, right of its place (4, k, n), or near it; else 0.
    """

    distance: np.ndarray
    away: Pair
    center: Pair
    kind: np.ndarray
    sides: np.ndarray

    @classmethod
    def of(cls, away: Pair, center: Pair, kind: np.ndarray, usable: np.ndarray, reach: float) -> "Beside":
        """Neighbours from lenslets (steps, n) in any order; places at `reach` and beyond do not see them."""
        distance = np.where(usable, np.hypot(*away), np.float32(_BEYOND * reach))
        count = int((distance < reach).sum(0).max(initial=0))
        order = np.argsort(distance, axis=0)[: max(count, 1)]
        distance, kind, *parts = (
            np.take_along_axis(part, order, 0) for part in (distance, kind, *away, *center)
        )
        sides = [side < np.float32(_MIDDLE) for part in parts[:2] for side in (part, -part)]
        return cls(
            distance, (parts[0], parts[1]), (parts[2], parts[3]), kind, np.stack(sides).astype(np.float32)
        )

    def within(self, reach: float) -> "Beside":
        """The lenslets that some place has within a reach [pitches], one at least."""
        count = max(1, int(np.searchsorted(self.distance.min(1), reach)))
        (ay, ax), (cy, cx) = self.away, self.center
        return Beside(
            self.distance[:count],
            (ay[:count], ax[:count]),
            (cy[:count], cx[:count]),
            self.kind[:count],
            self.sides[:, :count],
        )

    def disagreement(self, weight: np.ndarray, value: np.ndarray, most: float) -> np.ndarray:
        """Disagreement (n,) of lenslets of a weight and value (k, n) with the nearest sharp one; to 2 `most`.

        What stands before a place hides it from the lenslets on one side; so the better of the left and the
        right ones counts, and the better of the upper and the lower.
        """
        near = (weight[:_COMPARED] / (1 + self.distance[:_COMPARED])).argmax(0)[None]
        off = np.abs(value - np.take_along_axis(value, near, 0))
        np.put_along_axis(weight, near, 0, 0)
        off = np.minimum(off, np.float32(most), out=off)
        off *= weight
        total, weights = (np.einsum("akn,kn->an", self.sides, part) for part in (off, weight))
        means = (total + np.float32(_FEW * _UNKNOWN * most)) / (weights + np.float32(_FEW))
        return np.minimum(means[0], means[1]) + np.minimum(means[2], means[3])
