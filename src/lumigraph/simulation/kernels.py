"""The lenslet-periodic operator's matrices, in factors: few numbers for many images of points.

The block between two cells, (points, samples), is ``left @ right`` with as many columns in between as the
light there has patterns: over a hundred in front of a lenslet, one or two far from it. Singular values are
kept until the accuracy is reached; the light of what is left out is given to all points of its cell alike, so
that an even object stays exact.
"""

import hashlib
import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from lumigraph.core import memory, store
from lumigraph.core.cache import ByteCache
from lumigraph.elements import LensletArray
from lumigraph.errors import SamplingError
from lumigraph.simulation import cells as _cells
from lumigraph.simulation.camera import Camera
from lumigraph.simulation.cell_response import INFINITE, SLACK, Axis, Lenslets, Limits
from lumigraph.simulation.cells import Cells, Fineness
from lumigraph.simulation.glare import Glare, glare
from lumigraph.simulation.point_images import factors, images, mirrored, wave

Progress = Callable[[float], None]

VERSION = 2
"""Of what is kept on disk: to be raised with every change of the numbers."""


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """Part of the matrix between an object's cells and an image's.

    Parameters
    ----------
    rows, columns
        Cells of the image, counted from the ring around the array: 0 is the ring, 1 the first row.
    offsets
        (dy, dx, rank): cells from the image's to the object's, row by row, and the factors' columns for it.
    left
        (points, R) with the ranks side by side.
    right
        (R, samples).
    """

    rows: tuple[int, int]
    columns: tuple[int, int]
    offsets: tuple[tuple[int, int, int], ...]
    left: np.ndarray
    right: np.ndarray


Blocks = dict[tuple[int, int], tuple[np.ndarray, np.ndarray]]


@dataclass(frozen=True, slots=True, eq=False)
class Optics:
    """What the kernels of one depth depend on.

    Parameters
    ----------
    camera, array, cells, fineness
        The camera, its array with rows along x, the array's cells, and the accuracy.
    distance
        Object to main lens [m].
    """

    camera: Camera
    array: LensletArray
    cells: Cells
    fineness: Fineness
    distance: float

    @classmethod
    def of(cls, camera: Camera, distance: float, accuracy: float) -> "Optics":
        """Of a plane at a distance from the main lens [m]."""
        fineness, array = Fineness(accuracy), _cells.lenslet_array(camera)
        return cls(camera, array, _cells.cells_of(camera, array, fineness), fineness, distance)

    @property
    def rotation(self) -> float:
        """Of the array [rad]; the cells lie in a frame that turns with it."""
        return 0.0 if self.camera.lattice is None else self.camera.lattice.rotation

    @property
    def key(self) -> str:
        """Names all that the matrix depends on: not the sensor, nor the object's samples."""
        camera = self.camera
        with np.printoptions(threshold=2**62, floatmode="unique"):
            known = repr((
                VERSION, camera.wavelength, camera.separation, camera.lenslet_distance, camera.pupil_diameter,
                camera.lens_train(), self.array, self.cells, self.fineness, self.distance,
            ))  # fmt: skip
        return hashlib.sha256(known.encode()).hexdigest()[:32]

    @property
    def build_bytes(self) -> float:
        """Memory that building the matrix takes at most [bytes], from its sizes."""
        points, samples = (math.prod(n) for n in (self.cells.points, self.cells.samples))
        block = 4.0 * points * samples
        row = (2 * self.reach[1] + 1) * block
        kept = block * math.prod(2 * k + 1 for k in self.near)
        dense = 8.0 * math.prod(axis.samples * len(axis.window) for axis in self.axes)
        return 2 * row + kept + 6 * block + (0 if self.straight else dense)

    @property
    def straight(self) -> bool:
        """Whether what the lenslets do along y does not depend on x."""
        return self.array.shape == "square" and not isinstance(self.array.focal_length, tuple)

    @property
    def axes(self) -> tuple[Axis, Axis]:
        """Sampling of a cell along y and along x."""
        band = SLACK / 2 / _cells.airy(self.camera)
        neighbourhood = self.fineness.neighbours * self.array.lattice.pitch
        y, x = (
            Axis(size, points, samples, neighbourhood, band)
            for size, points, samples in zip(
                self.cells.size, self.cells.points, self.cells.samples, strict=True
            )
        )
        return y, x

    @property
    def reach(self) -> tuple[int, int]:
        """Cells along y and x to which a point's light is followed in full."""
        far = self.fineness.reach(_cells.blur(self.camera, self.distance), _cells.airy(self.camera))
        y, x = (max(1, math.ceil(far / size)) for size in self.cells.size)
        return y, x

    @property
    def near(self) -> tuple[int, int]:
        """Cells to which a point's light is followed at the border of the array."""
        far = self.fineness.near(_cells.blur(self.camera, self.distance), _cells.airy(self.camera))
        y, x = (max(1, round(far / size)) for size in self.cells.size)
        return min(y, self.reach[0]), min(x, self.reach[1])

    @property
    def image_scale(self) -> float:
        """Magnification of the telecentric image onto the sensor, 1 + b/L."""
        return 1 + _cells.lenslet_distance(self.camera) / self.camera.separation


