"""Array libraries: the only file that knows more than NumPy.

Array type in = array type out: NumPy, PyTorch (CPU or CUDA), CuPy and anything else that follows the
array API standard, through array-api-compat. Geometry (coordinates, frequencies, phases) is always
computed by NumPy in float64 and cast last, by `like`.
"""

import os
import weakref
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

import numpy as np
import scipy  # its submodules load when they are first used
from array_api_compat import array_namespace, device, is_numpy_array, is_torch_array

Array = Any
"""An array of any library that follows the array API standard."""

if TYPE_CHECKING:
    import typing_extensions
    from numpy.typing import DTypeLike

    class _Indexed(Protocol):
        @property
        def shape(self) -> Any: ...

        @property
        def dtype(self) -> Any: ...

        @property
        def ndim(self) -> int: ...

        def __getitem__(self, key: Any, /) -> Any: ...

    A = typing_extensions.TypeVar("A", bound=_Indexed, default=Any)
else:
    A = TypeVar("A")
"""The type of an array, kept from what goes in to what comes out."""

WORKERS = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else (os.cpu_count() or 1)
"""Threads that one FFT may use: the processors this process may run on."""

PART = 2**15
"""Values that are treated at a time, one operation after the other: they stay in a processor's own cache."""

_HELD: dict[tuple, Array] = {}
"""Copies that `held` has made on other devices."""

_SINGLE = ("float32", "complex64", "float16")


def namespace(*arrays: Array) -> Any:
    """Array API namespace that the arrays share."""
    return array_namespace(*arrays)


def to_numpy(array: Array) -> np.ndarray:
    """The array on the CPU as NumPy; shares memory where it can."""
    if is_numpy_array(array):
        return array
    if is_torch_array(array):
        return array.detach().cpu().resolve_conj().resolve_neg().numpy()
    if hasattr(array, "get"):  # CuPy
        return array.get()
    return np.asarray(array)


def as_numpy(array: Array, dtype: "DTypeLike | None" = None, copy: bool | None = None) -> np.ndarray:
    """The array on the CPU as `numpy.asarray` gives it: a copy always, never (false) or where needed (None).

    Raises
    ------
    ValueError
        `copy` is false but the type asks for one, or the array stands on a GPU.
    """
    if copy is False and not is_here(array):
        raise ValueError(f"an array on {device(array)} needs a copy. Leave copy=False out.")
    return np.array(to_numpy(array), dtype=dtype, copy=copy)


def is_numpy(array: Array) -> bool:
    """True for a NumPy array."""
    return is_numpy_array(array)


def is_single(array: Array) -> bool:
    """True for single precision: float32 or complex64."""
    # NumPy's name leaves out the byte order, which str() has: '>f4'.
    return (array.dtype.name if is_numpy_array(array) else str(array.dtype).rsplit(".", 1)[-1]) in _SINGLE


def is_complex(array: Array) -> bool:
    """True for complex numbers."""
    return bool(namespace(array).isdtype(array.dtype, "complex floating"))


def placement(array: Array) -> tuple[str, str, str]:
    """Hashable (library, dtype, device) of an array: the part of a cache key that depends on it."""
    return namespace(array).__name__, str(array.dtype), str(device(array))


def like(values: np.ndarray, array: Array) -> Array:
    """`values`, computed by NumPy in double precision, as `array`'s library, device and precision.

    Real values become float32 or float64, complex ones complex64 or complex128, after the precision
    of `array`; whether `array` itself is real or complex does not matter.
    """
    single = is_single(array)
    if np.iscomplexobj(values):
        values = values.astype(np.complex64 if single else np.complex128, copy=False)
    else:
        values = values.astype(np.float32 if single else np.float64, copy=False)
    if is_numpy_array(array):
        return values
    # PyTorch warns of arrays that cannot be written to, as those mapped from files.
    values = np.require(values, requirements=("C", "W"))
    return namespace(array).asarray(values, device=device(array))


