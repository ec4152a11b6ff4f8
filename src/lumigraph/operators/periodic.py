r"""Incoherent raw images without speckle: the lenslet-periodic operator.

Under incoherent light the intensity on the sensor is linear in the object's, and a lenslet array repeats
itself. Two facts make this a matrix product:

1. For each place s on the sensor, the intensity h(s; x) of an object point x is band-limited in x by the
   main lens, at D/(λz). So an object is represented by points :math:`\delta \le \lambda z/(2D)` apart.
2. In the Fresnel approximation, without the phase exp(iπw²/(λL)) of the lenslet plane (Talanov's lens
   transformation), the camera is telecentric: b becomes b L/(L + b), the sensor is magnified by 1 + b/L
   afterwards, and moving the object point by c z/L moves the intensity by exactly c, a cell of the array.

So only the points of one cell have images of their own (`point_images`). The raw image is a sum over
neighbouring cells of (cells × points) · (points × samples of a cell), each matrix in few factors
(`kernels`); cells at the border of the array have what is missing there subtracted.

M. Broxton et al., Opt. Express 21, 25418 (2013) use the same periodicity in a light-field microscope.
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from os import PathLike
from pathlib import Path
from typing import ClassVar

import numpy as np

from lumigraph.core import arrays, memory
from lumigraph.core.arrays import Array
from lumigraph.core.grid import Grid
from lumigraph.core.linear import Linear, Shape
from lumigraph.core.progress import Progress
from lumigraph.core.progress import part as part_of
from lumigraph.errors import GeometryError, SamplingError
from lumigraph.operators.blocks import Offset, Part
from lumigraph.operators.camera import HasOptics
from lumigraph.operators.cells import HALF_WIDTH, Cells
from lumigraph.operators.kernels import Matrix, matrix
from lumigraph.operators.optics import Optics
from lumigraph.operators.resampling import averaged, represented
from lumigraph.operators.streamed import Streamed
from lumigraph.operators.turning import Crop, Turn, turn_margin

PIECE = 600
"""Cells of the image that are computed at a time."""


@dataclass(frozen=True, slots=True, eq=False)
class Plane:
    """One depth of an object.

    Parameters
    ----------
    matrix
        From the points of the object's cells to the image's.
    spread
        From the object's samples to those points.
    """

    matrix: Matrix | Streamed
    spread: Linear


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class PeriodicOperator(Linear):
    """Raw image of an incoherent object, and the adjoint; see `periodic_operator`.

    Parameters
    ----------
    cells
        Of the lenslet array.
    planes
        One for each depth.
    readout
        From the image's samples to pixels, turned by 180°.
    accuracy
        That it was made for, relative rms.
    """

    cells: Cells
    planes: tuple[Plane, ...]
    readout: Linear
    accuracy: float

    title: ClassVar[str] = "Operator of a camera with lenslets"

    @property
    def shape(self) -> tuple[Shape, Shape]:
        """Pixels (ny, nx) of the raw image, samples (y, x) or (z, y, x) of the object."""
        volume = () if self.depths is None else (len(self.depths),)
        return self.readout.shape[0], (*volume, *self.planes[0].spread.shape[1])

    def _forward(self, intensity: Array) -> Array:
        xp, layers = (
            arrays.namespace(intensity),
            intensity if self.depths is not None else intensity[None, ...],
        )
        rows, columns = self.cells.image
        like = {"dtype": intensity.dtype, "device": intensity.device}
        image = xp.zeros((rows, columns, math.prod(self.cells.samples)), **like)
        for k, plane in enumerate(self.planes):
            points = _by_cell(plane.spread.forward(layers[k, ...]), self.cells.points)
            for part in _pieces(plane.matrix.parts):
                (top, bottom), (first, last) = part.rows, part.columns
                for group in _groups(part, plane.matrix.margin):
                    image[top:bottom, first:last, :] += group.seen(points) @ arrays.like(group.right, image)
            image += plane.matrix.glare.forward(xp.sum(points, axis=2))
        return self.readout.forward(_as_plane(image, self.cells.samples))

    def _adjoint(self, raw: Array) -> Array:
        xp = arrays.namespace(raw)
        image = _by_cell(self.readout.adjoint(raw), self.cells.samples)
        layers = [self._returned(plane, image) for plane in self.planes]
        return layers[0] if self.depths is None else xp.stack(layers, axis=0)

    def _returned(self, plane: Plane, image: Array) -> Array:
        xp, margin = arrays.namespace(image), plane.matrix.margin
        shape = [n + 2 * m for n, m in zip(self.cells.image, margin, strict=True)]
        size = (*shape, math.prod(self.cells.points))
        points = xp.zeros(size, dtype=image.dtype, device=image.device)
        for part in _pieces(plane.matrix.parts):
            mine = image[part.rows[0] : part.rows[1], part.columns[0] : part.columns[1], :]
            for group in _groups(part, margin):
                group.return_to(points, mine @ xp.matrix_transpose(arrays.like(group.right, image)))
        points += xp.expand_dims(plane.matrix.glare.adjoint(image), axis=2)
        return plane.spread.adjoint(_as_plane(points, self.cells.points))

    @property
    def memory_bytes(self) -> float:
        """Memory that `forward` and `adjoint` of a single-precision image take, with the matrices [bytes]."""
        cells = math.prod(self.cells.image) * math.prod(self.cells.samples)
        pixels = math.prod(self.shape[0])
        kept = sum(plane.matrix.nbytes for plane in self.planes)
        return kept + 4 * (4 * cells + math.sqrt(cells * pixels) + pixels)

    @property
    def error(self) -> float:
        """The accuracy that was asked for."""
        return self.accuracy


def _pieces(parts: Iterable[Part]) -> Iterator[Part]:
    """The parts, those of many cells in rows that stay in the processor's cache."""
    for part in parts:
        (top, bottom), (first, last) = part.rows, part.columns
        step = max(1, PIECE // (last - first))
        for row in range(top, bottom, step):
            yield replace(part, rows=(row, min(row + step, bottom)))


def _groups(part: Part, margin: tuple[int, int]) -> "Iterator[_Group]":
    """The part's offsets, row by row."""
    start = 0
    for dy, offsets in groupby(part.offsets, key=lambda offset: offset[0]):
        across = tuple((dx, rank) for _, dx, rank in offsets)
        ranks = slice(start, start + sum(rank for _, rank in across))
        start = ranks.stop
        rows = slice(part.rows[0] + margin[0] + dy, part.rows[1] + margin[0] + dy)
        columns = part.columns[0] + margin[1], part.columns[1] + margin[1]
        left = None if part.left is None else part.left[:, ranks]
        yield _Group(rows, columns, across, left, part.right[ranks])


@dataclass(frozen=True, slots=True, eq=False)
class _Group:
    """Offsets of one part in one row: (dx, rank) for each, and the columns that dx = 0 takes."""

    rows: slice
    columns: tuple[int, int]
    across: tuple[tuple[int, int], ...]
    left: np.ndarray | None
    right: np.ndarray

    def _span(self) -> slice:
        return slice(self.columns[0] + self.across[0][0], self.columns[1] + self.across[-1][0])

    def _places(self) -> Iterator[tuple[slice, slice]]:
        """Columns of cells within the span, and of factors, of each offset."""
        start, width = 0, self.columns[1] - self.columns[0]
        for dx, rank in self.across:
            shift = dx - self.across[0][0]
            yield slice(shift, shift + width), slice(start, start + rank)
            start += rank

    def seen(self, points: Array) -> Array:
        """Points (rows, columns, points) through the left factors: (rows, columns, ranks)."""
        xp = arrays.namespace(points)
        wide = points[self.rows, self._span(), :]
        if self.left is None:
            return wide
        wide = wide @ arrays.like(self.left, points)
        return xp.concat([wide[:, cells, ranks] for cells, ranks in self._places()], axis=2)

    def return_to(self, points: Array, seen: Array) -> None:
        """The transpose of `seen`, added to points."""
        xp = arrays.namespace(seen)
        span = self._span()
        if self.left is None:
            points[self.rows, span, :] += seen
            return
        shape = (seen.shape[0], span.stop - span.start, seen.shape[2])
        wide = xp.zeros(shape, dtype=seen.dtype, device=seen.device)
        for cells, ranks in self._places():
            wide[:, cells, ranks] = seen[:, :, ranks]
        points[self.rows, span, :] += wide @ xp.matrix_transpose(arrays.like(self.left, seen))


def periodic_operator(
    camera: HasOptics,
    grid: Grid,
    dz: float | Sequence[float] = 0.0,
    *,
    accuracy: float = 1e-3,
    folder: str | PathLike[str] | None = None,
    progress: Progress | None = None,
) -> PeriodicOperator:
    """Operator from planes sampled on `grid` to the raw image of a camera with lenslets.

    What it takes to compute is kept, in memory and on disk (see `store`), for the same camera and
    depth, whatever the grid and the sensor.

    Parameters
    ----------
    camera
        With any lenslet array.
    grid
        Samples of the object, all depths.
    dz
        Depth of the plane from the focused one [m], positive farther; or several, for a volume (z, y, x).
    accuracy
        Relative rms error of the raw image, 1e-2 to 1e-5, of objects inside the array's field; near its
        border the error may be three times as large.
    folder
        Keeps what is computed; None for the user's cache folder.
    progress
        Called as ``progress(fraction)``.

    Raises
    ------
    GeometryError
        A camera without lenslets, or no depth.
    SamplingError
        An accuracy out of range, or matrices that do not fit in memory.

    Examples
    --------
    ``periodic_operator(camera, camera.object_grid).forward(picture)``
    """
    depths = tuple(float(d) for d in np.ravel(np.asarray(dz, np.float64)))
    plain, planes, optics = camera.optics(), [], None
    for k, depth in enumerate(depths):
        optics = Optics.of(plain, plain.object_distance + depth, accuracy)
        report = part_of(progress, k, len(depths))
        planes.append(_plane(optics, matrix(optics, report, None if folder is None else Path(folder)), grid))
        report(1.0)
    if optics is None:
        raise GeometryError("dz is empty. Give at least one depth.")
    several = depths if np.ndim(dz) else None
    operator = PeriodicOperator(
        optics.cells, tuple(planes), readout(optics), accuracy, object_grid=grid, depths=several
    )
    memory.require(
        operator.memory_bytes, "the raw image", "Use fewer lenslets, or larger pixels.", SamplingError
    )
    return operator


def _plane(optics: Optics, matrix: Matrix | Streamed, grid: Grid) -> Plane:
    """The spread of an object's samples onto the points of the cells, turned with the array."""
    cells, camera = optics.cells, optics.camera
    ring = (cells.ring[0] + matrix.margin[0], cells.ring[1] + matrix.margin[1])
    scale = -optics.distance / camera.separation
    if not optics.rotation:
        return Plane(matrix, represented(grid, cells.grid(cells.points, scale, ring), HALF_WIDTH))
    wide = _widened(cells.grid(cells.points, 1.0, ring), optics)
    turn = Turn(cells.grid(cells.points, 1.0, wide), optics.rotation)
    spread = represented(grid, cells.grid(cells.points, scale, wide), HALF_WIDTH)
    return Plane(matrix, _cropped(turn.grid, wide, ring, cells.points) @ turn @ spread)


def readout(optics: Optics) -> Linear:
    """Means over the pixels of the image's samples, turned back."""
    cells, pixels = optics.cells, optics.camera.sensor.grid
    if not optics.rotation:
        return averaged(cells.grid(cells.samples, optics.image_scale, cells.ring), pixels)
    wide = _widened(cells.grid(cells.samples, 1.0, cells.ring), optics)
    turn = Turn(cells.grid(cells.samples, 1.0, wide), -optics.rotation)
    mean = averaged(cells.grid(cells.samples, optics.image_scale, wide), pixels)
    return mean @ turn @ _cropped(turn.grid, wide, cells.ring, cells.samples).T


def _cropped(plane: Grid, wide: Offset, ring: Offset, per_cell: Offset) -> Crop:
    """From cells in a wide ring to those in a narrower one."""
    y, x = ((w - r) * n for w, r, n in zip(wide, ring, per_cell, strict=True))
    return Crop(plane.shape, (y, x))


def _widened(grid: Grid, optics: Optics) -> tuple[int, int]:
    """Cells around the array that hold the grid's plane when it is turned."""
    size, cells = grid.size, optics.cells
    extra = turn_margin((size[0], size[1]), optics.rotation)
    wide = []
    for k in (0, 1):
        ring = (grid.size[k] / cells.size[k] - cells.count[k]) / 2
        wide.append(math.ceil(ring + extra[k] / cells.size[k]))
    return wide[0], wide[1]


def _by_cell(plane: Array, per_cell: tuple[int, int]) -> Array:
    """(rows ky, columns kx) to (rows, columns, ky kx)."""
    tiles = arrays.tiled(plane, per_cell)
    return arrays.namespace(plane).reshape(tiles, (*tiles.shape[:2], math.prod(per_cell)))


def _as_plane(cells: Array, per_cell: tuple[int, int]) -> Array:
    """(rows, columns, ky kx) to (rows ky, columns kx): the inverse of `_by_cell`."""
    return arrays.untiled(arrays.namespace(cells).reshape(cells, (*cells.shape[:2], *per_cell)))
