"""Planes and points before a lens of glass, where the thin lens in its exit pupil sees them."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from scipy.sparse import csr_array

from lumigraph.core import arrays, memory
from lumigraph.core.arrays import Array
from lumigraph.core.grid import Grid
from lumigraph.core.linear import Linear, Shape
from lumigraph.elements import ObjectSpace
from lumigraph.errors import GeometryError, SamplingError
from lumigraph.operators.sampling.band import HALF_WIDTH, OVERSAMPLING, kernel
from lumigraph.operators.sampling.camera import CameraOptics
from lumigraph.operators.sampling.regrid import Regridded
from lumigraph.scene import Points

Fields = tuple[np.ndarray, np.ndarray]
"""Along y and along x, tangents."""


def seen_points(camera: CameraOptics, points: Points) -> tuple[CameraOptics, Points]:
    """The thin lens in the exit pupil, and points where it sees them."""
    space = camera.objects
    if space is None:
        return camera, points
    y, x, dz = points.positions.T
    depth = space.depth(dz)
    scale = space.scale(y, x, camera.object_distance + depth)
    places = np.stack([y * scale, x * scale, np.broadcast_to(depth, y.shape)], axis=1)
    return replace(camera, objects=None), Points(places, points.intensities)


def seen_plane(
    camera: CameraOptics,
    grid: Grid,
    dz: float,
    operator: Callable[[CameraOptics, Grid, float, Fields], Linear],
) -> Regridded:
    """Operator of a plane at a depth [m], by one of the thin lens in the exit pupil."""
    space = camera.objects
    assert space is not None  # asked by those who call
    thin, depth = replace(camera, objects=None), float(space.depth(dz))
    distance = camera.object_distance + depth
    finest = camera.wavelength * distance / (2 * camera.pupil_diameter) / OVERSAMPLING
    onto, seen = distorted(space, grid, distance, finest)
    y, x = (part / distance for part in onto.places)
    fields = (np.array([y.min(), y.max()]), np.array([x.min(), x.max()]))
    return Regridded(operator(thin, seen, depth, fields), onto, grid, object_grid=grid)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Distorted(Linear):
    """Samples of an object, points of light, on samples of where they are seen: along x, then along y.

    Parameters
    ----------
    across
        Of all rows, sparse (rows · columns seen, rows · columns).
    down
        Sparse (rows seen · columns seen, rows · columns seen).
    sizes
        Of the plane that is seen, and of the object.
    places
        Where the samples are seen along y and along x (ny, nx) [m].
    """

    across: csr_array
    down: csr_array
    sizes: tuple[Shape, Shape]
    places: tuple[np.ndarray, np.ndarray]

    title: ClassVar[str] = "What a lens of glass makes of places"

    @property
    def shape(self) -> tuple[Shape, Shape]:
        """Shapes of the plane that is seen, and of the object."""
        return self.sizes

    def _forward(self, intensity: Array) -> Array:
        flat = _plain(intensity).ravel()
        return arrays.like((self.down @ (self.across @ flat)).reshape(self.sizes[0]), intensity)

    def _adjoint(self, raw: Array) -> Array:
        flat = _plain(raw).ravel()
        return arrays.like((self.across.T @ (self.down.T @ flat)).reshape(self.sizes[1]), raw)

    @property
    def memory_bytes(self) -> float:
        """Memory of both matrices [bytes]."""
        return float(sum(m.data.nbytes + m.indices.nbytes for m in (self.across, self.down)))


def _plain(array: Array) -> np.ndarray:
    """Array on the CPU, where sparse matrices are; no gradient goes through them."""
    if getattr(array, "requires_grad", False):
        raise GeometryError(
            "the object asks for gradients, which do not go through a lens of glass. Use operator.adjoint, "
            "or leave prescription out."
        )
    return arrays.to_numpy(array)


def distorted(space: ObjectSpace, grid: Grid, distance: float, finest: float) -> tuple[Distorted, Grid]:
    """Map from samples before the glass to those of the thin lens, at most `finest` apart [m], and these.

    Raises
    ------
    SamplingError
        Too many samples for the memory.
    """
    memory.require(
        4 * HALF_WIDTH * 12.0 * np.prod(grid.shape),
        "the distorted object",
        "Use fewer samples.",
        SamplingError,
    )
    y, x = np.broadcast_arrays(grid.y[:, None], grid.x)
    scale = space.scale(y, x, distance)
    places = y * scale, x * scale
    seen = _covering(grid, space.pupil_magnification, places, finest)
    ny, (rows, columns) = grid.shape[0], seen.shape
    across = _placed(places[1], seen.x, seen.pitch[1])
    # Where columns of what is seen cross rows of the object
    heights = np.array([np.interp(seen.x, at, up) for at, up in zip(places[1], places[0], strict=True)])
    down = _placed(heights.T, seen.y, seen.pitch[0])
    across = _stacked(across, grid.shape[1], columns)
    turned = _stacked(down, ny, rows).tocoo()
    into, of = turned.coords
    into, of = (into % rows) * columns + into // rows, (of % ny) * columns + of // ny
    down = csr_array((turned.data, (into, of)), shape=(rows * columns, ny * columns))
    # Samples of an operator are intensities: light over their own area
    area = space.pupil_magnification**2 * np.prod(grid.pitch) / np.prod(seen.pitch)
    return Distorted(across, down * np.float32(area), (seen.shape, grid.shape), places), seen


def _covering(grid: Grid, magnification: float, places: tuple[np.ndarray, np.ndarray], finest: float) -> Grid:
    """Samples of the thin lens' plane around places."""
    shape, pitch, center = [], [], []
    for own, at in zip(grid.pitch, places, strict=True):
        step = min(own * magnification, finest)
        count = round(float(np.ptp(at)) / step) + 1 + 2 * HALF_WIDTH
        shape.append(count)
        pitch.append(step)
        center.append((float(at.min() + at.max()) / 2) + (0.0 if count % 2 else step / 2))
    return Grid((shape[0], shape[1]), (pitch[0], pitch[1]), (center[0], center[1]))


Entries = tuple[np.ndarray, np.ndarray]
"""Values and the numbers of samples (lines, points, 2 HALF_WIDTH) that stand for points of lines."""


def _placed(places: np.ndarray, samples: np.ndarray, pitch: float) -> Entries:
    """Entries, values and numbers of samples, of points (lines, points) [m] on samples."""
    at = (places - samples[0]) / pitch
    numbers = np.floor(at).astype(int)[..., None] + np.arange(1 - HALF_WIDTH, HALF_WIDTH + 1)
    values = kernel(at[..., None] - numbers)
    values[(numbers < 0) | (numbers >= len(samples))] = 0
    return values.astype(np.float32), np.clip(numbers, 0, len(samples) - 1)


def _stacked(entries: Entries, points: int, samples: int) -> csr_array:
    """Sparse matrix (lines · samples, lines · points)."""
    values, numbers = entries
    lines = np.arange(len(values))[:, None, None]
    of = np.broadcast_to(lines * points + np.arange(points)[:, None], numbers.shape)
    shape = (len(values) * samples, len(values) * points)
    return csr_array((values.ravel(), ((lines * samples + numbers).ravel(), of.ravel())), shape=shape)
