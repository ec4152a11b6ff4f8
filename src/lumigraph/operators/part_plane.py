r"""Raw images of a plane before a camera with lenslets, and how they change with whatever changes of it.

The array repeats itself from cell to cell: with x the light of points of all cells, K the images of those of
one cell amid the array (`part_images`), and R what pixels take,

.. math:: I = R \sum_{p,c} x_{c,p}\, K_p(\cdot - c), \quad x = S o

where S spreads the object's samples onto the points (`tiles`). K is differentiated, and S and R compared
between cameras a little apart. Backwards, what all objects and weights say of K_p is a sum over cells: each
point is followed back once, however many objects there are.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from lumigraph.core import arrays
from lumigraph.core.grid import Grid
from lumigraph.core.threads import single_products
from lumigraph.errors import GeometryError
from lumigraph.operators.camera import CameraOptics
from lumigraph.operators.optics import Optics
from lumigraph.operators.part_images import PartImages
from lumigraph.operators.part_sight import Sight, Spot
from lumigraph.operators.part_waves import Both, Change, Slopes, Waves, Where, read_anew, times
from lumigraph.operators.points import SPARE
from lumigraph.operators.tiles import as_plane, by_cell, spread
from lumigraph.scene import Points

NODES = 64
"""Across the main lens, at least: more where the accuracy asks for them."""

TOGETHER = 8
"""Points whose images are known at a time."""


@dataclass(frozen=True, eq=False)
class PartPlane:
    """How a camera sees a plane, with derivatives by what differs between pairs of cameras.

    The object's samples stay where they are, and as bright, before all cameras. Light from beyond the array
    is as of cells amid it, and what falls beside its cells is dark: images of the outermost lenslets are some
    3 % off, of the raw image's rms.

    Parameters
    ----------
    images
        The cameras'.
    grid
        Samples of the object.
    dz
        Depth from the focused plane [m].
    """

    images: PartImages
    grid: Grid
    dz: float = 0.0

    @property
    def shape(self) -> tuple[tuple[int, int], tuple[int, int]]:
        """Of a raw image and of an object."""
        return self.images.shape, self.grid.shape

    @single_products()
    def forward(self, x: np.ndarray) -> np.ndarray:
        """Raw image (ny, nx) of an object (y, x); of several (k, y, x) theirs, at hardly more cost."""
        points = [self._points(self._here, one) for one in self._objects(x)]
        light = [self._dark() for _ in points]
        for block in self._blocks():
            for mine, one in zip(light, points, strict=True):
                block.add(mine, one)
        found = np.stack([self._here.read.forward(self._plane(one)) for one in light])
        return found.reshape(*np.shape(x)[:-2], *self.images.shape)

    @single_products()
    def derivative(self, x: np.ndarray, change: np.ndarray) -> np.ndarray:
        """Change (ny, nx) of `forward`, so many times (n,) from the first to the last camera of each pair."""
        if np.shape(change) != (len(self._ends),):
            raise GeometryError(f"change has shape {np.shape(change)} but must be ({len(self._ends)},).")
        weights, (given,) = np.asarray(change, np.float64).tolist(), self._objects(x)
        by = Change.of(self._own, zip(weights, self._ends, strict=True), self._spots, self._moved)
        here = Change.of(self._here, zip(weights, self._seen, strict=True), [])
        brighter = sum(w * _brighter(where) for w, where in zip(weights, self._moved, strict=True))
        points, light, moved = self._points(self._here, given), self._dark(), self._dark()
        onto = here.sum(lambda one: self._points(one, given))
        for block in self._blocks():
            block.add(light, points)
            block.add(moved, onto)
            block.changed(by, brighter).add(moved, points)
        changed = here.sum(lambda one: one.read.forward(self._plane(light)))
        return self._here.read.forward(self._plane(moved)) + changed

    @single_products()
    def gradient(self, x: np.ndarray, weights: np.ndarray) -> np.ndarray:
        """Transpose of `derivative`: (n,) from weights (ny, nx) of the raw image's pixels.

        Of several objects (k, y, x) and weights (k, ny, nx) their sum, at hardly more cost.
        """
        given, pixels = self._objects(x), np.asarray(weights, np.float64).reshape(-1, *np.shape(weights)[-2:])
        if pixels.shape != (len(given), *self.images.shape):
            raise GeometryError(
                f"weights have shape {np.shape(weights)} but must be ({len(given)}, {self.images.shape})."
            )
        points = [self._points(self._here, one) for one in given]
        seen = [self._cells(self._here.read.adjoint(one)) for one in pixels]
        light, told = [self._dark() for _ in given], [np.zeros_like(one) for one in points]
        by, pupil, bright = Slopes(), np.zeros(()), 0.0
        for block in self._blocks():
            for k, one in enumerate(points):
                block.add(light[k], one)
                block.return_to(told[k], seen[k])
            for waves, part in zip(block.waves, block.asked(points, seen), strict=True):
                bright += float(np.sum(part * np.abs(waves.field) ** 2))
                pupil = pupil + by.add(waves, waves.spot.intensity * part * waves.field.conj())
        found = np.array([bright * _brighter(where) for where in self._moved])
        found += [by.between(both, pupil, where) for both, where in zip(self._ends, self._moved, strict=True)]
        planes = [self._plane(one) for one in light]
        for k, here in enumerate(self._seen):
            found[k] += sum(read_anew(here, one, by) for one, by in zip(planes, pixels, strict=True))
            for one, back in zip(given, told, strict=True):
                found[k] += times(back, *(self._points(end, one) for end in here))
        return found

    def _objects(self, x: np.ndarray) -> list[np.ndarray]:
        if np.ndim(x) not in (2, 3) or np.shape(x)[-2:] != self.grid.shape:
            raise GeometryError(f"the object has shape {np.shape(x)} but the grid {self.grid.shape}.")
        return list(np.asarray(x, np.float64).reshape(-1, *self.grid.shape))

    def _points(self, seen: Sight, x: np.ndarray) -> np.ndarray:
        """Light (rows, columns, points) of cells in a margin around the array."""
        optics, cells = self._optics(seen), seen.optics.cells
        return by_cell(spread(optics, self.grid, cells.points, self._margin).forward(x), cells, cells.points)

    def _optics(self, seen: Sight) -> Optics:
        return replace(seen.optics, distance=seen.optics.camera.object_distance + self.dz)

    def _dark(self) -> np.ndarray:
        cells = self._here.optics.cells
        return np.zeros((*cells.count, math.prod(cells.samples)))

    def _plane(self, light: np.ndarray) -> np.ndarray:
        """Samples (y, x) of the image, of those (rows, columns, samples) of the array's cells."""
        cells = self._here.optics.cells
        (ry, rx) = cells.ring
        return as_plane(np.pad(light, ((ry, ry), (rx, rx), (0, 0))), cells, cells.samples)

    def _cells(self, plane: np.ndarray) -> np.ndarray:
        """The transpose of `_plane`."""
        cells = self._here.optics.cells
        (ry, rx), (ny, nx) = cells.ring, cells.count
        return by_cell(plane, cells, cells.samples)[ry : ry + ny, rx : rx + nx]

    def _blocks(self) -> Iterator["Block"]:
        spots = self._spots
        for k in range(0, len(spots), TOGETHER):
            yield Block.of(self._own, spots[k : k + TOGETHER], self._margin)

    @cached_property
    def _amid(self) -> PartImages:
        """Of arrays around the points of one cell, as wide as their light is followed."""
        camera, finer = self.images.camera, SPARE * self.images.accuracy
        optics = Optics.of(camera, camera.object_distance + self.dz, finer)
        # As even as the array: its cells' edges are where no rounding moves them by a cell.
        count = [2 * n + 1 + (k + 1) % 2 for n, k in zip(optics.reach, optics.cells.count, strict=True)]
        own, *ends = (
            _amid(one, count, finer) for one in (camera, *(end for pair in self.images.pairs for end in pair))
        )
        pairs = tuple(zip(ends[::2], ends[1::2], strict=True))
        return PartImages(own, pairs, self.images.accuracy)

    @cached_property
    def _own(self) -> Sight:
        """Before points of a cell amid."""
        middle = Points(np.array([[0.0, 0.0, self.dz]]), np.ones(1))
        return Sight.of(self._amid.camera, middle, self._amid.accuracy, NODES)

    @cached_property
    def _ends(self) -> list[Both]:
        return self._amid.ends(self._own)

    @cached_property
    def _here(self) -> Sight:
        """Of the whole array, sampled alike."""
        own = Optics.of(self.images.camera, self._own.optics.distance, self._own.optics.fineness.accuracy)
        amid = self._own.optics.cells
        cells = replace(own.cells, points=amid.points, samples=amid.samples)
        return Sight(replace(own, cells=cells), self._own.nodes)

    @cached_property
    def _seen(self) -> list[Both]:
        return self.images.ends(self._here)

    @cached_property
    def _spots(self) -> list[Spot]:
        return self._own.spots(self._lit(self._own))

    @cached_property
    def _moved(self) -> list[Where]:
        return [(self._lit(first), self._lit(last)) for first, last in self._ends]

    def _lit(self, own: Sight) -> Points:
        """The points of the cell amid the array, each as bright as its part of an even object of 1."""
        optics = self._optics(own)
        cells, camera = optics.cells, optics.camera
        scale = -optics.distance / camera.separation
        y, x = (
            edge + (n // 2 + (np.arange(k) + 0.5) / k) * size
            for edge, n, k, size in zip(cells.edge, cells.count, cells.points, cells.size, strict=True)
        )
        down, across = (one.ravel() * scale for one in np.meshgrid(y, x, indexing="ij"))
        sin, cos = math.sin(optics.rotation), math.cos(optics.rotation)
        places = [down * cos + across * sin, across * cos - down * sin, np.full(down.size, self.dz)]
        area = math.prod(cells.size) / math.prod(cells.points) * (scale / camera.object_pitch) ** 2
        return Points(np.stack(places, axis=1), np.full(down.size, area))

    @cached_property
    def _margin(self) -> tuple[int, int]:
        """Cells to which light comes from one."""
        far = []
        for k, middle in enumerate(middle_of(self._own)):
            ends = [(middle - spot.cells[k].start, spot.cells[k].stop - 1 - middle) for spot in self._spots]
            far.append(max(map(max, ends)))
        return far[0], far[1]


@dataclass(frozen=True, slots=True, eq=False)
class Block:
    """Images of some points of the cell amid the array, and the light of theirs in all cells.

    Parameters
    ----------
    own
        The camera before them.
    waves
        The points'.
    margin
        Of cells around the array whose points shine.
    kernel
        (rows, columns, n, samples) of the cells that they light.
    """

    own: Sight
    waves: list[Waves]
    margin: tuple[int, int]
    kernel: np.ndarray

    @classmethod
    def of(cls, own: Sight, spots: Sequence[Spot], margin: tuple[int, int]) -> "Block":
        """Of some points."""
        waves = [Waves.of(own, spot) for spot in spots]
        found = cls(own, waves, margin, np.zeros(()))
        return found._with([one.spot.intensity * np.abs(one.field) ** 2 for one in waves])

    def changed(self, by: Change, brighter: float) -> "Block":
        """Change of the images with the camera, and as the points become brighter."""
        return self._with([
            2 * one.spot.intensity * np.real(one.field.conj() * one.changed(by))
            + brighter * np.abs(one.field) ** 2
            for one in self.waves
        ])  # fmt: skip

    def add(self, light: np.ndarray, points: np.ndarray) -> None:
        """What points (rows, columns, points) bring, to cells (rows, columns, samples) of the array."""
        flat = light.reshape(-1, light.shape[-1])
        for offset in np.ndindex(*self.kernel.shape[:2]):
            flat += self._shining(points, offset, light.shape) @ self.kernel[offset]

    def return_to(self, points: np.ndarray, seen: np.ndarray) -> None:
        """The transpose of `add`."""
        flat = seen.reshape(-1, seen.shape[-1])
        for offset in np.ndindex(*self.kernel.shape[:2]):
            back = flat @ self.kernel[offset].T
            points[(*self._from(offset, seen.shape), self._numbers)] += back.reshape(*seen.shape[:2], -1)

    def asked(self, points: Sequence[np.ndarray], seen: Sequence[np.ndarray]) -> Iterator[np.ndarray]:
        """Slopes by each point's image (y, x), of objects' points and slopes by their light in the cells."""
        found = np.zeros_like(self.kernel)
        for one, light in zip(points, seen, strict=True):
            flat = light.reshape(-1, light.shape[-1])
            for offset in np.ndindex(*found.shape[:2]):
                found[offset] += self._shining(one, offset, light.shape).T @ flat
        samples = self.own.optics.cells.samples
        for k, waves in enumerate(self.waves):
            tiles = found[(*self._inside(waves.spot), k)]
            yield arrays.untiled(tiles.reshape(*tiles.shape[:2], *samples))

    def _with(self, images: Sequence[np.ndarray]) -> "Block":
        """With other images (y, x) of the points."""
        samples, size = self.own.optics.cells.samples, [len(cells) for cells in self._lit]
        kernel = np.zeros((*size, len(images), math.prod(samples)))
        for k, (waves, image) in enumerate(zip(self.waves, images, strict=True)):
            tiles = arrays.tiled(image, samples)
            kernel[(*self._inside(waves.spot), k)] = tiles.reshape(*tiles.shape[:2], -1)
        return replace(self, kernel=kernel)

    @property
    def _lit(self) -> tuple[range, range]:
        """Rows and columns that any of the points lights."""
        some = [waves.spot.cells for waves in self.waves]
        y, x = (range(min(one[k].start for one in some), max(one[k].stop for one in some)) for k in (0, 1))
        return y, x

    @property
    def _numbers(self) -> slice:
        """Of the points, in their cell."""
        return slice(self.waves[0].spot.number, self.waves[-1].spot.number + 1)

    def _inside(self, spot: Spot) -> tuple[slice, slice]:
        """The point's cells in the kernel."""
        y, x = (
            slice(mine.start - lit.start, mine.stop - lit.start)
            for mine, lit in zip(spot.cells, self._lit, strict=True)
        )
        return y, x

    def _from(self, offset: tuple[int, ...], shape: tuple[int, ...]) -> tuple[slice, slice]:
        """Where the points are whose light falls into the array's cells so many away."""
        places = zip(self.margin, middle_of(self.own), self._lit, offset, strict=True)
        first = [margin + middle - lit.start - k for margin, middle, lit, k in places]
        y, x = (slice(start, start + n) for start, n in zip(first, shape[:2], strict=True))
        return y, x

    def _shining(self, points: np.ndarray, offset: tuple[int, ...], shape: tuple[int, ...]) -> np.ndarray:
        """(cells, n): points' light that falls into the array's cells."""
        mine = points[(*self._from(offset, shape), self._numbers)]
        return mine.reshape(-1, mine.shape[-1])


def _brighter(where: Where) -> float:
    """How much brighter all points are before the last of a pair."""
    first, last = where
    return float(last.intensities[0] - first.intensities[0])


def middle_of(own: Sight) -> tuple[int, int]:
    """Row and column of the image's cell that is amid the array."""
    y, x = (ring + n // 2 for ring, n in zip(own.optics.cells.ring, own.optics.cells.count, strict=True))
    return y, x


def _amid(camera: CameraOptics, count: Sequence[int], accuracy: float) -> CameraOptics:
    """With so many cells."""
    assert camera.array is not None  # as `PartImages` asks
    size = Optics.of(camera, camera.object_distance, accuracy).cells.size
    extent = count[0] * size[0], count[1] * size[1]
    return replace(camera, array=replace(camera.array, extent=extent))