@dataclass(frozen=True, slots=True, eq=False)
class Matrix:
    """From the points of an object's cells to the samples of an image's.

    Parameters
    ----------
    parts
        The periodic one, then those at the array's border.
    glare
        The rest: faint, and far from the diagonal.
    margin
        Cells (y, x) beyond the ring around the array whose points reach into it.
    """

    parts: tuple[Part, ...]
    glare: Glare
    margin: tuple[int, int]

    @property
    def nbytes(self) -> int:
        """Memory that it takes [bytes]."""
        parts = sum(part.left.nbytes + part.right.nbytes for part in self.parts)
        return parts + self.glare.spectra.nbytes + self.glare.pictures.nbytes


_MATRICES = ByteCache(limit=2**31)


def matrix(optics: Optics, progress: Progress | None = None) -> Matrix:
    """Of one depth: from memory, from disk, or built.

    Raises
    ------
    SamplingError
        It does not fit in memory.
    """
    key = optics.key

    def found() -> Matrix:
        arrays = store.load(key)
        if arrays is None:
            memory.require(
                optics.build_bytes,
                "the periodic operator",
                "Use slower lenslets, a lower accuracy, or Snapshots.",
                SamplingError,
            )
            built = _build(optics, progress)
            store.save(key, _packed(built))
            return built
        return _unpacked(arrays)

    return _MATRICES.get(key, found)


def _packed(matrix: Matrix) -> dict[str, np.ndarray]:
    """The matrix as a few arrays."""
    places = [(*part.rows, *part.columns, len(part.offsets)) for part in matrix.parts]
    return {
        "places": np.array(places),
        "offsets": np.concatenate([np.array(part.offsets).reshape(-1, 3) for part in matrix.parts]),
        "left": np.concatenate([part.left for part in matrix.parts], axis=1),
        "right": np.concatenate([part.right for part in matrix.parts]),
        "spectra": matrix.glare.spectra,
        "pictures": matrix.glare.pictures,
        "shape": np.array([*matrix.glare.image, *matrix.glare.margin, *matrix.margin]),
    }


def _unpacked(arrays: dict[str, np.ndarray]) -> Matrix:
    """The inverse of `_packed`."""
    parts, first, column = [], 0, 0
    for top, bottom, left, right, count in arrays["places"].tolist():
        offsets = [(int(dy), int(dx), int(rank)) for dy, dx, rank in arrays["offsets"][first : first + count]]
        ranks = slice(column, column + sum(rank for _, _, rank in offsets))
        parts.append(
            Part(
                (top, bottom), (left, right), tuple(offsets), arrays["left"][:, ranks], arrays["right"][ranks]
            )
        )
        first, column = first + count, ranks.stop
    rows, columns, *margins = arrays["shape"].tolist()
    glare = Glare(arrays["spectra"], arrays["pictures"], (rows, columns), (margins[0], margins[1]))
    return Matrix(tuple(parts), glare, (margins[2], margins[3]))


def _build(optics: Optics, progress: Progress | None = None) -> Matrix:
    builder = _Builder(optics)
    rows, columns = optics.cells.count
    inside, means = builder.periodic()
    parts = [_part((1, rows + 1), (1, columns + 1), inside)]
    pairs = [
        (y, x) for y in _groups(optics, 0) for x in _groups(optics, 1) if (y[1], x[1]) != (INFINITE, INFINITE)
    ]
    for done, (y, x) in enumerate(pairs):
        ring = y[0][0] in (0, rows + 1) or x[0][0] in (0, columns + 1)
        blocks = builder.border(y[1], x[1], ring=ring)
        if any(left.shape[1] for left, _ in blocks.values()):
            parts.append(_part(y[0], x[0], blocks))
        if progress is not None:
            progress((done + 1) / len(pairs))
    return Matrix(tuple(parts), glare(means, optics.cells.size, (rows + 2, columns + 2)), optics.reach)


