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

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import groupby

import numpy as np

from lumigraph.core import arrays
from lumigraph.core.arrays import Array
from lumigraph.core.grid import Grid
from lumigraph.sensor import Sensor
from lumigraph.simulation.camera import Camera
from lumigraph.simulation.cells import Cells
from lumigraph.simulation.glare import Glare
from lumigraph.simulation.kernels import Optics, Part, parts
from lumigraph.simulation.resampling import Resampling, averaged, represented


@dataclass(frozen=True, slots=True, eq=False)
class PeriodicOperator:
    """Raw image of an incoherent plane at one depth, and its adjoint.

    Parameters
    ----------
    cells
        Of the lenslet array.
    parts
        Of the matrix between an object's cells and an image's.
    glare
        The rest of that matrix: faint, and far from the diagonal.
    object_grid
        Samples of the object.
    sensor
        Pixels.
    """

    cells: Cells
    parts: tuple[Part, ...]
    glare: Glare
    object_grid: Grid
    sensor: Sensor
    spread: Resampling
    readout: Resampling

    @property
    def shape(self) -> tuple[tuple[int, int], tuple[int, int]]:
        """Pixels (ny, nx) of the raw image, samples (y, x) of the object."""
        return self.sensor.shape, self.object_grid.shape

    def forward(self, intensity: Array) -> Array:
        """Raw image (ny, nx), turned by 180°, of an object's intensity (y, x) on `object_grid`."""
        xp = arrays.namespace(intensity)
        points = _by_cell(self.spread.forward(intensity), self.cells.points)
        rows, columns = (n + 2 for n in self.cells.count)
        image = xp.zeros((rows, columns, int(np.prod(self.cells.samples))), dtype=points.dtype, device=points.device)
        for part in self.parts:
            (top, bottom), (first, last) = part.rows, part.columns
            for group in self._groups(part):
                seen = group.seen(points)
                image[top:bottom, first:last, :] += seen @ arrays.like(group.right, intensity)
        image += self.glare.forward(xp.sum(points, axis=2))
        return self.readout.forward(_as_plane(image, self.cells.samples))

    def adjoint(self, raw: Array) -> Array:
        """Transpose of `forward`: (y, x) on `object_grid` from a raw image (ny, nx)."""
        xp = arrays.namespace(raw)
        image = _by_cell(self.readout.adjoint(raw), self.cells.samples)
        margin, count = margin_of(self.parts), self.cells.count
        shape = (*(n + 2 + 2 * m for n, m in zip(count, margin, strict=True)), int(np.prod(self.cells.points)))
        points = xp.zeros(shape, dtype=raw.dtype, device=raw.device)
        for part in self.parts:
            mine = image[part.rows[0] : part.rows[1], part.columns[0] : part.columns[1], :]
            for group in self._groups(part):
                group.return_to(points, mine @ xp.matrix_transpose(arrays.like(group.right, raw)))
        points += xp.expand_dims(self.glare.adjoint(image), axis=2)
        return self.spread.adjoint(_as_plane(points, self.cells.points))

    def psf(self, index: tuple[int, int]) -> np.ndarray:
        """Raw image (ny, nx), float32, of one object sample (iy, ix) of intensity 1."""
        point = np.zeros(self.object_grid.shape, np.float32)
        point[index] = 1
        return self.forward(point)

    def _groups(self, part: Part) -> "Iterator[_Group]":
        margin, start = margin_of(self.parts), 0
        for dy, offsets in groupby(part.offsets, key=lambda offset: offset[0]):
            across = tuple((dx, rank) for _, dx, rank in offsets)
            ranks = slice(start, start + sum(rank for _, rank in across))
            start = ranks.stop
            rows = slice(part.rows[0] + margin[0] + dy, part.rows[1] + margin[0] + dy)
            first, last = part.columns[0] + margin[1], part.columns[1] + margin[1]
            yield _Group(rows, (first, last), across, part.left[:, ranks], part.right[ranks])


@dataclass(frozen=True, slots=True, eq=False)
class _Group:
    """Offsets of one part in one row: (dx, rank) for each, and the columns that dx = 0 takes."""

    rows: slice
    columns: tuple[int, int]
    across: tuple[tuple[int, int], ...]
    left: np.ndarray
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
        wide = points[self.rows, self._span(), :] @ arrays.like(self.left, points)
        return xp.concat([wide[:, cells, ranks] for cells, ranks in self._places()], axis=2)

    def return_to(self, points: Array, seen: Array) -> None:
        """The transpose of `seen`, added to points."""
        xp = arrays.namespace(seen)
        span = self._span()
        shape = (seen.shape[0], span.stop - span.start, seen.shape[2])
        wide = xp.zeros(shape, dtype=seen.dtype, device=seen.device)
        for cells, ranks in self._places():
            wide[:, cells, ranks] = seen[:, :, ranks]
        points[self.rows, span, :] += wide @ xp.matrix_transpose(arrays.like(self.left, seen))


def periodic_operator(
    camera: Camera, grid: Grid, dz: float = 0.0, *, accuracy: float = 1e-3
) -> PeriodicOperator:
    optics = Optics.of(camera, camera.object_distance + dz, accuracy)
    return assembled(optics, *parts(optics), grid)


def assembled(optics: Optics, matrix: tuple[Part, ...], glare: Glare, grid: Grid) -> PeriodicOperator:
    cells, camera = optics.cells, optics.camera
    ring = tuple(1 + m for m in margin_of(matrix))
    scale = -optics.distance / camera.separation
    points = cells.grid(cells.points, scale, (ring[0], ring[1]))
    plane = cells.grid(cells.samples, optics.image_scale, (1, 1))
    return PeriodicOperator(
        cells, matrix, glare, grid, camera.sensor, represented(grid, points, True), averaged(plane, camera.sensor.grid)
    )


def margin_of(matrix: tuple[Part, ...]) -> tuple[int, int]:
    """Cells beyond the ring around the array whose points reach into it."""
    offsets = [offset for part in matrix for offset in part.offsets]
    return max(abs(dy) for dy, _, _ in offsets), max(abs(dx) for _, dx, _ in offsets)


def _by_cell(plane: Array, per_cell: tuple[int, int]) -> Array:
    """(rows ky, columns kx) to (rows, columns, ky kx)."""
    xp, (ky, kx) = arrays.namespace(plane), per_cell
    rows, columns = plane.shape[0] // ky, plane.shape[1] // kx
    cells = xp.permute_dims(xp.reshape(plane, (rows, ky, columns, kx)), (0, 2, 1, 3))
    return xp.reshape(cells, (rows, columns, ky * kx))


def _as_plane(cells: Array, per_cell: tuple[int, int]) -> Array:
    """(rows, columns, ky kx) to (rows ky, columns kx): the inverse of `_by_cell`."""
    xp, (ky, kx) = arrays.namespace(cells), per_cell
    rows, columns = cells.shape[:2]
    plane = xp.permute_dims(xp.reshape(cells, (rows, columns, ky, kx)), (0, 2, 1, 3))
    return xp.reshape(plane, (rows * ky, columns * kx))
