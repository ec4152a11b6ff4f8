r"""Raw images of a plane before a camera with lenslets, and how they change with whatever changes of it.

As `whole_planes` has them: K are the images of points of one cell amid the array (`part_images`), and S and R
those of `tiles`.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from lumigraph.core import arrays
from lumigraph.core.grid import Grid
from lumigraph.core.linear import Linear
from lumigraph.operators.lenslets.gradient import Both, Gradient, Moved, Tangent
from lumigraph.operators.lenslets.point_images import PointImages, squared
from lumigraph.operators.lenslets.sampled_camera import SPARE, SampledCamera, SourcePoint
from lumigraph.operators.lenslets.whole_planes import CellPlane, RepeatedImages
from lumigraph.operators.sampling.camera import CameraOptics
from lumigraph.operators.sampling.optics import Optics
from lumigraph.operators.sampling.tiles import as_plane, by_cell, spread
from lumigraph.scene import Points

TOGETHER = 8
"""Points whose images are known at a time."""


@dataclass(frozen=True, eq=False)
class PartPlane(CellPlane[SampledCamera, "CellImages"]):
    """Images of a plane by a camera, with derivatives by what differs in pairs of cameras.

    The object's samples stay where they are, and as bright, before all cameras. Light from beyond the array
    is as of cells amid it, and what falls beside its cells is dark: images of the outermost lenslets are some
    3 % off, of the raw image's rms.

    Parameters
    ----------
    images
        The cameras', with lenslets that are alike, behind a thin lens that is the same for all fields.
    grid
        Samples of the object.
    dz
        Depth from the focused plane [m].
    """

    images: PointImages
    grid: Grid
    dz: float = 0.0

    @property
    def shape(self) -> tuple[tuple[int, int], tuple[int, int]]:
        """Shapes of a raw image and of an object."""
        return self.images.shape, self.grid.shape

    def _whole(self) -> SampledCamera:
        return self._here

    def _pairs(self) -> Sequence[Both]:
        return self._seen

    def _read(self, end: SampledCamera) -> Linear:
        return end.read

    def _changed(self, change: list[float]) -> Callable[["CellImages"], RepeatedImages]:
        weighed = list(zip(change, self._ends, self._moved, strict=True))
        changed = Tangent.of(self._own, weighed, self._spots)
        return lambda block: block.changed(changed)

    def _slopes(self) -> "_BlockGradient":
        return _BlockGradient(self._amid.by_pairs(self._own, self._ends, self._moved))

    def _points(self, end: SampledCamera, x: np.ndarray) -> np.ndarray:
        optics, cells = self._optics(end), end.optics.cells
        return by_cell(spread(optics, self.grid, cells.points, self._margin).forward(x), cells, cells.points)

    def _optics(self, seen: SampledCamera) -> Optics:
        return replace(seen.optics, distance=seen.optics.camera.object_distance + self.dz)

    def _dark(self) -> np.ndarray:
        cells = self._here.optics.cells
        return np.zeros((*cells.count, math.prod(cells.samples)))

    def _plane(self, light: np.ndarray) -> np.ndarray:
        cells = self._here.optics.cells
        (ry, rx) = cells.ring
        return as_plane(np.pad(light, ((ry, ry), (rx, rx), (0, 0))), cells, cells.samples)

    def _cells(self, plane: np.ndarray) -> np.ndarray:
        cells = self._here.optics.cells
        (ry, rx), (ny, nx) = cells.ring, cells.count
        return by_cell(plane, cells, cells.samples)[ry : ry + ny, rx : rx + nx]

    def _blocks(self) -> Iterator["CellImages"]:
        spots = self._spots
        for k in range(0, len(spots), TOGETHER):
            yield CellImages.of(self._own, spots[k : k + TOGETHER], self._margin)

    @cached_property
    def _amid(self) -> PointImages:
        """Images by arrays around the points of one cell, as wide as their light is followed."""
        camera, finer = self.images.camera, SPARE * self.images.accuracy
        optics = Optics.of(camera, camera.object_distance + self.dz, finer)
        # As even as the array: its cells' edges are where no rounding moves them by a cell.
        count = [2 * n + 1 + (k + 1) % 2 for n, k in zip(optics.reach, optics.cells.count, strict=True)]
        own, *ends = (
            _amid(one, count, finer, self.dz)
            for one in (camera, *(end for pair in self.images.pairs for end in pair))
        )
        return replace(self.images, camera=own, pairs=tuple(zip(ends[::2], ends[1::2], strict=True)))

    @cached_property
    def _own(self) -> SampledCamera:
        """Camera before points of a cell amid."""
        middle = Points(np.array([[0.0, 0.0, self.dz]]), np.ones(1))
        camera, finer = self.images.camera, SPARE * self.images.accuracy
        beside = math.hypot(*Optics.of(camera, camera.object_distance + self.dz, finer).cells.size)
        return self._amid.before(middle, beside=beside)[0]

    @cached_property
    def _ends(self) -> list[Both]:
        return self._amid.ends(self._own)

    @cached_property
    def _here(self) -> SampledCamera:
        """Camera with the whole array, sampled alike."""
        own = Optics.of(self.images.camera, self._own.optics.distance, self._own.optics.fineness.accuracy)
        amid = self._own.optics.cells
        cells = replace(own.cells, points=amid.points, samples=amid.samples)
        return replace(self._own, optics=replace(own, cells=cells))

    @cached_property
    def _seen(self) -> list[Both]:
        return self.images.ends(self._here)

    @cached_property
    def _spots(self) -> list[SourcePoint]:
        return self._own.sources(self._lit(self._own))

    @cached_property
    def _moved(self) -> list[Moved | None]:
        return [(self._lit(first), self._lit(last)) for first, last in self._ends]

    def _lit(self, own: SampledCamera) -> Points:
        """The points of the cell amid the array, each as bright as its part."""
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
        return Points(np.stack(places, axis=1), np.full(down.size, 1 / down.size))

    @cached_property
    def _margin(self) -> tuple[int, int]:
        """Cells to which light comes from one."""
        far = []
        for k, middle in enumerate(middle_of(self._own)):
            ends = [
                (middle - spot.lit.cells[k].start, spot.lit.cells[k].stop - 1 - middle)
                for spot in self._spots
            ]
            far.append(max(map(max, ends)))
        return far[0], far[1]


@dataclass(frozen=True, slots=True, eq=False)
class CellImages(RepeatedImages):
    """Images of some points of the cell amid the array.

    Parameters
    ----------
    own
        The camera.
    sources
        The points.
    """

    own: SampledCamera
    sources: list[SourcePoint]

    @classmethod
    def of(cls, own: SampledCamera, sources: list[SourcePoint], margin: tuple[int, int]) -> "CellImages":
        """Images of points with others around the array, so many cells on all sides."""
        found = cls.around(own, sources, margin)
        return found._with([one.intensity * squared(own.own_field(one)[0]) for one in sources])

    @classmethod
    def around(cls, own: SampledCamera, sources: list[SourcePoint], margin: tuple[int, int]) -> "CellImages":
        """The same without the images: where these are."""
        numbers = slice(sources[0].number, sources[-1].number + 1)
        places = zip(margin, middle_of(own), _lit(sources), strict=True)
        y, x = (more + middle - lit.start for more, middle, lit in places)
        return cls(np.zeros(()), numbers, (y, x), own, sources)

    def changed(self, by: Tangent) -> "CellImages":
        """Change of the images."""
        return self._with([one.intensity * by.intensity(one)[1] for one in self.sources])

    def of_each(self, kernel: np.ndarray) -> Iterator[np.ndarray]:
        """Part of a kernel that is each point's image (y, x)."""
        for k, source in enumerate(self.sources):
            tiles = kernel[(*self._inside(source), k)]
            yield arrays.untiled(tiles.reshape(*tiles.shape[:2], *self.own.optics.cells.samples))

    def _with(self, images: Sequence[np.ndarray]) -> "CellImages":
        """The same with other images (y, x) of the points."""
        size, samples = [len(cells) for cells in self._cells], self.own.optics.cells.samples
        kernel = np.zeros((*size, len(images), math.prod(samples)))
        for k, (source, image) in enumerate(zip(self.sources, images, strict=True)):
            tiles = arrays.tiled(image, samples)
            kernel[(*self._inside(source), k)] = tiles.reshape(*tiles.shape[:2], -1)
        return replace(self, kernel=kernel)

    @property
    def _cells(self) -> tuple[range, range]:
        return _lit(self.sources)

    def _inside(self, source: SourcePoint) -> tuple[slice, slice]:
        """The point's cells in the kernel."""
        y, x = (
            slice(mine.start - lit.start, mine.stop - lit.start)
            for mine, lit in zip(source.lit.cells, self._cells, strict=True)
        )
        return y, x


