r"""Square lenslets that differ from each other: light around each, through it, to all samples that it lights.

At places (v, u) in halves of its width, lenslet n turns the phase of light by

.. math:: \varphi_n(v, u) = \sum_{jk} c_{n,jk} P_j(v) P_k(u)

of Legendre polynomials of degree 4 at most: focus and vertex, tilt and form. These are few numbers c for each
lenslet; the ways to it and from it are matrices that all share which stand on the lattice. As in
`cell_response`, a lenslet is a quadrature with exact borders.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import groupby
from typing import Any

import numpy as np

from lumigraph.elements import LensletArray, Scatter, form
from lumigraph.errors import GeometryError
from lumigraph.operators.lenslets.cell_response import CellLenslets, focal_lengths, legendre, nodes
from lumigraph.operators.lenslets.lenslet_light import AROUND
from lumigraph.operators.lenslets.line_parts import Key, Pieces
from lumigraph.operators.lenslets.lines import bright_ones
from lumigraph.operators.sampling import cells as _cells
from lumigraph.operators.sampling.camera import CameraOptics, Model
from lumigraph.operators.sampling.cell_axis import STEP, CellAxis
from lumigraph.operators.sampling.optics import Optics

Ways = tuple[range, range]
"""Rows and columns of cells."""

One = tuple[int, int]
"""Row and column of a lenslet's cell."""

DEGREES = form.ORDER + 1
"""Polynomials along an axis of a lenslet."""

Both = tuple[Key, Key]
"""Of matrices along y and along x."""

LIGHT: Both = (("light", 0), ("light", 1))
"""Of the way from light around a lenslet to its nodes (nodes, window)."""

SPREAD: Both = (("spread", 0), ("spread", 1))
"""Of the way from there to the samples around it (nodes, samples)."""


WIDER = 1.02
"""Steps of the periods in a cell that bands are rounded up to: cameras a little apart interpolate alike."""


def require_square(array: LensletArray, model: Model) -> None:
    """Refuse lenslets that differ by chance and are not simulated one by one.

    Raises
    ------
    GeometryError
        Others than squares of one focal length, or the exact model.
    """
    if array.shape != "square" or isinstance(array.focal_length, tuple) or model == "exact":
        raise GeometryError(
            "lenslets that differ from each other are simulated for square ones of one focal length and "
            f'model = "paraxial". Use those, or {_cells.ALIKE}.'
        )


def one_by_one(cameras: Sequence[CameraOptics]) -> list[CameraOptics]:
    """Cameras to be compared: where lenslets of some differ, those of all are taken one by one.

    Raises
    ------
    GeometryError
        Of `require_square`; other lenslets are missing, or all are drawn anew.
    """
    arrays = [camera.array for camera in cameras if camera.array is not None]
    own = next((array.scatter for array in arrays if array.scatter is not None), None)
    if own is None:
        return list(cameras)
    found = []
    for camera, array in zip(cameras, arrays, strict=True):
        require_square(array, camera.model)
        scatter = array.scatter or Scatter(seed=own.seed)
        if (scatter.seed, scatter.missing) != (own.seed, own.missing):
            raise GeometryError(
                f"cameras have seeds {own.seed} and {scatter.seed}, and {own.missing:g} and "
                f"{scatter.missing:g} of their lenslets missing, but derivatives are of the same lenslets: "
                "other ones are no small change. Give built.seed and built.missing alike, or search without "
                "derivatives."
            )
        found.append((camera, array, scatter))
    moved = [one.index for *_, scatter in found for one in scatter.own if one.aside is not None]
    named = {one.index: one.index in moved for *_, scatter in found for one in scatter.own}
    return [
        replace(camera, array=replace(array, scatter=scatter.naming(named)))
        for camera, array, scatter in found
    ]


@dataclass(frozen=True, slots=True)
class LitSamples:
    """Samples of some cells that a lenslet lights, and which of its own these are."""

    there: slice
    inside: slice


