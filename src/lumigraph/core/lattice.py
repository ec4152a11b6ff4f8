"""Lattices: positions of lenslets in a simulation [m], or of micro-images on a sensor [px]."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from lumigraph.core import checks
from lumigraph.errors import GeometryError

Layout = Literal["square", "hex", "rectangular"]
LAYOUTS: tuple[Layout, ...] = ("square", "hex", "rectangular")
Vector = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Lattice:
    """Points ``origin + i * basis[1] + j * basis[0]`` for all whole numbers i and j.

    One object places the lenslets in a simulation and is estimated from a white image. ``basis[0]`` is
    the row vector, along +x up to the rotation; ``basis[1]`` leads to the next row. Real lattices have
    two slightly different pitches and some shear, which the two vectors hold.

    Parameters
    ----------
    basis
        Two vectors (y, x), [m], or [px] on an image.
    origin
        One lattice point (y, x), in the unit of the basis.
    layout
        "square", "hex" or "rectangular" (two pitches at right angles): which neighbours a point has.
    kinds
        1, or 3 for a hexagonal array whose neighbours never have the same focal length.

    Raises
    ------
    GeometryError
        Parallel basis vectors, an unknown layout, or kinds that the layout cannot have.

    Examples
    --------
    >>> lattice = Lattice.square(150e-6, rotation=0.01)
    >>> round(lattice.pitch * 1e6, 3), round(lattice.rotation, 6)
    (150.0, 0.01)
    """

    basis: tuple[Vector, Vector]
    origin: Vector = (0.0, 0.0)
    layout: Layout = "square"
    kinds: int = 1

    def __post_init__(self) -> None:
        if not isinstance(self.basis, Sequence | np.ndarray) or len(np.atleast_1d(self.basis)) != 2:
            raise GeometryError(f"basis is {self.basis!r} but must be two vectors (y, x).")
        basis = tuple(checks.pair(f"basis[{k}]", self.basis[k]) for k in range(2))
        object.__setattr__(self, "basis", basis)
        object.__setattr__(self, "origin", checks.pair("origin", self.origin))
        if not isinstance(self.layout, str) or self.layout not in LAYOUTS:
            raise GeometryError(f"layout is {self.layout!r} but must be 'square', 'hex' or 'rectangular'.")
        kinds = (1, 3) if self.layout == "hex" else (1,)
        if isinstance(self.kinds, bool) or not isinstance(self.kinds, int) or self.kinds not in kinds:
            raise GeometryError(f"kinds is {self.kinds!r} but must be 1, or 3 in a 'hex' layout.")
        if self.cell_area < 1e-6 * math.hypot(*basis[0]) * math.hypot(*basis[1]) or self.cell_area == 0:
            raise GeometryError(f"the basis vectors {basis[0]} and {basis[1]} are parallel: no lattice.")

    @classmethod
    def square(cls, pitch: float, rotation: float = 0.0, origin: Vector = (0.0, 0.0)) -> "Lattice":
        """Square lattice of one pitch, turned by `rotation` [rad] from +x towards +y."""
        pitch, rotation = checks.positive("pitch", pitch), checks.finite("rotation", rotation, "rad")
        sin, cos = math.sin(rotation), math.cos(rotation)
        return cls(((pitch * sin, pitch * cos), (pitch * cos, -pitch * sin)), origin)

    @classmethod
    def hex(
        cls, pitch: float, rotation: float = 0.0, origin: Vector = (0.0, 0.0), *, kinds: int = 1
    ) -> "Lattice":
        """Hexagonal lattice, rows along +x turned by `rotation` [rad], nearest neighbours `pitch` apart."""
        pitch, rotation = checks.positive("pitch", pitch), checks.finite("rotation", rotation, "rad")
        row, next_row = rotation, rotation + math.pi / 3
        basis = tuple((pitch * math.sin(angle), pitch * math.cos(angle)) for angle in (row, next_row))
        return cls((basis[0], basis[1]), origin, "hex", kinds)

    @classmethod
    def rectangular(
        cls, pitches: tuple[float, float], rotation: float = 0.0, origin: Vector = (0.0, 0.0)
    ) -> "Lattice":
        """Rectangular lattice: `pitches` to the next row and along it, rows turned by `rotation` [rad].

        Examples
        --------
        >>> Lattice.rectangular((14.0, 18.0)).pitches
        (14.0, 18.0)
        """
        down, along = checks.pair("pitches", pitches)
        for name, value in (("pitches (to the next row)", down), ("pitches (along rows)", along)):
            checks.positive(name, value)
        sin, cos = math.sin(rotation), math.cos(checks.finite("rotation", rotation, "rad"))
        return cls(((along * sin, along * cos), (down * cos, -down * sin)), origin, "rectangular")

    @property
    def matrix(self) -> np.ndarray:
        """Columns are the vectors of one step in i and in j: point = origin + matrix @ (i, j)."""
        return np.array([self.basis[1], self.basis[0]]).T

    @property
    def pitches(self) -> tuple[float, float]:
        """Distances to the next row's lenslet and to the next of the row: lengths of basis[1], basis[0]."""
        return math.hypot(*self.basis[1]), math.hypot(*self.basis[0])

    @property
    def pitch(self) -> float:
        """Mean length of the two basis vectors."""
        return sum(self.pitches) / 2

    @property
    def rotation(self) -> float:
        """Angle of the row vector from +x towards +y [rad]."""
        return math.atan2(*self.basis[0])

    @property
    def cell_area(self) -> float:
        """Area of one cell, the basis' unit squared."""
        (y0, x0), (y1, x1) = self.basis
        return abs(y1 * x0 - y0 * x1)

    def position(self, indices: np.ndarray) -> np.ndarray:
        """Lattice points (..., 2) as (y, x) of index pairs (..., 2) as (i, j)."""
        pairs = np.asarray(indices)
        points = np.empty(pairs.shape)
        for axis, (i, j) in enumerate(self.matrix):  # five times as fast as a product of matrices
            points[..., axis] = i * pairs[..., 0] + j * pairs[..., 1] + self.origin[axis]
        return points

    def index(self, y: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Index (i, j) of the lattice point nearest to each position; y and x broadcast.

        The four corners of the cell around a position are compared, which is exact for a reduced basis
        (vectors no more than 60 to 120 degrees apart).
        """
        inverse = np.linalg.inv(self.matrix)
        dy, dx = np.asarray(y) - self.origin[0], np.asarray(x) - self.origin[1]
        u, v = inverse[0, 0] * dy + inverse[0, 1] * dx, inverse[1, 0] * dy + inverse[1, 1] * dx
        i0, j0 = np.floor(u), np.floor(v)
        (y0, x0), (y1, x1) = self.basis
        best, best_i, best_j = None, i0, j0
        for di in (0, 1):
            for dj in (0, 1):
                fi, fj = u - i0 - di, v - j0 - dj
                distance = (fi * y1 + fj * y0) ** 2 + (fi * x1 + fj * x0) ** 2
                if best is None:
                    best = distance
                    continue
                closer = distance < best
                best = np.where(closer, distance, best)
                best_i, best_j = np.where(closer, i0 + di, best_i), np.where(closer, j0 + dj, best_j)
        return best_i.astype(np.int64), best_j.astype(np.int64)

    def offset(self, y: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Position (dy, dx) relative to the nearest lattice point; y and x broadcast."""
        i, j = self.index(y, x)
        (y0, x0), (y1, x1) = self.basis
        return y - (self.origin[0] + i * y1 + j * y0), x - (self.origin[1] + i * x1 + j * x0)

    def kind(self, i: np.ndarray, j: np.ndarray) -> np.ndarray:
        """Kind (0, or 0 to 2) of the lenslets of index (i, j); neighbours of one kind never touch."""
        return np.mod(np.asarray(j) - np.asarray(i), self.kinds)

    def indices(self, y_range: Vector, x_range: Vector) -> np.ndarray:
        """Index pairs (k, 2) as (i, j) of all lattice points inside the closed ranges, row by row."""
        corners = np.array([(y, x) for y in y_range for x in x_range]) - np.asarray(self.origin)
        cell = corners @ np.linalg.inv(self.matrix).T
        (i0, j0), (i1, j1) = np.floor(cell.min(0)).astype(int), np.ceil(cell.max(0)).astype(int)
        pairs = np.stack(np.meshgrid(np.arange(i0, i1 + 1), np.arange(j0, j1 + 1), indexing="ij"), -1)
        pairs = pairs.reshape(-1, 2)
        y, x = self.position(pairs).T
        slack = 1e-9 * self.pitch
        inside = (y >= y_range[0] - slack) & (y <= y_range[1] + slack)
        inside &= (x >= x_range[0] - slack) & (x <= x_range[1] + slack)
        return pairs[inside]

    def centers(self, y_range: Vector, x_range: Vector) -> np.ndarray:
        """Lattice points (k, 2) as (y, x) inside the closed ranges, row by row."""
        return self.position(self.indices(y_range, x_range))

    def scaled(self, factor: float) -> "Lattice":
        """The lattice magnified about (0, 0), such as metres to pixels; a factor below 0 turns it by 180°."""
        (y0, x0), (y1, x1) = self.basis
        size = abs(checks.finite("factor", factor, "1"))
        return replace(
            self,
            basis=((y0 * size, x0 * size), (y1 * size, x1 * size)),
            origin=(self.origin[0] * factor, self.origin[1] * factor),
        )

    def moved(self, dy: float, dx: float) -> "Lattice":
        """The lattice with its origin moved by (dy, dx)."""
        dy, dx = checks.finite("dy", dy), checks.finite("dx", dx)
        return replace(self, origin=(self.origin[0] + dy, self.origin[1] + dx))
