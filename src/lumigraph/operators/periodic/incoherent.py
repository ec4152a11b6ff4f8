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
from lumigraph.core.linear import Chain, Linear, Shape, stack
from lumigraph.core.progress import Progress
from lumigraph.core.progress import part as part_of
from lumigraph.errors import GeometryError, SamplingError
from lumigraph.operators.lenslets.paraxial_error import field_matters, resolved
from lumigraph.operators.lenslets.points import seen
from lumigraph.operators.lenslets.tilted_planes import leaning_operator
from lumigraph.operators.periodic import mirrors
from lumigraph.operators.periodic.blocks import MatrixPart
from lumigraph.operators.periodic.far_field import FarField, beyond
from lumigraph.operators.periodic.kernels import A_MINUTE, LONGEST, KernelMatrix, matrix, operations, said
from lumigraph.operators.periodic.mirrors import Mirror
from lumigraph.operators.periodic.over_field import over_field
from lumigraph.operators.periodic.streamed import StreamedMatrix
from lumigraph.operators.sampling import field_lenses
from lumigraph.operators.sampling.border_classes import Turn
from lumigraph.operators.sampling.camera import CameraOptics, HasOptics
from lumigraph.operators.sampling.cell_axis import Pair
from lumigraph.operators.sampling.cells import Cells, blur, check_alike
from lumigraph.operators.sampling.glass_distortion import Fields, seen_plane
from lumigraph.operators.sampling.optics import Optics
from lumigraph.operators.sampling.tiles import as_plane, by_cell, readout, spread

PIECE, PIECE_ELSEWHERE = 600, 100_000
"""Cells of the image that are computed at a time: in a processor's cache, and on another device."""


@dataclass(frozen=True, slots=True, eq=False)
class ObjectPlane:
    """One depth of an object.

    Parameters
    ----------
    matrix
        From the points of the object's cells to the image's.
    spread
        From the object's samples to those points.
    beyond
        Light from farther away, where the object reaches there.
    """

    matrix: KernelMatrix | StreamedMatrix
    spread: Linear
    beyond: FarField | None = None

    @property
    def nbytes(self) -> float:
        """Memory that it takes [bytes]."""
        return self.matrix.nbytes + (self.beyond.nbytes if self.beyond else 0)


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
    planes: tuple[ObjectPlane, ...]
    readout: Linear
    accuracy: float

    title: ClassVar[str] = "Operator of a camera with lenslets"

    @property
    def shape(self) -> tuple[Shape, Shape]:
        """Pixels (ny, nx) of the raw image, samples (y, x) or (z, y, x) of the object."""
        volume = () if self.depths is None else (len(self.depths),)
        return self.readout.shape[0], (*volume, *self.planes[0].spread.shape[1])

    def _forward(self, intensity: Array) -> Array:
        xp = arrays.namespace(intensity)
        layers = intensity if self.depths is not None else intensity[None, ...]
        rows, columns = self.cells.image
        like = {"dtype": intensity.dtype, "device": intensity.device}
        image = xp.zeros((rows, columns, math.prod(self.cells.samples)), **like)
        for k, plane in enumerate(self.planes):
            points = by_cell(
                plane.spread.forward(layers[k, ...]), self.cells, self.cells.points, plane.matrix.margin[0]
            )
            for part in _pieces(plane.matrix.parts, points):
                mine = (_slice(part.rows), _slice(part.columns), slice(None))
                for group in _groups(part, plane.matrix.margin):
                    image[mine] += group.seen(points) @ group.right(image)
            light = xp.sum(points, axis=2)
            for glare in plane.matrix.glare:
                image += glare.forward(light)
            if plane.beyond is not None:
                image += plane.beyond.forward(layers[k, ...])
        return self.readout.forward(as_plane(image, self.cells, self.cells.samples))

    def _adjoint(self, raw: Array) -> Array:
        xp = arrays.namespace(raw)
        image = by_cell(self.readout.adjoint(raw), self.cells, self.cells.samples)
        layers = [self._returned(plane, image) for plane in self.planes]
        return layers[0] if self.depths is None else xp.stack(layers, axis=0)

    def _returned(self, plane: ObjectPlane, image: Array) -> Array:
        xp, margin = arrays.namespace(image), plane.matrix.margin
        shape = [n + 2 * m for n, m in zip(self.cells.image, margin, strict=True)]
        size = (*shape, math.prod(self.cells.points))
        points = xp.zeros(size, dtype=image.dtype, device=image.device)
        for part in _pieces(plane.matrix.parts, image):
            mine = image[_slice(part.rows), _slice(part.columns), :]
            for group in _groups(part, margin):
                group.return_to(points, mine @ xp.matrix_transpose(group.right(image)))
        for glare in plane.matrix.glare:
            points += xp.expand_dims(glare.adjoint(image), axis=2)
        layer = plane.spread.adjoint(as_plane(points, self.cells, self.cells.points, margin[0]))
        return layer if plane.beyond is None else layer + plane.beyond.adjoint(image)

    @property
    def memory_bytes(self) -> float:
        """Memory that `forward` and `adjoint` of a single-precision image take, with the matrices [bytes]."""
        cells = math.prod(self.cells.image) * math.prod(self.cells.samples)
        pixels = math.prod(self.shape[0])
        kept = sum(
            plane.matrix.nbytes + (plane.beyond.nbytes if plane.beyond else 0) for plane in self.planes
        )
        return kept + 4 * (4 * cells + math.sqrt(cells * pixels) + pixels)

    @property
    def error(self) -> float:
        """The accuracy that was asked for."""
        return self.accuracy


