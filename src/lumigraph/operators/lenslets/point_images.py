"""Images of the points of a cell of a lenslet array: what the lenslet-periodic operator repeats."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from lumigraph.operators.lenslets.point_light import point_light
from lumigraph.operators.sampling.camera import CameraOptics
from lumigraph.operators.sampling.cell_axis import STEP, CellAxis

Line = Callable[[int], np.ndarray]
"""Blocks (points, samples) of the cells of one row, by their column."""


@dataclass(frozen=True, slots=True, eq=False)
class LensletPlaneWave:
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

    def dimmed(self, factor: float) -> "LensletPlaneWave":
        """The amplitude divided by a factor."""
        return LensletPlaneWave(self.data / np.float32(factor), self.first)

    @property
    def even(self) -> tuple[bool, bool]:
        """Whether it is the same in a mirror, up and down, and left and right."""
        middle = [-f for f in self.first]
        span = [min(m, n - 1 - m) for m, n in zip(middle, self.data.shape, strict=True)]
        core = self.data[middle[0] - span[0] : middle[0] + span[0] + 1]
        core = core[:, middle[1] - span[1] : middle[1] + span[1] + 1]
        tolerance = 1e-5 * float(np.abs(core).max())
        y, x = (bool(np.abs(core - np.flip(core, axis)).max() < tolerance) for axis in (0, 1))
        return y, x


def wave(
    camera: CameraOptics,
    distance: float,
    axes: tuple[CellAxis, CellAxis],
    reach: Sequence[int],
    place: tuple[float, float] = (0.0, 0.0),
) -> LensletPlaneWave:
    """Of a point on the axis or imaged at a place, without the phase exp(iπw²/(λL)).

    It is wide enough for cells `reach` away.
    """
    multiples = []
    for axis, cells in zip(axes, reach, strict=True):
        n = axis.margin + (cells + 1) * axis.points + STEP
        multiples.append(np.arange(-n, n + 1))
    pitch = [axis.size / axis.points for axis in axes]
    y, x = (m * step for m, step in zip(multiples, pitch, strict=True))
    data = point_light(camera, distance, math.hypot(y[-1], x[-1]), place).at(y, x)
    data *= np.sqrt(np.prod(pitch))
    return LensletPlaneWave(data.astype(np.complex64), (int(multiples[0][0]), int(multiples[1][0])))


@dataclass(frozen=True, slots=True, eq=False)
class IlluminatedCells:
    """Light behind what square lenslets do along x, for the points of a range of cells.

    Parameters
    ----------
    rows
        Even and odd rows of the wave, each (terms, n, points along x, samples along x).
    first
        Multiple of the points' pitch of the wave's first row.
    columns
        Cells to which the points belong, counted from the image's.
    """

    rows: tuple[np.ndarray, np.ndarray]
    first: int
    columns: range


def lit(light: LensletPlaneWave, across: np.ndarray, axis: CellAxis, columns: range) -> IlluminatedCells:
    """All rows of a wave through `across` (terms, samples, window), of points in cells of `columns`."""
    points = np.arange(columns.start * axis.points, columns.stop * axis.points)
    rows = [through(light, term, axis, points) for term in across]
    even, odd = (np.stack([term[k::STEP] for term in rows]) for k in range(STEP))
    return IlluminatedCells((even, odd), light.first[0], columns)


def through(light: LensletPlaneWave, across: np.ndarray, axis: CellAxis, points: np.ndarray) -> np.ndarray:
    """All rows of a wave, windows along x around the cell's image of each point, through (k, window)."""
    windows = sliding_window_view(light.data, STEP * across.shape[1] - 1, axis=1)[..., ::STEP]
    return windows[:, -axis.margin - points - light.first[1]] @ across.astype(np.complex64).T


@dataclass(frozen=True, slots=True, eq=False)
class SquareLensletImages:
    """Images of points behind square lenslets, whose two axes are apart.

    Parameters
    ----------
    lit
        Light behind what they do along x.
    down
        (terms, samples, window) along y.
    axes
        Of the cells.
    """

    lit: IlluminatedCells
    down: np.ndarray
    axes: tuple[CellAxis, CellAxis]

    def line(self, dy: int) -> "Line":
        """Intensity (points, samples) in a cell of the points of the cell (dy, dx), as a function of dx."""
        return lambda dx: self._block(dy, dx)

    def _block(self, dy: int, dx: int) -> np.ndarray:
        y, x = self.axes
        down, start = self.down.astype(np.complex64), (dx - self.lit.columns[0]) * x.points
        result = np.empty((y.points, x.points, y.samples, x.samples), np.float32)
        for k, image in enumerate(result):
            top = -y.margin - (dy * y.points + k) - self.lit.first
            rows = self.lit.rows[top % STEP][:, top // STEP :, start : start + x.points]
            first, *others = rows[:, : down.shape[2]].transpose(0, 2, 1, 3)
            field = down[0] @ first
            for term, seen in zip(down[1:], others, strict=True):
                field += term @ seen
            intensity(field, image)
        return result.reshape(y.points * x.points, -1)


def intensity(field: np.ndarray, out: np.ndarray) -> None:
    """Squared modulus of a field (..., samples), complex64, which is overwritten."""
    parts = field.view(np.float32)
    parts *= parts
    np.add(parts[..., ::2], parts[..., 1::2], out=out)


def mirrored(factor: np.ndarray, shape: tuple[int, int], up: bool, left: bool) -> np.ndarray:
    """Rows (shape[0] shape[1], r) of a plane turned over, up and down or left and right."""
    plane = factor.reshape(*shape, -1)
    return plane[:: -1 if up else 1, :: -1 if left else 1].reshape(factor.shape)
