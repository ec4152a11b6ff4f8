"""Raw image of a volume by a light-field microscope, and the adjoint: matrix products over lenslets' cells.

With s × s points in each lenslet's cell and N × N samples of the image, a plane's raw image is the sum over
the offsets between the points' cell and the image's of (cells × s²) · (s² × N²). All offsets of a depth are
one product: the points of the neighbouring cells are gathered first. Where it takes less time, all of it goes
through the lenslets' frequencies instead (`microscope_spectrum`), with the same result to rounding. What goes
far is added by a few patterns (`microscope_far`).
"""

import hashlib
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from os import PathLike
from pathlib import Path
from typing import ClassVar

import numpy as np

from lumigraph import store
from lumigraph.core import arrays, checks, memory
from lumigraph.core.arrays import Array
from lumigraph.core.cache import ByteCache
from lumigraph.core.grid import Grid
from lumigraph.core.linear import Linear, Shape
from lumigraph.core.matrix import Matrix
from lumigraph.core.progress import Progress
from lumigraph.elements.objective import Objective
from lumigraph.errors import FormatError, GeometryError, SamplingError
from lumigraph.operators import microscope_pixels, microscope_spectrum
from lumigraph.operators.microscope_cell import CellSampling, Lenslet
from lumigraph.operators.microscope_far import Far, FarLight
from lumigraph.operators.microscope_kernels import (
    Demand,
    SliceKernel,
    kernel_bytes,
    octant,
    require_window,
    slice_kernel,
)
from lumigraph.operators.microscope_pixels import FRAME

VERSION = 1
"""Of the kernels' numbers: a change of theirs makes those that are kept useless."""

GATHERED = 2**27
"""Numbers that are gathered for one product."""

SHARE = 0.3
"""Part of the free memory that matrices of the lenslets' frequencies may take."""

