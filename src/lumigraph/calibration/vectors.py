"""Two lattice vectors and the layout that they form: `Vectors`."""

import math
from typing import NamedTuple

import numpy as np

from lumigraph.core.lattice import Layout

_RATIO, _ANGLES = 1.25, (52.0, 75.0)  # of neighbours: lengths, and what is hexagonal
_OBLONG, _RIGHT = 3.4, 84.0  # lengths of neighbours of a rectangular lattice, and their angle [degrees]
_SHEAR = 0.05  # cosine, by which a regular lattice may lean
UNEQUAL = 1.03
"""Lengths of neighbours from which a lattice is called rectangular, not square."""


class Vectors(NamedTuple):
    """Reduced lattice vectors (y, x) [px], row vector first, and the layout they form."""

    row: np.ndarray
    column: np.ndarray
    layout: Layout
    kinds: int = 1

    @classmethod
    def of(cls, first: np.ndarray, second: np.ndarray, longest: float = math.inf) -> "Vectors | None":
        """Row and column vector where the basis is that of a square or hexagonal lattice."""
        a, b = math.hypot(*first), math.hypot(*second)
        angle = math.degrees(math.acos(min(1.0, abs(float(first @ second)) / (a * b))))
        if b > _RATIO * a or b > longest or angle < _ANGLES[0]:
            return None
        layout: Layout = "hex" if angle < _ANGLES[1] else "square"
        return cls(*oriented(first, second, layout), layout)

    @classmethod
    def rectangular(
        cls, first: np.ndarray, second: np.ndarray, longest: float = math.inf
    ) -> "Vectors | None":
        """Row and column vector where the basis is that of a rectangular lattice."""
        a, b = sorted((math.hypot(*first), math.hypot(*second)))
        if not UNEQUAL < b / a < _OBLONG or b > longest:
            return None
        if math.degrees(math.acos(min(1.0, abs(float(first @ second)) / (a * b)))) < _RIGHT:
            return None
        return cls(*oriented(first, second, "rectangular"), "rectangular")

    @classmethod
    def any_of(cls, first: np.ndarray, second: np.ndarray) -> "Vectors | None":
        """Row and column vector of a reduced basis of any layout."""
        return cls.rectangular(first, second) or cls.of(first, second)

    @property
    def pitch(self) -> float:
        """Mean length [px]."""
        return (math.hypot(*self.row) + math.hypot(*self.column)) / 2

    @property
    def is_regular(self) -> bool:
        """True if lengths and angle are those of a square or hexagonal lattice, but for a few per cent."""
        first, second = math.hypot(*self.row), math.hypot(*self.column)
        wanted = 0.5 if self.layout == "hex" else 0.0
        cosine = float(self.row @ self.column) / (first * second)
        return max(first, second) < UNEQUAL * min(first, second) and abs(cosine - wanted) < _SHEAR

    @property
    def area(self) -> float:
        """Area of a cell [px²]."""
        return abs(float(self.row[0] * self.column[1] - self.row[1] * self.column[0]))

    def same(self, other: "Vectors", slack: float) -> bool:
        """True if two bases span one lattice, to a part of a pitch."""
        matrix = np.stack([other.row, other.column], -1)
        steps = np.linalg.solve(matrix, np.stack([self.row, self.column], -1))
        whole = np.rint(steps)
        return bool(np.abs(steps - whole).max() < slack and abs(abs(np.linalg.det(whole)) - 1) < 1e-9)


def oriented(first: np.ndarray, second: np.ndarray, layout: Layout) -> tuple[np.ndarray, np.ndarray]:
    """Row vector nearest to +x, and the vector to the next row 90° or 60° further towards +y."""
    around = [first, second, -first, -second]
    if layout == "hex":
        third = first - second if first @ second > 0 else first + second
        around += [third, -third]
    angles = [math.atan2(y, x) for y, x in around]
    row = min(range(len(around)), key=lambda k: (round(abs(angles[k]), 6), -angles[k]))
    step = math.pi / 3 if layout == "hex" else math.pi / 2
    turns = [abs(math.remainder(angle - angles[row] - step, 2 * math.pi)) for angle in angles]
    return around[row], around[int(np.argmin(turns))]