def is_here(array: Array) -> bool:
    """True for an array in the processor's memory."""
    return is_numpy_array(array) or "cpu" in str(device(array)).lower()


def held(values: np.ndarray, array: Array, *chosen: int | slice) -> Array:
    """`like` of ``values[*chosen, ...]``, for values that never change and are used again.

    Another device than the processor is sent all of the values once, and keeps them for as long as they live.
    """
    if is_here(array):
        return like(values[*chosen, ...], array)
    key = id(values), *placement(array)
    if key not in _HELD:
        _HELD[key] = like(values, array)
        weakref.finalize(values, _HELD.pop, key, None)
    return _HELD[key][*chosen, ...]


def is_parameter(value: Any) -> bool:
    """True for a 0-d array of a library other than NumPy, such as a PyTorch scalar."""
    return getattr(value, "shape", None) == () and not is_numpy_array(value) and not np.isscalar(value)


def number(value: Any) -> float:
    """A number or a 0-d array as a float, cut off from derivatives."""
    return float(to_numpy(value) if is_parameter(value) else value)


def parameter(value: Array) -> Array:
    """A 0-d array in double precision, through which derivatives go."""
    return namespace(value).astype(value, namespace(value).float64)


def turned(values: Array, coefficient: np.ndarray, amount: Array) -> Array:
    """Complex `values` times exp(i coefficient amount).

    `amount` is a 0-d array that is zero and has a derivative: `values` come from NumPy in double precision,
    as they do without derivatives, and this factor lets those of a parameter through.
    """
    xp, factor = namespace(values), like(coefficient, values)
    real = xp.float32 if is_single(values) else xp.float64
    amount = xp.astype(amount, real if not np.iscomplexobj(coefficient) else values.dtype)
    return values * xp.exp(1j * as_complex(factor * amount))


def framed(array: Array, before: tuple[int, int], shape: tuple[int, int]) -> Array:
    """Zeros (..., *shape) that hold the array (..., y, x), whose first sample stands at `before`."""
    result = namespace(array).zeros((*array.shape[:-2], *shape), dtype=array.dtype, device=device(array))
    y, x = (slice(first, first + n) for first, n in zip(before, array.shape[-2:], strict=True))
    result[..., y, x] = array
    return result