_MATRICES = ByteCache()


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class MicroscopeOperator(Linear):
    """A volume (z, y, x) to a raw image (ny, nx), and back.

    Parameters
    ----------
    kernels
        Of each depth.
    cells
        Lenslets (rows, columns) whose light is followed, with the frame.
    placement
        From samples to pixels; None where they are the N × N samples of each cell.
    frame
        Lenslets around the object: pixels at the border see some of their light.
    by_frequency
        Whether `forward` and `adjoint` go through the lenslets' frequencies (`microscope_spectrum`), where
        rounding may leave -1e-6 of the highest value instead of 0; else by products over all offsets.
    """

    kernels: tuple[SliceKernel, ...]
    cells: tuple[int, int]
    placement: Matrix | None = None
    frame: int = 0
    by_frequency: bool = False
    _spectra: dict = field(default_factory=dict)

    title: ClassVar[str] = "Operator of a light-field microscope"

    @property
    def shape(self) -> tuple[Shape, Shape]:
        """Pixels (ny, nx) of the raw image, samples (y, x) or (z, y, x) of the object."""
        s, N = self.kernels[0].sampling.points, self.kernels[0].sampling.pixels
        raw = (self.cells[0] * N, self.cells[1] * N) if self.placement is None else self.placement.raw_shape
        volume = () if self.depths is None else (len(self.kernels),)
        rows, columns = self._seen
        return raw, (*volume, rows * s, columns * s)

    @property
    def _seen(self) -> tuple[int, int]:
        """Lenslets before which the object stands."""
        return self.cells[0] - 2 * self.frame, self.cells[1] - 2 * self.frame

    @property
    def error(self) -> float:
        """Relative rms of points' images, of the worst depth."""
        return max(kernel.error for kernel in self.kernels)

    @property
    def multiply_adds(self) -> int:
        """Of the matrix products of one application of `forward` or `adjoint`."""
        if self.by_frequency:
            tiles = math.prod(microscope_spectrum.tiling(self.kernels, self.cells).counts)
            return 4 * tiles * microscope_spectrum.matrix_numbers(self.kernels, self.cells)
        rows = sum(len(kernel.offsets) * kernel.sampling.classes for kernel in self.kernels)
        return rows * self.kernels[0].sampling.pixels ** 2 * math.prod(self.cells)

    @property
    def nbytes(self) -> int:
        """Of the stored kernels."""
        return sum(kernel.blocks.nbytes for kernel in self.kernels)

    @property
    def memory_bytes(self) -> float:
        """Of the kernels, of the lenslets' frequencies where they are used, and of an image [bytes]."""
        spectra = microscope_spectrum.matrix_numbers(self.kernels, self.cells) if self.by_frequency else 0
        return self.nbytes + 4.0 * (spectra + 3 * sum(math.prod(shape) for shape in self.shape))

    @property
    def reach(self) -> int:
        """Lenslets that light goes to either side of the one that it is before, at most."""
        return max(map(_reach, self.kernels))

    def widened(self) -> "tuple[MicroscopeOperator, tuple[slice, slice]]":
        """The same raw image of an object that reaches as far beyond the lenslets as light comes from.

        A picture is a crop of what the lenslets see: light comes in from objects beside it, and a model
        without them explains it by objects at the border.

        Returns
        -------
        tuple
            The operator, and where its object (y, x) is that of this one.
        """
        margin, s = self.reach, self.kernels[0].sampling.points
        if "wide" not in self._spectra:
            self._spectra["wide"] = self._with_margin(margin)
        rows, columns = (slice(margin * s, (margin + n) * s) for n in self._seen)
        return self._spectra["wide"], (rows, columns)

    def _with_margin(self, margin: int) -> "MicroscopeOperator":
        sampling, grid = self.kernels[0].sampling, self.object_grid
        cells = (self.cells[0] + 2 * margin, self.cells[1] + 2 * margin)
        if grid is not None:
            ny, nx = (n + 2 * margin * sampling.points for n in grid.shape)
            grid = Grid((ny, nx), grid.pitch, grid.center)
        ny, nx = self.shape[0]
        placement = self.placement or microscope_pixels.every((ny, nx))
        return replace(
            self, cells=cells, object_grid=grid,
            placement=microscope_pixels.widened(placement, margin * sampling.pixels),
            by_frequency=_suits_frequencies(self.kernels, cells), _spectra={},
        )  # fmt: skip

    def _forward(self, intensity: Array) -> Array:
        volume = self._framed(intensity if self.depths is not None else intensity[None, ...])
        plane = self._light(volume) if self.by_frequency else self._by_offsets(volume)
        if (far := self._far(volume)) is not None:
            N = self.kernels[0].sampling.pixels
            plane = plane + _plane(far.forward(volume, self.kernels[0].sampling.points), N)
        return plane if self.placement is None else self.placement._forward(plane)

    def _framed(self, volume: Array) -> Array:
        s = self.kernels[0].sampling.points
        edge, shape = self.frame * s, (self.cells[0] * s, self.cells[1] * s)
        return arrays.framed(volume, (edge, edge), shape) if edge else volume

    def _far(self, like: Array) -> FarLight | None:
        key = "far", arrays.placement(like)
        fars = [kernel.far for kernel in self.kernels if kernel.far is not None]
        if len(fars) < len(self.kernels):
            return None
        if key not in self._spectra:
            self._spectra[key] = FarLight.of(fars, self.cells, like)
        return self._spectra[key]

    def _light(self, volume: Array) -> Array:
        tiling = microscope_spectrum.tiling(self.kernels, self.cells)
        N = self.kernels[0].sampling.pixels
        return microscope_spectrum.forward(self._matrix(volume), tiling, volume, N)

    def _matrix(self, like: Array) -> Array:
        key = arrays.placement(like)
        if key not in self._spectra:
            found = microscope_spectrum.matrices(self.kernels, self.cells)
            self._spectra[key] = arrays.like(found, like)
        return self._spectra[key]

    def _by_offsets(self, volume: Array) -> Array:
        xp, image = arrays.namespace(volume), 0.0
        for k, kernel in enumerate(self.kernels):
            s, reach = kernel.sampling.points, _reach(kernel)
            points = _padded(_class_first(volume[k, ...], s), reach)
            for rows, offsets, matrix in _products(kernel, volume, math.prod(self.cells)):
                parts = [self._window(points, reach - dy, reach - dx) for dy, dx in offsets]
                gathered = xp.reshape(xp.stack(parts), (rows, -1))
                image = image + xp.matrix_transpose(matrix) @ gathered
        N = self.kernels[0].sampling.pixels
        return _plane(xp.reshape(image, (N * N, *self.cells)), N)

    def _adjoint(self, raw: Array) -> Array:
        volume = self._volume(raw)
        return volume if self.depths is not None else volume[0, ...]

    def _volume(self, raw: Array) -> Array:
        xp = arrays.namespace(raw)
        plane = raw if self.placement is None else self.placement._adjoint(raw)
        s, N = self.kernels[0].sampling.points, self.kernels[0].sampling.pixels
        light = _class_first(plane, N)
        if self.by_frequency:
            tiling = microscope_spectrum.tiling(self.kernels, self.cells)
            volume = microscope_spectrum.adjoint(self._matrix(raw), tiling, plane, s)
        else:
            flat = xp.reshape(light, (N * N, -1))
            volume = xp.stack([self._back(kernel, flat) for kernel in self.kernels])
        if (far := self._far(raw)) is not None:
            volume = volume + far.adjoint(light, s)
        rows, columns = (slice(self.frame * s, (n - self.frame) * s) for n in self.cells)
        return volume[:, rows, columns]

    def _of_point(self, point: np.ndarray) -> np.ndarray:
        volume, sampling = self._framed(point.reshape(-1, *point.shape[-2:])), self.kernels[0].sampling
        plane = self._by_offsets(volume)  # dark pixels stay 0
        if (far := self._far(volume)) is not None:
            plane += np.maximum(_plane(far.forward(volume, sampling.points), sampling.pixels), 0)
        return plane if self.placement is None else self.placement._forward(plane)

    def _back(self, kernel: SliceKernel, flat: Array) -> Array:
        xp, s, reach = arrays.namespace(flat), kernel.sampling.points, _reach(kernel)
        shape = (s * s, *(n + 2 * reach for n in self.cells))
        points = xp.zeros(shape, dtype=flat.dtype, device=arrays.device(flat))
        for _, offsets, matrix in _products(kernel, flat, math.prod(self.cells)):
            parts = xp.reshape(matrix @ flat, (len(offsets), s * s, *self.cells))
            for part, (dy, dx) in enumerate(offsets):
                window = self._window(points, reach - dy, reach - dx)
                window += parts[part, ...]
        return _plane(points[:, reach : reach + self.cells[0], reach : reach + self.cells[1]], s)

    def _window(self, points: Array, top: int, left: int) -> Array:
        return points[:, top : top + self.cells[0], left : left + self.cells[1]]