def _part(rows: tuple[int, int], columns: tuple[int, int], blocks: Blocks) -> Part:
    order = sorted(key for key, (left, _) in blocks.items() if left.shape[1])
    offsets = tuple((dy, dx, blocks[dy, dx][0].shape[1]) for dy, dx in order)
    left = np.concatenate([blocks[key][0] for key in order], axis=1).astype(np.float32)
    right = np.concatenate([blocks[key][1] for key in order], axis=0).astype(np.float32)
    return Part(rows, columns, offsets, left, right)


def _groups(optics: Optics, axis: int) -> Iterator[tuple[tuple[int, int], Limits]]:
    """Rows (first, last + 1) of cells with the same lenslets around them, and the limits of those."""
    cells, extent = optics.cells, optics.array.extent
    size, n = cells.size[axis], cells.count[axis]
    if extent is None:
        yield (1, n + 1), INFINITE
        return
    far = size / 2 + optics.fineness.border * optics.array.lattice.pitch * (1 + 1e-9)
    start, known = 0, None
    for row in range(n + 3):
        middle = cells.edge[axis] + (row - 0.5) * size
        low, high = -extent[axis] / 2 - middle, extent[axis] / 2 - middle
        limits = (_near(low, far), _near(high, far))
        if row == n + 2 or (known is not None and limits != known):
            assert known is not None
            yield (start, row), known
            start = row
        known = limits


@dataclass(slots=True)
class _Found:
    """Factors of one block, more of them than needed at first."""

    left: np.ndarray
    right: np.ndarray
    strength: np.ndarray
    copies: int
    mean: np.ndarray

    def cut(self, least: float) -> tuple[np.ndarray, np.ndarray]:
        kept = self.strength > least
        return self.left[:, kept], self.right[kept]


def _near(border: float, far: float) -> float:
    """A border at a distance from a cell's centre; infinite where it is far."""
    return round(border, 12) if abs(border) < far else math.copysign(math.inf, border)


