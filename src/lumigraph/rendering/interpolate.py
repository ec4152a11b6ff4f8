"""Values between samples: gathered neighbours times weights, for every array library."""

from collections.abc import Iterator
from typing import Literal

import numpy as np

from lumigraph.core import checks
from lumigraph.core.arrays import Array, like, namespace
from lumigraph.errors import LumigraphError

Interpolation = Literal["cubic", "linear", "band_limited"]
INTERPOLATIONS = ("linear", "cubic", "band_limited")

_LOBES = 3  # of the sinc, on either side
_BLOCK = 1 << 13  # positions at a time: as many as a processor's cache holds

Tap = tuple[int, np.ndarray]
"""Steps from the sample below a position, and the weight of the sample there."""


def taps(fraction: np.ndarray, interpolation: Interpolation) -> list[Tap]:
    """Weights of the neighbours of positions `fraction` (0 to 1) beyond a sample; they add up to 1.

    - "linear" (bilinear in two dimensions): two taps for each axis; blurs, never overshoots.
    - "cubic": four taps, Keys' convolution kernel with a = -1/2 (Catmull-Rom), exact for quadratic pictures.
    - "band_limited": six taps, the sinc of the sampling theorem under Lanczos' window: keeps the most
      detail, overshoots at edges, and reaches three samples far.

    References
    ----------
    Keys, "Cubic convolution interpolation for digital image processing", IEEE Trans. ASSP 29, 1153 (1981).
    Duchon, "Lanczos filtering in one and two dimensions", J. Appl. Meteorol. 18, 1016 (1979).
    """
    check_interpolation(interpolation)
    f = np.asarray(fraction, float)
    if interpolation == "linear":
        return [(0, 1 - f), (1, f)]
    if interpolation == "band_limited":
        weights = [np.sinc(f - step) * np.sinc((f - step) / _LOBES) for step in range(1 - _LOBES, _LOBES + 1)]
        total = np.sum(weights, axis=0)
        return [(step, w / total) for step, w in enumerate(weights, start=1 - _LOBES)]
    return [
        (-1, ((2 - f) * f - 1) * f / 2),
        (0, (3 * f - 5) * f * f / 2 + 1),
        (1, ((4 - 3 * f) * f + 1) * f / 2),
        (2, (f - 1) * f * f / 2),
    ]


def neighbours(
    position: np.ndarray, count: int, interpolation: Interpolation
) -> list[tuple[np.ndarray, np.ndarray]]:
    """(index, weight) of every neighbour of positions along an axis of `count` samples, edges repeated.

    Neighbours whose weight is zero everywhere are left out, so that positions on samples cost one gather.
    """
    nearest = np.rint(position)
    position = np.where(np.abs(position - nearest) < 1e-9, nearest, position)
    below = np.floor(position)
    return [
        (np.clip(below.astype(np.int64) + step, 0, count - 1), weight)
        for step, weight in taps(position - below, interpolation)
        if np.any(weight)
    ]


def check_interpolation(interpolation: str) -> None:
    """Refuse an unknown interpolation."""
    checks.choice("interpolation", interpolation, INTERPOLATIONS, LumigraphError)


def as_float(data: Array) -> Array:
    """The data as floats: whole numbers become float32, floats stay as they are."""
    xp = namespace(data)
    return (
        data if xp.isdtype(data.dtype, ("real floating", "complex floating")) else xp.astype(data, xp.float32)
    )


def take(data: Array, index: np.ndarray, axis: int) -> Array:
    """Slices of the data along one axis at NumPy indices (k,)."""
    xp = namespace(data)
    return xp.take(data, xp.asarray(index, device=data.device), axis=axis)


def weighted(values: Array, weight: np.ndarray, trailing: int) -> Array:
    """Values times NumPy weights that broadcast from the left, with `trailing` axes of values after them."""
    return values * like(weight.reshape(weight.shape + (1,) * trailing), values)


def _combined(
    image_shape: tuple[int, ...], y: np.ndarray, x: np.ndarray, interpolation: Interpolation
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    columns = neighbours(x, image_shape[1], interpolation)
    for row, row_weight in neighbours(y, image_shape[0], interpolation):
        for column, column_weight in columns:
            yield (row * image_shape[1] + column).ravel(), (row_weight * column_weight).ravel()


def sample(image: Array, y: np.ndarray, x: np.ndarray, interpolation: Interpolation = "cubic") -> Array:
    """Image (ny, nx[, c]) at positions y and x [px] of one shape: values of that shape[, c].

    Positions beyond the edge take the edge's value.
    """
    y, x = np.broadcast_arrays(y, x)
    xp, tail = namespace(image), tuple(image.shape[2:])
    flat, size = xp.reshape(image, (image.shape[0] * image.shape[1], *tail)), tuple(image.shape[:2])
    if not isinstance(image, np.ndarray) or y.size <= _BLOCK:
        return xp.reshape(_summed(flat, size, y, x, interpolation), (*y.shape, *tail))
    y, x, shape = y.ravel(), x.ravel(), y.shape
    result = np.empty((y.size, *tail), _summed(flat, size, y[:1], x[:1], interpolation).dtype)
    for part in (slice(k, k + _BLOCK) for k in range(0, y.size, _BLOCK)):
        result[part] = _summed(flat, size, y[part], x[part], interpolation)
    return result.reshape(*shape, *tail)


def _summed(
    flat: Array, size: tuple[int, ...], y: np.ndarray, x: np.ndarray, interpolation: Interpolation
) -> Array:
    """Values (k[, c]) of a picture of a size, its pixels in one row, at k positions."""
    total = None
    for index, weight in _combined(size, y, x, interpolation):
        term = weighted(take(flat, index, 0), weight, len(flat.shape) - 1)
        total = term if total is None else total + term
    return total
