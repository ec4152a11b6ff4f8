"""Light that is known in the lenslet plane, through the lenslets to the image: cell by cell, nothing is kept.

For what has no use for the matrices of all points of a cell: single points wherever they are, planes of
coherent light, the pupil's own light. As in `cell_response`, each lenslet is a quadrature with exact borders,
and exactly those lenslets count that exist.
"""

import math
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from lumigraph.elements import form
from lumigraph.errors import GeometryError
from lumigraph.operators.cell_response import (
    INFINITE,
    MIDDLE,
    STEP,
    Axis,
    Box,
    Lenslets,
    Limits,
    focal_lengths,
    legendre,
    nodes,
)
from lumigraph.operators.exact import lenslets_of
from lumigraph.operators.optics import Optics

Pair = tuple[float, float]

Members = tuple[Pair, ...]

_STRONGEST = 0.2
"""Of the focal length, what no lenslet falls below that differs from the others: it sets quadratures."""


class Relay(Protocol):
    """From amplitudes in the lenslet plane to amplitudes on the image, for any block of its cells."""

    optics: Optics

    def places(self, rows: range, columns: range) -> tuple[np.ndarray, np.ndarray]:
        """Where amplitudes are needed along y and along x [m], without the phase exp(iπw²/(λL))."""
        ...

    def field(self, light: np.ndarray, rows: range, columns: range) -> np.ndarray:
        """Amplitude (y, x) on the samples of the cells, of light (y, x) at those places."""
        ...


def relay(optics: Optics) -> Relay:
    """Of a camera's lenslets, in the frame that turns with them."""
    if optics.array.scatter is not None:
        return Each(optics)
    return Straight(optics) if optics.straight else Lines(optics)


@dataclass(slots=True)
class _Cells:
    """Cells of the image along one axis, and the light around them."""

    optics: Optics
    which: int
    axis: Axis = field(init=False)

    def __post_init__(self) -> None:
        self.axis = self.optics.axes[self.which]  # once: how far light goes is asked of the main lens

    def center(self, cell: int) -> float:
        """Of a cell of the image [m]; 0 is the outermost of the ring."""
        cells = self.optics.cells
        return cells.edge[self.which] + (cell - cells.ring[self.which] + 0.5) * cells.size[self.which]

    def limits(self, cell: int) -> Limits:
        """Of the lenslets' centres from the cell's; infinite where light is not followed that far."""
        extent, axis = self.optics.array.extent, self.axis
        if extent is None:
            return INFINITE
        reach, middle = axis.size / 2 + axis.neighbourhood, self.center(cell)
        low, high = (round(side * extent[self.which] / 2 - middle, 12) for side in (-1, 1))
        return low if low > -reach else INFINITE[0], high if high < reach else INFINITE[1]

    def places(self, cells: range) -> np.ndarray:
        """Samples of light that hold the windows of all cells."""
        first, axis = self.axis.window, self.axis
        count = len(first) + (len(cells) - 1) * axis.points // STEP
        return self.center(cells[0]) + first[0] + np.arange(count) * (first[1] - first[0])

    def window(self, number: int) -> slice:
        """Of the cell of this number, among those samples."""
        start = number * self.axis.points // STEP
        return slice(start, start + len(self.axis.window))


