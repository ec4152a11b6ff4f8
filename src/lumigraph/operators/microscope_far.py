"""Light in cells far from a point's own: a cell counts as one point, its image as one of a few patterns.

Over lenslets that is one small convolution for each depth and pattern, and a product of few columns. All
depths share the patterns, so that one transform back is enough for each.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce
from operator import add

import numpy as np
import scipy.fft

from lumigraph.core import arrays
from lumigraph.core.arrays import Array


@dataclass(frozen=True, slots=True, eq=False)
class Far:
    """Light that far cells receive from one depth.

    Parameters
    ----------
    offsets
        (n, 2): the cells (dy, dx), relative to the points' own.
    weights
        (n, k): what each has of each pattern.
    images
        (k, N²): the patterns.
    parts
        (k, r): how much of each of r patterns, which depths share, is in them: `images` are those then. None
        where they are its own.
    """

    offsets: np.ndarray
    weights: np.ndarray
    images: np.ndarray
    parts: np.ndarray | None = None

    def spectrum(self, cells: tuple[int, int], margin: int) -> np.ndarray:
        """Transforms (patterns, L, L/2 + 1) of the weights; cells and margin are those of `FarLight`."""
        seen, lengths = _seen(cells, margin), _lengths(cells, margin)
        steps = self.offsets - margin  # from the object's first lenslet, to the image's first
        inside = np.asarray((steps > -np.asarray(seen)).all(1) & (steps < cells).all(1))
        wide = np.zeros((*lengths, self.weights.shape[1]))
        row, column = (steps[inside] % lengths).T
        wide[row, column] = self.weights[inside]
        own = np.fft.rfft2(wide, axes=(0, 1)).transpose(2, 0, 1)
        return own if self.parts is None else np.tensordot(self.parts.T.astype(float), own, 1)


def shared(
    fars: Sequence[Far], light: Sequence[tuple[float, float]], allowed: float
) -> tuple[list[Far], float]:
    """The same with as few patterns as all depths may share: singular vectors (C. Eckart & G. Young, 1936).

    Parameters
    ----------
    light
        Norms of a point's image, and of a cell's image of an even plane, of each depth.
    allowed
        Relative rms of both that may be lost; of the plane's, that all directions together may, light of one
        direction alone, as at borders, counting in full.

    Returns
    -------
    tuple
        Far light of each depth, and what the worst of them loses.
    """
    rows = []
    for far, (point, plane) in zip(fars, light, strict=True):
        weights = far.weights.astype(np.float64)
        even = np.sqrt(len(far.images)) * weights.sum(0)[:, None] * far.images / plane
        rows += [np.linalg.qr(weights, mode="r") @ far.images / point, even]
    vectors = np.linalg.svd(np.concatenate(rows), full_matrices=False)[2]
    lost = np.sqrt([np.cumsum(np.square(own @ vectors.T).sum(0)[::-1])[::-1] for own in rows]).max(0)
    kept = max(int((lost > allowed).sum()), 1)
    images = vectors[:kept].astype(np.float32)
    found = [Far(far.offsets, far.weights, images, far.images @ images.T) for far in fars]
    return found, float(lost[kept]) if kept < len(lost) else 0.0


@dataclass(frozen=True, slots=True, eq=False)
class FarLight:
    """Far light of all depths, for arrays of one library and precision.

    Parameters
    ----------
    spectra
        (z, k, L, L/2 + 1), of the weights.
    images
        (1 or z, k, r): those that all depths share, or each depth's own, in terms of r patterns of a cell's
        image.
    lengths
        Of the transforms (y, x).
    cells, seen
        Lenslets (rows, columns) whose images are followed, and those before which the object stands.
    """

    spectra: Array
    images: Array
    lengths: tuple[int, int]
    cells: tuple[int, int]
    seen: tuple[int, int]

    @classmethod
    def of(
        cls, fars: list[Far], cells: tuple[int, int], margin: int, basis: np.ndarray | None, like: Array
    ) -> "FarLight":
        """Far light by the depths' own, of objects that reach `margin` lenslets beyond those of the image.

        `basis` (N², r) are the patterns of a cell's image; None for its samples themselves.
        """
        y, x = _lengths(cells, margin)
        kind = np.complex64 if arrays.is_single(like) else np.complex128
        spectra = np.empty((len(fars), len(fars[0].images), y, x // 2 + 1), kind)
        for k, far in enumerate(fars):
            spectra[k] = far.spectrum(cells, margin)
        alike = all(far.images is fars[0].images for far in fars)
        images = np.stack([far.images for far in (fars[:1] if alike else fars)])
        images = images if basis is None else images @ basis
        return cls(arrays.like(spectra, like), arrays.like(images, like), (y, x), cells, _seen(cells, margin))

    def forward(self, volume: Array, points: int) -> Array:
        """Light (rows, columns, r) from a volume (z, rows s, columns s)."""
        xp, (rows, columns) = arrays.namespace(volume), self.cells
        cells, depths = arrays.rfft2(_summed(volume, points), self.lengths, axes=(1, 2)), volume.shape[0]
        lit = (cells[k, None, ...] * self.spectra[k, ...] for k in range(depths))
        spectrum = reduce(add, lit)[None, ...] if self.images.shape[0] == 1 else xp.stack(list(lit))
        light = arrays.irfft2(spectrum, self.lengths, axes=(2, 3))[..., :rows, :columns]
        light = xp.reshape(light, (-1, rows * columns))
        return xp.reshape(xp.matrix_transpose(light) @ self._patterns, (rows, columns, -1))

    @property
    def _patterns(self) -> Array:
        """(k or z k, r)."""
        return arrays.namespace(self.images).reshape(self.images, (-1, self.images.shape[-1]))

    def adjoint(self, light: Array) -> Array:
        """Light (z, rows, columns) that each point of a cell receives back from light (rows, columns, r)."""
        xp, (rows, columns) = arrays.namespace(light), self.cells
        flat = xp.reshape(light, (-1, light.shape[-1]))
        parts = xp.reshape(
            self._patterns @ xp.matrix_transpose(flat), (*self.images.shape[:2], rows, columns)
        )
        spectrum = arrays.rfft2(parts, self.lengths, axes=(2, 3))
        found, depths = spectrum.shape[0], self.spectra.shape[0]
        pairs = ((spectrum[k % found, ...], self.spectra[k, ...]) for k in range(depths))
        seen = xp.stack([xp.sum(light * xp.conj(own), axis=0) for light, own in pairs])
        cells = arrays.irfft2(seen, self.lengths, axes=(1, 2))
        return cells[:, : self.seen[0], : self.seen[1]]


def far_numbers(fars: Sequence[Far], cells: tuple[int, int], margin: int, patterns: int) -> int:
    """Numbers that a `FarLight` of shared patterns holds, with what `forward` or `adjoint` takes."""
    (y, x), k = _lengths(cells, margin), len(fars[0].images)
    spectrum = 2 * y * (x // 2 + 1)
    return spectrum * (len(fars) * (k + 1) + 3 * k) + k * patterns


def _seen(cells: tuple[int, int], margin: int) -> tuple[int, int]:
    """Lenslets (rows, columns) before which the object stands."""
    return cells[0] + 2 * margin, cells[1] + 2 * margin


def _lengths(cells: tuple[int, int], margin: int) -> tuple[int, int]:
    """Lengths of the transforms (y, x), in which no light falls round their ends."""
    y, x = (n + m - 1 for n, m in zip(cells, _seen(cells, margin), strict=True))
    return int(scipy.fft.next_fast_len(y, real=True) or y), int(scipy.fft.next_fast_len(x, real=True) or x)


def _summed(volume: Array, s: int) -> Array:
    """Sums (z, rows, columns) over the s × s points of each cell."""
    xp, (z, height, width) = arrays.namespace(volume), volume.shape
    ones = xp.ones((s, 1), dtype=volume.dtype, device=arrays.device(volume))
    along_x = xp.reshape(volume, (-1, s)) @ ones  # as a product: sums of short rows are slow
    return xp.sum(xp.reshape(along_x, (z, height // s, s, width // s)), axis=2)
