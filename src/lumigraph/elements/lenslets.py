"""Lenslet arrays on any lattice."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np

from lumigraph.core import arrays, checks, coverage
from lumigraph.core.arrays import Array
from lumigraph.core.field import Field
from lumigraph.core.grid import Grid
from lumigraph.core.lattice import Lattice, Vector
from lumigraph.elements.form import along, matrices
from lumigraph.elements.lens import lens_phase
from lumigraph.elements.scatter import Scatter
from lumigraph.elements.transmission import Edge, check_edge, transmit, warn_if_coarse
from lumigraph.errors import GeometryError

Shape = Literal["square", "hex", "round"]

_BLOCK = 2**20
"""Samples worked on at a time: what lies between a lattice and its transmission is ten times larger."""


@dataclass(frozen=True, slots=True)
class LensletArray:
    r"""Thin lenslets at the points of a lattice, opaque between them.

    Each sample belongs to the nearest lattice point, at distance ρ, whose lenslet gives it the phase

    .. math:: t = \exp(-i \pi \rho^2 / (\lambda f_\mu))

    It is sampled well where dx ≤ λ f / size, otherwise a `SamplingWarning` gives the numbers.

    Parameters
    ----------
    lattice
        Where the lenslets stand [m].
    focal_length
        [m], one number, or three for a lattice of three kinds. A 0-d array such as a PyTorch scalar is
        differentiated through.
    shape
        "square" or "hex": the lattice's own cell, so that lenslets abut; "round". None takes the cell.
    fill_factor
        Size of a lenslet over the pitch, along a line: 1 leaves no gap (between round lenslets, the corners).
    extent
        (height, width) [m], turned with the lattice about the axis: lenslets whose centres lie outside it are
        missing, and opaque. None for an array as large as the field.
    edge
        "grey" (area fractions; exact along straight edges and circles) or "hard".
    stretch
        Factor of all distances of the lattice, about the axis: the pitch over the lattice's. As a 0-d array
        it is differentiated through, for lenslets that abut everywhere: the edges' own movement is not.
    scatter
        Differences of single lenslets; not together with what is differentiated through. Apertures that stand
        beside the lattice stay within their cells.

    Raises
    ------
    GeometryError
        A focal length of zero or of the wrong count, a cell of the other layout, a fill factor outside
        0 to 1, an extent or a stretch that is not above zero, or one to be differentiated where lenslets end;
        a lenslet that would reach beyond its cell.

    Examples
    --------
    >>> array = LensletArray(Lattice.square(150e-6), 5.2e-3, fill_factor=0.5)
    >>> grid = Grid.square(150, 5e-6)
    >>> round(float(np.mean(np.abs(array.transmission(grid, 633e-9)))), 6)
    0.25
    """

    lattice: Lattice
    focal_length: float | Array | tuple[float | Array, ...]
    shape: Shape | None = field(default=None, kw_only=True)
    fill_factor: float = field(default=1.0, kw_only=True)
    extent: tuple[float, float] | None = field(default=None, kw_only=True)
    edge: Edge = field(default="grey", kw_only=True)
    stretch: float | Array = field(default=1.0, kw_only=True)
    scatter: Scatter | None = field(default=None, kw_only=True)

    def __post_init__(self) -> None:
        checks.instance("lattice", self.lattice, Lattice)
        object.__setattr__(self, "focal_length", _focal_lengths(self.focal_length, self.lattice.kinds))
        shape = self.lattice.layout if self.shape is None else self.shape
        if not isinstance(shape, str) or shape not in (self.lattice.layout, "round"):
            raise GeometryError(
                f"shape is {shape!r} but lenslets on a {self.lattice.layout!r} lattice are "
                f"{self.lattice.layout!r} (its cell) or 'round'."
            )
        object.__setattr__(self, "shape", shape)
        if checks.positive("fill_factor", self.fill_factor, "1") > 1:
            raise GeometryError(f"fill_factor is {self.fill_factor:g} but lenslets overlap above 1.")
        if self.extent is not None:
            extent = checks.pair("extent", self.extent)
            for name, value in zip(("height", "width"), extent, strict=True):
                checks.positive(f"extent ({name})", value)
            object.__setattr__(self, "extent", extent)
        check_edge(self.edge)
        self._stretched()
        if self.scatter is not None and self._fixed() is not self:
            raise GeometryError(
                "lenslets that scatter are not differentiated through. Leave one of them out."
            )
        self._check_room()

    def _check_room(self) -> None:
        """Refuse apertures that reach beyond their cells, where they might overlap."""
        room = (1 - self.fill_factor) * self.lattice.pitch / 2
        for one in () if self.scatter is None else self.scatter.own:
            down, across = one.aside or (0.0, 0.0)
            far = max(abs(down), abs(across)) if self.shape == "square" else math.hypot(down, across)
            if far > room * (1 + 1e-9) + 1e-15:
                raise GeometryError(
                    f"lenslet {one.index} stands {far * 1e6:.6g} µm beside its place but has "
                    f"{room * 1e6:.6g} µm of room in its cell. Move it less, use a smaller fill_factor, or "
                    "move its vertex alone (decentre)."
                )

    def _stretched(self) -> None:
        """A plain stretch goes into the lattice; one to be differentiated stays."""
        stretch = checks.parameter("stretch", self.stretch, "1")
        checks.positive("stretch", arrays.number(stretch), "1")
        if not arrays.is_parameter(stretch):
            if stretch != 1:
                object.__setattr__(self, "lattice", self.lattice.scaled(stretch))
            object.__setattr__(self, "stretch", 1.0)
        elif not self._open_everywhere:
            raise GeometryError(
                "stretch is to be differentiated but the lenslets end, and their edges' movement has no "
                "derivative here. Use abutting lenslets: fill_factor 1, the lattice's cell, no extent."
            )

    def __call__(self, field: Field) -> Field:
        """The field just behind the lenslets."""
        checks.instance("field", field, Field)
        fixed = self._fixed()
        focal_length, size = min(map(abs, fixed._focal)), self.fill_factor * fixed.lattice.pitch
        warn_if_coarse("a lenslet", field.grid, field.wavelength, focal_length, (size / 2, size / 2))
        return transmit(self, field) if fixed is self else self._differentiable(fixed, field)

    def _fixed(self) -> "LensletArray":
        """The array with plain numbers; itself where it has no others."""
        if not any(map(arrays.is_parameter, (self.stretch, *self._focal))):
            return self
        focal_lengths = tuple(map(arrays.number, self._focal))
        return replace(self, focal_length=focal_lengths, stretch=arrays.number(self.stretch))

    def _differentiable(self, fixed: "LensletArray", field: Field) -> Field:
        """Field behind the lenslets as of `transmit`, differentiable in its phase -π|x - s c|²/(λ f).

        Derivatives exist by the focal lengths f and the stretch s of the centres c.
        """
        y, x, turn = field.grid.y[:, None], field.grid.x, -np.pi / field.wavelength
        factor = arrays.like(fixed.transmission(field.grid, field.wavelength), field.data)
        i, j = fixed.lattice.index(y, x)
        here = arrays.number(self.stretch)
        center_y, center_x = (c / here for c in fixed._position(i, j))
        squares = (y - here * center_y) ** 2 + (x - here * center_x) ** 2
        kind = self.lattice.kind(i, j) % len(self._focal)
        stretch = arrays.parameter(self.stretch) if arrays.is_parameter(self.stretch) else None
        for k, focal_length in enumerate(self._focal):
            own = turn * (kind == k)
            if arrays.is_parameter(focal_length):
                focal_length = arrays.parameter(focal_length)
                bend = 1 / focal_length - 1 / arrays.number(focal_length)
                factor = arrays.turned(factor, own * squares, bend)
            if stretch is not None:
                across, centers = y * center_y + x * center_x, center_y**2 + center_x**2
                factor = arrays.turned(factor, -2 * own * across, (stretch - here) / focal_length)
                factor = arrays.turned(factor, own * centers, (stretch**2 - here**2) / focal_length)
        return field * factor

    def transmission(self, grid: Grid, wavelength: float) -> np.ndarray:
        """Complex factor (ny, nx) of each sample."""
        if (fixed := self._fixed()) is not self:
            return fixed.transmission(grid, wavelength)
        if self._along_axes:
            return np.outer(*(self._along(grid, wavelength, axis) for axis in (0, 1)))
        result = np.empty(grid.shape, np.complex128)
        rows = max(1, _BLOCK // grid.shape[1])
        for first in range(0, grid.shape[0], rows):
            y = grid.y[first : first + rows, None]
            i, j = self.lattice.index(y, grid.x)
            center_y, center_x = self._position(i, j)
            dy, dx = y - center_y, grid.x - center_x
            focal_length = np.asarray(self._focal)[self.lattice.kind(i, j) % len(self._focal)]
            opening = self._opening(i, j, dy, dx, grid.pitch)
            if self.scatter is not None:
                factor, down, across, _ = self.scatter.of(i, j)
                focal_length, (down, across) = focal_length * factor, self._turned(down, across)
                dy, dx = dy - down, dx - across
            block = np.exp(-1j * np.pi * (dy**2 + dx**2) / (wavelength * focal_length))
            if self.scatter is not None and self.scatter.warps:
                block = block * np.exp(2j * np.pi / wavelength * self._warped(i, j, y, grid.x))
            result[first : first + rows] = block * opening
        return result

    def _turned(self, down: np.ndarray, across: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Ways (y, x) of those along columns and rows."""
        sin, cos = coverage.sides(self.lattice.rotation)
        return down * cos + across * sin, across * cos - down * sin

    def _warped(self, i: np.ndarray, j: np.ndarray, y: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Path [m] of each sample besides those of focus and vertex, in its lenslet (i, j)."""
        assert self.scatter is not None
        (y0, x0), (sin, cos) = self._position(i, j), coverage.sides(self.lattice.rotation)
        dy, dx = self._inside(i, j, y - y0, x - x0)
        down, across = dy * cos - dx * sin, dy * sin + dx * cos
        low = int(i.min()), int(j.min())
        all_i, all_j = np.ogrid[low[0] : int(i.max()) + 1, low[1] : int(j.max()) + 1]
        warp, here = self.scatter.warp(all_i, all_j), (i - low[0], j - low[1])
        total = warp.down[here] * down + warp.across[here] * across
        half = self.fill_factor * self.lattice.pitch / 2
        v, u, each = along(down / half), along(across / half), matrices(warp.terms)
        for m, n in zip(*np.nonzero(np.any(each, axis=(0, 1))), strict=True):
            total = total + each[..., m, n][here] * v[..., m] * u[..., n]
        return total

    @property
    def _focal(self) -> tuple[Any, ...]:
        return self.focal_length if isinstance(self.focal_length, tuple) else (self.focal_length,)

    @property
    def _along_axes(self) -> bool:
        """True if the transmission is a product of one factor along y and one along x."""
        straight = self.lattice.basis[0][0] == 0 == self.lattice.basis[1][1]
        return self.scatter is None and straight and self.shape == "square" and len(self._focal) == 1

    @property
    def _open_everywhere(self) -> bool:
        return self.extent is None and self._abutting and not (self.scatter and self.scatter.missing)

    @property
    def _abutting(self) -> bool:
        return self.fill_factor == 1 and self.shape != "round"

    def _along(self, grid: Grid, wavelength: float, axis: int) -> np.ndarray:
        """Factor along one axis of a square lattice that is not turned."""
        coordinates, origin = (grid.y, grid.x)[axis], self.lattice.origin[axis]
        step = abs(self.lattice.basis[1 - axis][axis])
        index = np.floor((coordinates - origin) / step + 0.5)
        offset = coordinates - origin - index * step
        phase = lens_phase(offset, self._focal[0], wavelength)
        if self._open_everywhere:
            return phase
        half, opening = self.fill_factor * step / 2, np.zeros(len(coordinates))
        for k in (-1, 0, 1):
            inside = offset - k * step
            if self.edge == "grey":
                part = coverage.interval(inside, grid.pitch[axis], -half, half)
            else:
                part = np.where((np.abs(inside) <= half * (1 + 1e-12)) & (k == 0), 1.0, 0.0)
            if self.extent is not None:
                part = part * (np.abs(origin + (index + k) * step) <= self.extent[axis] / 2 * (1 + 1e-9))
            opening += part
        return phase * np.minimum(opening, 1.0)

    def _position(self, i: np.ndarray, j: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        (y0, x0), (y1, x1) = self.lattice.basis
        return self.lattice.origin[0] + i * y1 + j * y0, self.lattice.origin[1] + i * x1 + j * x0

    def _exists(self, i: np.ndarray, j: np.ndarray) -> np.ndarray | float:
        present = 1.0 if self.scatter is None else self.scatter.of(i, j)[3] * 1.0
        if self.extent is None:
            return present
        y, x = self._position(i, j)
        sin, cos = coverage.sides(self.lattice.rotation)
        height, width = self.extent[0] / 2 * (1 + 1e-9), self.extent[1] / 2 * (1 + 1e-9)
        return present * ((np.abs(y * cos - x * sin) <= height) & (np.abs(y * sin + x * cos) <= width))

    def _inside(
        self, i: np.ndarray, j: np.ndarray, dy: np.ndarray, dx: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Ways (y, x) from lenslets' middles, of those from their places on the lattice."""
        if self.scatter is None or not self.scatter.moves:
            return dy, dx
        down, across = self._turned(*self.scatter.aside(i, j))
        return dy - down, dx - across

    def _opening(
        self, i: np.ndarray, j: np.ndarray, dy: np.ndarray, dx: np.ndarray, pitch: Vector
    ) -> np.ndarray | float:
        """Open fraction of each sample: its own lenslet's part, and on an edge its neighbours' too."""
        if self._open_everywhere:
            return 1.0
        own = self._covered(*self._inside(i, j, dy, dx), pitch)
        opening = own * self._exists(i, j)
        if self.edge == "hard":
            return opening
        edge = own < 1
        i, j, dy, dx = i[edge], j[edge], dy[edge], dx[edge]
        total, passed = own[edge], opening[edge]
        (y0, x0), (y1, x1) = self.lattice.basis
        for di, dj in ((-1, -1), (-1, 0), (-1, 1), (0, -1), (0, 1), (1, -1), (1, 0), (1, 1)):
            there, away = (i + di, j + dj), (dy - di * y1 - dj * y0, dx - di * x1 - dj * x0)
            part = self._covered(*self._inside(*there, *away), pitch)
            total, passed = total + part, passed + part * self._exists(*there)
        # Where cells abut, every sample is covered once: this corrects the approximation at their corners.
        opening[edge] = passed / total if self._abutting else np.minimum(passed, 1.0)
        return opening

    def _covered(self, dy: np.ndarray, dx: np.ndarray, pitch: Vector) -> np.ndarray:
        """Fraction of a sample at (dy, dx) from a lenslet's centre that this lenslet covers."""
        if self.shape == "round":
            radius = self.fill_factor * self.lattice.pitch / 2
            if self.edge == "grey":
                return coverage.disc(dy, dx, radius, pitch)
            return (dy**2 + dx**2 <= radius**2 * (1 + 1e-12)) * 1.0
        inside, touched = np.ones(np.shape(dy), bool), np.ones(np.shape(dy), bool)
        for (ny, nx), half in self._sides():
            distance = np.abs(dy * ny + dx * nx)
            margin = (abs(ny) * pitch[0] + abs(nx) * pitch[1]) / 2 if self.edge == "grey" else -1e-12 * half
            inside &= distance <= half - margin
            touched &= distance < half + margin
        covered = inside * 1.0
        if self.edge == "grey":
            rim = touched & ~inside
            covered[rim] = 1.0
            for (ny, nx), half in self._sides():
                covered[rim] *= coverage.strip(dy[rim] * ny + dx[rim] * nx, half, (ny, nx), pitch)
        return covered

    def _sides(self) -> list[tuple[Vector, float]]:
        """Normal and distance from the centre of each pair of opposite sides of a lenslet."""
        (y0, x0), (y1, x1) = self.lattice.basis
        neighbours = [(y0, x0), (y1, x1)]
        if self.lattice.layout == "hex":
            neighbours.append(min((y1 - y0, x1 - x0), (y1 + y0, x1 + x0), key=lambda v: math.hypot(*v)))
        lengths = [math.hypot(*v) for v in neighbours]
        return [
            ((vy / length, vx / length), self.fill_factor * length / 2)
            for (vy, vx), length in zip(neighbours, lengths, strict=True)
        ]


def _focal_lengths(value: Any, kinds: int) -> Any:
    listed = isinstance(value, Sequence) and not isinstance(value, str)
    several = listed or (isinstance(value, np.ndarray) and value.ndim)
    values = tuple(value) if several else (value,)
    if len(values) not in (1, kinds):
        raise GeometryError(
            f"{len(values)} focal lengths were given for a lattice of {kinds} kind{'s'[: kinds - 1]}. "
            "Give one, or one for each kind."
        )
    lengths = tuple(checks.parameter("focal_length", number) for number in values)
    if 0 in map(arrays.number, lengths):
        raise GeometryError("focal_length is 0 m. Give a length, negative for a diverging lenslet.")
    return lengths[0] if len(lengths) == 1 else lengths