@dataclass(eq=False)
class IndividualLenslets:
    """A relay of square lenslets, each with its own phase; sampled as another that hardly differs, or not.

    Parameters
    ----------
    optics
        Of a camera whose lenslets differ.
    precision
        Of amplitudes.
    like
        Of a camera that hardly differs: as many samples, nodes and lenslets are taken.
    """

    optics: Optics
    precision: type[np.complexfloating] = np.complex64
    like: "IndividualLenslets | None" = None
    _pieces: dict[Key, np.ndarray] = field(default_factory=dict)

    def __post_init__(self) -> None:
        require_square(self.optics.array, self.optics.camera.model)

    def places(self, rows: range, columns: range) -> tuple[np.ndarray, np.ndarray]:
        """As `Relay.places`."""
        y, x = (self._places(which, cells) for which, cells in enumerate((rows, columns)))
        return y, x

    def field(self, light: np.ndarray, rows: range, columns: range) -> np.ndarray:
        """As `Relay.field`."""
        light, cells = light.astype(self.precision), (rows, columns)
        return self.past(light, self.lit(light, rows, columns), cells)

    def past(self, light: np.ndarray, lit: list[tuple[int, list[int]]], cells: Ways) -> np.ndarray:
        """The same, of light through some lenslets."""
        own, total = self.piece, self.dark(*cells)
        for row, members in lit:
            beside = self.unlit(cells)
            for column in members:
                one = row, column
                cut, spread = self.cut(1, column, cells[1]), own(self.spread(one)[1])
                bent = self.on_nodes((own, own), self.around(light, one, cells), one) * self.bend(*one)
                beside[:, cut.there] += bent @ spread[:, cut.inside]
            cut, spread = self.cut(0, row, cells[0]), own(self.spread((row, members[0]))[0])
            across = self.across(members, cells[1])
            total[cut.there, across] += spread[:, cut.inside].T @ beside[:, across]
        return total

    def across(self, members: list[int], columns: range) -> slice:
        """Samples of some columns of cells that lenslets of a row light."""
        lit = [self.cut(1, column, columns).there for column in members]
        return slice(min(one.start for one in lit), max(one.stop for one in lit))

    def light(self, one: One) -> Both:
        """`LIGHT` of a lenslet: its own where it stands beside the lattice."""
        return (("light", 0, *one), ("light", 1, *one)) if one in self._moved else LIGHT

    def spread(self, one: One) -> Both:
        """`SPREAD` of a lenslet."""
        return (("spread", 0, *one), ("spread", 1, *one)) if one in self._moved else SPREAD

    def unlit(self, cells: Ways) -> np.ndarray:
        """Nothing on a row's nodes along y and the samples along x of some cells."""
        return np.zeros((self._counts[0], len(cells[1]) * self.optics.cells.samples[1]), self.precision)

    def dark(self, rows: range, columns: range) -> np.ndarray:
        """Nothing on the samples (y, x) of some cells."""
        ky, kx = self.optics.cells.samples
        return np.zeros((len(rows) * ky, len(columns) * kx), self.precision)

    def keys(self, rows: range, columns: range) -> set[Key]:
        """Of all matrices that bring light to some cells."""
        around = self._around(0, rows), self._around(1, columns)
        moved = [one for one in self._moved if one[0] in around[0] and one[1] in around[1]]
        own = {key for one in moved for key in (*self.light(one), *self.spread(one))}
        return {*LIGHT, *SPREAD} | own | {("phases", row) for row in around[0]}

    def lit(self, light: np.ndarray, rows: range, columns: range) -> list[tuple[int, list[int]]]:
        """Cells of the lenslets that are there and not dark: rows, and the columns of each.

        Lenslets beside the lattice make rows of their own.
        """
        around = self._around(0, rows), self._around(1, columns)
        there = np.argwhere(self._scatter.of(*self._numbers(*around))[3]).tolist()
        ones = [(around[0][k], around[1][n]) for k, n in there]
        bright = np.array([np.linalg.norm(self.around(light, one, (rows, columns))) for one in ones])
        kept = (ones[k] for k in bright_ones(bright, self.optics.fineness.accuracy))
        alike = groupby(sorted(kept, key=self._row), self._row)
        return [(row, [x for _, x in some]) for (row, _), some in alike]

    def _row(self, one: One) -> One:
        """Names lenslets that share their way along y: those of a row, or one beside the lattice."""
        return one[0], one[1] if one in self._moved else -self._reach[1] - 1

    def around(self, light: np.ndarray, one: tuple[int, int], cells: Ways) -> np.ndarray:
        """Light (y, x) in the window of a lenslet; a change of what is added to it is one of the light."""
        y, x = (
            slice(start := (place - self._around(which, mine).start) * axis.points // STEP,
                  start + len(axis.window))
            for which, (place, mine, axis) in enumerate(zip(one, cells, self._axes, strict=True))
        )  # fmt: skip
        return light[y, x]

    def on_nodes(self, ways: tuple[Pieces, Pieces], window: np.ndarray, one: One) -> np.ndarray:
        """Light (v, u) on a lenslet's nodes, by matrices along y and along x."""
        (y, x), (down, across) = self.light(one), ways
        return down(y) @ window @ across(x).T

    def phase(self, pieces: Pieces, row: int, column: int) -> np.ndarray:
        """Of a lenslet, on its nodes (v, u) [rad], by how it differs from others."""
        terms = pieces(("phases", row))[:, self.number(column)].reshape(DEGREES, DEGREES)
        down, across = self.polynomials
        return down @ terms @ across.T

    def bend(self, row: int, column: int) -> np.ndarray:
        """What a lenslet does to light on its nodes (v, u)."""
        return np.exp(1j * self.phase(self.piece, row, column)).astype(self.precision)

    @cached_property
    def polynomials(self) -> tuple[np.ndarray, np.ndarray]:
        """On the nodes (nodes, degrees), along y and along x."""
        y, x = (form.along(legendre(-1, 1, count)[0]) for count in self._counts)
        return y, x

    def number(self, column: int) -> int:
        """Of a column's lenslet, in a piece ("phases", row)."""
        return column + self._reach[1]

    def cut(self, which: int, place: int, cells: range) -> LitSamples:
        """Along an axis, around the lenslet of a cell, of the samples of some cells."""
        reach, samples = self._reach[which], self.optics.axes[which].samples
        low, high = max(place - reach, cells.start), min(place + reach + 1, cells.stop)
        there, inside = (
            slice((low - first) * samples, (max(low, high) - first) * samples)
            for first in (cells.start, place - reach)
        )
        return LitSamples(there, inside)

    def piece(self, key: Key) -> np.ndarray:
        """A matrix: `light` or `spread` along an axis, or terms (degrees², columns) of a row's "phases"."""
        if key not in self._pieces:
            if self.like is not None and self._shared(key):
                self._pieces[key] = self.like.piece(key)
            else:
                what, *of = key
                made = {"light": self._light, "spread": self._spread, "phases": self._phases}
                self._pieces[key] = made[str(what)](*of)
        return self._pieces[key]

    def _shared(self, key: Key) -> bool:
        """Whether a matrix is the other's, with all it follows from."""
        assert self.like is not None
        return self._given(key) == self.like._given(key)

    def _given(self, key: Key) -> tuple[Any, ...]:
        """What a matrix follows from, beside what all have that are sampled alike."""
        array, lenslets, what = self.optics.array, self._lenslets, key[0]
        of, *one = (int(str(number)) for number in key[1:])
        aside = self._aside(tuple(one))
        if what == "light":
            return array.fill_factor, *np.divide(aside, self.optics.cells.size)
        if what == "spread":
            return lenslets.optics, lenslets.pixels, self._halves, self.optics.cells.size, aside
        row = int(self._numbers(range(of, of + 1), range(1))[0][0, 0])
        return lenslets.optics[0], self._halves, replace(array, scatter=self._scatter.in_row(row))

    @cached_property
    def _lenslets(self) -> CellLenslets:
        """With axes whose windows are around a lenslet."""
        camera, distance = self.optics.camera, _cells.telecentric_distance(self.optics.camera)
        return CellLenslets(
            self._axes, self.optics.array, camera.wavelength, distance, _cells.accepted(camera)
        )

    @cached_property
    def _axes(self) -> tuple[CellAxis, CellAxis]:
        """Of the light around a lenslet: as many samples, and periods of the band, as the other's."""
        found = []
        for which, axis in enumerate(self.optics.axes):
            if self.like is None:
                more = AROUND[0] + AROUND[1] * max(0.0, math.log10(1e-3 / self.optics.fineness.accuracy))
                margin = replace(axis, neighbourhood=more / axis.band / 2).margin
                steps = math.ceil(math.log(axis.band * axis.size) / math.log(WIDER) - 1e-9)
                band = WIDER**steps / axis.size
            else:
                like = self.like._axes[which]
                margin, band = like.margin, like.band * like.size / axis.size
            beyond = (margin - 0.5) * axis.size / axis.points  # so many samples, however rounded
            found.append(replace(axis, neighbourhood=beyond, band=band))
        return found[0], found[1]

    @cached_property
    def _halves(self) -> tuple[float, float]:
        """Of a lenslet's height and width [m]."""
        y, x = (self.optics.array.fill_factor * size / 2 for size in self.optics.cells.size)
        return y, x

    @cached_property
    def _reach(self) -> tuple[int, int]:
        """Cells beside it to which a lenslet sends light, along y and along x."""
        if self.like is not None:
            return self.like._reach
        y, x = (math.floor(0.5 + axis.neighbourhood / axis.size + 1e-9) for axis in self.optics.axes)
        return y, x

    @cached_property
    def _counts(self) -> tuple[int, int]:
        """Nodes along y and along x: more where lenslets are stronger, tilted or have a form."""
        if self.like is not None:
            return self.like._counts
        scatter, optics, found = self._scatter, self._lenslets.optics, []
        strongest = focal_lengths(self.optics.array)[0] * (1 - 4 * scatter.focal_length)
        for half, axis in zip(self._halves, self.optics.axes, strict=True):
            turn = scatter.turn + scatter.decentre / abs(strongest)
            steepest = 4 * turn + form.STEEPEST * scatter.form / half
            found.append(nodes(half, strongest, axis, optics) + math.ceil(4 * half * steepest / optics[0]))
        return found[0], found[1]

    @cached_property
    def _moved(self) -> dict[One, tuple[float, float]]:
        """By cell, ways (y, x) from the lattice of lenslets that have matrices of their own [m]."""
        cells, lattice, found = self.optics.cells, self.optics.array.lattice, {}
        for own in self._scatter.own:
            if own.aside is not None:
                middle = np.array(lattice.origin) + own.index[0] * np.array(lattice.basis[1])
                middle += own.index[1] * np.array(lattice.basis[0])
                row, column = np.rint((middle - cells.edge) / cells.size - 0.5).astype(int) + cells.ring
                found[int(row), int(column)] = own.aside
        return found

    def _aside(self, one: tuple[int, ...]) -> tuple[float, float]:
        """Of a lenslet, or of those on the lattice."""
        return self._moved[one[0], one[1]] if one else (0.0, 0.0)

    def _light(self, which: int, *one: int) -> np.ndarray:
        at, _ = self._nodes(which, *one)
        found = self._lenslets.values(which, at) @ self._lenslets.coefficients[which]
        return found.astype(self.precision)

    def _spread(self, which: int, *one: int) -> np.ndarray:
        (at, weight), axis, reach = self._nodes(which, *one), self.optics.axes[which], self._reach[which]
        parts = []
        for cell in range(-reach, reach + 1):
            seen = at - cell * axis.size
            spread = self._lenslets.spread(axis.image, seen)
            parts.append(spread * (weight * axis.fade(seen, axis.size)))
        return np.concatenate(parts).T.astype(self.precision)

    def _nodes(self, which: int, *one: int) -> tuple[np.ndarray, np.ndarray]:
        """Places from the middle of its cell, and weights [m]."""
        half, aside = self._halves[which], self._aside(one)[which]
        return legendre(aside - half, aside + half, self._counts[which])

    def _phases(self, row: int) -> np.ndarray:
        """Terms (degrees², columns) of the phases of a row of lenslets [rad]."""
        columns = range(-self._reach[1], self.optics.cells.image[1] + self._reach[1])
        i, j = self._numbers(range(row, row + 1), columns)
        (focal_length,), (high, wide) = focal_lengths(self.optics.array), self._halves
        (factor, *vertex, _), terms = self._scatter.of(i, j), np.zeros((*j.shape, DEGREES, DEGREES))
        dy, dx = np.subtract(vertex, self._scatter.aside(i, j))
        if self._scatter.warps:
            warp = self._scatter.warp(i, j)
            terms += form.matrices(warp.terms)
            terms[..., 1, 0] += warp.down * high
            terms[..., 0, 1] += warp.across * wide
        length = 2 * focal_length * factor  # a path of -((y - dy)² + (x - dx)²) over it
        terms[..., 2, 0] -= 2 / 3 * high**2 / length
        terms[..., 0, 2] -= 2 / 3 * wide**2 / length
        terms[..., 1, 0] += 2 * high * dy / length
        terms[..., 0, 1] += 2 * wide * dx / length
        terms[..., 0, 0] -= ((high**2 + wide**2) / 3 + dy**2 + dx**2) / length
        return 2 * np.pi / self._lenslets.optics[0] * terms[0].reshape(len(columns), -1).T

    def _numbers(self, rows: range, columns: range) -> tuple[np.ndarray, np.ndarray]:
        """Of lenslets (i, j) in cells (rows, columns), on the lattice."""
        lattice, found = self.optics.array.lattice, []
        for which, mine in enumerate((rows, columns)):
            step, at = lattice.basis[1 - which][which], self._middles(which, mine)
            found.append(np.rint((at - lattice.origin[which]) / step).astype(np.int64))
        i, j = np.meshgrid(*found, indexing="ij")
        return i, j

    @property
    def _scatter(self) -> Scatter:
        scatter = self.optics.array.scatter
        assert scatter is not None  # as `relay` and `one_by_one` have it
        return scatter

    def _middles(self, which: int, mine: range) -> np.ndarray:
        """Of cells [m]."""
        cells = self.optics.cells
        number = np.arange(mine.start, mine.stop) - cells.ring[which] + 0.5
        return cells.edge[which] + number * cells.size[which]

    def _around(self, which: int, mine: range) -> range:
        """Cells along an axis whose lenslets send light to some cells, as far as the array has any."""
        reach, extent = self._reach[which], self.optics.array.extent
        far = range(mine.start - reach, mine.stop + reach)
        if extent is None:
            return far
        inside = np.abs(self._middles(which, far)) <= extent[which] / 2 + 1e-9 * self.optics.cells.size[which]
        kept = np.flatnonzero(inside).tolist()
        return far[kept[0] : kept[-1] + 1] if kept else far[:0]

    def _places(self, which: int, cells: range) -> np.ndarray:
        """Of the light around those lenslets."""
        around, axis = self._around(which, cells), self._axes[which]
        window = axis.window
        count = len(window) + (len(around) - 1) * axis.points // STEP if around else 0
        start = self._middles(which, around[:1])[0] + window[0] if around else 0.0
        return start + np.arange(count) * (window[1] - window[0])
