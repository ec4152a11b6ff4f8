r"""Incoherent raw images without speckle: the lenslet-periodic operator.

Under incoherent light the intensity on the sensor is linear in the object's, and a lenslet array repeats
itself. Two facts make this a matrix product:

1. For each place s on the sensor, the intensity h(s; x) of an object point x is band-limited in x by the
   main lens, at D/(λz). So an object is represented by points :math:`\delta \le \lambda z/(2D)` apart.
2. In the Fresnel approximation, without the phase exp(iπw²/(λL)) of the lenslet plane (Talanov's lens
   transformation), the camera is telecentric: b becomes b L/(L + b), the sensor is magnified by 1 + b/L
   afterwards, and moving the object point by c z/L moves the intensity by exactly c, a cell of the array.

So only the points of one cell have images of their own. With n points along each side of a cell, the
raw image is a sum over neighbouring cells of (cells × n²) · (n² × samples of a cell): one matrix product
for each offset between an object's cell and an image's.

The array is taken to continue beyond its border, and the image cut off there: what the outermost
lenslets receive includes the little that lenslets beyond them would diffract into them.

M. Broxton et al., Opt. Express 21, 25418 (2013) use the same periodicity in a light-field microscope.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.special import i0

from lumigraph.core import arrays, coverage, memory
from lumigraph.core.arrays import Array
from lumigraph.core.cache import ByteCache
from lumigraph.core.grid import Grid
from lumigraph.errors import SamplingError
from lumigraph.sensor import Sensor, integrate, integrate_adjoint
from lumigraph.simulation.camera import Camera
from lumigraph.simulation.point_images import (
    Cells,
    cells_of,
    fits,
    lenslet_array,
    lenslet_distance,
    point_images,
    reach_of,
    size_of,
)

KERNEL = 10
"""Half width [points] of that kernel: a Kaiser-windowed sinc, exact to 1e-5 at this oversampling."""

KAISER_BETA = 10.5
"""Of the kernel's window: 104 dB."""

FAINT = 1e-3
"""Part of the light in the faintest offsets between cells, which are left out."""


_KERNELS = ByteCache(limit=2**30)


@dataclass(frozen=True, slots=True, eq=False)
class PeriodicOperator:
    """Raw image of an incoherent plane at one depth, and its adjoint.

    Parameters
    ----------
    cells
        Of the lenslet array.
    kernels
        Images of a cell's points (T, T, ny nx, my mx), float32: [dy, dx] is the image in the cell that
        stands (dy, dx) - T // 2 from the points' own; ny nx points, my mx samples.
    offsets
        Those [dy, dx] that carry light worth the while.
    object_grid
        Samples of the object.
    object_scale
        Position of a point's image on the lenslets over its own: -L/z.
    image_scale
        Magnification of the sensor's plane, 1 + b/L.
    sensor
        Pixels.
    """

    cells: Cells
    kernels: Array
    offsets: tuple[tuple[int, int], ...]
    object_grid: Grid
    object_scale: float
    image_scale: float
    sensor: Sensor

    @property
    def shape(self) -> tuple[tuple[int, int], tuple[int, int]]:
        """Pixels (ny, nx) of the raw image, samples (y, x) of the object."""
        return self.sensor.shape, self.object_grid.shape

    def forward(self, intensity: Array) -> Array:
        """Raw image (ny, nx), turned by 180°, of an object's intensity (y, x) on `object_grid`."""
        xp, (spread_y, spread_x) = arrays.namespace(intensity), self._spread(intensity)
        points = _by_cell(spread_y @ intensity @ xp.matrix_transpose(spread_x), self.cells.points)
        kernels = arrays.like(self.kernels, intensity)
        rows, columns = (n + 2 for n in self.cells.count)
        image = 0.0
        for dy, dx, (down, across) in self._offsets():
            part = xp.reshape(points[down, across, ...], (rows * columns, -1))
            image = image + part @ kernels[dy, dx, ...]
        plane = _as_plane(xp.reshape(image, (rows, columns, -1)), self.cells.samples)
        pixels = integrate(plane, self._image_grid, self.sensor)
        return pixels * arrays.like(self._lit, intensity)

    def adjoint(self, raw: Array) -> Array:
        """Transpose of `forward`: (y, x) on `object_grid` from a raw image (ny, nx)."""
        xp, (spread_y, spread_x) = arrays.namespace(raw), self._spread(raw)
        plane = integrate_adjoint(raw * arrays.like(self._lit, raw), self._image_grid, self.sensor)
        image = _by_cell(plane, self.cells.samples)
        rows, columns = image.shape[:2]
        flat, kernels = xp.reshape(image, (rows * columns, -1)), arrays.like(self.kernels, raw)
        margin = 2 * self._reach
        points = 0.0
        for dy, dx, _ in self._offsets():
            part = xp.reshape(flat @ xp.matrix_transpose(kernels[dy, dx, ...]), (rows, columns, -1))
            points = points + _surrounded(part, (margin - dy, dy), (margin - dx, dx))
        plane = _as_plane(points, self.cells.points)
        return xp.matrix_transpose(spread_y) @ plane @ spread_x

    @property
    def _reach(self) -> int:
        """How many cells off an image still falls."""
        return self.kernels.shape[0] // 2

    def _offsets(self) -> Iterator[tuple[int, int, tuple[slice, slice]]]:
        """Offsets (dy, dx) of the kernels, and the points' cells that they carry to the image's cells."""
        margin, (rows, columns) = 2 * self._reach, (n + 2 for n in self.cells.count)
        for dy, dx in self.offsets:
            top, left = margin - dy, margin - dx
            yield dy, dx, (slice(top, top + rows), slice(left, left + columns))

    def _spread(self, array: Array) -> tuple[Array, Array]:
        """Matrices that represent an object's samples by the points of the cells, along y and along x."""
        points = self.cells.grid(self.cells.points, 1 / self.object_scale, self._reach + 1)
        matrices = []
        for axis in (0, 1):
            at = _descending(points, axis)  # object_scale is below 0: the main lens turns the picture
            off = (at[:, None] - (self.object_grid.y, self.object_grid.x)[axis]) / points.pitch[axis]
            matrix = kernel(off) * (self.object_grid.pitch[axis] / points.pitch[axis])
            matrices.append(arrays.like(matrix, array))
        return matrices[0], matrices[1]

    @property
    def _image_grid(self) -> Grid:
        return self.cells.grid(self.cells.samples, self.image_scale, 1)

    @property
    def _lit(self) -> np.ndarray:
        """Part of each pixel (ny, nx) that the array covers."""
        along, pixels = [], self.sensor.grid
        for axis in (0, 1):
            half = self.cells.extent[axis] / 2 * self.image_scale
            along.append(coverage.interval((pixels.y, pixels.x)[axis], pixels.pitch[axis], -half, half))
        return np.outer(*along)


