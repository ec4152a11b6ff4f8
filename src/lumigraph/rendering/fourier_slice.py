"""Refocused pictures as slices of the four-dimensional spectrum."""

import math

import numpy as np

from lumigraph.core import arrays, checks, memory
from lumigraph.core.arrays import A, Array, like, namespace
from lumigraph.core.lightfield import LightField
from lumigraph.rendering.geometry import lit
from lumigraph.rendering.interpolate import as_float, take, weighted

_WIDTH = 6  # samples of the spectrum that the kernel spans
_OVERSAMPLING = 2.0


def refocus_fourier(views: LightField[A], alpha: float) -> A:
    r"""Picture (t, s[, c]) focused on F' = F / alpha, as in `refocus`, by the Fourier slice theorem.

    The spectrum of the picture is a plane through the spectrum of the light field,

    .. math:: \hat E(k) = \hat L(k, k_u = -k (1 - \alpha')),

    interpolated along the aperture's frequencies with a Kaiser-Bessel kernel (6 samples of a spectrum
    sampled twice as finely as needed, about 1e-5 of the peak). Views are moved by their Fourier series:
    exactly for pictures that the lenslets sample without aliasing, and round the edges: where `refocus`
    leaves out views that do not see a place, here the opposite edge comes in.

    Parameters
    ----------
    views
        Decoded light field.
    alpha
        F / F', above 0.

    Raises
    ------
    GeometryError
        alpha is not above 0.
    LumigraphError
        It would not fit in memory.

    References
    ----------
    Ng, "Fourier slice photography", ACM Trans. Graphics 24, 735 (2005). Kernel and its correction: Beatty et
    al., "Rapid gridding reconstruction with a minimal oversampling ratio", IEEE Trans. Med. Imaging 24, 799
    (2005).
    """
    checks.instance("views", views, LightField)
    alpha = checks.positive("alpha", alpha, "1")
    _check_memory(views)
    data = as_float(views.data)
    single = arrays.is_single(data)
    spectrum = arrays.fft(arrays.fft(arrays.as_complex(data), axis=2), axis=3)
    for axis, grids in ((1, "x"), (0, "y")):
        positions = getattr(views.aperture, grids)
        lenslets = views.lenslets
        k = (lenslets.fx, lenslets.fy)[1 - axis]
        pitch = views.aperture.pitch[axis]
        first = positions[0] / pitch
        spectrum = _sliced(spectrum, axis, -k * (1 - alpha) * pitch, first)
    xp = namespace(data)
    picture = xp.real(arrays.ifft(arrays.ifft(spectrum, axis=0), axis=1))
    picture = picture / max(1, int(lit(data).sum()))
    return xp.astype(picture, xp.float32) if single else picture


def _sliced(spectrum: Array, axis: int, frequency: np.ndarray, first: float) -> Array:
    r"""Sum over aperture samples j of data times exp(-i2π f (j + first)), one f per lenslet frequency.

    Removes `axis` (1: u, with f along s; 0: v, with f along t) from spectrum (v, u, t, s[, c]), or, once u is
    gone, (v, t, s[, c]).
    """
    xp, count = namespace(spectrum), spectrum.shape[axis]
    partner = 3 if axis == 1 else 1  # where the lenslet frequency stands: s in (v, u, t, s), t in (v, t, s)
    size = math.ceil(_OVERSAMPLING * count + _WIDTH)
    middle = np.arange(count) - count // 2
    shape = [1] * spectrum.ndim
    shape[axis] = count
    corrected = spectrum * like((1 / _kernel_transform(middle / size, size / count)).reshape(shape), spectrum)
    fine = arrays.fft(corrected, size, axis=axis)
    turn = np.exp(2j * np.pi * np.arange(size) * (count // 2) / size)
    shape[axis] = size
    fine = fine * like(turn.reshape(shape), spectrum)
    place = frequency * size
    below = np.floor(place - _WIDTH / 2).astype(np.int64) + 1
    flat, tail = _joined(fine, axis, partner)
    total = None
    for step in range(_WIDTH):
        index = np.mod(below + step, size) * len(frequency) + np.arange(len(frequency))
        weight = _kernel(place - below - step, size / count)
        term = weighted(take(flat, index, 0), weight, len(tail))
        total = term if total is None else total + term
    # The kernel's phase was taken about sample count // 2; the samples stand at j + first.
    phase = np.exp(-2j * np.pi * frequency * (count // 2 + first))
    total = weighted(total, phase, len(tail))
    return xp.moveaxis(total, 0, partner - 1)


def _joined(fine: Array, axis: int, partner: int) -> tuple[Array, tuple[int, ...]]:
    """Spectrum with the aperture's and the lenslets' frequency as one leading axis; the others' sizes."""
    xp = namespace(fine)
    order = [axis, partner, *(k for k in range(fine.ndim) if k not in (axis, partner))]
    turned = xp.permute_dims(fine, tuple(order))
    tail = tuple(turned.shape[2:])
    return xp.reshape(turned, (turned.shape[0] * turned.shape[1], *tail)), tail


def _shape_parameter(oversampling: float) -> float:
    """Beatty et al. 2005, equation 5."""
    return math.pi * math.sqrt(_WIDTH**2 / oversampling**2 * (oversampling - 0.5) ** 2 - 0.8)


def _kernel(distance: np.ndarray, oversampling: float) -> np.ndarray:
    """Kaiser-Bessel kernel at distances [samples]."""
    inside = np.clip(1 - (2 * distance / _WIDTH) ** 2, 0, None)
    return np.i0(_shape_parameter(oversampling) * np.sqrt(inside)) * (np.abs(distance) <= _WIDTH / 2) / _WIDTH


def _kernel_transform(position: np.ndarray, oversampling: float) -> np.ndarray:
    """Fourier transform of the kernel at positions [cycles per sample] below the shape parameter."""
    root = np.sqrt(_shape_parameter(oversampling) ** 2 - (np.pi * _WIDTH * position) ** 2)
    return np.sinh(root) / root


def _check_memory(views: LightField) -> None:
    itemsize = 16 if "64" in str(views.data.dtype) else 8
    size = (2.5 + 2 * _OVERSAMPLING) * math.prod(views.data.shape) * itemsize
    memory.require(
        size, "the spectrum of the light field", "Use refocus, which needs {factor:.0f}x less or fewer."
    )
