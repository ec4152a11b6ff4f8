r"""Raw images of a plane before a microscope with lenslets, and how they change with whatever changes of it.

As `whole_planes` has them, K the images of points of one lenslet's cell: those of all others are the same, moved
by whole cells, for a microscope is telecentric. With P the wave of a point in the pupil, B_y and B_x the
Bloch waves behind the lenslets, and S what samples take (`pupil_points`),

.. math:: U = B_y t_y (P t_x B_x), \quad K = S |U|^2 S^T

where t turn the phase as a point moves along y and along x. What is in brackets is the same for a column of
points, which go through it, and back to it, at once.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from lumigraph.core import arrays
from lumigraph.core.grid import Grid
from lumigraph.core.linear import Linear
from lumigraph.operators.microscope_building import points_grid
from lumigraph.operators.microscope_pupil import BLOCK, PupilImages
from lumigraph.operators.microscope_pupil_waves import Told as Sampled
from lumigraph.operators.microscope_pupil_waves import Waves, of_each
from lumigraph.operators.part_waves import times
from lumigraph.operators.pupil_points import Both, Parts, require_alike
from lumigraph.operators.resampling import represented
from lumigraph.operators.whole_planes import Block, CellPlane

Pieces = tuple[np.ndarray, np.ndarray, np.ndarray]
"""P without a place (modes, rows, nodes), its phases by y, x and dz (3, rows, nodes), a cell's size ()."""


