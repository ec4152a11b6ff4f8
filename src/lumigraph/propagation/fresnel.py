"""Fresnel diffraction in one step, onto its own or a given grid.

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
from lumigraph.propagation.window import check_memory


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


def _onto_own_grid(field: Field, distance: float, output: Grid) -> Field:
    sampling.warn(sampling.one_step_aliases(field.grid, distance, field.wavelength))
    item = 8 if arrays.is_single(field.data) else 16
    check_memory(3 * item * math.prod(field.data.shape), f"fresnel on {field.grid.shape} samples")
    area = abs(distance) * field.wavelength
    data = conjugate_if(distance < 0, field.data)
    for axis in (-2, -1):
        n, p = field.grid.shape[axis], field.grid.pitch[axis]
        j = np.arange(n) - n // 2
        before = np.exp(1j * math.pi * (j * p) ** 2 / area)
        after = np.exp(1j * math.pi * (j * output.pitch[axis]) ** 2 / area) * p / np.sqrt(1j * area)
        # exp(-i2π jk/N) about sample n//2 of both sides
        turn = np.exp(2j * math.pi * ((n // 2) * np.arange(n) % n) / n)
        centre = np.exp(2j * math.pi * ((n // 2) * j % n) / n)
        data = arrays.fft(data * along(before * turn, data, axis), axis=axis, overwrite=True)
        data = data * along(after * centre, data, axis)
    data = data * carrier(abs(distance), field.wavelength)
    return replace(field, data=conjugate_if(distance < 0, data), grid=output)


def _onto_grid(field: Field, distance: float, output: Grid) -> Field:
    _check_points(field, distance, output)
    area = abs(distance) * field.wavelength
    axes = ((output.y, field.grid.y), (output.x, field.grid.x))
    kernel, product = (_halves, both) if arrays.is_numpy(field.data) else (_matrix, _product)
    rows, columns = (kernel(field, pair, p, area) for pair, p in zip(axes, field.grid.pitch, strict=True))
    data = product(rows, conjugate_if(distance < 0, field.data), columns)
    data = data * carrier(abs(distance), field.wavelength)
    return replace(field, data=conjugate_if(distance < 0, data), grid=output)


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
    turn = carrier(abs(here), field.wavelength)
    data = data * (turn if here > 0 else turn.conjugate())
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


def carrier(distance: float, wavelength: float) -> complex:
    """Factor exp(ikz) of a distance [m], reduced to one turn before the exponential."""
    angle = 2 * math.pi * math.fmod(distance / wavelength, 1.0)
    return complex(math.cos(angle), math.sin(angle))


def along(values: np.ndarray, data: Array, axis: int) -> Array:
    """Factor (n,) of one axis, -2 or -1, as data's kind of array and ready to multiply it."""
    return arrays.like(values[:, None] if axis == -2 else values, data)


def conjugate_if(condition: bool, data: Array) -> Array:
    """Complex conjugate of the data where the condition holds, else the data."""
    return arrays.namespace(data).conj(data) if condition else data
