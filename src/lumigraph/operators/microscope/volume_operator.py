"""Raw image of a volume by a light-field microscope, and the adjoint: matrix products over lenslets' cells.

With s × s points in each lenslet's cell and N × N samples of the image, a plane's raw image is the sum over
the offsets between the points' cell and the image's of (cells × s²) · (s² × N²). All offsets of a depth are
one product: the points of the neighbouring cells are gathered first. Where it takes less time, all of it goes
through the lenslets' frequencies instead (`spectrum`), with the same result to rounding and to
`left_out`. What goes far is added by a few patterns (`far_light`).
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np

from lumigraph.core import arrays
from lumigraph.core.arrays import Array
from lumigraph.core.cache import ByteCache
from lumigraph.core.grid import Grid
from lumigraph.core.linear import Linear, Shape
from lumigraph.operators.microscope import spectrum
from lumigraph.operators.microscope.far_light import FarCells, FarLight, far_numbers, shared
from lumigraph.operators.microscope.kernels import SHARES, SliceKernel
from lumigraph.operators.microscope.patterns import Patterns, patterns, pixel_patterns
from lumigraph.operators.microscope.tiles import Tiling

GATHERED = 2**27
"""Numbers that are gathered for one product."""

FINEST = 1e-6
"""Relative rms that far light loses where nothing else may."""

_MATRICES = ByteCache()


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class MicroscopeOperator(Linear):
    """A volume (z, y, x) to a raw image (ny, nx), and back.

    Parameters
    ----------
    kernels
        Of each depth.
    cells
        Lenslets (rows, columns) whose images are followed.
    placement
        From samples to pixels; None where they are the N × N samples of each cell.
    margin
        Lenslets that the object reaches beyond those on each side; below 0 where they reach beyond it, as
        pixels at the border see some of their light.
    by_frequency
        Whether `forward` and `adjoint` go through the lenslets' frequencies (`spectrum`), where
        rounding may leave -1e-6 of the highest value instead of 0; else by products over all offsets.
    left_out
        Relative rms of a point's image that fewer patterns of the points may leave out there, those of the
        pixels what is left (`patterns.pixel_patterns`); 0 for all patterns.
    """

    kernels: tuple[SliceKernel, ...]
    cells: tuple[int, int]
    placement: Linear | None = None
    margin: int = 0
    by_frequency: bool = False
    left_out: float = 0.0
    _spectra: dict = field(default_factory=dict)

    title: ClassVar[str] = "Operator of a light-field microscope"

    @property
    def shape(self) -> tuple[Shape, Shape]:
        """Pixels (ny, nx) of the raw image, samples (y, x) or (z, y, x) of the object."""
        s, N = self.kernels[0].sampling.points, self.kernels[0].sampling.pixels
        raw = (self.cells[0] * N, self.cells[1] * N) if self.placement is None else self.placement.shape[0]
        volume = () if self.depths is None else (len(self.kernels),)
        rows, columns = self._seen
        return raw, (*volume, rows * s, columns * s)

    @property
    def _seen(self) -> tuple[int, int]:
        """Lenslets before which the object stands."""
        return self.cells[0] + 2 * self.margin, self.cells[1] + 2 * self.margin

    @property
    def error(self) -> float:
        """Relative rms of points' images, of the worst depth, with what is left out of them."""
        if not self.by_frequency:
            return max(kernel.error for kernel in self.kernels)
        pairs, pixels, far = (
            zip(self.kernels, self._points, strict=True),
            self._pixels.left_out,
            self._shared[1],
        )
        return max(math.hypot(kernel.error, points.left_out, pixels, far) for kernel, points in pairs)

    @property
    def multiply_adds(self) -> int:
        """Multiply-adds of the matrix products in one application of `forward` or `adjoint`."""
        if self.by_frequency:
            return 4 * self._tiling.count * self._matrix_numbers
        rows = sum(len(kernel.offsets) * kernel.sampling.classes for kernel in self.kernels)
        return rows * self.kernels[0].sampling.pixels ** 2 * math.prod(self.cells)

    @property
    def nbytes(self) -> int:
        """Memory of the stored kernels [bytes]."""
        return sum(kernel.blocks.nbytes for kernel in self.kernels)

    @property
    def memory_bytes(self) -> float:
        """Memory of the kernels, of the matrices, and of what `forward` or `adjoint` holds [bytes]."""
        N, given = self.kernels[0].sampling.pixels, sum(math.prod(shape) for shape in self.shape)
        if self.by_frequency:
            held = spectrum.held_numbers(self._tiling, self._points, self._pixels)
            return self.nbytes + 4.0 * (self._matrix_numbers + self._far_numbers + given + held)
        most = max(len(kernel.offsets) * kernel.sampling.classes for kernel in self.kernels)
        gathered = min(2 * most * math.prod(self.cells), 2 * GATHERED)
        matrices = sum(len(kernel.offsets) * kernel.sampling.classes for kernel in self.kernels) * N * N
        images = 3 * N * N * math.prod(self.cells)
        return self.nbytes + 4.0 * (matrices + 2 * given + images + gathered)

    @property
    def reach(self) -> int:
        """Lenslets that light goes to either side of the one that it is before, at most."""
        return max(map(_reach, self.kernels))

    def widened(self, least: float) -> "tuple[MicroscopeOperator, tuple[slice, slice]]":
        """The same raw image of an object that reaches beyond the lenslets, as light comes in from there.

        A picture is a crop of what the lenslets see: a model without what stands beside it explains its
        light by objects at the border.

        Parameters
        ----------
        least
            Part of the light of a lenslet's samples that must come onto the picture if they are followed.

        Returns
        -------
        tuple
            The operator, and where its object (y, x) is that of this one.
        """
        more, s = max(_followed(kernel, least) for kernel in self.kernels), self.kernels[0].sampling.points
        if ("wide", more) not in self._spectra:
            self._spectra["wide", more] = self._with_margin(more)
        rows, columns = (slice(more * s, (more + n) * s) for n in self._seen)
        return self._spectra["wide", more], (rows, columns)

    def _with_margin(self, more: int) -> "MicroscopeOperator":
        s, grid, margin = self.kernels[0].sampling.points, self.object_grid, self.margin + more
        if grid is not None:
            ny, nx = (n + 2 * more * s for n in grid.shape)
            grid = Grid((ny, nx), grid.pitch, grid.center)
        return replace(
            self, margin=margin, object_grid=grid,
            by_frequency=suits_frequencies(self.kernels, self.cells, margin, self.left_out), _spectra={},
        )  # fmt: skip

    @property
    def _tiling(self) -> Tiling:
        if "tiling" not in self._spectra:
            counts = _counts(self._points, self._pixels)
            told = spectrum.tiling(self.kernels, self.cells, self.margin, counts)
            self._spectra["tiling"] = told
        return self._spectra["tiling"]

    @property
    def _points(self) -> list[Patterns]:
        """Patterns of each depth."""
        if "points" not in self._spectra:
            self._spectra["points"] = patterns(self.kernels, self.left_out)
        return self._spectra["points"]

    @property
    def _pixels(self) -> Patterns:
        """Patterns of a cell's image."""
        if "pixels" not in self._spectra:
            self._spectra["pixels"] = pixel_patterns(self.kernels, self.left_out, self._points)
        return self._spectra["pixels"]

    @property
    def _matrix_numbers(self) -> int:
        return spectrum.matrix_numbers(self._tiling, *_counts(self._points, self._pixels))

    @property
    def _far_numbers(self) -> int:
        """Numbers of far light, and of what it holds while it is followed."""
        fars = self._shared[0]
        return far_numbers(fars, self.cells, self.margin, self._pixels.count) if fars else 0

    @property
    def side_by_side(self) -> int:
        """Objects that go through each frequency's matrix in less time than through all one by one."""
        if not self.by_frequency:
            return 1
        return spectrum.sharing(self._tiling)

    def _forward(self, intensity: Array) -> Array:
        return self._forwards([intensity])[0]

    def _forwards(self, intensities: Sequence[Array]) -> list[Array]:
        volumes = intensities if self.depths is not None else [one[None, ...] for one in intensities]
        if self.by_frequency:
            return self._by_frequencies(volumes[0]).forward(volumes)
        planes = [self._by_offsets(volume) + self._far_plane(volume) for volume in volumes]
        placement = self.placement
        return planes if placement is None else [placement._forward(plane) for plane in planes]

    def _far(self, like: Array, pixels: Patterns | None = None) -> FarLight | None:
        """Far light, on patterns of a cell's image by those that depths share, on samples by their own."""
        if not self._own_fars:
            return None
        key = "far", pixels is None, arrays.placement(like)
        if key not in self._spectra:
            fars, basis = (
                (self._own_fars, None) if pixels is None else (self._shared[0], pixels.nearest.basis)
            )
            self._spectra[key] = FarLight.of(fars, self.cells, self.margin, basis, like)
        return self._spectra[key]

    @property
    def _own_fars(self) -> list[FarCells]:
        """Far light of each depth; empty where one has none."""
        fars = [kernel.far for kernel in self.kernels if kernel.far is not None]
        return fars if len(fars) == len(self.kernels) else []

    @property
    def _shared(self) -> tuple[list[FarCells], float]:
        """Far light of each depth by patterns that they share, and the relative rms that those lose."""
        if "shared" not in self._spectra:
            accuracy, spent = self.left_out / SHARES["patterns"], max(one.error for one in self.kernels)
            left = 0.5 * math.sqrt(accuracy**2 - spent**2) if spent < accuracy else accuracy  # missed anyway
            allowed = max(min(SHARES["rank"] * accuracy, left), FINEST)
            light = [_norms(kernel) for kernel in self.kernels]
            self._spectra["shared"] = shared(self._own_fars, light, allowed) if self._own_fars else ([], 0.0)
        return self._spectra["shared"]

    def _far_plane(self, volume: Array) -> Array | float:
        if (far := self._far(volume)) is None:
            return 0.0
        N = self.kernels[0].sampling.pixels
        light = far.forward(volume, self.kernels[0].sampling.points)
        return arrays.untiled(arrays.namespace(light).reshape(light, (*self.cells, N, N)))

    def _by_frequencies(self, like: Array) -> spectrum.Spectra:
        key = arrays.placement(like)
        if key not in self._spectra:
            self._spectra[key] = spectrum.Spectra.of(
                self.kernels, (self._points, self._pixels), self._tiling, like,
                self.placement, self._far(like, self._pixels),
            )  # fmt: skip
        return self._spectra[key]

    def _by_offsets(self, volume: Array) -> Array:
        xp, image = arrays.namespace(volume), 0.0
        for k, kernel in enumerate(self.kernels):
            s, edge = kernel.sampling.points, self._edge(kernel)
            points, first = _padded(_class_first(volume[k, ...], s), edge), self.margin + edge
            for rows, offsets, matrix in _products(kernel, volume, math.prod(self.cells)):
                parts = [self._window(points, first - dy, first - dx) for dy, dx in offsets]
                gathered = xp.reshape(xp.stack(parts), (rows, -1))
                image = image + xp.matrix_transpose(matrix) @ gathered
        N = self.kernels[0].sampling.pixels
        return _plane(xp.reshape(image, (N * N, *self.cells)), N)

    def _adjoint(self, raw: Array) -> Array:
        return self._adjoints([raw])[0]

    def _adjoints(self, raws: Sequence[Array]) -> list[Array]:
        if self.by_frequency:
            volumes = self._by_frequencies(raws[0]).adjoint(raws)
        else:
            placed = self.placement
            planes = raws if placed is None else [placed._adjoint(raw) for raw in raws]
            volumes = [self._by_offsets_back(plane) for plane in planes]
        return volumes if self.depths is not None else [volume[0, ...] for volume in volumes]

    def _by_offsets_back(self, plane: Array) -> Array:
        xp, s, N = arrays.namespace(plane), self.kernels[0].sampling.points, self.kernels[0].sampling.pixels
        light = _class_first(plane, N)
        flat = xp.reshape(light, (N * N, -1))
        volume = xp.stack([self._back(kernel, flat) for kernel in self.kernels])
        if (far := self._far(plane)) is None:
            return volume
        even = far.adjoint(xp.permute_dims(light, (1, 2, 0)))
        return volume + xp.repeat(xp.repeat(even, s, axis=1), s, axis=2)

    def _of_point(self, point: np.ndarray) -> np.ndarray:
        volume = point.reshape(-1, *point.shape[-2:])
        plane = self._by_offsets(volume)  # dark pixels stay 0
        plane += np.maximum(self._far_plane(volume), 0)
        return plane if self.placement is None else self.placement._forward(plane)

    def _back(self, kernel: SliceKernel, flat: Array) -> Array:
        xp, s, edge = arrays.namespace(flat), kernel.sampling.points, self._edge(kernel)
        (rows, columns), first = self._seen, self.margin + edge
        shape = (s * s, rows + 2 * edge, columns + 2 * edge)
        points = xp.zeros(shape, dtype=flat.dtype, device=arrays.device(flat))
        for _, offsets, matrix in _products(kernel, flat, math.prod(self.cells)):
            parts = xp.reshape(matrix @ flat, (len(offsets), s * s, *self.cells))
            for part, (dy, dx) in enumerate(offsets):
                window = self._window(points, first - dy, first - dx)
                window += parts[part, ...]
        return _plane(points[:, edge : edge + rows, edge : edge + columns], s)

    def _edge(self, kernel: SliceKernel) -> int:
        """Lenslets around the object that light is taken from, as if something stood there."""
        return max(_reach(kernel) - self.margin, 0)

    def _window(self, points: Array, top: int, left: int) -> Array:
        return points[:, top : top + self.cells[0], left : left + self.cells[1]]