@dataclass(slots=True)
class Straight:
    """Square lenslets, whose two axes are apart, or a sum of terms whose are."""

    optics: Optics
    _known: dict[tuple[int, Limits, float, Box], np.ndarray] = field(default_factory=dict)
    _lenslets: Lenslets = field(init=False)
    _sides: tuple[_Cells, _Cells] = field(init=False)

    def __post_init__(self) -> None:
        self._lenslets = lenslets_of(self.optics)
        self._sides = _Cells(self.optics, 0), _Cells(self.optics, 1)

    def places(self, rows: range, columns: range) -> tuple[np.ndarray, np.ndarray]:
        """As `Relay.places`."""
        return self._sides[0].places(rows), self._sides[1].places(columns)

    def field(self, light: np.ndarray, rows: range, columns: range) -> np.ndarray:
        """As `Relay.field`."""
        box = self._box(rows, columns) if self.optics.camera.model == "exact" else MIDDLE
        down = self.along(0, light[None], rows, box)
        return self.along(1, down.transpose(0, 2, 1), columns, box).sum(0).T

    def _box(self, rows: range, columns: range) -> Box:
        ends = [
            (mine.center(cells[0]), mine.center(cells[-1]))
            for mine, cells in zip(self._sides, (rows, columns), strict=True)
        ]
        (top, bottom), (left, right) = ends
        return ((top + bottom) / 2, (left + right) / 2), ((bottom - top) / 2, (right - left) / 2)

    def along(self, which: int, light: np.ndarray, cells: range, box: Box) -> np.ndarray:
        """Amplitudes (terms, samples, n) along one axis of light (1 or terms, places, n)."""
        mine = self._sides[which]
        parts = [self._matrix(which, cell, box) @ light[:, mine.window(k)] for k, cell in enumerate(cells)]
        return np.concatenate(parts, axis=1)

    def _matrix(self, which: int, cell: int, box: Box) -> np.ndarray:
        """Amplitudes (terms, samples, window) of one cell along one axis."""
        mine = self._sides[which]
        middle, limits = mine.center(cell), mine.limits(cell)
        key = which, limits, 0.0 if box is MIDDLE else middle, box
        if key not in self._known:
            found = self._lenslets.along(which, middle, limits, key[2], box)
            self._known[key] = found.astype(np.complex64)
        return self._known[key]


@dataclass(slots=True)
class Lines:
    """Lenslets of any shape: line after line across each row of them."""

    optics: Optics
    _known: dict[Members, np.ndarray] = field(default_factory=dict)
    _spreads: dict[float, np.ndarray] = field(default_factory=dict)
    _lenslets: Lenslets = field(init=False)

    def __post_init__(self) -> None:
        self._lenslets = lenslets_of(self.optics)

    def places(self, rows: range, columns: range) -> tuple[np.ndarray, np.ndarray]:
        """As `Relay.places`: along y, the lines of all rows of lenslets."""
        lines = self._lenslets.lines[0]
        return (self._rows(rows)[:, None] + lines).ravel(), _Cells(self.optics, 1).places(columns)

    def field(self, light: np.ndarray, rows: range, columns: range) -> np.ndarray:
        """As `Relay.field`."""
        (y, x), all_rows = self.optics.axes, self._rows(rows)
        light = light.reshape(len(all_rows), -1, light.shape[1])
        result = np.zeros((len(rows), y.samples, len(columns), x.samples), np.complex64)
        for k, column in enumerate(columns):
            around = [self._around(row, column, all_rows) for row in rows]
            behind = self._behind(light[:, :, _Cells(self.optics, 1).window(k)], around)
            for j, seen in enumerate(around):
                for number, (place, _) in seen.items():
                    result[j, :, k] += self._spread(place) @ behind[number]
        return result.reshape(len(rows) * y.samples, -1)

    def _rows(self, cells: range) -> np.ndarray:
        """Places of the rows of lenslets that the cells see [m]."""
        mine, lattice, axis = _Cells(self.optics, 0), self.optics.array.lattice, self.optics.axes[0]
        reach, step = axis.size / 2 + axis.neighbourhood, lattice.basis[1][0]
        low, high = mine.center(cells[0]) - reach, mine.center(cells[-1]) + reach
        first = math.ceil((low - lattice.origin[0]) / step - 1e-6)
        last = math.floor((high - lattice.origin[0]) / step + 1e-6)
        return lattice.origin[0] + np.arange(first, last + 1) * step

    def _around(self, row: int, column: int, all_rows: np.ndarray) -> dict[int, tuple[float, Members]]:
        """Rows of lenslets around a cell: number, place along y from the cell's centre, and members."""
        y, x = _Cells(self.optics, 0), _Cells(self.optics, 1)
        center, limits = (y.center(row), x.center(column)), (y.limits(row), x.limits(column))
        return {
            int(np.abs(all_rows - place - center[0]).argmin()): (round(place, 12), tuple(members))
            for place, members in self._lenslets.rows(center, limits)
        }

    def _behind(
        self, light: np.ndarray, around: list[dict[int, tuple[float, Members]]]
    ) -> dict[int, np.ndarray]:
        """Amplitude (lines, samples) along x behind each row of lenslets, of light (rows, lines, window)."""
        alike: dict[Members, set[int]] = {}
        for seen in around:
            for number, (_, members) in seen.items():
                alike.setdefault(members, set()).add(number)
        result = {}
        for members, numbers in alike.items():
            order = sorted(numbers)
            behind = self._matrix(members) @ light[order].transpose(1, 2, 0)
            result |= {number: behind[:, :, k] for k, number in enumerate(order)}
        return result

    def _matrix(self, members: Members) -> np.ndarray:
        """Amplitude (lines, samples, window) along x behind these lenslets of a row."""
        if members not in self._known:
            coefficients = self._lenslets.coefficients[1]
            behind = self._lenslets.member(*members[0]).copy()
            for member in members[1:]:
                behind += self._lenslets.member(*member)
            behind = behind.reshape(len(behind), self.optics.axes[1].samples, -1)
            self._known[members] = behind @ coefficients.astype(np.complex64)
        return self._known[members]

    def _spread(self, place: float) -> np.ndarray:
        """Amplitude (samples, lines) along y of a row of lenslets there from the cell's centre [m]."""
        if place not in self._spreads:
            axis, (lines, weight, _) = self.optics.axes[0], self._lenslets.lines
            spread = self._lenslets.spread(axis.image, place + lines)
            spread *= weight * axis.fade(place + lines, self.optics.array.lattice.pitch)
            self._spreads[place] = spread.astype(np.complex64)
        return self._spreads[place]


