r"""Light that is a sum over directions, with derivatives: where a lens sends it, and the way back.

With phases P of places along both axes [rad, by the cosine] and cosines d of directions,

.. math:: U = \sum_d S \, e^{i P \cdot d} \Big(1 + \frac{i}{2} P^T B P\Big)

has the amplitude S of a stop and bends B of its ways, which change little from place to place.
"""

from dataclasses import dataclass

import numpy as np

Both = tuple[np.ndarray, np.ndarray]
"""Along y and along x."""

Moves = tuple[Both, Both, np.ndarray, np.ndarray]
"""Of places, directions, stop (y, x) and bends (3, y, x): changes, or slopes by them."""


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
        """Of all directions, at places."""
        left = np.exp(1j * np.outer(places[0], directions[0]))
        right = np.exp(1j * np.outer(directions[1], places[1]))
        above = np.stack([one @ right for one in _each(stop, bends)])
        return cls(places, directions, stop, bends, (left, right), above, left @ above)

    @property
    def light(self) -> np.ndarray:
        """Amplitude (y, x) at the places."""
        return np.einsum("kyx, kyx -> yx", self._factors, self.parts)

    def changed(self, by: Moves) -> np.ndarray:
        """How the light changes."""
        (down, across), directions, stop, bends = by
        y, x = self.places
        left, right = (
            1j * turn * (np.outer(p, own) + np.outer(at, d))
            for turn, p, own, at, d in zip(
                (self.turns[0], self.turns[1].T), (down, across), self.directions, self.places, directions,
                strict=True,
            )
        )  # fmt: skip
        above = [one @ right.T for one in _each(self.stop, self.bends)]
        above[0] += stop @ self.turns[1]
        for k, (bend, more) in enumerate(zip(self.bends, bends, strict=True), 1):
            above[k] += (bend * stop + more * self.stop) @ self.turns[1]
        parts = left @ self.above + self.turns[0] @ np.stack(above)
        found = np.einsum("kyx, kyx -> yx", self._factors, parts)
        found += 1j * (y * down)[:, None] * self.parts[1] + 1j * (x * across) * self.parts[3]
        return found + 1j * (np.outer(down, x) + np.outer(y, across)) * self.parts[2]

    def back(self, by: np.ndarray) -> Moves:
        """Slopes, of those by the light (y, x); what changes is the real part of their products, summed."""
        (y, x), (left, right), each = self.places, self.turns, by * self._factors
        bent = [np.real(1j * by * part) for part in self.parts[1:]]
        down = y * bent[0].sum(1) + bent[1] @ x
        across = y @ bent[1] + x * bent[2].sum(0)
        above = left.T @ each
        ways = (each @ self.above.transpose(0, 2, 1)).sum(0) * left
        beside, stop = np.zeros_like(right), np.zeros_like(self.stop)
        bends = np.empty((4, *stop.shape))
        for k, (one, bend) in enumerate(zip(above, (np.ones(()), *self.bends), strict=True)):
            mine = one @ right.T
            beside += (self.stop * bend).T @ one
            stop += mine * bend
            bends[k] = np.real(mine * self.stop)
        ways, beside = np.real(1j * ways), np.real(1j * beside * right)
        places = down + ways @ self.directions[0], across + self.directions[1] @ beside
        return places, (y @ ways, beside @ x), stop, bends[1:]

    @property
    def _factors(self) -> np.ndarray:
        """Of the parts (4, y, x)."""
        y, x = self.places
        bends = np.broadcast_arrays(y[:, None] ** 2, 2 * np.outer(y, x), x**2)
        return np.stack([np.ones_like(bends[0]), *(0.5j * bend for bend in bends)])


def _each(stop: np.ndarray, bends: np.ndarray) -> list[np.ndarray]:
    """The stop alone, and times bends."""
    return [stop, *(stop * bend for bend in bends)]
