r"""Patterns of a cell's points, even or odd along y and x, as which a depth's light is followed.

Points stand as close at all depths as the depth that is seen most finely asks for. At others their images
differ by less: the matrix from a cell's points to the pixels of all cells is of low rank but for a small
rest. Its singular vectors are the few patterns that hold every point's image but for the relative rms that is
allowed. What they leave out is measured, and counts in the operator's error.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lumigraph.core.cache import ByteCache, remembered
from lumigraph.core.threads import each, single_products
from lumigraph.operators.microscope_cell import parts
from lumigraph.operators.microscope_kernels import SliceKernel

WORTH = 0.8
"""Part of all patterns: if more are wanted all of them are followed, which leaves nothing out."""

_FOUND = ByteCache()


@dataclass(frozen=True, slots=True, eq=False)
class Patterns:
    """Orthonormal patterns over the places of a cell.

    Parameters
    ----------
    basis
        (n², r): each pattern's value at the cell's places.
    odd
        (2, r) of 0 and 1: whether a pattern is odd along y, and along x.
    left_out
        Relative rms of the image of a point as the sum of its patterns, the worst of all points.
    along
        (n, n), of which they are all products of two rows, one along y and one along x; None for others.
    """

    basis: np.ndarray
    odd: np.ndarray
    left_out: float = 0.0
    along: np.ndarray | None = None

    @property
    def count(self) -> int:
        """Patterns, r."""
        return self.basis.shape[1]

    @property
    def nbytes(self) -> int:
        """Of the arrays."""
        return self.basis.nbytes + self.odd.nbytes

    def of_parity(self, odd_y: int, odd_x: int) -> np.ndarray:
        """Numbers of the patterns of a parity."""
        return np.flatnonzero((self.odd[0] == odd_y) & (self.odd[1] == odd_x))


@remembered
def all_patterns(n: int) -> Patterns:
    """As many patterns as a cell of n × n places has.

    >>> all_patterns(3).count, all_patterns(3).of_parity(0, 1).tolist()
    (9, [2, 5])
    """
    one, half = parts(n), (n + 1) // 2
    odd_y, odd_x = np.divmod(np.arange(n * n), n)
    odd = np.stack([odd_y >= half, odd_x >= half]).astype(np.int8)
    return Patterns(np.kron(one, one).T, odd, along=one)


def patterns(kernels: Sequence[SliceKernel], left_out: float) -> list[Patterns]:
    """Of each depth, so few that no point's image loses more than a relative rms `left_out`.

    Parameters
    ----------
    kernels
        Symmetric ones.
    left_out
        0 for all patterns.
    """
    if left_out <= 0:
        return [all_patterns(kernel.sampling.points) for kernel in kernels]

    def found(kernel: SliceKernel) -> Patterns:
        return _FOUND.get((kernel, left_out), lambda: few_patterns(kernel, left_out))

    return list(each(found, kernels))


@single_products()
def few_patterns(kernel: SliceKernel, left_out: float) -> Patterns:
    """The strongest patterns of a depth: singular vectors of each parity (C. Eckart & G. Young, 1936)."""
    whole = all_patterns(kernel.sampling.points)
    vectors, energy = _strongest_first(kernel, whole)
    shares = np.square(whole.basis @ vectors) * energy  # of each point's image
    left = np.cumsum(shares[:, ::-1], 1)[:, ::-1]  # without that pattern and all weaker ones
    missing = np.sqrt(np.max(left / np.maximum(left[:, :1], np.finfo(float).tiny), axis=0))
    kept = int((missing > left_out).sum())
    if kept > WORTH * whole.count:
        return whole
    chosen = vectors[:, :kept]
    odd = whole.odd[:, np.abs(chosen).argmax(0)]
    return Patterns(whole.basis @ chosen, odd, float(missing[kept]))


def _strongest_first(kernel: SliceKernel, whole: Patterns) -> tuple[np.ndarray, np.ndarray]:
    """Singular vectors (s², s²) in terms of all patterns, and the light² of each in all cells, falling."""
    blocks, weights = quadrant(kernel)
    rows = whole.basis.T.astype(np.float32) @ blocks
    vectors, energy = np.zeros((whole.count, whole.count)), np.zeros(whole.count)
    for places in map(whole.of_parity, (0, 0, 1, 1), (0, 1, 0, 1)):
        part = rows[:, places].astype(np.float64)
        products = np.tensordot(weights, part @ part.transpose(0, 2, 1), 1)
        energy[places], vectors[np.ix_(places, places)] = np.linalg.eigh(products)
    order = np.argsort(-energy, kind="stable")
    return vectors[:, order], np.maximum(energy[order], 0)


def quadrant(kernel: SliceKernel) -> tuple[np.ndarray, np.ndarray]:
    """Images (n, s², N²) in cells below and right of a point's own, and for how many cells each stands."""
    first = np.asarray((kernel.offsets >= 0).all(1))  # the other quadrants follow by parity
    n, s, N = len(first), kernel.sampling.points, kernel.sampling.pixels
    weights = np.where(kernel.offsets[first] > 0, 2.0, 1.0).prod(1)
    return kernel.matrix().reshape(n, s * s, N * N)[first], weights
