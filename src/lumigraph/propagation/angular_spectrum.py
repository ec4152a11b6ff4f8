"""Angular spectrum of plane waves, plain and band-limited.

The transfer function exp(ikz sqrt(1 - (λfx)² - (λfy)²)) is exact; on a sampled window it aliases above
`sampling.band_limits`. Methods differ only in their `PassBand`, the frequencies that they keep.

J. W. Goodman, *Introduction to Fourier Optics*, section 3.10; K. Matsushima and T. Shimobaba,
Opt. Express 17, 19662 (2009); the thesis' section 2.4, where rect(f/f_max) of 2.65 is rect(f/(2 f_max)).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from lumigraph.core import arrays
from lumigraph.core.arrays import Array
from lumigraph.core.field import Field
from lumigraph.core.grid import Grid
from lumigraph.propagation import sampling
from lumigraph.propagation.cache import CACHE
from lumigraph.propagation.dropped import dropped_light
from lumigraph.propagation.pruned import Band, Transfer, convolve, convolved_intensity
from lumigraph.propagation.window import check_memory, reach, samples_between, window_shape

Pair = tuple[float, float]
Distance = float | Array
Limits = Callable[[Grid, Grid, float, float], Pair]


@dataclass(frozen=True, slots=True)
class PassBand:
    """Frequencies that a method keeps of the transfer function.

    Parameters
    ----------
    method
        Name of the method, for messages.
    limits
        Highest frequencies (y, x) [1/m], a function of the input's grid, the window of the calculation, the
        distance [m] and the wavelength [m].
    circular
        Keep an ellipse with these half axes, not the rectangle.
    """

    method: str
    limits: Limits
    circular: bool = False


PLAIN = PassBand("angular_spectrum", lambda grid, window, distance, wavelength: (math.inf, math.inf))
RECTANGLE = PassBand(
    "band_limited",
    lambda grid, window, distance, wavelength: sampling.band_limits(window, distance, wavelength),
)


def angular_spectrum(field: Field, distance: Distance, pad: float, grid: Grid | None) -> Field:
    """Field by every frequency of the window, aliased or not."""
    return spectral(field, distance, PLAIN, pad, grid)


def band_limited(field: Field, distance: Distance, pad: float, grid: Grid | None) -> Field:
    """Field by the rectangle of frequencies of `sampling.band_limits` (Matsushima and Shimobaba 2009)."""
    return spectral(field, distance, RECTANGLE, pad, grid)


def spectral(field: Field, distance: Distance, band: PassBand, pad: float, grid: Grid | None) -> Field:
    """Field after the distance [m] by the frequencies of a pass band, on `grid` or the field's own."""
    output = grid or field.grid
    transfer, clean = _transfer(field, distance, band, pad, output)
    found = replace(field, data=convolve(field.data, transfer, output.shape), grid=output)
    if clean is not None:
        fields = field, output, found.intensity
        sampling.warn(dropped_light(band.method, *clean, fields, arrays.number(distance)))
    return found


def transfer_function(fy: np.ndarray, fx: np.ndarray, distance: float, wavelength: float) -> np.ndarray:
    r"""Angular-spectrum transfer function (fy, fx), complex128.

    .. math:: H = \exp(i 2\pi z/\lambda \sqrt{1 - s}), \quad s = (\lambda f_x)^2 + (\lambda f_y)^2

    The phase is computed as the carrier 2πz/λ, reduced to one turn, plus 2πz/λ · (sqrt(1-s) - 1) by way of
    -s/(1 + sqrt(1-s)), which keeps its digits. Evanescent waves, s > 1, decay for z > 0; for z < 0 they
    are dropped, because they would grow without bound.

    Parameters
    ----------
    fy, fx
        Frequencies of the rows (ny,) and the columns (nx,) [1/m].
    distance
        z [m].
    wavelength
        In vacuum [m].

    References
    ----------
    Goodman, *Introduction to Fourier Optics*, equation 3-74 (3rd edition); the thesis' 2.53.
    """
    waves = distance / wavelength
    s = ((wavelength * fy) ** 2)[:, None] + (wavelength * fx) ** 2
    evanescent = s > 1
    turns = math.fmod(waves, 1.0) - waves * (s / (1 + np.sqrt(np.maximum(1 - s, 0))))
    H = np.exp(2j * math.pi * turns)
    if evanescent.any():
        H[evanescent] = np.exp(-2 * math.pi * waves * np.sqrt(s[evanescent] - 1)) if waves > 0 else 0.0
    return H


def wave_numbers(fy: np.ndarray, fx: np.ndarray, wavelength: float) -> np.ndarray:
    """Phase of `transfer_function` per distance (fy, fx) [rad/m]: complex where waves are evanescent."""
    s = 1 - ((wavelength * fy) ** 2)[:, None] - (wavelength * fx) ** 2
    root = np.sqrt(s.astype(np.complex128)) if (s < 0).any() else np.sqrt(s)
    return 2 * math.pi / wavelength * root