class _Builder:
    """Blocks of one depth; those that mirror each other are computed once."""

    def __init__(self, optics: Optics) -> None:
        self.optics, self.axes = optics, optics.axes
        distance = _cells.telecentric_distance(optics.camera)
        self.lenslets = Lenslets(self.axes, optics.array, optics.camera.wavelength, distance)
        self.light = wave(optics.camera, optics.distance, self.axes, optics.reach)
        self.even = self.light.even and _symmetric(optics.array)
        y, x = self.axes
        self.square = y == x and bool(np.allclose(self.light.data, self.light.data.T))
        self.strongest = 1e-30
        self.norm = 0.0
        self._kept: dict[tuple[int, int], np.ndarray] = {}
        self._known: dict[tuple[Limits, Limits, bool], Blocks] = {}

    def periodic(self) -> tuple[Blocks, dict[tuple[int, int], np.ndarray]]:
        """Blocks inside the array, and the mean images (samples,) of a cell's points."""
        found: dict[tuple[int, int], _Found] = {}
        _, own = next(self._blocks(INFINITE, INFINITE, (0, 0)))
        self.strongest = float(np.linalg.norm(own))
        for key, block in self._blocks(INFINITE, INFINITE, self.optics.reach):
            copies = 2 ** sum(k != 0 for k in key) if self.even else 1
            self.norm += copies * float(np.linalg.norm(block)) ** 2
            found[key] = self._factored(block, copies)
        least = _least(found.values(), self.optics.fineness.rank**2 * self.norm)
        folds = (self.even, self.even)
        result = self._unfolded({key: f.cut(least) for key, f in found.items()}, folds)
        means = self._unfolded({key: (f.left[:, :1] * 0, f.mean[None]) for key, f in found.items()}, folds)
        even = np.ones((math.prod(self.optics.cells.points), 1))
        for key, (left, right) in result.items():
            left_out = means[key][1] - left.mean(0, keepdims=True) @ right
            result[key] = np.hstack([left, even]), np.vstack([right, left_out])
        return result, {key: mean[0] for key, (_, mean) in means.items()}

    def border(self, limits_y: Limits, limits_x: Limits, *, ring: bool) -> Blocks:
        """What differs from `periodic` where lenslets are missing; all of it in the ring."""
        if (known := self._mirrored(limits_y, limits_x, ring)) is not None:
            return known
        found: dict[tuple[int, int], _Found] = {}
        for key, block in self._blocks(limits_y, limits_x, self.optics.near):
            found[key] = self._factored(block if ring else block - self._inside(key), 1)
        # A row of cells is a small part of the picture: its error may be larger.
        least = _least(found.values(), (2 * self.optics.fineness.rank) ** 2 * self.norm)
        cut = {key: f.cut(least) for key, f in found.items()}
        result = self._unfolded(cut, self._folds(limits_y, limits_x))
        self._known[limits_y, limits_x, ring] = result
        return result

    def _inside(self, key: tuple[int, int]) -> np.ndarray:
        """A block of the periodic array near a cell; they are kept."""
        if not self._kept:
            self._kept = dict(self._blocks(INFINITE, INFINITE, self.optics.near))
        if key in self._kept:
            return self._kept[key]
        block = self._kept[abs(key[0]), abs(key[1])]
        flips, cells = (key[0] < 0, key[1] < 0), self.optics.cells
        return mirrored(mirrored(block, cells.points, *flips).T, cells.samples, *flips).T

    def _folds(self, limits_y: Limits, limits_x: Limits) -> tuple[bool, bool]:
        """Whether what is up mirrors what is down, and left mirrors right."""
        return self.even and limits_y == INFINITE, self.even and limits_x == INFINITE

    def _mirrored(self, limits_y: Limits, limits_x: Limits, ring: bool) -> Blocks | None:
        """Blocks at a border from those at its mirror image, or from the other side of the diagonal."""
        if not self.even:
            return None
        for across in (False, True) if self.square else (False,):
            for up in (False, True):
                for left in (False, True):
                    key = (_flipped(limits_y, up), _flipped(limits_x, left))
                    known = self._known.get((key[1], key[0], ring) if across else (*key, ring))
                    if known is not None:
                        turned = {}
                        for (dy, dx), pair in known.items():
                            (i, j), factor = ((dx, dy), self._crossed(pair)) if across else ((dy, dx), pair)
                            turned[-i if up else i, -j if left else j] = self._turned(factor, up, left)
                        return turned
        return None

    def _crossed(self, pair: tuple[np.ndarray, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        points, samples = self.optics.cells.points, self.optics.cells.samples
        left = pair[0].reshape(*points, -1).transpose(1, 0, 2).reshape(pair[0].shape)
        return left, pair[1].reshape(-1, *samples).transpose(0, 2, 1).reshape(pair[1].shape)

    def _blocks(
        self, limits_y: Limits, limits_x: Limits, reach: tuple[int, int]
    ) -> Iterator[tuple[tuple[int, int], np.ndarray]]:
        """Offset and block; only offsets that are not negative where the others mirror them."""
        cells = self.optics.cells
        middle = [  # of any cell: only the border, as it is told, makes a difference
            e + (n // 2 + 0.5) * s for e, n, s in zip(cells.edge, cells.count, cells.size, strict=True)
        ]
        lenslets = self.lenslets.response((middle[0], middle[1]), (limits_y, limits_x))
        up, left = self._folds(limits_y, limits_x)
        columns = range(0 if left else -reach[1], reach[1] + 1)
        for dy in range(0 if up else -reach[0], reach[0] + 1):
            row = images(self.light, lenslets, self.axes, dy, columns)
            row /= self.optics.image_scale**2
            yield from (((dy, dx), block) for dx, block in zip(columns, row, strict=True))

    def _factored(self, block: np.ndarray, copies: int) -> _Found:
        least = 0.02 * self.optics.fineness.rank * self.strongest
        left, right, strength = factors(block, least)
        return _Found(left, right, strength, copies, block.mean(0, dtype=np.float64))

    def _turned(
        self, pair: tuple[np.ndarray, np.ndarray], up: bool, left: bool
    ) -> tuple[np.ndarray, np.ndarray]:
        points, samples = self.optics.cells.points, self.optics.cells.samples
        return mirrored(pair[0], points, up, left), mirrored(pair[1].T, samples, up, left).T

    def _unfolded(self, blocks: Blocks, folds: tuple[bool, bool]) -> Blocks:
        result = dict(blocks)
        for (dy, dx), pair in blocks.items():
            for up in {False, folds[0]}:
                for left in {False, folds[1]}:
                    key = (-dy if up else dy, -dx if left else dx)
                    if key not in result:
                        result[key] = self._turned(pair, up, left)
        return result


def _flipped(limits: Limits, flip: bool) -> Limits:
    return (-limits[1], -limits[0]) if flip else limits


def _symmetric(array: LensletArray) -> bool:
    """Whether a lenslet's surroundings are the same in a mirror."""
    return array.lattice.kinds == 1 or isinstance(array.focal_length, float)


def _least(found: Iterable[_Found], budget: float) -> float:
    """The strength up to which all factors together stay within a squared norm."""
    strengths = np.concatenate([f.strength for f in found])
    copies = np.concatenate([np.full(len(f.strength), f.copies) for f in found])
    order = np.argsort(strengths)
    spent = np.cumsum(copies[order] * strengths[order] ** 2)
    k = int(np.searchsorted(spent, budget))
    return float(strengths[order[k - 1]]) if k else 0.0
