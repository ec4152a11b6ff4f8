"""Area fraction of each sample that a shape covers: the grey edges of stops, lenslets and targets.

A hard edge on a coarse grid is wrong by up to half a sample; with area fractions the power through a
shape is exact. Shapes are centred on the axis unless offsets say otherwise; all is NumPy in float64.
"""

import math

import numpy as np

from lumigraph.core import checks, memory
from lumigraph.core.grid import Grid


def interval(coordinates: np.ndarray, pitch: float, start: float, stop: float) -> np.ndarray:
    """Fraction (n,) of each sample, `pitch` wide, that lies between `start` and `stop`."""
    overlap = np.minimum(coordinates + pitch / 2, stop) - np.maximum(coordinates - pitch / 2, start)
    return np.clip(overlap / pitch, 0.0, 1.0)


def half_plane(distance: np.ndarray, normal: tuple[float, float], pitch: tuple[float, float]) -> np.ndarray:
    """Fraction of each sample on the positive side of a straight line; exact.

    Parameters
    ----------
    distance
        Signed distance of the sample's centre from the line, along `normal`.
    normal
        Unit vector (y, x) towards the covered side.
    pitch
        Size of a sample (dy, dx), in the unit of the distance.
    """
    long, short = sorted((abs(normal[0]) * pitch[0], abs(normal[1]) * pitch[1]), reverse=True)
    if short < 1e-6 * long:
        return np.clip(distance / long + 0.5, 0.0, 1.0)
    # The sample's shadow on the normal is two boxes convolved; this is the integral of that trapezoid.
    outer, inner = (long + short) / 2, (long - short) / 2
    distance = np.clip(distance, -outer, outer)
    ramps = [np.square(np.maximum(distance + step, 0.0)) for step in (outer, inner, -inner, -outer)]
    return np.clip((ramps[0] - ramps[1] - ramps[2] + ramps[3]) / (2 * long * short), 0.0, 1.0)


def strip(
    distance: np.ndarray, half_width: float, normal: tuple[float, float], pitch: tuple[float, float]
) -> np.ndarray:
    """Fraction of each sample between two parallel lines `half_width` from the line of distance 0."""
    above = half_plane(distance + half_width, normal, pitch)
    return np.clip(above - half_plane(distance - half_width, normal, pitch), 0.0, 1.0)


def disc(y: np.ndarray, x: np.ndarray, radius: float, pitch: tuple[float, float]) -> np.ndarray:
    """Fraction of each sample inside a disc about (0, 0); exact.

    Parameters
    ----------
    y, x
        Centres of the samples; they broadcast against each other.
    radius
        Radius of the disc.
    pitch
        Size of a sample (dy, dx).
    """
    half_y, half_x = pitch[0] / 2, pitch[1] / 2
    far = np.square(np.abs(y) + half_y) + np.square(np.abs(x) + half_x)
    inside = far <= radius**2
    near = np.square(np.maximum(np.abs(y) - half_y, 0)) + np.square(np.maximum(np.abs(x) - half_x, 0))
    edge = ~inside & (near < radius**2)
    fraction = inside.astype(np.float64)
    y_edge, x_edge = (np.broadcast_to(values, edge.shape)[edge] for values in (y, x))
    corners = [
        sy * sx * _quadrant(y_edge + sy * half_y, x_edge + sx * half_x, radius)
        for sy in (-1, 1)
        for sx in (-1, 1)
    ]
    fraction[edge] = np.clip(sum(corners) / (pitch[0] * pitch[1]), 0.0, 1.0)
    return fraction


def _quadrant(y: np.ndarray, x: np.ndarray, radius: float) -> np.ndarray:
    """Area of a disc between the axes and (y, x), odd in both: four of them give any rectangle's."""
    sign = np.sign(y) * np.sign(x)
    y, x = np.minimum(np.abs(y), radius), np.minimum(np.abs(x), radius)
    crossing = np.minimum(np.sqrt(radius**2 - y**2), x)
    return sign * (y * crossing + _under_circle(x, radius) - _under_circle(crossing, radius))


def _under_circle(t: np.ndarray, radius: float) -> np.ndarray:
    """Integral of sqrt(r² - t²) from 0 to t."""
    return (t * np.sqrt(np.maximum(radius**2 - t**2, 0)) + radius**2 * np.arcsin(t / radius)) / 2


def supersampled(grid: Grid, inside, factor: int = 8) -> np.ndarray:
    """Mean (ny, nx) of ``inside(y, x)`` over `factor` × `factor` points of each sample.

    For shapes without a closed form; an edge is right to about 1 / (4 factor) of a sample.
    """
    steps = (np.arange(factor) + 0.5) / factor - 0.5
    total = np.zeros(grid.shape)
    for step_y in steps:
        for step_x in steps:
            total += inside(grid.y[:, None] + step_y * grid.pitch[0], grid.x + step_x * grid.pitch[1])
    return total / factor**2


def sides(angle: float) -> tuple[float, float]:
    """Unit vector (y, x) turned by `angle` [rad] from +x towards +y."""
    return math.sin(angle), math.cos(angle)


def check_canvas(grid: Grid) -> None:
    """Refuse what is no grid to draw on, or one whose picture would not fit in memory."""
    checks.instance("grid", grid, Grid)
    memory.require_plane(grid.shape, 32, "a target")