@dataclass(frozen=True, slots=True, eq=False)
class _BlockGradient:
    """Slopes of a number by images of a cell's points; see `whole_planes`."""

    by: Gradient

    def add(self, block: CellImages, asked: np.ndarray) -> None:
        for source, part in zip(block.sources, block.of_each(asked), strict=True):
            self.by.add(source, source.intensity * part)

    def along(self) -> np.ndarray:
        return self.by.along()


def _lit(spots: Sequence[SourcePoint]) -> tuple[range, range]:
    """Rows and columns that any of the points lights."""
    some = [spot.lit.cells for spot in spots]
    y, x = (range(min(one[k].start for one in some), max(one[k].stop for one in some)) for k in (0, 1))
    return y, x


def middle_of(own: SampledCamera) -> tuple[int, int]:
    """Row and column of the image's cell that is amid the array."""
    y, x = (ring + n // 2 for ring, n in zip(own.optics.cells.ring, own.optics.cells.count, strict=True))
    return y, x


def _amid(camera: CameraOptics, count: Sequence[int], accuracy: float, dz: float) -> CameraOptics:
    """Camera with so many cells, of which points at a depth are each as bright as a whole one."""
    assert camera.array is not None  # as `PartPlane` asks
    size = Optics.of(camera, camera.object_distance, accuracy).cells.size
    extent = count[0] * size[0], count[1] * size[1]
    pitch = math.sqrt(math.prod(size)) * (camera.object_distance + dz) / camera.separation
    return replace(camera, array=replace(camera.array, extent=extent), object_pitch=pitch)
