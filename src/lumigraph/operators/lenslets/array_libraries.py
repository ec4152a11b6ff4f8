"""Array functions that the image of a point is computed with: the same lines for several libraries.

NumPy runs them as they are, autograd with their derivatives. Windows of an array and sums of overlapping
parts are each other's transpose: they alone have their derivatives by hand, since slices are slow in
autograd.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import Any, Protocol

import numpy as np

Array = Any
Numbers = Mapping[Any, Array]
"""What light follows from, by name."""


class ArrayLibrary(Protocol):
    """Functions of arrays."""

    def asarray(self, x: np.ndarray, /) -> Array:
        """Array of plain numbers."""
        ...

    def exp(self, x: Array, /) -> Array:
        """Exponential function."""
        ...

    def real(self, x: Array, /) -> Array:
        """Real part."""
        ...

    def imag(self, x: Array, /) -> Array:
        """Imaginary part."""
        ...

    def stack(self, parts: Sequence[Array], /) -> Array:
        """Arrays along a new first axis."""
        ...

    def concatenate(self, parts: Sequence[Array], axis: int, /) -> Array:
        """Arrays one after the other."""
        ...

    def sum(self, x: Array, axis: int, /) -> Array:
        """Sum along an axis."""
        ...

    def moveaxis(self, x: Array, source: int, goal: int, /) -> Array:
        """Array with an axis in another place."""
        ...

    def part(self, x: Array, start: int, stop: int, axis: int, /) -> Array:
        """Part of an array along an axis, from a start to before a stop."""
        ...

    def windows(self, x: Array, starts: Sequence[int], size: int, axis: int, /) -> Array:
        """Parts (n, ...) of an array along an axis, from each start on; zero beyond its ends."""
        ...

    def overlap_add(self, parts: Array, starts: Sequence[int], count: int, axis: int, /) -> Array:
        """Sum of parts (n, ...), each from its start on along an axis of `count` samples; cut at its ends."""
        ...


def part(x: np.ndarray, start: int, stop: int, axis: int) -> np.ndarray:
    """Part of an array along an axis; see `ArrayLibrary`."""
    return x[(slice(None),) * (axis % x.ndim) + (slice(start, stop),)]


def _placed(x: np.ndarray, start: int, count: int, axis: int) -> np.ndarray:
    """Array between zeros along an axis of `count` samples: the transpose of `part`."""
    shape = list(x.shape)
    shape[axis] = count
    found = np.zeros(shape, x.dtype)
    found[(slice(None),) * (axis % x.ndim) + (slice(start, start + x.shape[axis]),)] = x
    return found


def windows(x: np.ndarray, starts: Sequence[int], size: int, axis: int) -> np.ndarray:
    """Parts (n, ...) of an array; see `ArrayLibrary`."""
    lines = np.moveaxis(x, axis, -1)
    found = np.zeros((len(starts), *lines.shape[:-1], size), x.dtype)
    for part, (there, inside) in zip(found, _overlaps(starts, size, lines.shape[-1]), strict=True):
        part[..., inside] = lines[..., there]
    return np.moveaxis(found, -1, axis + 1 if axis >= 0 else axis)


def overlap_add(parts: np.ndarray, starts: Sequence[int], count: int, axis: int) -> np.ndarray:
    """Sum of parts (n, ...); see `ArrayLibrary`."""
    lines = np.moveaxis(parts, axis + 1 if axis >= 0 else axis, -1)
    found = np.zeros((*lines.shape[1:-1], count), parts.dtype)
    for part, (there, inside) in zip(lines, _overlaps(starts, lines.shape[-1], count), strict=True):
        found[..., there] += part[..., inside]
    return np.moveaxis(found, -1, axis)


def _overlaps(starts: Sequence[int], size: int, count: int) -> list[tuple[slice, slice]]:
    """Slices into `count` samples, and into each part of a size, where the two overlap."""
    found = []
    for start in starts:
        low, high = max(0, start), max(0, min(count, start + size))
        high = max(low, high)
        found.append((slice(low, high), slice(low - start, high - start)))
    return found


class NumPy:
    """NumPy's functions."""

    asarray = staticmethod(np.asarray)
    exp = staticmethod(np.exp)
    real = staticmethod(np.real)
    imag = staticmethod(np.imag)
    stack = staticmethod(np.stack)
    concatenate = staticmethod(np.concatenate)
    sum = staticmethod(np.sum)
    moveaxis = staticmethod(np.moveaxis)
    part = staticmethod(part)
    windows = staticmethod(windows)
    overlap_add = staticmethod(overlap_add)


NUMPY = NumPy()


class _Differentiable:
    """Autograd's functions."""

    def __init__(self) -> None:
        import autograd.numpy as anp
        from autograd.extend import defjvp, defvjp, primitive

        self.asarray, self.exp, self.real, self.imag = np.asarray, anp.exp, anp.real, anp.imag
        self.stack, self.concatenate, self.sum = anp.stack, anp.concatenate, anp.sum
        self.moveaxis = anp.moveaxis
        self.windows, self.overlap_add = primitive(windows), primitive(overlap_add)
        self.part, self._placed = primitive(part), primitive(_placed)
        defvjp(self.part, self._of_part)
        defjvp(self.part, "same")
        defvjp(self.windows, self._of_windows)
        defvjp(self.overlap_add, self._of_parts)
        defjvp(self.windows, "same")
        defjvp(self.overlap_add, "same")

    def _of_part(self, found: Array, x: Array, start: int, stop: int, axis: int) -> Any:
        count = x.shape[axis]
        return lambda by: self._placed(by, start, count, axis)

    def _of_windows(self, found: Array, x: Array, starts: Sequence[int], size: int, axis: int) -> Any:
        count = x.shape[axis]
        return lambda by: self.overlap_add(by, starts, count, axis)

    def _of_parts(self, found: Array, parts: Array, starts: Sequence[int], count: int, axis: int) -> Any:
        size = parts.shape[axis + 1 if axis >= 0 else axis]
        return lambda by: self.windows(by, starts, size, axis)


@cache
def differentiable() -> ArrayLibrary:
    """Autograd's functions, imported when they are first asked for."""
    return _Differentiable()


def slopes(function: Callable[[Numbers], Array], numbers: dict[Any, Array]) -> dict[Any, np.ndarray]:
    """Derivatives of a real number by all that it is computed from; of complex ones, conjugated.

    A number changes by Re Σ slope · change.
    """
    from autograd import make_vjp

    names = list(numbers)
    back, _ = make_vjp(lambda values: function(dict(zip(names, values, strict=True))))(
        [numbers[name] for name in names]
    )
    return dict(zip(names, back(1.0), strict=True))


def tangent(
    function: Callable[[Numbers], Sequence[Array]], numbers: dict[Any, Array], changes: Mapping[Any, Array]
) -> tuple[Sequence[np.ndarray], Sequence[np.ndarray]]:
    """Values of what is computed from numbers, and their change to first order as these change."""
    from autograd import make_jvp
    from autograd.builtins import tuple as together

    names = list(numbers)
    given = [numbers[name] for name in names]
    return make_jvp(lambda values: together(tuple(function(dict(zip(names, values, strict=True))))))(given)(
        [changes[name] for name in names]
    )
