"""Angular spectrum onto a grid of any pitch, size and place: matrix DFT, or chirp-z where that is cheaper.

The frequencies are chosen for the two grids at hand instead of by an FFT: spaced closely enough that
nothing wraps round into the output, and only those whose rays join the two grids, up to the input's
Nyquist frequency. Far away few frequencies are left, and the sum is both quicker and more exact than
an FFT on a padded window.

R. Soummer et al., Opt. Express 15, 15935 (2007) (matrix DFT); L. Rabiner, R. Schafer and C. Rader,
IEEE Trans. Audio Electroacoust. 17, 86 (1969) (chirp-z).
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from lumigraph.core import arrays
from lumigraph.core.arrays import Array
from lumigraph.core.field import Field
from lumigraph.core.grid import Grid
from lumigraph.errors import SamplingError
from lumigraph.propagation.angular_spectrum import transfer_function
from lumigraph.propagation.cache import CACHE
from lumigraph.propagation.window import check_memory, smooth_size

MARGIN = 1.0
"""Rays are followed this fraction of the grids' joint width beyond it, so that the band's edge stays outside."""
GAIN = 8.0
"""One multiplication in a matrix product is this much quicker than one in an FFT (measured, two cores)."""


@dataclass(frozen=True, slots=True)
class Samples:
    """Evenly spaced positions or frequencies: first + step · k, k < n."""

    n: int
    first: float
    step: float

    @classmethod
    def axis(cls, grid: Grid, axis: int) -> "Samples":
        """Positions of a grid's rows (0) or columns (1)."""
        n, pitch = grid.shape[axis], grid.pitch[axis]
        return cls(n, grid.center[axis] - (n // 2) * pitch, pitch)

    @property
    def values(self) -> np.ndarray:
        """All of them (n,)."""
        return self.first + self.step * np.arange(self.n)

    @property
    def last(self) -> float:
        """The last one."""
        return self.first + self.step * (self.n - 1)


def zoom(field: Field, distance: float, pad: float, grid: Grid | None) -> Field:
    """Angular spectrum onto `grid`, of any pitch, size and place; `pad` has no use here.

    Raises
    ------
    SamplingError
        No grid is given, or the frequencies need more memory than there is.
    """
    if grid is None:
        raise SamplingError("zoom needs the output's grid: pass grid=Grid(shape, pitch, center).")
    fy, fx = (frequencies(field, grid, axis, distance) for axis in (0, 1))
    _check_memory(field, grid, fy, fx)
    data = _transform(field.data, Samples.axis(field.grid, 1), fx, -1)
    data = _swap(_transform(_swap(data), Samples.axis(field.grid, 0), fy, -1))
    dy, dx = field.grid.pitch
    scale = dy * dx * fy.step * fx.step

    def build() -> Array:
        H = transfer_function(fy.values, fx.values, distance, field.wavelength)
        return arrays.like(H * scale, field.data)

    key = ("zoom", fy, fx, distance, field.wavelength, scale, arrays.placement(field.data))
    data = data * CACHE.get(key, build)
    data = _swap(_transform(_swap(data), fy, Samples.axis(grid, 0), +1))
    return replace(field, data=_transform(data, fx, Samples.axis(grid, 1), +1), grid=grid)


def frequencies(field: Field, grid: Grid, axis: int, distance: float) -> Samples:
    """Frequencies of one axis that carry light from the field's grid to `grid` [1/m].

    A ray that moves by x over z has the frequency x/(λ sqrt(x² + z²)); the movements between the two
    grids, widened by `MARGIN` on both sides, give the range, and their width the spacing.
    """
    (low, high), (low_y, high_y) = (_movements(field.grid, grid, k) for k in (axis, 1 - axis))
    margin = MARGIN * (high - low) / 2 + math.sqrt(field.wavelength * abs(distance))
    low, high = low - margin, high + margin
    across = max(abs(low_y), abs(high_y))
    nyquist = 0.5 / field.grid.pitch[axis]
    ends = [_frequency(x, r, distance, field.wavelength) for x in (low, high) for r in (0.0, across)]
    start, stop = max(min(ends), -nyquist), min(max(ends), nyquist)
    if stop <= start:
        raise SamplingError(
            f"the output lies {max(abs(low), abs(high)):.4g} m off the input along {'yx'[axis]}, where a pitch of "
            f"{field.grid.pitch[axis]:.4g} m sends no light over {abs(distance):.4g} m. "
            "Use a finer input pitch, or move grid nearer."
        )
    count = max(2, math.ceil((stop - start) * (high - low)))
    step = (stop - start) / count
    return Samples(count, start + step / 2, step)


def _movements(grid: Grid, output: Grid, axis: int) -> tuple[float, float]:
    """Smallest and largest way from an input to an output sample along one axis [m]."""
    a, b = Samples.axis(grid, axis), Samples.axis(output, axis)
    return b.first - a.last, b.last - a.first


def _frequency(x: float, across: float, distance: float, wavelength: float) -> float:
    sign = 1.0 if distance >= 0 else -1.0
    return sign * x / (wavelength * math.hypot(x, across, distance))


def _transform(data: Array, source: Samples, target: Samples, sign: int) -> Array:
    """Sum over the last axis of data · exp(sign · i2π source · target): matrix product or chirp-z."""
    size = smooth_size(source.n + target.n - 1)
    chirp_cost = size * 2 * math.log2(size) + source.n + size + target.n
    if source.n * target.n <= GAIN * chirp_cost:
        return data @ _fourier_matrix(data, source, target, sign)
    return _chirp_z(data, source, target, sign)


def _fourier_matrix(data: Array, source: Samples, target: Samples, sign: int) -> Array:
    def build() -> Array:
        turns = np.outer(source.values, target.values) % 1.0
        return arrays.like(np.exp(sign * 2j * math.pi * turns), data)

    return CACHE.get(("matrix", source, target, sign, arrays.placement(data)), build)


def _chirp_z(data: Array, source: Samples, target: Samples, sign: int) -> Array:
    """Bluestein's convolution: jk = (j² + k² - (k - j)²)/2."""
    rate = source.step * target.step  # turns per j · k
    j, k = np.arange(source.n), np.arange(target.n)
    size = smooth_size(source.n + target.n - 1)
    lags = np.zeros(size)
    lags[: target.n] = k
    lags[size - source.n + 1 :] = np.arange(-source.n + 1, 0)
    turn = sign * 2j * math.pi
    kernel = np.fft.fft(np.exp(-turn * (rate / 2 * lags**2 % 1.0)))
    before = np.exp(turn * ((rate / 2 * j**2 + source.step * j * target.first) % 1.0))
    after = np.exp(turn * ((rate / 2 * k**2 + source.first * target.values) % 1.0))
    spectrum = arrays.fft(data * arrays.like(before, data), size) * arrays.like(kernel, data)
    return arrays.ifft(spectrum, overwrite=True)[..., : target.n] * arrays.like(after, data)


def _swap(data: Array) -> Array:
    return arrays.namespace(data).matrix_transpose(data)


def _check_memory(field: Field, grid: Grid, fy: Samples, fx: Samples) -> None:
    item = 8 if arrays.is_single(field.data) else 16
    planes = math.prod(field.data.shape[:-2])
    tall = max(field.grid.shape[0], fy.n, grid.shape[0])
    wide = max(field.grid.shape[1], fx.n, grid.shape[1])
    nbytes = 4 * planes * item * tall * wide + 40 * fy.n * fx.n
    check_memory(nbytes, f"zoom with {fy.n} x {fx.n} frequencies")
