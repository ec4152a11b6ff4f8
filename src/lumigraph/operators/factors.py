"""Blocks of a matrix in factors: as many as the light there has patterns, the strongest of all blocks."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from scipy.linalg import get_lapack_funcs

_BLOCK = 2**21
"""Numbers worked on at a time."""

_LOST = 32 * float(np.finfo(np.float32).eps)
"""Part of a squared norm that sums of products in single precision may be off by."""

_FAINT = 1000.0
"""Norm of a block over the faintest strength that counts from which a fifth of its points tell too little."""

(_pivoted_cholesky,) = get_lapack_funcs(("pstrf",), dtype=np.float64)

LEFT = 0.3
"""Part of the faintest strength that counts which rows may keep when no more of them are taken."""

Key = TypeVar("Key")

Factors = tuple[np.ndarray, np.ndarray]
"""Left (points, r) and right (r, samples)."""

LARGEST = 64.0
"""Norm of a right factor in half precision, far from that type's smallest and largest numbers."""


@dataclass(slots=True, eq=False)
class Found:
    """Factors of one block, more of them than needed at first.

    Parameters
    ----------
    left, right, strength
        (n, r), (r, samples) and the norm of each product (r,).
    copies
        How many blocks they are of.
    basis
        (points, n) that the left factors are to be taken through; None where they are of all points.
    """

    left: np.ndarray
    right: np.ndarray
    strength: np.ndarray
    copies: int
    basis: np.ndarray | None = None

    def cut(self, least: float) -> Factors:
        """Factors that are stronger than `least`."""
        kept = self.strength > least
        left = self.left[:, kept]
        return left if self.basis is None else self.basis @ left, self.right[kept]

    def narrowed(self, precision: type[np.floating]) -> "Found":
        """The same with right factors of a precision."""
        left, right = narrowed(self.left, self.right, precision)
        return replace(self, left=left, right=right)


def narrowed(left: np.ndarray, right: np.ndarray, precision: type[np.floating]) -> Factors:
    """The same product, with right factors of a precision; those of half of it have `LARGEST` norms."""
    if precision is np.float16:
        size = np.linalg.norm(right, axis=1) / LARGEST
        size[size == 0] = 1.0
        left, right = left * size, right / size[:, None]
    return left.astype(np.float32, copy=False), right.astype(precision, copy=False)


def factors(block: np.ndarray, least: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """``block ≈ left @ right``, (points, r) and (r, samples), and their strengths above `least`.

    Faint blocks have few: a sketch of a fifth of the points finds them, or finds that it needs them all.
    """
    points, norm = block.shape[0], float(np.linalg.norm(block))
    if norm <= least:
        return np.zeros((points, 0)), np.zeros((0, block.shape[1])), np.zeros(0)
    if norm < _FAINT * least:
        sketch = np.random.default_rng(0).standard_normal((points, math.ceil(points / 5)), np.float32)
        basis = np.linalg.qr(block @ (block.T @ sketch))[0]
        left, right, strength, all_told = _strongest(basis.T @ block, least)
        if all_told:
            return basis @ left, right, strength
    return strongest(block, None, least)


def strongest(
    rows: np.ndarray, weights: np.ndarray | None, least: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Strongest factors, as `factors`, of ``weights @ rows``, few rows that need no sketch."""
    return _strongest(rows, least, weights)[:3]


def _strongest(
    rows: np.ndarray, least: float, weights: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray, np.ndarray, bool]:
    """Orthonormal left factors, right ones, strengths above `least`, and whether so few tell all."""
    products = _products(rows, least)
    if weights is not None:
        products = weights @ products @ weights.T
    vectors, strength, all_told = _patterns(products, least)
    left = vectors.astype(np.float32)
    across = left.T if weights is None else left.T @ weights
    return left, across @ rows, strength, all_told


def _patterns(products: np.ndarray, least: float) -> tuple[np.ndarray, np.ndarray, bool]:
    """Eigenvectors (n, r) of rows' products and their strengths above `least`, and whether so few tell all.

    A pivoted Cholesky decomposition takes row after row until none has more than `LEFT` of that strength
    left, which is about as many as there are patterns; only those need an eigenvalue decomposition.
    """
    triangle, order, rank, _ = _pivoted_cholesky(products, tol=(LEFT * least) ** 2, lower=1)
    lower = np.tril(triangle)[:, :rank]
    squared, turn = np.linalg.eigh(lower.T @ lower)
    kept = squared > least**2
    strength = np.sqrt(squared[kept])
    vectors = np.empty((len(products), len(strength)))
    vectors[order - 1] = lower @ (turn[:, kept] / strength)
    return vectors, strength, rank < len(products)


def _products(rows: np.ndarray, least: float) -> np.ndarray:
    """``rows @ rows.T``, in double precision where single would hide strengths of `least`."""
    if least**2 > _LOST * float(np.linalg.norm(rows)) ** 2:
        return rows @ rows.T
    parts = np.array_split(rows, math.ceil(rows.size / _BLOCK), axis=1)
    return np.sum([part @ part.T for part in (p.astype(np.float64) for p in parts)], axis=0)


def weakest(found: Iterable[Found], budget: float) -> float:
    """The strength up to which all factors together stay within a squared norm."""
    strengths = np.concatenate([f.strength for f in found])
    copies = np.concatenate([np.full(len(f.strength), f.copies) for f in found])
    order = np.argsort(strengths)
    spent = np.cumsum(copies[order] * strengths[order] ** 2)
    k = int(np.searchsorted(spent, budget))
    return float(strengths[order[k - 1]]) if k else 0.0


def together(blocks: Mapping[Key, Factors]) -> dict[Key, Factors]:
    """The same in one piece of memory, which the system takes back when it is let go."""
    ends = np.cumsum([left.shape[1] for left, _ in blocks.values()])[:-1]
    left = np.concatenate([left.T for left, _ in blocks.values()])
    right = np.concatenate([right for _, right in blocks.values()])
    pairs = zip(np.split(left, ends), np.split(right, ends), strict=True)
    return {key: (mine.T, other) for key, (mine, other) in zip(blocks, pairs, strict=True)}
