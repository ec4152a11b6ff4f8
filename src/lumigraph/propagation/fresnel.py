"""Fresnel diffraction: one step onto its own or a given grid, and many steps that keep the pitch.

One step is the paraxial integral

    U(x2) = exp(ikz)/(iλz) ∫ U(x1) exp(iπ(x2 - x1)²/(λz)) dx1

with the input samples taken as points; without `grid` it is a single FFT, whose output pitch λz/(N p)
follows from the distance. Going back, z < 0, is the complex conjugate of going forth.

J. W. Goodman, *Introduction to Fourier Optics*, section 4.2; the thesis' section 2.3.
"""

import math
from dataclasses import replace

import numpy as np

from lumigraph.core import arrays
from lumigraph.core.arrays import Array
from lumigraph.core.field import Field
from lumigraph.core.grid import Grid
from lumigraph.errors import SamplingError
from lumigraph.propagation import sampling
from lumigraph.propagation.cache import CACHE
from lumigraph.propagation.halves import Halves, both
from lumigraph.propagation.window import check_memory, reach, window_shape

MOST_STEPS = 10_000
"""Multi-step Fresnel refuses more steps than this."""


def fresnel(field: Field, distance: float | Array, pad: float, grid: Grid | None) -> Field:
    """One step: a single FFT onto its own pitch λ|z|/(N p), or a matrix DFT onto `grid`.

    `pad` has no use here: nothing wraps round, and a finer output is what `grid` is for. The matrix
    DFT is exact for input samples that are points, in the paraxial approximation; on NumPy arrays it goes by
    halves (`propagation.halves`), in half the time.
    """
    if arrays.is_parameter(distance) and grid is not None:
        return _differentiable(field, distance, grid)
    distance = arrays.number(distance)
    if distance == 0:
        raise SamplingError(
            "fresnel cannot propagate over 0 m: its output pitch would be 0 m. Use another method."
        )
    step = _onto_grid if grid is not None else _onto_own_grid
    return step(field, distance, grid or one_step_grid(field.grid, distance, field.wavelength))


def one_step_grid(grid: Grid, distance: float, wavelength: float) -> Grid:
    """Output grid of one-step `fresnel`: as many samples, pitch λ|z|/(N p), the same centre."""
    pitch = [wavelength * abs(distance) / size for size in grid.size]
    return Grid(grid.shape, (pitch[0], pitch[1]), grid.center)


def multi_step_fresnel(field: Field, distance: float, pad: float, grid: Grid | None) -> Field:
    r"""Steps of dz = W²/(Nλ), each of which keeps the pitch (the thesis' 2.3.1), the rest by its spectrum.

    Each step is one FFT between two chirps exp(iπj²/N). The distance need not be a multiple of dz: what
    is left, less than one step, is multiplied by exp(-iπλzf²), which such a short way samples without
    aliasing. The axes are independent, so that a window may be oblong. The window has an even number of
    samples, because only then a chirp of N samples is periodic; on it the result equals the unpadded
    paraxial angular spectrum to rounding.
    """
    output = grid or field.grid
    first = output.samples_to(field.grid)
    window = Grid(window_shape(field.grid, output, pad, first, (2, 2)), field.grid.pitch)
    _check_steps(field, window, distance, (first, output))
    steps = sampling.fresnel_step(window, field.wavelength)
    data = _conjugate_if(distance < 0, field.data)
    for axis, n, step, offset, n_out in zip((-2, -1), window.shape, steps, first, output.shape, strict=True):
        data = _steps_along(data, axis, n, abs(distance) / step)
        data = arrays.namespace(data).roll(data, -offset, axis=axis)
        data = data[..., :n_out, :] if axis == -2 else data[..., :n_out]
    data = data * _carrier(abs(distance), field.wavelength)
    return replace(field, data=_conjugate_if(distance < 0, data), grid=output)


