"""Images of the points of a cell of a lenslet array: what the lenslet-periodic operator repeats."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.lib.stride_tricks import sliding_window_view

from lumigraph.operators.camera import CameraOptics
from lumigraph.operators.cell_response import STEP, Axis, Response
from lumigraph.operators.point_light import point_light

_BLOCK = 2**21
"""Numbers worked on at a time."""

Line = Callable[[int], np.ndarray]
"""Blocks (points, samples) of the cells of one row, by their column."""


@dataclass(frozen=True, slots=True, eq=False)
class Wave:
    """Amplitude of a point's light in the lenslet plane, at whole multiples of the points' pitch.

    Parameters
    ----------
    data
        (y, x), complex64, for light of 1 in all at that pitch.
    first
        Multiples (y, x) of the first sample.
    """

    data: np.ndarray
    first: tuple[int, int]

    def dimmed(self, factor: float) -> "Wave":
        """The amplitude divided by a factor."""
        return Wave(self.data / np.float32(factor), self.first)

    @property
    def even(self) -> bool:
        """Whether it is the same in a mirror, left and right and up and down."""
        middle = [-f for f in self.first]
        span = [min(m, n - 1 - m) for m, n in zip(middle, self.data.shape, strict=True)]
        core = self.data[middle[0] - span[0] : middle[0] + span[0] + 1]
        core = core[:, middle[1] - span[1] : middle[1] + span[1] + 1]
        tolerance = 1e-5 * float(np.abs(core).max())
        return all(np.abs(core - np.flip(core, axis)).max() < tolerance for axis in (0, 1))


def wave(camera: CameraOptics, distance: float, axes: tuple[Axis, Axis], reach: Sequence[int]) -> Wave:
    """Of a point on the axis, without the phase exp(iπw²/(λL)), wide enough for cells `reach` away."""
    multiples = []
    for axis, cells in zip(axes, reach, strict=True):
        n = axis.margin + (cells + 1) * axis.points + STEP
        multiples.append(np.arange(-n, n + 1))
    pitch = [axis.size / axis.points for axis in axes]
    y, x = (m * step for m, step in zip(multiples, pitch, strict=True))
    data = point_light(camera, distance, math.hypot(y[-1], x[-1])).at(y, x)
    data *= np.sqrt(np.prod(pitch))
    return Wave(data.astype(np.complex64), (int(multiples[0][0]), int(multiples[1][0])))


@dataclass(frozen=True, slots=True, eq=False)
class Lit:
    """Light behind what square lenslets do along x, for the points of a range of cells.

    Parameters
    ----------
    rows
        Even and odd rows of the wave, each (n, points along x, samples along x).
    first
        Multiple of the points' pitch of the wave's first row.
    columns
        Cells to which the points belong, counted from the image's.
    """

    rows: tuple[np.ndarray, np.ndarray]
    first: int
    columns: range


def lit(light: Wave, across: np.ndarray, axis: Axis, columns: range) -> Lit:
    """All rows of a wave through `across` (samples, window), of points in cells of `columns`."""
    points = np.arange(columns.start * axis.points, columns.stop * axis.points)
    rows = _through(light, across, axis, points)
    return Lit((rows[::STEP].copy(), rows[1::STEP].copy()), light.first[0], columns)


def _through(light: Wave, across: np.ndarray, axis: Axis, points: np.ndarray) -> np.ndarray:
    """All rows of a wave, windows along x around the cell's image of each point, through (k, window)."""
    windows = sliding_window_view(light.data, STEP * across.shape[1] - 1, axis=1)[..., ::STEP]
    return windows[:, -axis.margin - points - light.first[1]] @ across.astype(np.complex64).T