def kernel(offset: np.ndarray) -> np.ndarray:
    """Interpolation kernel at offsets [points]: a sinc in a Kaiser window of half width `KERNEL`."""
    inside = np.clip(1 - (offset / KERNEL) ** 2, 0, None)
    window = np.where(np.abs(offset) <= KERNEL, i0(KAISER_BETA * np.sqrt(inside)) / i0(KAISER_BETA), 0)
    return np.sinc(offset) * window


def periodic_operator(
    camera: Camera, grid: Grid, dz: float = 0.0, *, dropped: float = 0.01
) -> PeriodicOperator:
    """Operator from a plane at depth `dz`, sampled on `grid`, to the raw image; kernels are kept for reuse.

    Parameters
    ----------
    camera
        With an array that is not turned: see `fits`.
    grid
        Samples of the object.
    dz
        Depth of the plane from the focused one [m], positive farther.
    dropped
        Part of a point's light that may fall outside the window in which its image is computed. What
        falls inside is scaled up to all of it, so that only the faintest surroundings are lost.

    Raises
    ------
    SamplingError
        The array is turned, or the kernels do not fit in memory.
    """
    if not fits(camera):
        raise SamplingError("the lenslet array is turned against the axes: use Snapshots, or rotation 0.")
    distance = camera.object_distance + dz
    cells, scale = cells_of(camera, distance), 1 + lenslet_distance(camera) / camera.separation
    reach = reach_of(camera, cells, distance, dropped)
    needed = 2 * size_of(cells, reach)
    memory.require(needed, "the periodic operator", "Use slower lenslets, or Snapshots.", SamplingError)
    optics = (
        camera.wavelength,
        camera.separation,
        scale,
        camera.lens_train(),
        lenslet_array(camera),
        camera.pupil_grid,
    )
    kernels = _KERNELS.get(
        repr((cells, distance, reach, optics)),
        lambda: point_images(camera, cells, distance, reach),
    )
    return PeriodicOperator(
        cells, kernels, _bright(kernels), grid, -camera.separation / distance, scale, camera.sensor
    )


def kernel_bytes(camera: Camera, dz: float = 0.0, *, dropped: float = 0.01) -> float:
    """Memory that the kernels of `periodic_operator` take [bytes]."""
    distance = camera.object_distance + dz
    cells = cells_of(camera, distance)
    return size_of(cells, reach_of(camera, cells, distance, dropped))


def _bright(kernels: np.ndarray) -> tuple[tuple[int, int], ...]:
    """Offsets that hold all of the light but the part `FAINT`, row by row."""
    light = kernels.sum((2, 3), dtype=np.float64)
    order = np.argsort(light, axis=None)
    faint = np.cumsum(light.ravel()[order]) <= FAINT * light.sum()
    kept = np.sort(order[~faint])
    return tuple((int(k) // light.shape[1], int(k) % light.shape[1]) for k in kept)


def _descending(grid: Grid, axis: int) -> np.ndarray:
    """Positions of a plane that is turned by 180°: from the largest down."""
    n, pitch, center = grid.shape[axis], grid.pitch[axis], grid.center[axis]
    return center - (np.arange(n) - n // 2) * pitch


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


def _surrounded(cells: Array, rows: tuple[int, int], columns: tuple[int, int]) -> Array:
    """Cells (y, x, k) with so many rows of zeros above and below, and columns left and right."""
    xp = arrays.namespace(cells)
    like = {"dtype": cells.dtype, "device": cells.device}
    wide = [xp.zeros((cells.shape[0], n, cells.shape[2]), **like) for n in columns]
    cells = xp.concat([wide[0], cells, wide[1]], axis=1)
    high = [xp.zeros((n, *cells.shape[1:]), **like) for n in rows]
    return xp.concat([high[0], cells, high[1]], axis=0)
