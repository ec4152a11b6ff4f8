"""Ray matrices of a plane: rays (x, p) of position x [m] and momentum p = n θ, and light fields of them.

A matrix A takes a ray through part of an optical system, X1 = A X0, with det A = 1. Radiance goes with its
ray, so that the light field behind is L1(X) = L0(A⁻¹ X). Matrices multiply from the last part to the first.
"""

from collections.abc import Callable

import numpy as np

from lumigraph.core import checks
from lumigraph.errors import GeometryError

Radiance = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""Light field (x, p) -> radiance, of arrays that broadcast."""


def momentum(angle: float, index: float = 1.0) -> float:
    """Momentum p = n θ of a ray at a small angle [rad] in a medium of index n; thesis eq. 1.12."""
    return checks.positive("index", index) * checks.finite("angle", angle, "rad")


def free_space(distance: float, index: float = 1.0) -> np.ndarray:
    """Matrix (2, 2) of a distance [m] in a medium, [[1, t/n], [0, 1]].

    Examples
    --------
    >>> free_space(0.1).tolist()
    [[1.0, 0.1], [0.0, 1.0]]
    """
    along = checks.finite("distance", distance) / checks.positive("index", index)
    return np.array([[1.0, along], [0.0, 1.0]])


def lens(focal_length: float) -> np.ndarray:
    """Matrix (2, 2) of a thin lens [m], [[1, 0], [-1/f, 1]]; a negative f spreads light."""
    f = checks.finite("focal_length", focal_length)
    if f == 0:
        raise GeometryError("focal_length is 0 m but must not be. Give the lens' own, such as 5.2e-3.")
    return np.array([[1.0, 0.0], [-1.0 / f, 1.0]])


def surface(radius: float, before: float, behind: float) -> np.ndarray:
    """Matrix (2, 2) of a sphere between two indices, [[1, 0], [-(n2 - n1)/R, 1]]; R > 0 bulges to the light.

    Parameters
    ----------
    radius
        R [m]; infinite for a plane.
    before, behind
        Indices n1 and n2.

    Examples
    --------
    A plano-convex lenslet of silica, thesis eq. 6.1: f = R/(n - 1).

    >>> power = surface(2.376e-3, 1.0, 1.457)[1, 0] + surface(float("inf"), 1.457, 1.0)[1, 0]
    >>> round(-1e3 / float(power), 2)
    5.2
    """
    n1, n2 = checks.positive("before", before), checks.positive("behind", behind)
    if not abs(radius) > 0:  # not a number, or nought
        raise GeometryError(f"radius is {radius:g} m but must not be 0; a plane's is infinite.")
    return np.array([[1.0, 0.0], [-(n2 - n1) / radius, 1.0]])


def system(*parts: np.ndarray) -> np.ndarray:
    """Matrix (2, 2) of parts that light meets in this order; thesis eq. 1.14.

    Examples
    --------
    >>> system(free_space(0.12), lens(0.06), free_space(0.12))[0].round(9).tolist()
    [-1.0, 0.0]
    """
    whole = np.eye(2)
    for part in parts:
        whole = np.asarray(part, float) @ whole
    return whole


def inverse(matrix: np.ndarray) -> np.ndarray:
    """Inverse (2, 2) of a ray matrix, which has determinant 1; thesis eq. 1.15 and 1.21.

    Raises
    ------
    GeometryError
        Another shape or determinant: no optical system of one plane has it.
    """
    a = np.asarray(matrix, float)
    found = np.linalg.det(a) if a.shape == (2, 2) else np.nan
    if not abs(found - 1) <= 1e-9:
        raise GeometryError(
            f"matrix has shape {a.shape} and determinant {found:.6g} but a ray matrix is (2, 2) with 1. "
            "Compose it of free_space, lens and surface."
        )
    return np.array([[a[1, 1], -a[0, 1]], [-a[1, 0], a[0, 0]]])


def relay(relay_distance: float, lenslet_distance: float, focal_length: float) -> np.ndarray:
    """Matrix (2, 2) from the main-lens image through one lenslet to the sensor; thesis eq. 1.20.

    [[-b/a, 0], [-1/f, -a/b]] where 1/a + 1/b = 1/f.

    Examples
    --------
    >>> relay(15.6e-3, 7.8e-3, 5.2e-3).round(3).tolist()
    [[-0.5, 0.0], [-192.308, -2.0]]
    """
    return system(free_space(relay_distance), lens(focal_length), free_space(lenslet_distance))


def through(matrix: np.ndarray, radiance: Radiance) -> Radiance:
    """Light field behind a system, L1(X) = L0(A⁻¹ X); thesis eq. 1.16 to 1.19.

    Examples
    --------
    A shear: light of one place, 10 mm on, stands where its direction has brought it.

    >>> here = lambda x, p: np.exp(-(x / 1e-5) ** 2) + 0 * p
    >>> there = through(free_space(10e-3), here)
    >>> float(there(np.array(1e-4), np.array(0.01)))
    1.0
    """
    back = inverse(matrix)

    def behind(x: np.ndarray, p: np.ndarray) -> np.ndarray:
        return radiance(back[0, 0] * x + back[0, 1] * p, back[1, 0] * x + back[1, 1] * p)

    return behind


def intensity(radiance: Radiance, x: np.ndarray, momenta: np.ndarray) -> np.ndarray:
    """Intensity (n,) at places x [m], the integral over evenly spaced momenta; thesis eq. 1.11 and 1.13."""
    x, p = np.asarray(x, float), np.asarray(momenta, float)
    step = p[1] - p[0]
    return np.asarray(radiance(x[:, None], p), float).sum(1) * step