def _check_steps(field: Field, window: Grid, distance: float, target: tuple[tuple[int, int], Grid]) -> None:
    shortest = min(sampling.fresnel_step(window, field.wavelength))
    if abs(distance) > MOST_STEPS * shortest:
        raise SamplingError(
            f"multi_step_fresnel over {abs(distance):.4g} m takes {abs(distance) / shortest:.0f} steps of "
            f"{shortest:.4g} m, more than {MOST_STEPS}. Use method='band_limited', or a coarser pitch."
        )
    item = 8 if arrays.is_single(field.data) else 16
    samples = math.prod(field.data.shape[:-2]) * math.prod(window.shape)
    check_memory(3 * item * samples, f"multi_step_fresnel on {window.shape[0]} x {window.shape[1]} samples")
    farthest = tuple(map(reach, field.grid.shape, target[0], target[1].shape))
    wave = (distance, field.wavelength)
    sampling.warn(
        sampling.unlimited_aliases("multi_step_fresnel", window, *wave)
        or sampling.light_wraps(window, (math.inf, math.inf), (farthest[0], farthest[1]), *wave)
    )


def _steps_along(data: Array, axis: int, n: int, steps: float) -> Array:
    """Carry data over `steps` times dz along one axis, on a periodic window of `n` samples (even)."""
    whole = math.floor(steps + 1e-9)
    rest = max(steps - whole, 0.0)
    j = np.arange(n)
    chirp = np.exp(1j * math.pi * (j * j % (2 * n)) / n)
    factor = np.exp(-0.25j * math.pi) / math.sqrt(n)
    data = _padded(data, axis, n)
    for index in range(whole):
        data = data * _vector(chirp if index == 0 else factor * chirp * chirp, data, axis)
        data = arrays.fft(data, axis=axis, overwrite=True)
    if whole:
        data = data * _vector(factor * chirp, data, axis)
    if rest > 0:  # λ dz f² = N p² (k/(N p))² = k²/N
        frequency = np.fft.fftfreq(n, 1 / n)
        transfer = np.exp(-1j * math.pi * (rest * frequency**2 / n % 2))
        data = arrays.fft(data, axis=axis) * _vector(transfer, data, axis)
        data = arrays.ifft(data, axis=axis, overwrite=True)
    return data


def _padded(data: Array, axis: int, n: int) -> Array:
    """Zeros behind the samples of one axis, up to `n` of them."""
    missing = n - data.shape[axis]
    if missing == 0:
        return data
    xp = arrays.namespace(data)
    one = data[..., :1, :] if axis == -2 else data[..., :1]
    shape = list(data.shape)
    shape[axis] = missing
    return xp.concat([data, xp.broadcast_to(xp.zeros_like(one), tuple(shape))], axis=axis)