@dataclass(frozen=True, slots=True)
class Layout:
    """Lenslets that see the object, how finely they are sampled, and the pixels behind them.

    Parameters
    ----------
    seen
        Lenslets (rows, columns) before the object.
    sampling
        Of a cell.
    placement
        From samples, those of the frame too, to real pixels; None for N × N samples per cell.
    center
        Of the cells, in the object (y, x) [m].
    """

    seen: tuple[int, int]
    sampling: CellSampling
    placement: Matrix | None = None
    center: tuple[float, float] = (0.0, 0.0)

    @property
    def frame(self) -> int:
        """Lenslets around those that are seen, to each side: pixels at the border see some of their light."""
        return 0 if self.placement is None else FRAME

    @property
    def cells(self) -> tuple[int, int]:
        """Lenslets whose light is followed."""
        return self.seen[0] + 2 * self.frame, self.seen[1] + 2 * self.frame


def microscope_operator(
    objectives: Sequence[Objective],
    lenslet: Lenslet,
    layout: Layout,
    depths: Sequence[float] | None = None,
    *,
    accuracy: float = 1e-3,
    folder: str | PathLike[str] | None = None,
    progress: Progress | None = None,
) -> MicroscopeOperator:
    """Operator from slices at `depths` to a raw image.

    Parameters
    ----------
    objectives
        One for each wavelength.
    lenslet, layout
        The array and the pixels.
    depths
        Of the slices from the focused plane [m], positive farther from the objective, for an object
        (z, y, x); None for the focused plane alone, an object (y, x).
    accuracy
        Relative rms of points' images.
    folder
        Keeps the kernels in files that are mapped into memory, and finds again those that are there: for
        volumes whose kernels do not fit in memory, and for the next run.
    progress
        Called as ``progress(fraction)`` after each slice.

    Raises
    ------
    SamplingError
        The kernels do not fit in memory and no folder is given, or not on its disk.
    GeometryError
        No depths, one that is not finite, or depths that are not in order.
    FormatError
        A folder that cannot be made.
    """
    planes = (0.0,) if depths is None else tuple(checks.finite("a depth", dz) for dz in depths)
    _check_order(planes)
    demand = Demand(require_accuracy(accuracy), math.ceil(1.5 * max(layout.cells)))
    for one in objectives:
        require_window(one, lenslet, max(planes, key=abs), demand)
    sizes = [kernel_bytes(objectives[0], lenslet, layout.sampling, dz, demand) for dz in planes]
    stored = 1 if folder is None else 0
    needed = max(sizes) * 2 + stored * sum(sizes) * (0.25 if objectives[0].is_round else 1)
    remedy = "Use fewer slices or samples, or folder= to keep them on disk."
    memory.require(needed, f"the images of points at {len(planes)} depths", remedy, SamplingError)
    if folder is not None:
        try:
            Path(folder).mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise FormatError(f"folder {folder} cannot be made ({error.strerror}). Give another.") from error
        share = len(octant(layout.sampling.points)) / layout.sampling.classes if objectives[0].is_round else 1
        memory.require_disk(sum(sizes) * share, folder, "the images of points", SamplingError)
    kernels = []
    for done, dz in enumerate(planes):
        kernels.append(_kept(objectives, lenslet, layout.sampling, dz, demand, folder))
        if progress is not None:
            progress((done + 1) / len(planes))
    return MicroscopeOperator(
        tuple(kernels), layout.cells, layout.placement, layout.frame,
        _suits_frequencies(kernels, layout.cells),
        object_grid=_object_grid(lenslet, layout), depths=None if depths is None else planes,
    )  # fmt: skip


