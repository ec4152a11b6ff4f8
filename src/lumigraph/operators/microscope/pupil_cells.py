"""Waves of the points of a microscope's cell, column by column, their changes, and the way back.

The formulas are those of `pupil_plane`.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from lumigraph.operators.lenslets.gradient import times
from lumigraph.operators.lenslets.whole_planes import RepeatedImages
from lumigraph.operators.microscope.pupil import PupilImages
from lumigraph.operators.microscope.pupil_points import Both, WindowParts
from lumigraph.operators.microscope.pupil_waves import PupilWaves, of_each
from lumigraph.operators.microscope.pupil_waves import Told as Sampled

Pieces = tuple[np.ndarray, np.ndarray, np.ndarray]
"""P without a place (modes, rows, nodes), its phases by y, x and dz (3, rows, nodes), a cell's size ()."""


@dataclass(frozen=True, slots=True, eq=False)
class CellOptics:
    """Objective and the lenslets behind it, as light of a cell's points goes through them.

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
    waves: PupilWaves
    pieces: Pieces

    @classmethod
    def of(cls, images: PupilImages, which: int, dz: float) -> "CellOptics":
        """Objective of a microscope, by its number, for points at a depth [m]."""
        told, waves = images.sampled(images.objectives[which], dz)
        return cls(images, which, dz, told, waves, _pieces(images, which, told))

    @property
    def field_numbers(self) -> int:
        """Number of values of a point's field."""
        return len(self.pieces[0]) * self.waves.down.shape[0] ** 2

    def parts(self, pairs: Sequence[Both]) -> WindowParts:
        """The matrices, as they are compared."""
        own = self.images.layout.sampling
        resampled = any(end.layout.sampling != own for pair in pairs for end in pair)
        return WindowParts(self.which, self.told, self.waves, resampled)

    def ends(self, pair: Both) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Pieces of both, one after the other."""
        yield from zip(*(_pieces(one, self.which, self.told) for one in pair), strict=True)


@dataclass(frozen=True, slots=True, eq=False)
class CellChange:
    """Change of what images of a cell's points follow from: of pieces, and of the matrices that change."""

    pieces: Pieces
    matrices: dict[int, np.ndarray]

    @classmethod
    def of(cls, behind: CellOptics, change: list[float], pairs: Sequence[Both]) -> "CellChange":
        """Change of so many times each pair, from its first to its last."""
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
class PupilColumn:
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

    behind: CellOptics
    at: float
    turn: np.ndarray
    wave: np.ndarray
    even: np.ndarray
    right: np.ndarray

    @classmethod
    def of(cls, behind: CellOptics, at: float) -> "PupilColumn":
        """Column of the points at x [cells]."""
        (pupil, phases, size), waves = behind.pieces, behind.waves
        turn = np.exp(1j * (at * float(size) * phases[1] + behind.dz * phases[2]))
        wave = pupil * turn
        even = of_each(waves.onto, wave, waves.across.shape[1])
        return cls(behind, at, turn, wave, even, waves.across.right(even))

    def turned(self, places: np.ndarray) -> np.ndarray:
        """t_y (m, rows) at places [cells]."""
        _, phases, size = self.behind.pieces
        return np.exp(1j * (np.outer(places, phases[0, :, 0]) * float(size))).astype(self.right.dtype)

    def changed(self, by: CellChange) -> np.ndarray:
        """Change of `right`."""
        (pupil, phases, size), behind = by.pieces, self.behind
        _, own, wide = behind.pieces
        angle = self.at * (wide * phases[1] + size * own[1]) + behind.dz * phases[2]
        wave = pupil * self.turn + 1j * angle * self.wave
        even = of_each(behind.waves.onto, wave, self.even.shape[-1])
        return behind.waves.across.right(even) + (self.even @ by.matrices[1].T if 1 in by.matrices else 0.0)