@dataclass(slots=True)
class Each:
    """Square lenslets that differ from each other, each a quadrature of its own on every cell."""

    optics: Optics
    _known: dict[tuple[int, float], tuple[np.ndarray, np.ndarray, np.ndarray]] = field(default_factory=dict)
    _lenslets: Lenslets = field(init=False)

    def __post_init__(self) -> None:
        if not self.optics.straight or self.optics.camera.model == "exact":
            raise GeometryError(
                "lenslets that differ from each other are simulated for square ones of one focal length and "
                'model = "paraxial". Use those, or leave focal_length_scatter, decentre_scatter, '
                "tilt_scatter, form_scatter and missing out of [built]."
            )
        self._lenslets = lenslets_of(self.optics)

    def places(self, rows: range, columns: range) -> tuple[np.ndarray, np.ndarray]:
        """As `Relay.places`."""
        return _Cells(self.optics, 0).places(rows), _Cells(self.optics, 1).places(columns)

    def field(self, light: np.ndarray, rows: range, columns: range) -> np.ndarray:
        """As `Relay.field`."""
        y, x = _Cells(self.optics, 0), _Cells(self.optics, 1)
        lines = []
        for k, row in enumerate(rows):
            cells = (light[y.window(k), x.window(n)] for n in range(len(columns)))
            pairs = zip(columns, cells, strict=True)
            lines.append(np.hstack([self._cell(seen, (row, column)) for column, seen in pairs]))
        return np.vstack(lines)

    def _cell(self, light: np.ndarray, cell: tuple[int, int]) -> np.ndarray:
        """Amplitude (y, x) on one cell's samples, of the light (y, x) in its window."""
        mine = [_Cells(self.optics, which) for which in (0, 1)]
        (down, ys), (across, xs) = (self._around(one, at) for one, at in zip(mine, cell, strict=True))
        i, j = np.meshgrid(down, across, indexing="ij")
        scatter = self.optics.array.scatter
        assert scatter is not None  # `relay` has looked
        factor, dy, dx, there = scatter.of(i, j)
        warp = scatter.warp(i, j) if scatter.warps else None
        total = np.zeros([axis.samples for axis in self.optics.axes], np.complex64)
        for k, n in zip(*np.nonzero(there), strict=True):
            bend = float(factor[k, n])
            above, seen = self._behind(0, ys[k], bend, float(dy[k, n]))
            beside, across = self._behind(1, xs[n], bend, float(dx[k, n]))
            if warp is None:  # few samples first: nodes are many
                total += (above @ seen) @ light @ (beside @ across).T
                continue
            own = (float(warp.down[k, n]), float(warp.across[k, n]), warp.terms[k, n])
            inside = seen @ light @ across.T * self._warped((ys[k], xs[n]), *own)
            total += above @ inside @ beside.T
        return total

    def _warped(self, middle: Pair, down: float, across: float, terms: np.ndarray) -> np.ndarray:
        """Factor on the nodes (y, x) of the lenslet there, which is tilted and has a form of its own."""
        y, x = (self._quadrature(which, middle[which])[1] - middle[which] for which in (0, 1))
        half_y, half_x = (self._half(which) for which in (0, 1))
        path = form.path(terms, y / half_y, x / half_x) + down * y[:, None] + across * x
        return np.exp(2j * np.pi / self._lenslets.optics[0] * path).astype(np.complex64)

    def _around(self, mine: _Cells, cell: int) -> tuple[np.ndarray, list[float]]:
        """Numbers of the lenslets that light is followed to along an axis, and their places from the cell."""
        lattice, axis, which = self.optics.array.lattice, mine.axis, mine.which
        step, origin = lattice.basis[1 - which][which], lattice.origin[which] - mine.center(cell)
        reach, (low, high) = axis.size / 2 + axis.neighbourhood, mine.limits(cell)
        ends = sorted(((max(-reach, low) - origin) / step, (min(reach, high) - origin) / step))
        numbers = np.arange(math.ceil(ends[0] - 1e-9), math.floor(ends[1] + 1e-9) + 1)
        return numbers, (origin + numbers * step).round(12).tolist()

    def _behind(
        self, which: int, middle: float, factor: float, decentre: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Along one axis of one lenslet: from its nodes to the samples, and of the window's light to them."""
        wavelength, focal_length = self._lenslets.optics[0], focal_lengths(self.optics.array)[0] * factor
        spread, at, light = self._quadrature(which, middle)
        phase = np.exp(-1j * np.pi * (at - middle - decentre) ** 2 / (wavelength * focal_length))
        return (spread * phase).astype(np.complex64), light

    def _quadrature(self, which: int, middle: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Of a lenslet's aperture: to the samples, its nodes from the cell, and of the window's light."""
        if (which, middle) not in self._known:
            axis, array, optics = self.optics.axes[which], self.optics.array, self._lenslets.optics
            step, half = abs(array.lattice.basis[1 - which][which]), self._half(which)
            count = nodes(half, _STRONGEST * focal_lengths(array)[0], axis, optics) + self._more(half)
            at, weight = legendre(middle - half, middle + half, count)
            spread = self._lenslets.spread(axis.image, at) * (weight * axis.fade(at, step))
            light = self._lenslets.values(which, at) @ self._lenslets.coefficients[which]
            self._known[which, middle] = spread, at, light.astype(np.complex64)
        return self._known[which, middle]

    def _half(self, which: int) -> float:
        """Of a lenslet's width along an axis [m]."""
        lattice = self.optics.array.lattice
        return self.optics.array.fill_factor * abs(lattice.basis[1 - which][which]) / 2

    def _more(self, half: float) -> int:
        """Nodes that tilts and forms ask for, as `nodes` counts."""
        scatter = self.optics.array.scatter
        assert scatter is not None
        steepest = 4 * scatter.turn + form.STEEPEST * scatter.form / half
        return math.ceil(4 * half * steepest / self._lenslets.optics[0])