def _norms(kernel: SliceKernel) -> tuple[float, float]:
    """Norms of the image of the faintest point, in cells that are not far, and of an even plane's."""
    return math.sqrt(min(float(np.vdot(one, one)) for one in kernel.blocks)), float(
        np.linalg.norm(kernel.white())
    )


def suits_frequencies(
    kernels: Sequence[SliceKernel], cells: tuple[int, int], margin: int, left_out: float = 0.0
) -> bool:
    """True if the lenslets' frequencies are faster, and their matrices take no more than `MOST`.

    Or less than those of all offsets, which then would only be worse. It does not depend on the memory that
    is free: the two ways differ by rounding, and a result's bits should not tell the machine.
    """
    if not all(kernel.symmetric for kernel in kernels):
        return False
    points = patterns(kernels, left_out)
    counts = _counts(points, pixel_patterns(kernels, left_out, points))
    told = spectrum.tiling(kernels, cells, margin, counts)
    needed = 4.0 * spectrum.matrix_numbers(told, *counts)
    offsets = 4.0 * sum(len(one.offsets) * one.sampling.classes * one.sampling.pixels**2 for one in kernels)
    fits = needed <= max(spectrum.MOST, offsets)
    return fits and spectrum.is_faster(kernels, told, counts)


def _counts(points: Sequence[Patterns], pixels: Patterns) -> tuple[int, int]:
    return sum(one.count for one in points), pixels.count


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


def _followed(kernel: SliceKernel, least: float) -> int:
    """Lenslets beyond a straight border that send at least a part of their light across it."""
    light = kernel.matrix().reshape(len(kernel.offsets), -1).sum(1, dtype=np.float64)
    beyond = [float(light[kernel.offsets[:, 0] >= k].sum()) for k in range(_reach(kernel) + 1)]
    return sum(bool(part >= least * light.sum()) for part in beyond[1:])


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
