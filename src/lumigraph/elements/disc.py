"""Integrals over a disc, and the fields that a pupil sends into a plane, by rows of nodes.

Gauss's nodes of Chebyshev's second kind along y take up the rows' length; Legendre's stand along each row.
Polynomials are integrated exactly, and waves over the disc err by rounding once there are more nodes than
half the radians from the middle to the rim.
"""

import math
from functools import lru_cache

import numpy as np

BLOCK = 2**22
"""Numbers of the waves that are held at a time."""


@lru_cache(maxsize=8)
def disc(rows: int, nodes: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Places y (rows, 1), x (rows, nodes) in the unit disc, and their weights (rows, nodes).

    Examples
    --------
    >>> y, x, weight = disc(4, 4)
    >>> round(float((weight * x**2 * y**4).sum()) / np.pi, 6)  # 1/64
    0.015625
    """
    turn = np.arange(1, rows + 1) * (np.pi / (rows + 1))
    at, weight = np.polynomial.legendre.leggauss(nodes)
    y = np.cos(turn)[:, None]
    return y, np.sin(turn)[:, None] * at, (np.pi / (rows + 1) * np.sin(turn) ** 2)[:, None] * weight


def nodes_for(radians: float) -> int:
    """Nodes along a diameter for phases that change by so much from the middle to the rim.

    >>> nodes_for(0.0), nodes_for(100.0)
    (24, 88)
    """
    return 8 * math.ceil((20 + 0.5 * radians + 3 * radians ** (1 / 3)) / 8)


def plane(pupil: np.ndarray, q: tuple[np.ndarray, np.ndarray], y: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Sums (modes, y, x) of waves exp(i (q_y y + q_x x)) of amplitudes (modes, rows, nodes).

    `q` is (rows, 1) and (rows, nodes) [1/m], `y` and `x` are places along the axes (n,) [m].
    """
    modes, rows, nodes = pupil.shape
    across = np.empty((rows, modes, len(x)), np.complex128)
    step = max(1, BLOCK // (nodes * len(x)))
    for first in range(0, rows, step):
        part = slice(first, first + step)
        waves = np.exp(1j * q[1][part, :, None] * x)
        across[part] = pupil[:, part].transpose(1, 0, 2) @ waves
    return np.exp(1j * np.outer(y, q[0])) @ across.transpose(1, 0, 2)