def require_accuracy(accuracy: float) -> float:
    """A relative rms that can be asked for, or an error."""
    if not 1e-5 <= checks.finite("accuracy", accuracy, "1") <= 0.1:
        raise GeometryError(f"accuracy is {accuracy:g} but must be from 1e-5 to 0.1.")
    return accuracy


def _check_order(depths: tuple[float, ...]) -> None:
    if not depths:
        raise GeometryError("there are no depths. Give at least one, such as 0.0 for the focused plane.")
    steps = np.diff(depths)
    if len(steps) and not ((steps > 0).all() or (steps < 0).all()):
        raise GeometryError("depths must ascend or descend, and differ. Sort them, and leave out duplicates.")


def _suits_frequencies(kernels: Sequence[SliceKernel], cells: tuple[int, int]) -> bool:
    """Whether the way through the lenslets' frequencies is faster, and its matrices leave memory free."""
    needed, free = 4.0 * microscope_spectrum.matrix_numbers(kernels, cells), memory.available()
    fits = free is None or needed < free * SHARE
    return fits and microscope_spectrum.is_faster(kernels, cells)


def _object_grid(lenslet: Lenslet, layout: Layout) -> Grid:
    s = layout.sampling.points
    shape = (layout.seen[0] * s, layout.seen[1] * s)
    pitch = lenslet.pitch / lenslet.magnification / s
    # Cells are centred as a whole: with an even number of samples the middle lies between two.
    center = [c + (0.0 if n % 2 else pitch / 2) for c, n in zip(layout.center, shape, strict=True)]
    return Grid(shape, (pitch, pitch), (center[0], center[1]))


def _kept(
    objectives: Sequence[Objective],
    lenslet: Lenslet,
    sampling: CellSampling,
    dz: float,
    demand: Demand,
    folder: str | PathLike[str] | None,
) -> SliceKernel:
    """The kernel of a depth, mapped from its file in the folder, or in the user's cache."""
    told = repr((VERSION, tuple(objectives), lenslet, sampling, dz, demand))
    key = f"slice-{hashlib.sha256(told.encode()).hexdigest()[:20]}"

    def built() -> dict[str, np.ndarray]:
        kernel = slice_kernel(objectives, lenslet, sampling, dz, demand)
        held = {"offsets": kernel.offsets, "blocks": kernel.blocks}
        if kernel.far is not None:
            held |= {f"far_{name}": getattr(kernel.far, name) for name in ("offsets", "weights", "images")}
        return held | {"told": np.array([kernel.error, kernel.passed])}

    found = store.kept(key, built, None if folder is None else Path(folder))
    symmetric = all(one.is_round for one in objectives)
    far = (
        Far(found["far_offsets"], found["far_weights"], found["far_images"])
        if "far_images" in found
        else None
    )
    error, passed = (float(value) for value in found["told"])
    return SliceKernel(found["offsets"], found["blocks"], sampling, symmetric, far, error, passed)


def _products(
    kernel: SliceKernel, like: Array, cells: int
) -> Iterator[tuple[int, list[tuple[int, int]], Array]]:
    """Groups of offsets that fit in memory: rows, the offsets, and their matrix (rows, N²)."""
    matrix = _MATRICES.get((kernel, arrays.placement(like)), lambda: arrays.like(kernel.matrix(), like))
    classes, offsets = kernel.sampling.classes, [(int(dy), int(dx)) for dy, dx in kernel.offsets]
    step = max(1, GATHERED // (classes * cells))
    for start in range(0, len(offsets), step):
        chosen = offsets[start : start + step]
        yield len(chosen) * classes, chosen, matrix[start * classes : (start + len(chosen)) * classes, ...]


def _reach(kernel: SliceKernel) -> int:
    return int(np.abs(kernel.offsets).max())


def _class_first(plane: Array, n: int) -> Array:
    """(rows n, columns n) to (n², rows, columns)."""
    xp, tiles = arrays.namespace(plane), arrays.tiled(plane, (n, n))
    return xp.reshape(xp.permute_dims(tiles, (2, 3, 0, 1)), (n * n, *tiles.shape[:2]))


def _plane(cells: Array, n: int) -> Array:
    """(n², rows, columns) to (rows n, columns n): the inverse of `_class_first`."""
    xp = arrays.namespace(cells)
    return arrays.untiled(xp.permute_dims(xp.reshape(cells, (n, n, *cells.shape[1:])), (2, 3, 0, 1)))


def _padded(points: Array, reach: int) -> Array:
    """Zeros around cells (k, rows, columns)."""
    rows, columns = (n + 2 * reach for n in points.shape[1:])
    return arrays.framed(points, (reach, reach), (rows, columns))
