r"""Form of a lenslet: the path through it without focus and tilt.

Over the square around a lenslet, products of Legendre polynomials are orthogonal. The path through it is

.. math:: W = \sum_k c_k \sqrt{(2m+1)(2n+1)}\, P_m(v)\, P_n(u)

v and u along columns and rows in halves of its width, with the terms of degree 2 to 4 (m + n): astigmatism,
coma and its like, spherical aberration. Of P₂(v) and P₂(u), whose sum is focus, the difference alone counts.
So no term moves the focus, nor, for the least rms, the image, and c are rms paths over the square [m].
"""

import math
from functools import cache

import numpy as np

ORDER = 4
"""Degree of the terms at most."""

TERMS = ((2, 0), (1, 1), (3, 0), (2, 1), (1, 2), (0, 3), (4, 0), (3, 1), (2, 2), (1, 3), (0, 4))
"""Degrees (m, n) along columns and rows; the first is the difference of (2, 0) and (0, 2), over √2."""

STEEPEST = 60.0
"""Slopes at a corner, of the rms over half of the width, that no lenslet drawn by chance goes beyond."""


def matrices(terms: np.ndarray) -> np.ndarray:
    """Coefficients (..., m, n) of products of Legendre polynomials, of terms (..., k) [m]."""
    found = np.zeros((*terms.shape[:-1], ORDER + 1, ORDER + 1))
    for k, (m, n) in enumerate(TERMS):
        found[..., m, n] = terms[..., k] * math.sqrt((2 * m + 1) * (2 * n + 1))
    found[..., 2, 0] /= math.sqrt(2)
    found[..., 0, 2] = -found[..., 2, 0]
    return found


def along(at: np.ndarray) -> np.ndarray:
    """Legendre polynomials (..., m) at places in halves of the width."""
    return np.polynomial.legendre.legvander(at, ORDER)


def path(terms: np.ndarray, v: np.ndarray, u: np.ndarray) -> np.ndarray:
    """Paths (v, u) [m] through one lenslet of terms (k,), at places in halves of its width."""
    return along(v) @ matrices(terms) @ along(u).T


@cache
def _slopes() -> tuple[np.ndarray, np.ndarray]:
    ends = along(np.array([1.0])) - along(np.array([-1.0]))
    down, across = np.zeros(len(TERMS)), np.zeros(len(TERMS))
    for k in range(len(TERMS)):
        one = matrices(np.eye(len(TERMS))[k])
        down[k], across[k] = (ends[0] @ one)[0] / 2, (one @ ends[0])[0] / 2
    return down, across


def slopes(terms: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean of the path's slope over the square, along columns and rows, times half of the width [m].

    By so much, over half of the width, light behind a lenslet goes aside: its centroid, by wave optics too.
    """
    down, across = _slopes()
    return terms @ down, terms @ across
