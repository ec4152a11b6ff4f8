"""Agreement of micro-images of a plenoptic 2.0 picture with their neighbours at each patch size."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter
from scipy.sparse import csr_array

from lumigraph.core import memory
from lumigraph.core.calibration import Calibration
from lumigraph.core.progress import Progress
from lumigraph.core.raw import RawImage
from lumigraph.depth.flat import grey, lit_radius
from lumigraph.rendering.interpolate import sample
from lumigraph.rendering.patches import lenslet_indices

_REACH = 1.8  # pitches: nearest neighbours, and the next ones, which in a multi-focus array have one kind
_NEXT = 1.2  # pitches: beyond the nearest neighbours
_LEAST_SEEN = 0.12  # part of a micro-image that both must show
_NOISE = 0.01  # of the picture's white
_BLOCK = 128  # lenslets at a time: what is read over and over stays in the processor's cache


@dataclass(frozen=True, slots=True)
class MicroImages:
    """Micro-images of a raw image, each about its own centre, less its mean.

    Parameters
    ----------
    data
        Pixels (lenslets, height * width), row by row.
    inside
        Which of them count (height, width): 1 or 0.
    indices
        Of the lenslets in the lattice (rows, cols, 2).
    calibration
        Of the camera.
    """

    data: np.ndarray
    inside: np.ndarray
    indices: np.ndarray
    calibration: Calibration

    @classmethod
    def of(cls, raw: RawImage, calibration: Calibration) -> "MicroImages":
        """Micro-images of all whole lenslets. Raises LumigraphError if they would not fit in memory."""
        image = grey(raw)
        return cls.read(gaussian_filter(image, 0.5), calibration, lit_radius(image, calibration))

    @classmethod
    def read(cls, image: np.ndarray, calibration: Calibration, radius: float) -> "MicroImages":
        """Micro-images of an image (y, x), which count up to a radius [px]."""
        indices = lenslet_indices(calibration)
        half = int(calibration.lattice.pitch / 2)
        size = (2 * half + 1) ** 2
        memory.require(
            40.0 * size * indices.shape[0] * indices.shape[1],
            f"comparing {indices.shape[0]} x {indices.shape[1]} micro-images of {2 * half + 1} px",
            "Crop the raw image to a part {factor:.1f}x smaller.",
        )
        steps = np.arange(-half, half + 1.0)
        centers = calibration.position(indices)
        data = np.empty((indices[..., 0].size, size), np.float32)
        for part in _blocks(len(data)):
            y, x = np.moveaxis(centers.reshape(-1, 2)[part], -1, 0)[..., None, None]
            seen = sample(image, y + steps[:, None], x + steps, "cubic")
            data[part] = np.reshape(seen, (-1, size))
        data -= data.mean(1, keepdims=True)
        inside = np.hypot(steps[:, None], steps) <= radius
        return cls(data, inside.astype(np.float32), indices, calibration)

    @property
    def radius(self) -> float:
        """Radius to which pixels count [px]."""
        return math.sqrt(float(self.inside.sum()) / math.pi)

    def differences(self, moves: np.ndarray) -> np.ndarray:
        """Half the mean square (ways, n, rows, cols) by which each differs from itself, moved by (n,) px.

        In the directions of the two or three nearest neighbours; NaN where too little of it is left.
        """
        ways = [way for way in self._ways() if way > (0, 0) and math.hypot(*self._vector(way)) < _NEXT]
        out = np.full((len(ways), len(moves), len(self.data)), np.nan, np.float32)
        for k, way in enumerate(ways):
            readings = self._readings(way, moves)
            for part in _blocks(len(self.data)):
                mine = np.ascontiguousarray(self.data[part].T)
                for j, reading in readings.items():
                    out[k, j, part] = reading.difference(mine)
        return out.reshape(*out.shape[:2], *self.indices.shape[:2])

    def scores(self, sizes: np.ndarray, progress: Progress) -> np.ndarray:
        """Agreement (n, rows, cols) with the neighbours at each patch size [px] of `sizes` (n,), at most 1.

        The normalised correlation of what two micro-images share, where the second is read linearly at
        positions moved back, of the better half of the neighbours.
        """
        count = len(self.data)
        neighbours = [(*self._neighbour(way), self._readings(way, sizes)) for way in self._ways()]
        out = np.empty((len(sizes), count), np.float32)
        for part in _blocks(count):
            mine = np.ascontiguousarray(self.data[part].T)
            found = np.full((len(neighbours), len(sizes), mine.shape[1]), np.nan, np.float32)
            for k, (number, there, readings) in enumerate(neighbours):
                its = np.ascontiguousarray(self.data[number[part]].T)
                for j, reading in readings.items():
                    found[k, j] = np.where(there[part], reading.agreement(mine, its), np.nan)
                progress((part.start + (part.stop - part.start) * (k + 1) / len(neighbours)) / count)
            out[:, part] = _better_half(found)
        return out.reshape(-1, *self.indices.shape[:2])

    def _readings(self, way: tuple[int, int], sizes: np.ndarray) -> "dict[int, MicroImageReader]":
        """Readings of a neighbour, by number, for each size at which enough of it is shared."""
        read = {k: MicroImageReader.of(self.inside, self._vector(way) * size) for k, size in enumerate(sizes)}
        return {k: reading for k, reading in read.items() if reading is not None}

    def _ways(self) -> list[tuple[int, int]]:
        """Steps (di, dj) to the neighbours."""
        reach = range(-2, 3)
        near = [(i, j) for i in reach for j in reach if (i, j) != (0, 0)]
        return [way for way in near if math.hypot(*self._vector(way)) < _REACH]

    def _vector(self, way: tuple[int, int]) -> np.ndarray:
        """Vector (y, x) to a neighbour, in pitches."""
        return self.calibration.lattice.matrix @ way / self.calibration.lattice.pitch

    def _neighbour(self, way: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
        """Number of each lenslet's neighbour (lenslets,), and whether there is one."""
        rows, columns = self.indices.shape[:2]
        i, j = self.indices[..., 0] + way[0], self.indices[..., 1] + way[1]
        skew = self.calibration.lattice.layout == "hex"
        first = self.indices[0, 0]
        row = i - first[0]
        column = j - first[1] + ((i // 2 - first[0] // 2) if skew else 0)
        there = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
        number = np.clip(row, 0, rows - 1) * columns + np.clip(column, 0, columns - 1)
        return number.ravel(), there.ravel()


@dataclass(frozen=True, slots=True)
class MicroImageReader:
    """Micro-images read linearly at positions moved by a fraction of a pixel, where both are inside.

    Parameters
    ----------
    places
        Numbers of the pixels (n,) at which they are read.
    weight
        Of each place (n,); 1 in all.
    matrix
        Sparse (n, height * width): from the micro-images' pixels to their values at the moved places.
    """

    places: np.ndarray
    weight: np.ndarray
    matrix: csr_array

    @classmethod
    def of(cls, inside: np.ndarray, move: np.ndarray) -> "MicroImageReader | None":
        """Reading for a move (dy, dx) [px]; None where too little of the pixels inside (h, w) is shared."""
        lines = [_line(count, float(part)) for count, part in zip(inside.shape, move, strict=True)]
        weight = (inside * (lines[0] @ inside @ lines[1].T)).ravel()
        if weight.sum() < _LEAST_SEEN * inside.sum():
            return None
        places = np.flatnonzero(weight)
        return cls(places, weight[places] / weight.sum(), _taps(places, inside.shape, move))

    def agreement(self, mine: np.ndarray, its: np.ndarray) -> np.ndarray:
        """Normalised correlation (lenslets,) of micro-images (height * width, lenslets), the second moved."""
        mine, its = mine.take(self.places, 0), self.matrix @ its
        mean, its_mean = self.weight @ mine, self.weight @ its
        shared = self.weight @ (mine * its) - mean * its_mean
        power = self.weight @ np.square(mine, out=mine) - mean**2
        its_power = self.weight @ np.square(its, out=its) - its_mean**2
        return shared / np.sqrt((power + _NOISE**2) * (its_power + _NOISE**2))

    def difference(self, mine: np.ndarray) -> np.ndarray:
        """Half the mean square (lenslets,) by which micro-images (height * width, lenslets) differ, moved."""
        off = mine.take(self.places, 0) - self.matrix @ mine
        return 0.5 * (self.weight @ np.square(off) - (self.weight @ off) ** 2)


def _blocks(count: int) -> Iterator[slice]:
    """Slices of `_BLOCK` and less that make up a number of lenslets."""
    for start in range(0, count, _BLOCK):
        yield slice(start, min(start + _BLOCK, count))


def _line(count: int, move: float) -> np.ndarray:
    """Matrix (count, count) from values to those at places moved by a distance, linearly; 0 beyond."""
    below = math.floor(move)
    part = move - below
    weights = (1 - part) * np.eye(count, k=below) + part * np.eye(count, k=below + 1)
    return weights.astype(np.float32)


def _taps(places: np.ndarray, shape: tuple[int, ...], move: np.ndarray) -> csr_array:
    """Matrix from pixels (height * width) of a shape to values at numbered places (n,), moved, linearly."""
    below = np.floor(move).astype(int)
    y, x = (np.array([1 - part, part]) for part in move - below)
    steps = np.array([[0, 0], [0, 1], [1, 0], [1, 1]]) + below
    at = np.stack(np.divmod(places, shape[1]), -1)[:, None] + steps
    there = ((at >= 0) & (at < shape)).all(-1)
    weights = np.outer(y, x).ravel() * there
    number = np.where(there, at[..., 0] * shape[1] + at[..., 1], 0)
    rows = np.arange(0, 4 * len(places) + 1, 4)
    return csr_array(
        (weights.ravel().astype(np.float32), number.ravel(), rows), (len(places), shape[0] * shape[1])
    )


def _better_half(scores: np.ndarray) -> np.ndarray:
    """Mean of the better half of the scores (k, ...) of those neighbours that there are; else 0."""
    ordered = -np.sort(-np.where(np.isnan(scores), -np.inf, scores), axis=0)
    count = np.isfinite(ordered).sum(0)
    number = np.arange(len(scores)).reshape(-1, *[1] * (scores.ndim - 1))
    used = (number < (count + 1) // 2) & np.isfinite(ordered)
    return np.where(used, ordered, 0).sum(0) / np.maximum((count + 1) // 2, 1)