@dataclass(frozen=True, slots=True, eq=False)
class ColumnImages(RepeatedImages):
    """Images of some points of a column.

    Parameters
    ----------
    columns
        Behind each objective.
    places
        y (m,) [cells].
    turns
        t_y of each (m, rows).
    before, fields
        (m, modes, n, n) of each: before a window of lenslets, if there is one, and on the sensor.
    """

    columns: list[PupilColumn]
    places: np.ndarray
    turns: list[np.ndarray]
    before: list[np.ndarray]
    fields: list[np.ndarray]

    @classmethod
    def of(cls, columns: list[PupilColumn], places: np.ndarray, numbers: slice, reach: int) -> "ColumnImages":
        """Images of the points of these numbers at places [cells], whose light goes `reach` cells around."""
        turns = [one.turned(places) for one in columns]
        before = [
            one.behind.waves.down.down(turn[:, None, :, None] * one.right)
            for one, turn in zip(columns, turns, strict=True)
        ]
        fields = [one.behind.waves.behind(light) for one, light in zip(columns, before, strict=True)]
        images = columns[0].behind.images
        kernel = np.zeros((2 * reach + 1, 2 * reach + 1, len(places), images.layout.sampling.pixels**2))
        found = cls(kernel, numbers, (2 * reach, 2 * reach), columns, places, turns, before, fields)
        return found._with([images.unit * one for one in found.samples()])

    def samples(self) -> Iterator[np.ndarray]:
        """(m, count, count) of light of 1, behind each objective."""
        for one, fields in zip(self.columns, self.fields, strict=True):
            yield one.behind.waves.samples(_light(fields))

    def changed(self, by: Sequence[CellChange], brighter: float) -> "ColumnImages":
        """Change of the images with the microscope, and as the points become brighter."""
        unit, found = self.columns[0].behind.images.unit, []
        for k, (change, samples) in enumerate(zip(by, self.samples(), strict=True)):
            found.append(unit * self._moved(k, change) + brighter * samples)
        return self._with(found)

    def _moved(self, k: int, by: CellChange) -> np.ndarray:
        """Change of samples behind an objective."""
        column, turn, fields = self.columns[k], self.turns[k][:, None, :, None], self.fields[k]
        (_, phases, size), (_, own, wide), waves = by.pieces, column.behind.pieces, column.behind.waves
        angle = np.outer(self.places, wide * phases[0, :, 0] + size * own[0, :, 0])
        right = turn * (column.changed(by) + 1j * angle[:, None, :, None] * column.right)
        moved = waves.down.down(right)
        if 0 in by.matrices:
            moved = moved + by.matrices[0] @ (turn * column.right)
        moved = waves.behind(moved)
        if waves.window is not None and 3 in by.matrices:
            moved = moved + waves.window.changed(self.before[k], by.matrices[3], by.matrices[4])
        found = waves.samples(2 * np.real(fields.conj() * moved).sum(1))
        if 2 in by.matrices:
            light, sampled = _light(fields), by.matrices[2]
            found = found + waves.sampled.right(sampled @ light) + waves.sampled.down(light) @ sampled.T
        return found

    def of_each(self, kernel: np.ndarray) -> Iterator[np.ndarray]:
        """Windows (m, count, count) of the points in a kernel, behind each objective."""
        for one in self.columns:
            cells, N = one.behind.told[0], self._samples
            tiles = kernel[self._inside(cells)].reshape(cells, cells, -1, N, N).transpose(2, 0, 3, 1, 4)
            yield tiles.reshape(-1, cells * N, cells * N)

    def _with(self, images: Sequence[np.ndarray]) -> "ColumnImages":
        """Images with other windows (m, count, count) behind each objective."""
        kernel, N = np.zeros_like(self.kernel), self._samples
        for one, image in zip(self.columns, images, strict=True):
            cells = one.behind.told[0]
            tiles = image.reshape(-1, cells, N, cells, N).transpose(1, 3, 0, 2, 4)
            kernel[self._inside(cells)] += tiles.reshape(cells, cells, -1, N * N)
        return replace(self, kernel=kernel)

    @property
    def _samples(self) -> int:
        """Number of samples along a cell."""
        return self.columns[0].behind.images.layout.sampling.pixels

    def _inside(self, cells: int) -> tuple[slice, slice]:
        """Slices of the kernel in which a window of so many cells stands."""
        first = (len(self.kernel) - cells) // 2
        return slice(first, first + cells), slice(first, first + cells)


@dataclass(eq=False)
class ColumnGradient:
    """Gradient of a number by what images of a cell's points, behind one objective, follow from.

    Without conjugates: what changes is Re of products with changes.
    """

    behind: CellOptics
    parts: WindowParts
    by: list[np.ndarray] = field(default_factory=list)
    _right: np.ndarray = field(default_factory=lambda: np.zeros(()))
    _column: PupilColumn | None = None

    def __post_init__(self) -> None:
        self.by = [np.zeros(one.shape, np.result_type(one, np.float64)) for one in self.behind.pieces]

    def add(self, lit: ColumnImages, k: int, given: np.ndarray) -> None:
        """Add the slopes that follow from those by samples (m, count, count), of light of 1."""
        column, turn, fields, parts = lit.columns[k], lit.turns[k], lit.fields[k], self.parts
        if column is not self._column:
            self.leave()
            self._column, self._right = column, np.zeros(column.right.shape, np.complex128)
        given = given.astype(np.real(fields).dtype)
        across = parts.spread.right(given)
        if parts.resampled:
            parts.add_sampled(given, across, _light(fields))
        by = parts.back(2 * parts.spread.down(across)[:, None] * fields.conj(), lit.before[k])
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
        """Change of the number from one microscope to another close by."""
        self.leave()
        found = self.parts.along(pair, self.behind.images)
        return found + sum(times(by, *ends) for by, ends in zip(self.by, self.behind.ends(pair), strict=True))


def _pieces(images: PupilImages, which: int, told: Sampled) -> Pieces:
    objective, (_, _, nodes, _) = images.objectives[which], told
    size = images.lenslet.pitch / images.lenslet.magnification
    return images.pupil(objective, nodes), images.phases(objective, nodes), np.array(size)


def _light(fields: np.ndarray) -> np.ndarray:
    """Light on the fine grid (m, n, n), of fields (m, modes, n, n)."""
    return np.square(np.abs(fields)).sum(1)