def band_limited_intensity(field: Field, distance: Distance, pad: float, grid: Grid | None) -> Array:
    """Intensity (..., y, x) of `band_limited`, without the field itself: a fifth quicker."""
    output = grid or field.grid
    transfer, clean = _transfer(field, distance, RECTANGLE, pad, output)
    intensity = convolved_intensity(field.data, transfer, output.shape)
    if clean is not None:
        fields = field, output, intensity
        sampling.warn(dropped_light(RECTANGLE.method, *clean, fields, arrays.number(distance)))
    return intensity


def _transfer(
    field: Field, way: Distance, band: PassBand, pad: float, output: Grid
) -> tuple[Transfer, tuple[Grid, Pair] | None]:
    """Transfer function to `output`, and its window and highest frequencies where it has a clean limit."""
    distance = arrays.number(way)
    step, between = samples_between(output, field.grid)
    first = between.samples_to(field.grid)
    window = Grid(window_shape(field.grid, between, pad, first, step), field.grid.pitch)
    limits = band.limits(field.grid, window, distance, field.wavelength)
    rows, columns = Band.below(window.fy, limits[0]), Band.below(window.fx, limits[1])
    _check_memory(field, rows, columns, output)
    farthest = tuple(map(reach, field.grid.shape, first, between.shape))
    aliases = _check_sampling(band.method, field, window, limits, (distance, (farthest[0], farthest[1])))
    circle = limits if band.circular else None
    key = ("spectral", window, first, step, distance, field.wavelength, rows, columns, circle)
    values = CACHE.get(
        (*key, arrays.placement(field.data)),
        lambda: arrays.like(
            _on_band(window, (rows, columns), first, (distance, field.wavelength), circle)
            / (rows.fewer(step[0]) * columns.fewer(step[1])),
            field.data,
        ),
    )
    if arrays.is_parameter(way):
        across, up = rows.take(window.fy), columns.take(window.fx)  # values are (columns, rows)
        waves = wave_numbers(up, across, field.wavelength)
        values = arrays.turned(values, waves, arrays.parameter(way) - distance)
    return Transfer(values, rows, columns, step), None if aliases or math.isinf(limits[0]) else (
        window,
        limits,
    )


def _on_band(
    window: Grid, bands: tuple[Band, Band], first: tuple[int, int], wave: Pair, circle: Pair | None
) -> np.ndarray:
    """Transfer function (columns, rows) on its band, with the shift that puts the output's first sample at 0.

    It is even in both frequencies, so only one quadrant is computed.
    """
    rows, columns = bands
    fy, fx = np.abs(window.fy[: rows.n // 2 + 1]), np.abs(window.fx[: columns.n // 2 + 1])
    fy, fx = fy[: max(rows.positive, rows.negative + 1)], fx[: max(columns.positive, columns.negative + 1)]
    quadrant = transfer_function(fx, fy, *wave)  # transposed: x first
    if circle is not None:
        quadrant[((fx / circle[1]) ** 2)[:, None] + (fy / circle[0]) ** 2 > 1] = 0
    values = quadrant[_mirrored(columns)][:, _mirrored(rows)]
    if any(first):
        turns_y, turns_x = (n * np.arange(band.n) for n, band in zip(first, bands, strict=True))
        shift_y = rows.take(np.exp(2j * math.pi * (turns_y % rows.n) / rows.n))
        shift_x = columns.take(np.exp(2j * math.pi * (turns_x % columns.n) / columns.n))
        values *= shift_y
        values *= shift_x[:, None]
    return np.ascontiguousarray(values)


def _mirrored(band: Band) -> np.ndarray:
    """Index of |f| for each frequency of the band, in FFT order."""
    return np.concatenate([np.arange(band.positive), np.arange(band.negative, 0, -1)])


def _check_memory(field: Field, rows: Band, columns: Band, output: Grid) -> None:
    planes = math.prod(field.data.shape[:-2])
    item = 8 if arrays.is_single(field.data) else 16
    result = output.shape[0] * output.shape[1]
    spectrum = columns.count * (field.grid.shape[0] + output.shape[0])
    transfer = columns.count * rows.count
    nbytes = item * (planes * result + spectrum + transfer) + 40 * transfer
    check_memory(nbytes, f"propagation on a window of {rows.n} x {columns.n} samples")


def _check_sampling(
    method: str, field: Field, window: Grid, limits: Pair, target: tuple[float, tuple[int, int]]
) -> bool:
    distance, wavelength = target[0], field.wavelength
    if math.isinf(limits[0]):
        message = sampling.unlimited_aliases(method, window, distance, wavelength)
    else:
        message = sampling.kept_alias(method, limits, window, distance, wavelength)
    message = message or sampling.light_wraps(window, limits, target[1], distance, wavelength)
    sampling.warn(message)
    return message is not None
