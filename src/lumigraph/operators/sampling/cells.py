"""Cells of a lenslet array: the period of the lenslet-periodic operator, and how finely it is sampled."""

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np

from lumigraph.core.field import Field
from lumigraph.core.grid import Grid
from lumigraph.core.lattice import Lattice
from lumigraph.elements import (
    CircularAperture,
    LensletArray,
    PupilMask,
    ThinLens,
    Train,
    ZernikePlate,
    noll_to_nm,
)
from lumigraph.elements.lens import lens_phase
from lumigraph.elements.train import Element
from lumigraph.elements.transmission import Thin, transmit
from lumigraph.errors import GeometryError
from lumigraph.operators.sampling import field_lenses
from lumigraph.operators.sampling.camera import CameraOptics
from lumigraph.operators.sampling.cell_axis import Accepted
from lumigraph.operators.sampling.sampling_rules import Edges, SamplingRules

ALIKE = (
    "leave focal_length_scatter, decentre_scatter, tilt_scatter, form_scatter and missing out of [built], "
    "and single out of [lenslets]"
)
"""What makes lenslets alike, in messages."""

OVERSAMPLING = 1.2
"""How much closer than λL/(2D) the points of a cell stand: a kernel of `HALF_WIDTH` interpolates them."""

HALF_WIDTH = 20
"""Of that kernel [points]: its spectrum falls to nothing between OVERSAMPLING and 2 - 1/OVERSAMPLING."""

Offset = tuple[int, int]


