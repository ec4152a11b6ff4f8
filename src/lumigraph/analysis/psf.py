"""Measures of a point image: where it is, and how much light is near."""

import numpy as np

from lumigraph.core import checks
from lumigraph.core.arrays import Array, to_numpy
from lumigraph.core.grid import Grid
from lumigraph.errors import GeometryError, LumigraphError


def centroid(image: Array, grid: Grid) -> tuple[float, float]:
    """Centre of gravity of an image (y, x) [m].

    Parameters
    ----------
    image
        Intensity (y, x).
    grid
        Where the samples stand.

    Raises
    ------
    GeometryError
        The image does not fit the grid.
    LumigraphError
        It has no light.

    Examples
    --------
    >>> centroid(np.array([[0.0, 1.0, 1.0]]), Grid((1, 3), 2.0))
    (0.0, 1.0)
    """
    data = _checked(image, grid)
    total = data.sum()
    return float(data.sum(1) @ grid.y / total), float(data.sum(0) @ grid.x / total)


def encircled_energy(
    image: Array, grid: Grid, radius: float, center: tuple[float, float] | None = None
) -> float:
    """Fraction of an image's light inside a circle.

    Parameters
    ----------
    image
        Intensity (y, x).
    grid
        Where the samples stand.
    radius
        Of the circle [m]; a sample counts by its centre.
    center
        Of the circle (y, x) [m]; the centroid if left out.

    Raises
    ------
    GeometryError
        The image does not fit the grid, or the radius is not above zero.
    LumigraphError
        It has no light.

    Examples
    --------
    >>> encircled_energy(np.ones((3, 3)), Grid.square(3, 1.0), 1.0)
    0.5555555555555556
    """
    radius = checks.positive("radius", radius)
    data = _checked(image, grid)
    y, x = centroid(data, grid) if center is None else center
    inside = (grid.y - y)[:, None] ** 2 + (grid.x - x) ** 2 <= radius**2 * (1 + 1e-12)
    return float(data[inside].sum() / data.sum())


def _checked(image: Array, grid: Grid) -> np.ndarray:
    data = np.asarray(to_numpy(image))
    if data.shape != grid.shape:
        raise GeometryError(f"the image has shape {data.shape} but the grid {grid.shape}. Give its own grid.")
    if data.dtype.kind == "c":
        raise LumigraphError("the image is complex. Give its intensity, abs(field)**2.")
    if not data.any():
        raise LumigraphError("the image has no light. Check the position and the window.")
    return data.astype(np.float64)
