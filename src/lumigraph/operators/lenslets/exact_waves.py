r"""Light that is a sum over directions: where a lens sends it.

With phases P of places along both axes [rad, by the cosine] and cosines d of directions,

.. math:: U = \sum_d S \, e^{i P \cdot d} \Big(1 + \frac{i}{2} P^T B P\Big)

has the amplitude S of a stop and bends B of its ways, which change little from place to place.
"""

from dataclasses import dataclass

import numpy as np

Both = tuple[np.ndarray, np.ndarray]
"""Along y and along x."""


@dataclass(frozen=True, slots=True, eq=False)
class DirectionSum:
    """Light of all directions together.

    Parameters
    ----------
    places, directions
        P [rad] and d along both axes.
    stop, bends
        S (y, x), and B's yy, yx and xx (3, y, x) [1/rad].
    turns
        Factors of both axes, (places y, directions y) and (directions x, places x).
    above
        Stop alone and times bends, along x: (4, directions y, places x).
    parts
        The same along both axes (4, y, x).
    """

    places: Both
    directions: Both
    stop: np.ndarray
    bends: np.ndarray
    turns: Both
    above: np.ndarray
    parts: np.ndarray

    @classmethod
    def of(cls, places: Both, directions: Both, stop: np.ndarray, bends: np.ndarray) -> "DirectionSum":
        """Light of all directions together, at places."""
        left = np.exp(1j * np.outer(places[0], directions[0]))
        right = np.exp(1j * np.outer(directions[1], places[1]))
        above = np.stack([one @ right for one in _each(stop, bends)])
        return cls(places, directions, stop, bends, (left, right), above, left @ above)

    @property
    def light(self) -> np.ndarray:
        """Amplitude (y, x) at the places."""
        return np.einsum("kyx, kyx -> yx", self._factors, self.parts)

    @property
    def _factors(self) -> np.ndarray:
        """Factors of the parts (4, y, x)."""
        y, x = self.places
        bends = np.broadcast_arrays(y[:, None] ** 2, 2 * np.outer(y, x), x**2)
        return np.stack([np.ones_like(bends[0]), *(0.5j * bend for bend in bends)])


def _each(stop: np.ndarray, bends: np.ndarray) -> list[np.ndarray]:
    """The stop alone, and times bends."""
    return [stop, *(stop * bend for bend in bends)]