def _slice(numbers: range, farther: int = 0) -> slice:
    return slice(numbers[0] + farther, numbers[-1] + farther + 1, numbers.step)


def _pieces(parts: Iterable[MatrixPart], like: Array) -> Iterator[MatrixPart]:
    """The parts, those of many cells in rows that stay in the processor's cache, or are few elsewhere."""
    cells = PIECE if arrays.is_here(like) else PIECE_ELSEWHERE
    for part in parts:
        step = max(1, cells // len(part.columns))
        for row in range(0, len(part.rows), step):
            yield replace(part, rows=part.rows[row : row + step])


def _groups(part: MatrixPart, margin: tuple[int, int]) -> "Iterator[_OffsetGroup]":
    """The part's offsets, row by row, those together whose object's cells are the same."""
    start, apart = 0, part.columns.step
    for (dy, _), offsets in groupby(part.offsets, key=lambda offset: (offset[0], offset[1] % apart)):
        across = tuple((dx, rank) for _, dx, rank in offsets)
        ranks = slice(start, start + sum(rank for _, rank in across))
        start = ranks.stop
        rows = _slice(part.rows, margin[0] + dy)
        first = part.columns.start + margin[1]
        columns = range(first, first + len(part.columns) * apart, apart)
        yield _OffsetGroup(rows, columns, across, ranks, part)


@dataclass(frozen=True, slots=True, eq=False)
class _OffsetGroup:
    """Offsets of one part in one row: (dx, rank) for each, columns that dx = 0 takes, and the factors'."""

    rows: slice
    columns: range
    across: tuple[tuple[int, int], ...]
    ranks: slice
    part: MatrixPart

    def _left(self, like: Array) -> Array | None:
        left = self.part.left
        return None if left is None else arrays.held(left, like, slice(None), self.ranks)

    def right(self, like: Array) -> Array:
        """The right factor (ranks, samples) in the library, precision and place of an array."""
        return arrays.held(self.part.right, like, self.ranks)

    def _span(self) -> range:
        columns = self.columns
        return range(columns.start + self.across[0][0], columns.stop + self.across[-1][0], columns.step)

    @property
    def _seen(self) -> tuple[slice, slice, slice]:
        """Of the object's cells."""
        return self.rows, _slice(self._span()), slice(None)

    def _places(self) -> Iterator[tuple[slice, slice]]:
        """Columns of cells within the span, and of factors, of each offset."""
        start, width = 0, len(self.columns)
        for dx, rank in self.across:
            shift = (dx - self.across[0][0]) // self.columns.step
            yield slice(shift, shift + width), slice(start, start + rank)
            start += rank

    def seen(self, points: Array) -> Array:
        """Points (rows, columns, points) through the left factors: (rows, columns, ranks)."""
        xp, left = arrays.namespace(points), self._left(points)
        wide = points[self._seen]
        if left is None:
            return wide
        wide = wide @ left
        return xp.concat([wide[:, cells, ranks] for cells, ranks in self._places()], axis=2)

    def return_to(self, points: Array, seen: Array) -> None:
        """The transpose of `seen`, added to points."""
        xp, left = arrays.namespace(seen), self._left(seen)
        if left is None:
            points[self._seen] += seen
            return
        shape = (seen.shape[0], len(self._span()), seen.shape[2])
        wide = xp.zeros(shape, dtype=seen.dtype, device=seen.device)
        for cells, ranks in self._places():
            wide[:, cells, ranks] = seen[:, :, ranks]
        points[self._seen] += wide @ xp.matrix_transpose(left)


def periodic_operator(
    camera: HasOptics,
    grid: Grid,
    dz: float | Sequence[float] = 0.0,
    *,
    accuracy: float = 1e-3,
    folder: str | PathLike[str] | None = None,
    progress: Progress | None = None,
) -> Linear:
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
    if not depths:
        raise GeometryError("dz is empty. Give at least one depth.")
    check_alike(camera.optics())
    if camera.optics().lean is not None:
        return leaning_operator(
            camera.optics(), accuracy, lambda one, number, count: periodic_operator(
                one, grid, dz, accuracy=accuracy, folder=folder, progress=part_of(progress, number, count)
            ),
        )  # fmt: skip
    plain, several = resolved(camera.optics(), accuracy), depths if np.ndim(dz) else None
    if field_lenses.plate_of(plain) is not None:
        making = _OperatorMaker(accuracy, folder, progress)
        maps = [_varying(plain, grid, depth, making.of(k, len(depths))) for k, depth in enumerate(depths)]
        return maps[0] if several is None else stack(maps, object_grid=grid, depths=several)

    distances = [plain.object_distance + depth for depth in depths]
    blurred = max([plain.object_distance, *distances], key=lambda z: blur(plain, z))

    def at(place: Pair, report: Progress | None) -> PeriodicOperator:
        planes, optics = [], []
        for k, distance in enumerate(distances):
            optics.append(replace(Optics.of(plain, distance, accuracy, blurred).bricks, place=place))
            told = part_of(report, k, len(depths))
            held = matrix(optics[k], told, None if folder is None else Path(folder))
            planes.append(_plane(optics[k], held, grid))
            told(1.0)
        return PeriodicOperator(
            optics[0].cells, tuple(planes), readout(optics[0]), accuracy, object_grid=grid, depths=several
        )

    if plain.model == "exact" and field_matters(plain, accuracy):
        parts = (part_of(progress, k, 9) for k in range(9))
        operator: Linear = over_field(plain, lambda place: at(place, next(parts)))
    else:
        operator = at((0.0, 0.0), progress)
    memory.require(
        operator.memory_bytes, "the raw image", "Use fewer lenslets, or larger pixels.", SamplingError
    )
    return operator


@dataclass(frozen=True, slots=True)
class _OperatorMaker:
    """How an operator is made."""

    accuracy: float
    folder: str | PathLike[str] | None
    progress: Progress | None

    def of(self, number: int, count: int) -> "_OperatorMaker":
        """One of several."""
        return replace(self, progress=part_of(self.progress, number, count))


def _varying(
    camera: CameraOptics, grid: Grid, dz: float, making: _OperatorMaker, fields: Fields | None = None
) -> Linear:
    """Of a plane before a lens that changes over the field; `fields`, its own where the grid has more."""
    if camera.objects is not None:
        return seen_plane(
            camera, grid, dz, lambda one, seen, depth, known: _varying(one, seen, depth, making, known)
        )
    distance, accuracy = camera.object_distance + dz, making.accuracy
    optics = Optics.of(camera, distance, accuracy)
    turns = mirrors.turns(optics.bricks)
    found = field_lenses.lenses(
        camera, fields or (grid.y / distance, grid.x / distance), seen(camera, distance, accuracy), accuracy,
        mirrors.of_fields(turns, optics.rotation),
    )  # fmt: skip
    count, number = len(found.sources), iter(range(len(found.sources)))
    _check_price(optics.bricks, found.sources)

    def of(one: CameraOptics) -> PeriodicOperator:
        mine = making.of(next(number), count)
        result = periodic_operator(
            one, grid, dz, accuracy=accuracy, folder=mine.folder, progress=mine.progress
        )
        memory.require(
            count * result.memory_bytes, f"the operators of {count} lenses over the field",
            "Use fewer lenslets, or a coarser accuracy.", SamplingError,
        )  # fmt: skip
        assert isinstance(result, PeriodicOperator)  # of one lens and depth
        return result

    def mirrored(one: PeriodicOperator, number: int) -> PeriodicOperator:
        return mirrored_operator(one, turns[number])

    return field_lenses.operator(camera, grid, distance, found, of, mirrored)


def mirrored_operator(operator: PeriodicOperator, turn: Turn) -> PeriodicOperator:
    """With the same matrices, of what the main lens makes of mirrored light."""

    def before(spread: Linear) -> Chain:
        return Chain((spread, Mirror(spread.shape[0], turn).T))

    planes = tuple(
        replace(
            plane,
            spread=before(plane.spread),
            beyond=plane.beyond and replace(plane.beyond, spread=before(plane.beyond.spread)),
        )
        for plane in operator.planes
    )
    image = Mirror(operator.readout.shape[1], turn)
    return replace(operator, planes=planes, readout=Chain((image, operator.readout)))


def _check_price(optics: Optics, sources: Sequence[Pair]) -> None:
    """Refuse what would take too long, behind the lenses of some fields; warn of minutes."""
    each = (replace(optics, camera=field_lenses.at(optics.camera, *source)) for source in sources)
    told, total = f"the operators of {len(sources)} lenses over the field", sum(map(operations, each))
    if total > LONGEST:
        raise SamplingError(
            f"{told} take {total:.0e} operations, {total / A_MINUTE:.0f} min of a processor that does 1e11 "
            f"a second; {LONGEST:.0e} are allowed. Ask for a coarser accuracy, or use "
            f"{'slower' if optics.straight else 'square'} lenslets."
        )
    said(total, f"{told} take, where they are not kept already,")


def _plane(optics: Optics, matrix: KernelMatrix | StreamedMatrix, grid: Grid) -> ObjectPlane:
    """The spread of an object's samples onto the points of the cells, and what lies beyond these."""
    cells = optics.cells
    ring = (cells.ring[0] + matrix.margin[0], cells.ring[1] + matrix.margin[1])
    return ObjectPlane(
        matrix, spread(optics, grid, cells.points, ring), beyond(optics, grid, matrix.glare[0])
    )