def _onto_own_grid(field: Field, distance: float, output: Grid) -> Field:
    sampling.warn(sampling.one_step_aliases(field.grid, distance, field.wavelength))
    item = 8 if arrays.is_single(field.data) else 16
    check_memory(3 * item * math.prod(field.data.shape), f"fresnel on {field.grid.shape} samples")
    area = abs(distance) * field.wavelength
    data = _conjugate_if(distance < 0, field.data)
    for axis in (-2, -1):
        n, p = field.grid.shape[axis], field.grid.pitch[axis]
        j = np.arange(n) - n // 2
        before = np.exp(1j * math.pi * (j * p) ** 2 / area)
        after = np.exp(1j * math.pi * (j * output.pitch[axis]) ** 2 / area) * p / np.sqrt(1j * area)
        # exp(-i2π jk/N) about sample n//2 of both sides
        turn = np.exp(2j * math.pi * ((n // 2) * np.arange(n) % n) / n)
        centre = np.exp(2j * math.pi * ((n // 2) * j % n) / n)
        data = arrays.fft(data * _vector(before * turn, data, axis), axis=axis, overwrite=True)
        data = data * _vector(after * centre, data, axis)
    data = data * _carrier(abs(distance), field.wavelength)
    return replace(field, data=_conjugate_if(distance < 0, data), grid=output)


def _onto_grid(field: Field, distance: float, output: Grid) -> Field:
    _check_points(field, distance, output)
    area = abs(distance) * field.wavelength
    axes = ((output.y, field.grid.y), (output.x, field.grid.x))
    kernel, product = (_halves, both) if arrays.is_numpy(field.data) else (_matrix, _product)
    rows, columns = (kernel(field, pair, p, area) for pair, p in zip(axes, field.grid.pitch, strict=True))
    data = product(rows, _conjugate_if(distance < 0, field.data), columns)
    data = data * _carrier(abs(distance), field.wavelength)
    return replace(field, data=_conjugate_if(distance < 0, data), grid=output)


def _differentiable(field: Field, distance: Array, output: Grid) -> Field:
    """`_onto_grid`, with derivatives after the distance: of both matrices, and of the carrier."""
    way = arrays.parameter(distance)
    here, xp = arrays.number(distance), arrays.namespace(field.data)
    _check_points(field, here, output)
    area, nearer = abs(here) * field.wavelength, 1 / way - 1 / here
    data, matrices = field.data, []
    for axes, pitch in (
        ((output.y, field.grid.y), field.grid.pitch[0]),
        ((output.x, field.grid.x), field.grid.pitch[1]),
    ):
        matrix = _matrix(field, axes, pitch, area)
        squares = (axes[0][:, None] - axes[1]) ** 2
        bent = arrays.turned(
            matrix if here > 0 else xp.conj(matrix), math.pi / field.wavelength * squares, nearer
        )
        matrices.append(bent * xp.astype(xp.sqrt(here / way), xp.real(data).dtype))
    data = _product(matrices[0], data, matrices[1])
    carrier = _carrier(abs(here), field.wavelength)
    data = data * (carrier if here > 0 else carrier.conjugate())
    whole = np.array(2 * math.pi / field.wavelength)
    return replace(field, data=arrays.turned(data, whole, way - here), grid=output)


def _matrix(field: Field, axes: tuple[np.ndarray, np.ndarray], pitch: float, area: float) -> Array:
    """Paraxial kernel of one axis (output, input): exp(iπ(x2 - x1)²/(λz)) p/sqrt(iλz)."""

    def build() -> Array:
        squares = (axes[0][:, None] - axes[1]) ** 2
        return arrays.like(
            np.exp(1j * math.pi * (squares / area % 2)) * pitch / np.sqrt(1j * area), field.data
        )

    return CACHE.get(("points", _spans(axes), pitch, area, arrays.placement(field.data)), build)


def _halves(field: Field, axes: tuple[np.ndarray, np.ndarray], pitch: float, area: float) -> Halves:
    """The same, in even and odd halves."""
    key = ("halves", _spans(axes), pitch, area, arrays.placement(field.data))
    return CACHE.get(key, lambda: Halves.of(axes, pitch, area, field.data))


def _spans(axes: tuple[np.ndarray, np.ndarray]) -> tuple[tuple[int, float, float], ...]:
    return tuple((len(axis), float(axis[0]), float(axis[-1])) for axis in axes)


def _product(rows: Array, data: Array, columns: Array) -> Array:
    """The product rows · data · columnsᵀ, in the cheaper order."""
    xp = arrays.namespace(data)
    (my, ny), (mx, nx) = rows.shape, columns.shape
    turned = xp.matrix_transpose(columns)
    if my * ny * nx + my * nx * mx <= ny * nx * mx + my * ny * mx:
        return (rows @ data) @ turned
    return rows @ (data @ turned)


def _check_points(field: Field, distance: float, output: Grid) -> None:
    item = 8 if arrays.is_single(field.data) else 16
    planes = math.prod(field.data.shape[:-2])
    (ny, nx), (my, mx) = field.grid.shape, output.shape
    samples = planes * (my * mx + max(my * nx, ny * mx)) + 4 * (my * ny + mx * nx)
    check_memory(item * samples, f"fresnel from {ny} x {nx} onto {my} x {mx} samples")
    for axis, n in enumerate(field.grid.shape):
        if n == 1:
            continue  # a single point has no neighbour to interfere with
        farthest = abs(output.center[axis] - field.grid.center[axis])
        farthest += sum(grid.size[axis] - grid.pitch[axis] for grid in (output, field.grid)) / 2
        message = sampling.points_alias(field.grid.pitch[axis], farthest, distance, field.wavelength)
        if message:
            sampling.warn(message)
            return


def _carrier(distance: float, wavelength: float) -> complex:
    """exp(ikz), reduced to one turn before the exponential."""
    angle = 2 * math.pi * math.fmod(distance / wavelength, 1.0)
    return complex(math.cos(angle), math.sin(angle))


def _vector(values: np.ndarray, data: Array, axis: int) -> Array:
    """A 1-D factor of one axis, as data's kind of array."""
    return arrays.like(values[:, None] if axis == -2 else values, data)


def _conjugate_if(condition: bool, data: Array) -> Array:
    return arrays.namespace(data).conj(data) if condition else data