@dataclass(frozen=True, slots=True)
class Cells:
    """Cells that tile a lenslet array: rectangles, in rows that may be staggered as those of bricks.

    Parameters
    ----------
    size
        Height and width of a cell [m].
    edge
        Corner (y, x) of the first cell with the least coordinates [m].
    count
        Cells along y and x that hold the array.
    points
        Object points along y and x of a cell, even.
    samples
        Samples of the image along y and x of a cell.
    ring
        Cells of the image on each side of the array, at least one.
    staggered
        Whether odd rows, counted from the array's first, stand half a cell towards larger x.
    kinds
        A cell's row and column tell its kind: those of one kind have the same surroundings.
    kind
        Of the array's first cell.
    """

    size: tuple[float, float]
    edge: tuple[float, float]
    count: tuple[int, int]
    points: tuple[int, int]
    samples: tuple[int, int]
    ring: tuple[int, int] = (1, 1)
    staggered: bool = False
    kinds: int = 1
    kind: int = 0

    @property
    def image(self) -> tuple[int, int]:
        """Cells along y and x of the image: the array's and the ring."""
        y, x = (n + 2 * r for n, r in zip(self.count, self.ring, strict=True))
        return y, x

    def grid(self, per_cell: tuple[int, int], scale: float, margin: tuple[int, int]) -> Grid:
        """`per_cell` samples of each cell and of `margin` more on all sides, times `scale`.

        The samples stand evenly inside their cell; a negative scale turns the plane by 180°. Beside staggered
        rows there is half a cell more.
        """
        shape, pitch, center, more = [], [], [], (0, self.step(per_cell))
        for size, edge, n, k, m, half in zip(
            self.size, self.edge, self.count, per_cell, margin, more, strict=True
        ):
            shape.append((n + 2 * m) * k + half)
            pitch.append(size / k * abs(scale))
            center.append((edge - m * size + (shape[-1] // 2 + 0.5) * size / k) * scale)
        return Grid((shape[0], shape[1]), (pitch[0], pitch[1]), (center[0], center[1]))

    def step(self, per_cell: tuple[int, int]) -> int:
        """Samples, `per_cell` of them to a cell, from an even row's first to an odd row's."""
        return per_cell[1] // 2 if self.staggered else 0

    @property
    def parities(self) -> range:
        """Rows that differ in where their cells stand: 0 the even ones or all, 1 the odd ones."""
        return range(2 if self.staggered else 1)

    def shift(self, dy: int) -> int:
        """Half cells by which cell (dy, 0) is shifted from an even row, as offsets are counted."""
        return dy % 2 if self.staggered else 0

    def mirrored(self, dy: int, dx: int) -> int:
        """The column that is on the left what `dx` is on the right, `dy` rows away."""
        return -dx - self.shift(dy)

    def seen_from(self, parity: int, dy: int, dx: int) -> Offset:
        """Rows and columns to the cell that is at (dy, dx) from an even row, from a row of a parity."""
        return dy, dx + parity * self.shift(dy)

    def rows(self, first: int, last: int, parity: int) -> range:
        """Rows of the image from `first` to before `last` of a parity."""
        if not self.staggered:
            return range(first, last)
        return range(first + (first - self.ring[0] - parity) % 2, last, 2)

    def columns(self, first: int, last: int, parity: int, kind: int) -> range:
        """Columns of the image from `first` to before `last` with cells of a kind, in rows of a parity."""
        start = (kind - self.kind + parity - (first - self.ring[1])) % self.kinds
        return range(first + start, last, self.kinds)

    def middle(self, kind: int) -> tuple[float, float]:
        """Centre (y, x) of a cell of a kind, amid the array [m]."""
        row, column = (n // 2 for n in self.count)
        if self.staggered:
            row -= row % 2
        column += (kind - self.kind - column) % self.kinds
        y, x = (e + (k + 0.5) * s for e, k, s in zip(self.edge, (row, column), self.size, strict=True))
        return y, x


def lenslet_distance(camera: CameraOptics) -> float:
    """Lenslets to sensor, b [m], of a camera that has lenslets."""
    assert camera.lenslet_distance is not None  # asked by `lenslet_array`
    return camera.lenslet_distance


def telecentric_distance(camera: CameraOptics) -> float:
    """Lenslets to sensor of the telecentric camera with the same image, b L/(L + b) [m]."""
    b, L = lenslet_distance(camera), camera.separation
    return b * L / (b + L)


def accepted(camera: CameraOptics) -> Accepted | None:
    """Angular response of the pixels behind lenslets, with their distance; None for a flat one."""
    response = camera.sensor.angular_response
    return None if response is None or response.is_flat else (response, lenslet_distance(camera))


def lenslet_array(camera: CameraOptics) -> LensletArray:
    """The array of a camera that has lenslets, turned about the axis so that its rows lie along x."""
    if camera.array is None:
        raise GeometryError("the camera has no lenslets: the periodic operator is for lenslet arrays.")
    if camera.lean is not None:
        raise GeometryError(
            "the array or the sensor leans, which simulations and operators of planes follow alone. Use "
            "those, or leave array_tilt, array_bow and sensor_tilt out of [built]."
        )
    return replace(camera.array, lattice=straight(camera.array.lattice))


def check_alike(camera: CameraOptics) -> None:
    """Refuse lenslets that differ from each other: operators repeat from cell to cell.

    Raises
    ------
    GeometryError
        They differ.
    """
    if camera.array is not None and camera.array.scatter is not None:
        raise GeometryError(
            "lenslets that differ from each other have no operator, which repeats from lenslet to lenslet. "
            f"Simulate points, or slices in Coherent() light, or {ALIKE}."
        )


def straight(lattice: Lattice) -> Lattice:
    """The lattice turned about (0, 0) so that its rows lie along x; one for all turns, to the last bit."""
    sin, cos = math.sin(lattice.rotation), math.cos(lattice.rotation)
    (row, column), origin = lattice.basis, lattice.origin

    def turned(vector: tuple[float, float]) -> tuple[float, float]:
        y, x = vector[0] * cos - vector[1] * sin, vector[0] * sin + vector[1] * cos
        return round(y, 15), round(x, 15)

    row = (0.0, turned(row)[1])
    y, x = turned(column)
    column = (y, 0.0 if lattice.layout == "square" else x)
    return replace(lattice, basis=(row, column), origin=turned(origin))


def cells_of(
    camera: CameraOptics, array: LensletArray, fineness: SamplingRules, distance: float | None = None
) -> Cells:
    """The smallest upright rectangle that repeats the lattice, its points and its samples."""
    return _sampled(camera, fineness, placed_cells(camera, array), distance)


def placed_cells(camera: CameraOptics, array: LensletArray) -> Cells:
    """The same cells, sampled as coarsely as possible."""
    lattice = array.lattice
    if lattice.layout == "hex":
        size = (math.sqrt(3) * lattice.pitch, lattice.pitch * lattice.kinds)
    else:
        size = lattice.pitches
    extent = array.extent or camera.sensor.grid.size
    count = tuple(max(1, math.ceil(e / s - 1e-6)) for e, s in zip(extent, size, strict=True))
    # Cells are centred on a lattice point or, for an even number of them, on the axis' side of it.
    edge = tuple(
        _nearest(-n * s / 2, o - s / 2, s) for n, s, o in zip(count, size, lattice.origin, strict=True)
    )
    return Cells(_pair(size), _pair(edge), _pair(count), (2, 2), (1, 1))


def bricks_of(
    camera: CameraOptics, array: LensletArray, fineness: SamplingRules, distance: float | None = None
) -> Cells:
    """A rectangle around each lenslet; those of a hexagonal array are staggered."""
    lattice = array.lattice
    if lattice.layout == "square":
        return cells_of(camera, array, fineness, distance)
    height, pitch = math.sqrt(3) / 2 * lattice.pitch, lattice.pitch
    tall, wide = array.extent or camera.sensor.grid.size
    rows = max(1, math.ceil(tall / height - 1e-6))
    low = _nearest(-rows * height / 2, lattice.origin[0] - height / 2, height)
    i = round((low + height / 2 - lattice.origin[0]) / height)
    start = lattice.origin[1] + (i - 1) * pitch / 2
    # Odd rows begin half a brick later, and hold as many.
    steps = math.ceil((-wide / 2 - start) / pitch - 1 - 1e-6)
    left = start + steps * pitch
    columns = max(1, math.ceil((wide / 2 - left) / pitch - 0.5 + 1e-6))
    kinds = 1 if isinstance(array.focal_length, float) else lattice.kinds
    bricks = Cells(
        (height, pitch), (low, left), (rows, columns), (2, 2), (1, 1),
        staggered=True, kinds=kinds, kind=int(lattice.kind(np.array(i), np.array(steps))) % kinds,
    )  # fmt: skip
    return _sampled(camera, fineness, bricks, distance)


def _sampled(camera: CameraOptics, fineness: SamplingRules, cells: Cells, distance: float | None) -> Cells:
    """The cells with as many points and samples, and as wide a ring, as the accuracy asks for."""
    finest = airy(camera) / 2 / OVERSAMPLING
    assert camera.lattice is not None  # asked by `lenslet_array`
    assert camera.array is not None
    pitch = camera.lattice.pitch
    widest, beyond = blur(camera, distance or camera.object_distance) / pitch, spill(camera)
    # Where micro-images overlap, light of more lenslets interferes.
    number = fresnel_number(camera) * (1 + 2 / 3 * beyond / pitch)
    image = pitch / fineness.samples(number, widest, edges(camera.array))
    points = tuple(2 * math.ceil(s / finest / 2) for s in cells.size)
    samples = [math.ceil(s / image) for s in cells.size]
    if cells.staggered:
        samples[1] += samples[1] % 2
    lit, ring = beyond + fineness.ring * pitch, []
    for seen, e, n, s in zip(_seen(camera), cells.edge, cells.count, cells.size, strict=True):
        looked_at = math.ceil((seen + max(e, -e - n * s)) / s - 1e-6)
        ring.append(max(1, min(math.ceil(lit / s), looked_at)))
    return replace(cells, points=_pair(points), samples=_pair(samples), ring=_pair(ring))


def _seen(camera: CameraOptics) -> tuple[float, float]:
    """Half size (y, x) of what the sensor sees of the straight array, on the telecentric image [m]."""
    scale, rotation = (
        1 + lenslet_distance(camera) / camera.separation,
        camera.lattice.rotation if camera.lattice else 0.0,
    )
    grid, sin, cos = camera.sensor.grid, abs(math.sin(rotation)), abs(math.cos(rotation))
    height, width = ((n + 1) * p / 2 / scale for n, p in zip(grid.shape, grid.pitch, strict=True))
    return height * cos + width * sin, width * cos + height * sin


def diffraction(camera: CameraOptics) -> float:
    """Width of the diffraction on the image [m]: the main lens', or the lenslets' where it is wide.

    They are the same where the f-numbers match, and taken for the same up to a quarter more.
    """
    assert camera.lattice is not None  # asked by `lenslet_array`
    behind = camera.wavelength * telecentric_distance(camera) / camera.lattice.pitch
    return max(airy(camera), 0.8 * behind)


def spill(camera: CameraOptics) -> float:
    """Overlap of a micro-image with its lenslet's neighbours [m]: 0 unless the main lens is wide."""
    assert camera.lattice is not None  # asked by `lenslet_array`
    width = camera.pupil_diameter * lenslet_distance(camera) / camera.separation
    return max(0.0, width - 1.25 * camera.lattice.pitch) / 2


def fresnel_number(camera: CameraOptics) -> float:
    """p²/(λb) of the telecentric camera: light goes aside the less, the larger it is."""
    assert camera.lattice is not None  # asked by `lenslet_array`
    return camera.lattice.pitch**2 / (camera.wavelength * telecentric_distance(camera))


def airy(camera: CameraOptics) -> float:
    """λL/D in the lenslet plane [m]: the finest period that the main lens' light has there."""
    return camera.wavelength * camera.separation / camera.pupil_diameter


def edges(array: LensletArray) -> Edges:
    """Kind of edges of an array's lenslets: "meet", "straight" or "other"."""
    if array.shape == "round":
        return "other"
    return "meet" if array.fill_factor == 1 else "straight" if array.lattice.layout == "square" else "other"


def lens(camera: CameraOptics) -> Train:
    """The camera's main lens, turned about the axis as `lenslet_array` turns the array.

    Raises
    ------
    GeometryError
        An element that is not known to be round, before a turned array; a lens that changes over the field.
    """
    field_lenses.check_one(camera)
    train, rotation = camera.lens, 0.0 if camera.lattice is None else camera.lattice.rotation
    if not rotation:
        return train
    return Train(_turned(element, -rotation) for element in train.elements)


def _turned(element: Element, angle: float) -> Element:
    if isinstance(element, ZernikePlate):
        return element.turned(angle)
    if isinstance(element, ThinLens) or (
        isinstance(element, CircularAperture) and element.center == (0.0, 0.0)
    ):
        return element
    raise GeometryError(
        f"the main lens has {type(element).__name__}, which may not be round, and the lenslets are turned by "
        f"{-angle:.6g} rad. Use lenslets that are not turned, or Snapshots."
    )


def mirrored(camera: CameraOptics) -> bool:
    """True if the main lens is known to be the same in a mirror along each axis of the straight array."""
    return all(
        isinstance(element, ThinLens | CircularAperture)
        or (isinstance(element, ZernikePlate) and _upright(element))
        for element in lens(camera).elements
    )


def _upright(plate: ZernikePlate) -> bool:
    if plate.center != (0.0, 0.0) or plate.axes[0] != plate.axes[1]:
        return False
    return all(_even(j, coefficient) for j, coefficient in dict(plate.coefficients).items())


def over_lens(camera: CameraOptics, lens: Train, distance: float, grid: Grid) -> np.ndarray:
    """A point's wave behind the main lens (y, x), over one that converges in the lenslet plane.

    That is smooth where neither of them is, so that samples need hold their product alone.
    """
    bent = -1 / (1 / distance + 1 / camera.separation)
    wave = np.outer(*(lens_phase(c, bent, camera.wavelength) for c in (grid.y, grid.x)))
    field = Field(wave, grid, camera.wavelength)
    for element in lens.elements:
        field = transmit(element, field) if isinstance(element, Thin) else element(field)
    return field.data


def stop_reach(lens: Train) -> float:
    """Farthest place of a lens' stop from the axis, over half of the camera's diameter; 1 of round ones."""
    return max([1.0, *(p.reach for p in lens.elements if isinstance(p, ZernikePlate))])


def stop_area(lens: Train) -> float:
    """Area of a lens' stop, over that of the camera's round one."""
    return math.prod(p.area for p in lens.elements if isinstance(p, ZernikePlate | PupilMask))


def _even(j: int, coefficient: float) -> bool:
    _, m = noll_to_nm(j)
    return abs(coefficient) < 1e-9 or (m >= 0 and m % 2 == 0)


def blur(camera: CameraOptics, distance: float) -> float:
    """Radius of a point's geometric image in the lenslet plane [m].

    A ray through (y, x) of the pupil arrives at (y, x) (1 - L/f + L/z) + λL/(2π) ∇φ for plates of phase φ.
    Where they aberrate, it is √2 times the rms distance from the axis, as of an even disc: few go farther.
    Where that changes over the field, it is the largest.
    """
    if field_lenses.plate_of(camera) is not None:
        return _widest(replace(camera, array=None), distance)
    elements = camera.lens.elements
    (focal_length,) = (p.focal_length for p in elements if isinstance(p, ThinLens))
    spread = 1 - camera.separation * (1 / focal_length - 1 / distance)
    plates = [p for p in elements if isinstance(p, ZernikePlate | PupilMask)]
    if not plates:
        return camera.pupil_diameter / 2 * abs(spread)
    angle = np.arange(64)[:, None] * (math.pi / 32)
    rho = camera.pupil_diameter / 2 * np.sqrt((np.arange(64) + 0.5) / 64)  # of equal areas
    y, x, step = rho * np.sin(angle), rho * np.cos(angle), camera.pupil_diameter * 1e-5
    bend = camera.wavelength * camera.separation / (2 * math.pi) / (2 * step)
    down, across = y * spread, x * spread
    for plate in plates:
        down = down + bend * (plate.phase(y + step, x) - plate.phase(y - step, x))
        across = across + bend * (plate.phase(y, x + step) - plate.phase(y, x - step))
    return math.sqrt(2 * float(np.mean(down**2 + across**2)))


@lru_cache(maxsize=64)
def _widest(camera: CameraOptics, distance: float) -> float:
    """`blur` behind a lens that changes over the field: asked for thousands of times."""
    return max(blur(each, distance) for each in field_lenses.some(camera))


def _pair(values: Iterable[Any]) -> tuple[Any, Any]:
    y, x = values
    return y, x


def _nearest(value: float, start: float, step: float) -> float:
    """The number nearest to `value` among ``start + k * step``."""
    return start + round((value - start) / step) * step