def tiled(plane: Array, tile: tuple[int, int]) -> Array:
    """Tiles (..., rows, columns, ky, kx) of ky x kx samples each, of a plane (..., rows ky, columns kx)."""
    xp, (*batch, height, width), (ky, kx) = namespace(plane), plane.shape, tile
    k = len(batch)
    tiles = xp.reshape(plane, (*batch, height // ky, ky, width // kx, kx))
    return xp.permute_dims(tiles, (*range(k), k, k + 2, k + 1, k + 3))


def untiled(tiles: Array) -> Array:
    """The plane (..., rows ky, columns kx) of tiles (..., rows, columns, ky, kx): undoes `tiled`."""
    xp, (*batch, rows, columns, ky, kx) = namespace(tiles), tiles.shape
    k = len(batch)
    plane = xp.permute_dims(tiles, (*range(k), k, k + 2, k + 1, k + 3))
    return xp.reshape(plane, (*batch, rows * ky, columns * kx))


def by_part(function: Callable[..., Array], first: Array, *others: Array) -> Array:
    """``function(first, *others)`` of one value at a time, for arrays of one shape.

    NumPy's go part by part: what lies between stays in the processor's cache, and is no new memory.
    """
    if not is_numpy_array(first):
        return function(first, *others)
    result = np.empty_like(first)
    for part, *given in _parts(result, first, *others):
        part[...] = function(*given)
    return result


def sum_by_part(function: Callable[..., Array], first: Array, *others: Array) -> float:
    """Sum of ``function(first, *others)`` over all values; see `by_part`."""
    if not is_numpy_array(first):
        return float(namespace(first).sum(function(first, *others)))
    return float(sum(np.sum(function(*given), dtype=np.float64) for given in _parts(first, *others)))


def _parts(*whole: np.ndarray) -> Iterator[tuple[np.ndarray, ...]]:
    """Parts of arrays of one shape, of `PART` values where they are contiguous, else of a row or plane."""
    if whole[0].ndim < 2 or all(one.flags.c_contiguous for one in whole):
        whole = tuple(one.reshape(-1) for one in whole)
        for start in range(0, whole[0].size, PART):
            yield tuple(one[start : start + PART] for one in whole)
    else:
        yield from zip(*whole, strict=True)


def as_complex(array: Array) -> Array:
    """The array as complex numbers of its own precision; a complex array is returned as it is."""
    if is_complex(array):
        return array
    xp = namespace(array)
    return xp.astype(array, xp.complex64 if is_single(array) else xp.complex128)


def intensity(array: Array) -> Array:
    """Squared modulus, real, of the array's own precision."""
    if is_numpy_array(array):
        result = np.square(np.real(array))
        result += np.square(np.imag(array))
        return result
    xp = namespace(array)
    return xp.real(array) ** 2 + xp.imag(array) ** 2


def fft(array: Array, n: int | None = None, axis: int = -1, *, overwrite: bool = False) -> Array:
    """1-D DFT along one axis, zero-padded or cropped to `n`; `overwrite` may reuse the input's memory."""
    if is_numpy_array(array):
        return scipy.fft.fft(array, n, axis=axis, overwrite_x=overwrite, workers=WORKERS)
    return namespace(array).fft.fft(array, n=n, axis=axis)


def ifft(array: Array, n: int | None = None, axis: int = -1, *, overwrite: bool = False) -> Array:
    """1-D inverse DFT along one axis; see `fft`."""
    if is_numpy_array(array):
        return scipy.fft.ifft(array, n, axis=axis, overwrite_x=overwrite, workers=WORKERS)
    return namespace(array).fft.ifft(array, n=n, axis=axis)


def rfft(array: Array, n: int, axis: int = -1) -> Array:
    """1-D DFT of a real array along one axis, zero-padded to `n`: n // 2 + 1 frequencies."""
    if is_numpy_array(array):
        return scipy.fft.rfft(array, n, axis=axis, workers=WORKERS)
    return namespace(array).fft.rfft(array, n=n, axis=axis)


def irfft(array: Array, n: int, axis: int = -1) -> Array:
    """The real array, `n` along one axis, whose `rfft` this is."""
    if is_numpy_array(array):
        return scipy.fft.irfft(array, n, axis=axis, workers=WORKERS)
    return namespace(array).fft.irfft(array, n=n, axis=axis)


def fft2(array: Array, *, overwrite: bool = False) -> Array:
    """2-D DFT of the last two axes."""
    if is_numpy_array(array):
        return scipy.fft.fft2(array, overwrite_x=overwrite, workers=WORKERS)
    return namespace(array).fft.fftn(array, axes=(-2, -1))


def ifft2(array: Array, *, overwrite: bool = False) -> Array:
    """2-D inverse DFT of the last two axes."""
    if is_numpy_array(array):
        return scipy.fft.ifft2(array, overwrite_x=overwrite, workers=WORKERS)
    return namespace(array).fft.ifftn(array, axes=(-2, -1))


def rfft2(array: Array, shape: tuple[int, int], axes: tuple[int, int] = (-2, -1)) -> Array:
    """2-D DFT of two axes of a real array, zero-padded to `shape`: (ny, nx // 2 + 1) along them."""
    if is_numpy_array(array):
        return scipy.fft.rfft2(array, shape, axes=axes, workers=WORKERS)
    return namespace(array).fft.rfftn(array, s=shape, axes=axes)


def irfft2(array: Array, shape: tuple[int, int], axes: tuple[int, int] = (-2, -1)) -> Array:
    """The real array, `shape` along two axes, whose `rfft2` this is."""
    if is_numpy_array(array):
        return scipy.fft.irfft2(array, shape, axes=axes, workers=WORKERS)
    return namespace(array).fft.irfftn(array, s=shape, axes=axes)