@dataclass(frozen=True, eq=False)
class PupilPlane(CellPlane[PupilImages, "Lit"]):
    """How a microscope sees a plane, with derivatives by what differs between pairs of microscopes.

    The object's samples stay where they are, along the lenslets' rows and columns, and as bright, before all
    microscopes. Light from beyond the lenslets that are seen comes in; what goes beyond a point's window, a
    share of the accuracy, is left out.

    Parameters
    ----------
    images
        The microscope's, without terms.
    pairs
        (n,), of microscopes a little to either side, sampled alike and in double precision.
    grid
        Samples of the object.
    dz
        Depth from the focused plane [m].

    Raises
    ------
    GeometryError
        Microscopes of another number of lenslets before the pixels, or of wavelengths.
    """

    images: PupilImages
    pairs: Sequence[Both]
    grid: Grid
    dz: float = 0.0

    def __post_init__(self) -> None:
        for end in (end for pair in self.pairs for end in pair):
            require_alike(end, self.images)

    @property
    def shape(self) -> tuple[tuple[int, int], tuple[int, int]]:
        """Of a raw image and of an object."""
        return self.images.shape, self.grid.shape

    def _whole(self) -> PupilImages:
        return self.images

    def _pairs(self) -> Sequence[Both]:
        return self.pairs

    def _points(self, end: PupilImages, x: np.ndarray) -> np.ndarray:
        points = points_grid(end.lenslet, end.layout, end.layout.frame + self._reach)
        return _tiled(represented(self.grid, points, upright=True).forward(x), end.layout.sampling.points)

    def _dark(self) -> np.ndarray:
        layout = self.images.layout
        return np.zeros((*layout.cells, layout.sampling.pixels**2))

    def _plane(self, light: np.ndarray) -> np.ndarray:
        N = self.images.layout.sampling.pixels
        return arrays.untiled(light.reshape(*light.shape[:2], N, N))

    def _cells(self, plane: np.ndarray) -> np.ndarray:
        return _tiled(plane, self.images.layout.sampling.pixels)

    def _read(self, end: PupilImages) -> Linear:
        assert end.layout.placement is not None  # pixels may stand anywhere
        return end.layout.placement

    def _blocks(self) -> Iterator["Lit"]:
        s = self.images.layout.sampling.points
        at = (np.arange(s) - (s - 1) / 2) / s
        step = max(1, BLOCK // max(one.field_numbers for one in self._behind))
        for k in range(s):
            columns = [Column.of(one, float(at[k])) for one in self._behind]
            for first in range(0, s, step):
                places = at[first : first + step]
                numbers = slice(first * s + k, (first + len(places)) * s, s)
                yield Lit.of(columns, places, numbers, self._reach)

    def _changed(self, change: list[float]) -> Callable[["Lit"], Block]:
        by = [Change.of(one, change, self.pairs) for one in self._behind]
        brighter = sum(w * (high.unit - low.unit) for w, (low, high) in zip(change, self.pairs, strict=True))
        return lambda block: block.changed(by, brighter)

    def _slopes(self) -> "_Told":
        return _Told(self.pairs, [Slopes(one, one.parts(self.pairs)) for one in self._behind])

    @cached_property
    def _behind(self) -> list["Behind"]:
        return [Behind.of(self.images, k, self.dz) for k in range(len(self.images.objectives))]

    @property
    def _reach(self) -> int:
        """Cells to each side that light comes to from a point's own."""
        return max(one.told[0] for one in self._behind) // 2


@dataclass(frozen=True, slots=True, eq=False)
class Behind:
    """What an objective and the lenslets behind it do to light of a cell's points.

    Parameters
    ----------
    images, which, dz
        The microscope's, the objective's number, and the points' depth [m].
    told, waves
        How a window is sampled, and with what.
    pieces
        Of the points' waves.
    """

    images: PupilImages
    which: int
    dz: float
    told: Sampled
    waves: Waves
    pieces: Pieces

    @classmethod
    def of(cls, images: PupilImages, which: int, dz: float) -> "Behind":
        """Of a microscope."""
        told, waves = images.sampled(images.objectives[which], dz)
        return cls(images, which, dz, told, waves, _pieces(images, which, told))

    @property
    def field_numbers(self) -> int:
        """Of a point's field."""
        return len(self.pieces[0]) * self.waves.down.shape[0] ** 2

    def parts(self, pairs: Sequence[Both]) -> Parts:
        """The matrices, as they are compared."""
        own = self.images.layout.sampling
        resampled = any(end.layout.sampling != own for pair in pairs for end in pair)
        return Parts(self.which, self.told, self.waves, resampled)

    def ends(self, pair: Both) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Pieces of both, one after the other."""
        yield from zip(*(_pieces(one, self.which, self.told) for one in pair), strict=True)


@dataclass(frozen=True, slots=True, eq=False)
class Change:
    """Of what images of a cell's points follow from: of pieces, and of the matrices that change."""

    pieces: Pieces
    matrices: dict[int, np.ndarray]

    @classmethod
    def of(cls, behind: Behind, change: list[float], pairs: Sequence[Both]) -> "Change":
        """So many times from the first to the last of each pair."""
        parts, matrices = behind.parts(pairs), dict[int, np.ndarray]()
        pieces = [np.zeros(one.shape, np.result_type(one, np.float64)) for one in behind.pieces]
        for weight, pair in zip(change, pairs, strict=True):
            for moved, (low, high) in zip(pieces, behind.ends(pair), strict=True):
                moved += weight * (high - low)
            for which, (low, high) in parts.ends(pair, behind.images).items():
                matrices[which] = matrices.get(which, 0.0) + weight * (high - low)
        pupil, phases, size = pieces
        return cls((pupil, phases, size), matrices)


@dataclass(frozen=True, slots=True, eq=False)
class Column:
    """Light of the points of a cell that stand at one x, as far as it is the same for all of them.

    Parameters
    ----------
    behind
        The objective.
    at
        x [cells].
    turn
        t_x, and the depth's (rows, nodes).
    wave, even
        P t_x (modes, rows, nodes), and on the grid that all rows share.
    right
        P t_x B_x (modes, rows, n).
    """

    behind: Behind
    at: float
    turn: np.ndarray
    wave: np.ndarray
    even: np.ndarray
    right: np.ndarray

    @classmethod
    def of(cls, behind: Behind, at: float) -> "Column":
        """At x [cells]."""
        (pupil, phases, size), waves = behind.pieces, behind.waves
        turn = np.exp(1j * (at * float(size) * phases[1] + behind.dz * phases[2]))
        wave = pupil * turn
        even = of_each(waves.onto, wave, waves.across.shape[1])
        return cls(behind, at, turn, wave, even, waves.across.right(even))

    def turned(self, places: np.ndarray) -> np.ndarray:
        """t_y (m, rows) at places [cells]."""
        _, phases, size = self.behind.pieces
        return np.exp(1j * (np.outer(places, phases[0, :, 0]) * float(size))).astype(self.right.dtype)

    def changed(self, by: Change) -> np.ndarray:
        """Change of `right`."""
        (pupil, phases, size), behind = by.pieces, self.behind
        _, own, wide = behind.pieces
        angle = self.at * (wide * phases[1] + size * own[1]) + behind.dz * phases[2]
        wave = pupil * self.turn + 1j * angle * self.wave
        even = of_each(behind.waves.onto, wave, self.even.shape[-1])
        return behind.waves.across.right(even) + (self.even @ by.matrices[1].T if 1 in by.matrices else 0.0)


@dataclass(frozen=True, slots=True, eq=False)
class Lit(Block):
    """Images of some points of a column.

    Parameters
    ----------
    columns
        Behind each objective.
    places
        y (m,) [cells].
    turns
        t_y of each (m, rows).
    fields
        (m, modes, n, n) of each.
    """

    columns: list[Column]
    places: np.ndarray
    turns: list[np.ndarray]
    fields: list[np.ndarray]

    @classmethod
    def of(cls, columns: list[Column], places: np.ndarray, numbers: slice, reach: int) -> "Lit":
        """At places [cells], of these numbers, whose light goes so many cells to each side."""
        turns = [one.turned(places) for one in columns]
        fields = [
            one.behind.waves.down.down(turn[:, None, :, None] * one.right)
            for one, turn in zip(columns, turns, strict=True)
        ]
        images = columns[0].behind.images
        kernel = np.zeros((2 * reach + 1, 2 * reach + 1, len(places), images.layout.sampling.pixels**2))
        found = cls(kernel, numbers, (2 * reach, 2 * reach), columns, places, turns, fields)
        return found._with([images.unit * one for one in found.samples()])

    def light(self) -> Iterator[np.ndarray]:
        """On the fine grid (m, n, n), behind each objective."""
        for one in self.fields:
            yield np.square(np.abs(one)).sum(1)

    def samples(self) -> Iterator[np.ndarray]:
        """(m, count, count) of light of 1, behind each objective."""
        for one, light in zip(self.columns, self.light(), strict=True):
            yield one.behind.waves.samples(light)

    def changed(self, by: Sequence[Change], brighter: float) -> "Lit":
        """Change of the images with the microscope, and as the points become brighter."""
        unit, found = self.columns[0].behind.images.unit, []
        for k, (change, samples) in enumerate(zip(by, self.samples(), strict=True)):
            found.append(unit * self._moved(k, change) + brighter * samples)
        return self._with(found)

    def _moved(self, k: int, by: Change) -> np.ndarray:
        """Change of samples behind an objective."""
        column, turn, field = self.columns[k], self.turns[k][:, None, :, None], self.fields[k]
        (_, phases, size), (_, own, wide), waves = by.pieces, column.behind.pieces, column.behind.waves
        angle = np.outer(self.places, wide * phases[0, :, 0] + size * own[0, :, 0])
        right = turn * (column.changed(by) + 1j * angle[:, None, :, None] * column.right)
        moved = waves.down.down(right)
        if 0 in by.matrices:
            moved = moved + by.matrices[0] @ (turn * column.right)
        found = waves.samples(2 * np.real(field.conj() * moved).sum(1))
        if 2 in by.matrices:
            other = waves.sampled.right(by.matrices[2] @ np.square(np.abs(field)).sum(1))
            found = found + other + waves.sampled.down(np.square(np.abs(field)).sum(1)) @ by.matrices[2].T
        return found

    def of_each(self, kernel: np.ndarray) -> Iterator[np.ndarray]:
        """What a kernel has of the points' windows (m, count, count), behind each objective."""
        (reach, _), N = self.first, self.columns[0].behind.images.layout.sampling.pixels
        for one in self.columns:
            inside = slice(reach // 2 - one.behind.told[0] // 2, reach // 2 + one.behind.told[0] // 2 + 1)
            tiles = kernel[inside, inside]
            cells, _, count, _ = tiles.shape
            planes = tiles.reshape(cells, cells, count, N, N).transpose(2, 0, 3, 1, 4)
            yield planes.reshape(count, cells * N, cells * N)

    def _with(self, images: Sequence[np.ndarray]) -> "Lit":
        """With other windows (m, count, count) behind each objective."""
        kernel, (reach, _) = np.zeros_like(self.kernel), self.first
        N = self.columns[0].behind.images.layout.sampling.pixels
        for image in images:
            count, cells = len(image), image.shape[1] // N
            inside = slice((reach - cells + 1) // 2, (reach + cells + 1) // 2)
            tiles = image.reshape(count, cells, N, cells, N).transpose(1, 3, 0, 2, 4)
            kernel[inside, inside] += tiles.reshape(cells, cells, count, N * N)
        return replace(self, kernel=kernel)


@dataclass(eq=False)
class Slopes:
    """What a number changes by as what images of a cell's points, behind one objective, follow from.

    Without conjugates: what changes is Re of products with changes.
    """

    behind: Behind
    parts: Parts
    by: list[np.ndarray] = field(default_factory=list)
    _right: np.ndarray = field(default_factory=lambda: np.zeros(()))
    _column: Column | None = None

    def __post_init__(self) -> None:
        self.by = [np.zeros(one.shape, np.result_type(one, np.float64)) for one in self.behind.pieces]

    def add(self, lit: Lit, k: int, given: np.ndarray) -> None:
        """Those by samples (m, count, count) behind the objective, of light of 1."""
        column, turn, fields, parts = lit.columns[k], lit.turns[k], lit.fields[k], self.parts
        if column is not self._column:
            self.leave()
            self._column, self._right = column, np.zeros(column.right.shape, np.complex128)
        given = given.astype(np.real(fields).dtype)
        across = parts.spread.right(given)
        if parts.resampled:
            parts.add_sampled(given, across, np.square(np.abs(fields)).sum(1))
        by = 2 * parts.spread.down(across)[:, None] * fields.conj()
        turn = turn[:, None, :, None]
        parts.by[0] += np.tensordot(by, turn * column.right, ([0, 1, 3], [0, 1, 3]))
        rows = turn * parts.down.down(by)
        self._right += rows.sum(0)
        angles = np.real(1j * rows * column.right).sum((1, 3), dtype=np.float64)
        (_, phases, size), moved = self.behind.pieces, lit.places @ angles
        self.by[1][0, :, 0] += float(size) * moved
        self.by[2] += moved @ phases[0, :, 0]

    def leave(self) -> None:
        """Adds those by the column's light."""
        if (column := self._column) is None:
            return
        (_, phases, size), behind, right = (
            self.behind.pieces,
            self.behind,
            self._right.astype(column.right.dtype),
        )
        self.parts.by[1] += np.tensordot(right, column.even, ([0, 1], [0, 1]))
        nodes = of_each(behind.waves.onto.T, self.parts.across.right(right), column.wave.shape[2])
        self.by[0] += nodes * column.turn
        angle = np.real(1j * nodes * column.wave).sum(0, dtype=np.float64)
        self.by[1][1] += column.at * float(size) * angle
        self.by[1][2] += behind.dz * angle
        self.by[2] += column.at * float((phases[1] * angle).sum())
        self._column = None

    def along(self, pair: Both) -> float:
        """From one microscope to another close by."""
        self.leave()
        found = self.parts.along(pair, self.behind.images)
        return found + sum(times(by, *ends) for by, ends in zip(self.by, self.behind.ends(pair), strict=True))


@dataclass(eq=False)
class _Told:
    """`whole_planes.Told` before a microscope: slopes behind each objective, and by how bright points are."""

    pairs: Sequence[Both]
    by: list[Slopes]
    bright: float = 0.0

    def add(self, block: Lit, asked: np.ndarray) -> None:
        unit = block.columns[0].behind.images.unit
        for k, (one, given) in enumerate(zip(self.by, block.of_each(asked), strict=True)):
            one.add(block, k, unit * given)
        self.bright += float(np.vdot(block.kernel, asked)) / unit

    def along(self) -> np.ndarray:
        found = [
            self.bright * (high.unit - low.unit) + sum(one.along((low, high)) for one in self.by)
            for low, high in self.pairs
        ]
        return np.array(found, np.float64)


def _pieces(images: PupilImages, which: int, told: Sampled) -> Pieces:
    objective, (_, _, nodes, _) = images.objectives[which], told
    size = images.lenslet.pitch / images.lenslet.magnification
    return images.pupil(objective, nodes), images.phases(objective, nodes), np.array(size)


def _tiled(plane: np.ndarray, n: int) -> np.ndarray:
    """(rows n, columns n) to (rows, columns, n²)."""
    tiles = arrays.tiled(plane, (n, n))
    return tiles.reshape(*tiles.shape[:2], -1)