@dataclass(frozen=True, slots=True, eq=False)
class Apart:
    """Images of points behind square lenslets, whose two axes are apart.

    Parameters
    ----------
    lit
        Light behind what they do along x.
    down
        (samples, window) along y.
    axes
        Of the cells.
    """

    lit: Lit
    down: np.ndarray
    axes: tuple[Axis, Axis]

    def line(self, dy: int) -> "Line":
        """Intensity (points, samples) in a cell of the points of the cell (dy, dx), as a function of dx."""
        return lambda dx: self._block(dy, dx)

    def _block(self, dy: int, dx: int) -> np.ndarray:
        y, x = self.axes
        down, start = self.down.astype(np.complex64), (dx - self.lit.columns[0]) * x.points
        result = np.empty((y.points, x.points, y.samples, x.samples), np.float32)
        for k, image in enumerate(result):
            top = -y.margin - (dy * y.points + k) - self.lit.first
            rows = self.lit.rows[top % STEP][top // STEP :, start : start + x.points]
            _intensity(down @ rows[: down.shape[1]].transpose(1, 0, 2), image)
        return result.reshape(y.points * x.points, -1)


def _intensity(field: np.ndarray, out: np.ndarray) -> None:
    """Squared modulus of a field (..., samples), complex64, which is overwritten."""
    parts = field.view(np.float32)
    parts *= parts
    np.add(parts[..., ::2], parts[..., 1::2], out=out)


@dataclass(frozen=True, slots=True, eq=False)
class Few:
    """Images of points behind lenslets of any shape, from the fields of few of the points.

    A field is band-limited in the point's place too, so that those of some points give those of all.

    Parameters
    ----------
    fields
        (few along y, few along x, samples).
    down, across
        (points, few) along y and x, for the points of all cells.
    reach
        Cells (y, x) on each side.
    staggered
        Whether odd rows of cells stand half a cell towards larger x.
    """

    fields: np.ndarray
    down: np.ndarray
    across: np.ndarray
    reach: tuple[int, int]
    staggered: bool = False

    def line(self, dy: int) -> "Line":
        """As `Apart.line`."""
        y, x = (len(m) // (2 * r + 1) for m, r in zip((self.down, self.across), self.reach, strict=True))
        parts, samples = self.fields.view(np.float32), self.fields.shape[2]
        down = self.down[(dy + self.reach[0]) * y :][:y]
        rows = (down @ parts.reshape(len(parts), -1)).reshape(y, *parts.shape[1:])
        first = self.reach[1] * x + (dy % 2 * x // 2 if self.staggered else 0)

        def block(dx: int) -> np.ndarray:
            across = self.across[first + dx * x :][:x]
            result = np.empty((y, x, samples), np.float32)
            for row, image in zip(rows, result, strict=True):
                _intensity((across @ row).view(np.complex64), image)
            return result.reshape(y * x, samples)

        return block


def few(
    light: Wave, lenslets: Response, axes: tuple[Axis, Axis], reach: tuple[int, int], staggered: bool = False
) -> Few:
    """For the points of all cells up to `reach` away."""
    assert lenslets.core is not None
    (y, x), core = axes, lenslets.core.T
    down = lenslets.down.astype(np.complex64)
    (rows, along_y), (columns, along_x) = (
        _skeleton(axis, cells) for axis, cells in zip(axes, reach, strict=True)
    )
    behind = _through(light, lenslets.across, x, columns)
    fields = np.empty((len(rows), len(columns), core.shape[1]), np.complex64)
    for field, row in zip(fields, rows, strict=True):
        top = -y.margin - row - light.first[0]
        part = behind[top : top + STEP * down.shape[1] : STEP].reshape(down.shape[1], -1)
        part = (down @ part).reshape(len(down), len(columns), -1).transpose(1, 0, 2)
        field[:] = part.reshape(len(columns), -1) @ core
    return Few(fields, along_y, along_x, reach, staggered)


def _skeleton(axis: Axis, reach: int) -> tuple[np.ndarray, np.ndarray]:
    """Numbers of few points of `reach` cells on each side, and the matrix (points, few) from them to all.

    Discrete prolate sequences hold what the band lets through; rows of theirs that are far from dependent
    are found by a pivoted QR decomposition.
    """
    points = np.arange(-reach * axis.points, (reach + 1) * axis.points)
    at = points * (axis.size / axis.points)
    strength, vectors = np.linalg.eigh(np.sinc(2 * axis.band * (at[:, None] - at)))
    basis = vectors[:, strength > 1e-10 * strength[-1]]
    chosen = np.asarray(scipy.linalg.qr(basis.T, mode="r", pivoting=True)[-1])
    chosen = np.sort(chosen[: basis.shape[1]])
    matrix = np.linalg.solve(basis[chosen].T, basis.T).T
    return points[chosen], matrix.astype(np.float32)


def mirrored(factor: np.ndarray, shape: tuple[int, int], up: bool, left: bool) -> np.ndarray:
    """Rows (shape[0] shape[1], r) of a plane turned over, up and down or left and right."""
    plane = factor.reshape(*shape, -1)
    return plane[:: -1 if up else 1, :: -1 if left else 1].reshape(factor.shape)


def factors(block: np.ndarray, least: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """``block ≈ left @ right``, (points, r) and (r, samples), and their strengths above `least`.

    Most blocks have few: a sketch of a fifth of the points finds them, or finds that it needs them all.
    """
    points = block.shape[0]
    if np.linalg.norm(block) <= least:
        return np.zeros((points, 0)), np.zeros((0, block.shape[1])), np.zeros(0)
    sketch = np.random.default_rng(0).standard_normal((points, math.ceil(points / 5)), np.float32)
    for basis in (np.linalg.qr(block @ (block.T @ sketch))[0], None):
        seen = block if basis is None else basis.T @ block
        strength, vectors = np.linalg.eigh(_products(seen))
        strength = np.sqrt(np.maximum(strength, 0))
        if strength[0] < least / 2:
            break
    kept = strength > least
    left = vectors[:, kept].astype(np.float32)
    return left if basis is None else basis @ left, left.T @ seen, strength[kept]


def _products(rows: np.ndarray) -> np.ndarray:
    """``rows @ rows.T`` in double precision, from some columns at a time."""
    parts = np.array_split(rows, math.ceil(rows.size / _BLOCK), axis=1)
    return np.sum([part @ part.T for part in (p.astype(np.float64) for p in parts)], axis=0)
