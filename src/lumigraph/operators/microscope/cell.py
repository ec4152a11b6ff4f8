"""One lenslet of a light-field microscope, and how its cell is sampled."""

from dataclasses import dataclass

import numpy as np

from lumigraph.core.cache import remembered


@dataclass(frozen=True, slots=True)
class Lenslet:
    """A lenslet and what stands behind it, in lengths at the lenslets.

    Parameters
    ----------
    pitch, focal_length, distance
        d, f_µ, and b from the lenslets to the sensor [m].
    magnification
        M, from the object to the lenslets.
    width
        Of the open part [m].
    is_round
        Whether that is a disc, not a square.
    """

    pitch: float
    focal_length: float
    distance: float
    magnification: float
    width: float
    is_round: bool = False


@dataclass(frozen=True, slots=True)
class CellSampling:
    """Points and samples of the image of a lenslet's cell, symmetric about its centre.

    Parameters
    ----------
    points
        s: object points along each side.
    pixels
        N: samples of the image along each side.
    width
        Of a pixel, a square over which light is averaged, over the lenslet's pitch.
    degree
        0 where the samples are pixels; else that of the B-splines whose coefficients they are, from which
        pixels anywhere are interpolated (`pixels`).
    light
        What a pixel reads of even light of 1: the square of its fill factor.
    """

    points: int
    pixels: int
    width: float
    degree: int = 0
    light: float = 1.0

    @property
    def classes(self) -> int:
        """Points of a cell, s²."""
        return self.points**2


@remembered
def parts(n: int) -> np.ndarray:
    """Orthonormal matrix (n, n) from n samples to their even parts, then their odd ones.

    >>> (parts(3) @ [1.0, 0.0, -1.0]).round(6).tolist()
    [0.0, 0.0, 1.414214]
    """
    found, half = np.zeros((n, n)), (n + 1) // 2
    for k in range(half):
        found[k, k] += 1
        found[k, n - 1 - k] += 1
    for k in range(n // 2):
        found[half + k, k], found[half + k, n - 1 - k] = 1, -1
    return found / np.linalg.norm(found, axis=1, keepdims=True)
