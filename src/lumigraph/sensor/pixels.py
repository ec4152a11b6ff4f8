"""Intensity on a grid integrated over the areas of pixels of any pitch."""

import numpy as np
import scipy

from lumigraph.core import checks
from lumigraph.core.arrays import WORKERS, Array, like, namespace, placement
from lumigraph.core.cache import ByteCache
from lumigraph.core.grid import Grid
from lumigraph.errors import GeometryError
from lumigraph.sensor.sensor import Sensor

_MATRICES = ByteCache()


def integrate(intensity: Array, grid: Grid, sensor: Sensor | Grid, *, turned: bool = True) -> Array:
    r"""Mean intensity over the area of each pixel; an even intensity of 1 gives 1.

    Where a sensor's `fill_factor` is below 1, what falls on the dark part of a pixel counts as nothing.

    Exact for an intensity that is band-limited on its grid (1/(2dx) ≥ 1/(λ F#), PSF of f-number F#) and
    dark at its border: along each axis the samples' Fourier series is integrated in closed form over each
    pixel, as a matrix product,

    .. math:: P = R_y \, I \, R_x^T

    so that pixels that tile the grid's window keep the total energy to rounding. What lies outside the
    window is dark. A hard edge rings, below zero too.

    Parameters
    ----------
    intensity
        (..., y, x), real; any array library, precision kept.
    grid
        Where its samples stand [m].
    sensor
        A `Sensor`, or the grid of its pixels.
    turned
        The picture on a sensor stands on its head; a readout is turned by 180° so that pictures stand
        upright: the pixel at (y, x) shows the intensity at (-y, -x). False keeps physical coordinates.

    Returns
    -------
    Array
        (..., ny, nx) of the pixels.

    Raises
    ------
    GeometryError
        The intensity's last axes differ from the grid.

    Examples
    --------
    >>> even = np.ones((6, 6))
    >>> integrate(even, Grid.square(6, 1.0), Grid.square(3, 1.5)).round(12).tolist()
    [[1.0, 1.0, 1.0], [1.0, 1.0, 1.0], [1.0, 1.0, 1.0]]
    """
    checks.array("intensity", intensity)
    checks.instance("grid", grid, Grid)
    if tuple(intensity.shape[-2:]) != grid.shape:
        raise GeometryError(
            f"intensity has shape {tuple(intensity.shape)} but the grid has {grid.shape}: "
            "the last two axes must be (y, x) of the grid."
        )
    along_y, along_x = _matrices(grid, _pixels(sensor), _fill(sensor), intensity, turned)
    xp = namespace(intensity)
    return xp.matmul(xp.matmul(along_y, intensity), xp.matrix_transpose(along_x))


def integrate_adjoint(values: Array, grid: Grid, sensor: Sensor | Grid, *, turned: bool = True) -> Array:
    """Adjoint of `integrate`: ``(integrate(I) * values).sum() == (I * integrate_adjoint(values)).sum()``.

    Parameters
    ----------
    values
        (..., ny, nx) of the pixels, real.
    grid, sensor, turned
        As for `integrate`.

    Returns
    -------
    Array
        (..., y, x) of the grid.

    Raises
    ------
    GeometryError
        The values' last axes differ from the pixels.
    """
    checks.array("values", values)
    checks.instance("grid", grid, Grid)
    pixels = _pixels(sensor)
    if tuple(values.shape[-2:]) != pixels.shape:
        raise GeometryError(
            f"values have shape {tuple(values.shape)} but the sensor has {pixels.shape} pixels: "
            "the last two axes must be (y, x) of the pixels."
        )
    along_y, along_x = _matrices(grid, pixels, _fill(sensor), values, turned)
    xp = namespace(values)
    return xp.matmul(xp.matmul(xp.matrix_transpose(along_y), values), along_x)


def _pixels(sensor: Sensor | Grid) -> Grid:
    if isinstance(sensor, Sensor):
        return sensor.grid
    checks.instance("sensor", sensor, Grid)
    return sensor


def _fill(sensor: Sensor | Grid) -> float:
    return sensor.fill_factor if isinstance(sensor, Sensor) else 1.0


def _matrices(grid: Grid, pixels: Grid, fill: float, array: Array, turned: bool) -> tuple[Array, Array]:
    matrices = []
    for axis in (0, 1):
        centers = (pixels.y, pixels.x)[axis]
        samples = grid.shape[axis], grid.pitch[axis], grid.center[axis]
        seen = pixels.shape[axis], pixels.pitch[axis], pixels.center[axis], fill
        key = samples, seen, turned, placement(array)
        matrices.append(
            _MATRICES.get(
                key,
                lambda centers=centers, samples=samples, axis=axis: like(
                    averages(-centers if turned else centers, fill * pixels.pitch[axis], *samples) * fill,
                    array,
                ),
            )
        )
    return matrices[0], matrices[1]


def averages(centers: np.ndarray, width: float, n: int, pitch: float, center: float) -> np.ndarray:
    """Matrix (pixels, samples), float64: mean over each pixel of the samples' Fourier series.

    Parameters
    ----------
    centers, width
        Centres and width of the pixels along the axis [m].
    n, pitch, center
        Number, pitch and centre of the samples [m].

    Notes
    -----
    The mean of exp(2πifx) over a width w about c is sinc(f w) exp(2πifc). Pixels that reach out of the
    window keep the part inside, as the series would repeat the window.
    """
    first = center - (n // 2) * pitch
    left, right = first - pitch / 2, first + (n - 0.5) * pitch
    start = np.clip(centers - width / 2, left, right)
    stop = np.clip(centers + width / 2, left, right)
    inside, middle = stop - start, (start + stop) / 2 - first
    frequency = np.arange(n // 2 + 1) / (n * pitch)
    spectrum = np.sinc(inside[:, None] * frequency) * np.exp(-2j * np.pi * middle[:, None] * frequency)
    if n % 2 == 0:
        spectrum[:, -1] = spectrum[:, -1].real  # the highest frequency is a cosine, half of it on either side
    matrix = np.asarray(scipy.fft.irfft(spectrum, n, axis=1, workers=WORKERS))
    return matrix * (inside / width)[:, None]
