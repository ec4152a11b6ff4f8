"""Images of the points of one cell of a lenslet array: what the lenslet-periodic operator repeats."""

import math
import warnings
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from lumigraph.core.field import Field
from lumigraph.core.grid import Grid
from lumigraph.elements import LensletArray, ThinLens
from lumigraph.errors import SamplingWarning
from lumigraph.propagation import propagate
from lumigraph.scene import sources
from lumigraph.simulation.camera import Camera

OVERSAMPLING = 1.5
"""How much closer than λz/(2D) the points of a cell stand, so that a short kernel interpolates them."""

FINENESS = 2.6
"""Samples of an image's cell, over what its incoherent cut-off asks for."""


@dataclass(frozen=True, slots=True)
class Cells:
    """Rectangular cells that tile a lenslet array, one lenslet or more in each.

    Parameters
    ----------
    size
        Height and width of a cell [m].
    edge
        Corner (y, x) of the first cell with the least coordinates [m].
    count
        Cells along y and x that hold the array.
    points
        Object points along y and x of a cell.
    samples
        Samples of the image along y and x of a cell; multiples of `points`.
    extent
        Height and width of the array, centred on the axis [m]; the cells may reach beyond it.
    """

    size: tuple[float, float]
    edge: tuple[float, float]
    count: tuple[int, int]
    points: tuple[int, int]
    samples: tuple[int, int]
    extent: tuple[float, float]

    @property
    def step(self) -> tuple[float, float]:
        """Pitch of the image's samples along y and x [m]."""
        return self.size[0] / self.samples[0], self.size[1] / self.samples[1]

    def grid(self, per_cell: tuple[int, int], scale: float, margin: int) -> Grid:
        """`per_cell` samples of each cell and of `margin` more on all sides, times `scale`.

        The first sample of a cell stands on its edge; a negative scale turns the plane by 180°.
        """
        shape, pitch, center = [], [], []
        for size, edge, n, k in zip(self.size, self.edge, self.count, per_cell, strict=True):
            shape.append((n + 2 * margin) * k)
            pitch.append(size / k * abs(scale))
            center.append((edge - margin * size + (shape[-1] // 2) * size / k) * scale)
        return Grid((shape[0], shape[1]), (pitch[0], pitch[1]), (center[0], center[1]))


def fits(camera: Camera) -> bool:
    """Whether the camera has an array whose cells lie along the axes."""
    lattice = camera.lattice
    return lattice is not None and abs(lattice.rotation) < 1e-12 and camera.lenslet_distance is not None


def lenslet_distance(camera: Camera) -> float:
    """Lenslets to sensor, b [m], of a camera that has lenslets."""
    assert camera.lenslet_distance is not None  # `fits` has been asked
    return camera.lenslet_distance


def lenslet_array(camera: Camera) -> LensletArray:
    """The array of a camera that has lenslets, as the first element behind the lenslet plane."""
    train = camera.relay_train()
    assert train is not None
    array = train.elements[0]
    assert isinstance(array, LensletArray)
    return array


def cells_of(camera: Camera, distance: float) -> Cells:
    """The smallest upright rectangle that repeats the lattice, its points and its samples."""
    lattice, array = camera.lattice, lenslet_array(camera)
    assert lattice is not None
    if lattice.layout == "hex":
        size = (math.sqrt(3) * lattice.pitch, lattice.pitch * lattice.kinds)
    else:
        size = lattice.pitches
    extent = array.extent or camera.image_grid.size
    count = tuple(max(1, math.ceil(e / s - 1e-6)) for e, s in zip(extent, size, strict=True))
    # Cells are centred on a lattice point or, for an even number of them, on the axis' side of it.
    edge = tuple(
        _nearest(-n * s / 2, o - s / 2, s) for n, s, o in zip(count, size, lattice.origin, strict=True)
    )
    wavelength, b, L = camera.wavelength, lenslet_distance(camera), camera.separation
    finest = wavelength * L / (2 * camera.pupil_diameter) / OVERSAMPLING
    image = wavelength * (b * L / (b + L)) / lattice.pitch / 2 / FINENESS
    points = tuple(math.ceil(s / finest) for s in size)
    samples = tuple(n * math.ceil(s / image / n) for s, n in zip(size, points, strict=True))
    return Cells(_pair(size), _pair(edge), _pair(count), _pair(points), _pair(samples), _pair(extent))


def _pair(values: Iterable[Any]) -> tuple[Any, Any]:
    y, x = values
    return y, x


def _nearest(value: float, start: float, step: float) -> float:
    """The number nearest to `value` among ``start + k * step``."""
    return start + round((value - start) / step) * step


def reach_of(camera: Camera, cells: Cells, distance: float, dropped: float) -> int:
    """Cells on each side of a point's own that its image reaches."""
    wavelength, L, D = camera.wavelength, camera.separation, camera.pupil_diameter
    focal_length = _focal_length(camera)
    blur = D / 2 * abs(1 - L * (1 / focal_length - 1 / distance))
    tail = 2 * wavelength * L / D / (math.pi**2 * dropped)
    return math.ceil((blur + tail) / min(cells.size) + 0.5)


def _focal_length(camera: Camera) -> float:
    lenses = [part.focal_length for part in camera.lens_train().elements if isinstance(part, ThinLens)]
    return lenses[0]


def point_images(camera: Camera, cells: Cells, distance: float, reach: int) -> np.ndarray:
    """Images of the points of a cell (T, T, points, samples), each for all of the main lens' light."""
    T, step = 2 * reach + 1, cells.step
    stride = tuple(k // n for k, n in zip(cells.samples, cells.points, strict=True))
    shape = (T * cells.samples[0], T * cells.samples[1])
    wave = _main_lens(
        camera, distance, Grid((shape[0] + 2 * cells.samples[0], shape[1] + 2 * cells.samples[1]), step)
    )
    first = (cells.edge[axis] - reach * cells.size[axis] + (shape[axis] // 2) * step[axis] for axis in (0, 1))
    window = Grid(shape, step, _pair(first))
    array = replace(lenslet_array(camera), extent=None)
    b, L = lenslet_distance(camera), camera.separation
    # An even object of intensity 1 gives an even image of 1, and that is magnified onto the sensor.
    light = math.prod(stride) / (1 + b / L) ** 2
    kernels = np.empty((T, T, math.prod(cells.points), math.prod(cells.samples)), np.float32)
    middle = tuple(n // 2 for n in wave.shape)
    for ky in range(cells.points[0]):
        for kx in range(cells.points[1]):
            # The window begins `reach` cells before the points' own; point ky is ky strides into it.
            top = middle[0] - reach * cells.samples[0] - ky * stride[0]
            left = middle[1] - reach * cells.samples[1] - kx * stride[1]
            field = Field(wave[top : top + shape[0], left : left + shape[1]], window, camera.wavelength)
            image = propagate(array(field), b * L / (b + L), "auto").intensity
            image *= light / field.intensity.sum()
            parts = image.reshape(T, cells.samples[0], T, cells.samples[1]).transpose(0, 2, 1, 3)
            kernels[:, :, ky * cells.points[1] + kx] = parts.reshape(T, T, -1)
    return kernels


def size_of(cells: Cells, reach: int) -> float:
    """Memory of the images of all points of a cell, `reach` cells to each side [bytes]."""
    return 4.0 * (2 * reach + 1) ** 2 * math.prod(cells.points) * math.prod(cells.samples)


def _main_lens(camera: Camera, distance: float, grid: Grid) -> np.ndarray:
    """Amplitude (y, x) of a point on the axis in the lenslet plane, without the phase exp(iπw²/(λL))."""
    point = sources.point_source(camera.pupil_grid, camera.wavelength, distance, paraxial=True)
    with warnings.catch_warnings():  # a smooth converging wave: its samples do not stand for points
        warnings.simplefilter("ignore", SamplingWarning)
        field = propagate(camera.lens_train()(point), camera.separation, "fresnel", grid=grid)
    phase = [np.exp(-1j * np.pi * c**2 / (camera.wavelength * camera.separation)) for c in (grid.y, grid.x)]
    return (field.data * phase[0][:, None] * phase[1]).astype(np.complex64)
