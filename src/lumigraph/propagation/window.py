"""The window a calculation runs on: large enough, a quick size to transform, and within memory."""

import math
from typing import Any

import scipy

from lumigraph.core import memory
from lumigraph.core.grid import Grid
from lumigraph.errors import SamplingError

FARTHEST = 16
"""An aligned output may lie this many times (input + output window) off before it is refused, and
as far as a window of `LARGEST_EMPTY` samples reaches in any case."""
LARGEST_EMPTY = 20_000


def smooth_size(n: int, multiple: int = 1) -> int:
    """Smallest quick FFT size from `n` upwards that `multiple` divides, away from large powers of two.

    Sizes are products of primes up to 11. A multiple of 512 is passed over where another size within
    3 % exists, because rows a power of two apart share cache lines: 2000² takes 1.3 to 1.7 times less
    than 2048².

    Examples
    --------
    >>> smooth_size(1999), smooth_size(2048), smooth_size(4001)
    (2000, 2058, 4032)
    """
    first = size = _next_fast(n, multiple)
    while size % 512 == 0 and size <= 1.03 * n:
        size = _next_fast(size + 1, multiple)
    return size if size <= 1.03 * n else first


def _next_fast(n: int, multiple: int) -> int:
    size: Any = scipy.fft.next_fast_len(-(-n // multiple))
    return multiple * size


def reach(n_in: int, first: int, n_out: int) -> int:
    """Largest distance between an input and an output sample [samples]."""
    return max(abs(first - (n_in - 1)), abs(first + n_out - 1))


def samples_between(output: Grid, grid: Grid) -> tuple[tuple[int, int], Grid]:
    """Step (y, x) from one of the output's samples to the next in samples of `grid`, and all that those span.

    Where the pitch is no whole multiple of the grid's, that is left for `Grid.samples_to` to refuse.

    Examples
    --------
    >>> samples_between(Grid((3, 4), 2.0), Grid((8, 8), 1.0))[1].shape
    (5, 7)
    """
    steps = [max(1, round(coarse / fine)) for coarse, fine in zip(output.pitch, grid.pitch, strict=True)]
    if any(abs(step * p - q) > 1e-9 * q for step, p, q in zip(steps, grid.pitch, output.pitch, strict=True)):
        steps = [1, 1]
    shape = [step * (n - 1) + 1 for step, n in zip(steps, output.shape, strict=True)]
    pitch = [p / step for step, p in zip(steps, output.pitch, strict=True)]
    first = output.y[0], output.x[0]
    center = [at + n // 2 * p for at, n, p in zip(first, shape, pitch, strict=True)]
    between = Grid((shape[0], shape[1]), (pitch[0], pitch[1]), (float(center[0]), float(center[1])))
    return (steps[0], steps[1]), between


def window_shape(
    grid: Grid, output: Grid, pad: float, first: tuple[int, int], multiples: tuple[int, int] = (1, 1)
) -> tuple[int, int]:
    """Samples (ny, nx) of the window of a circular convolution from `grid` to `output`.

    The window holds both grids and `1 + pad` times the input. With ``pad >= 1`` it is also at least
    twice the largest distance between an input and an output sample, so that each pair of samples has
    its own value of the periodic kernel, and none of them is a wrapped one. With ``pad = 0`` it is
    exactly the window that holds both, as in the thesis, and light that leaves it comes back on the
    other side.

    Parameters
    ----------
    grid, output
        Aligned grids of one pitch.
    pad
        Added window as a fraction of the input window.
    first
        Index of the output's first sample, counted from the input's first.
    multiples
        Divisors of the numbers.

    Raises
    ------
    SamplingError
        The output lies so far from the input that the window would be mostly empty.
    """
    shape = []
    for n_in, n_out, offset, multiple in zip(grid.shape, output.shape, first, multiples, strict=True):
        farthest = reach(n_in, offset, n_out)
        if 2 * farthest + 1 > max(2 * FARTHEST * (n_in + n_out), LARGEST_EMPTY):
            raise SamplingError(
                f"the output reaches {farthest} samples from the input, which has only {n_in}: "
                f"the window would need {2 * farthest + 1} samples. Use method='zoom', or move grid nearer."
            )
        hull = max(n_in, offset + n_out) - min(0, offset)
        linear = max(2 * farthest + 1, hull)
        size = math.ceil(max(hull + min(pad, 1.0) * (linear - hull), (1 + pad) * n_in) - 1e-6)
        shape.append(smooth_size(size, multiple) if pad > 0 or size % multiple else size)
    return shape[0], shape[1]


def check_memory(nbytes: float, what: str) -> None:
    """Refuse a calculation that needs more memory than the machine has free.

    Raises
    ------
    SamplingError
        The estimate is above the free memory; the message gives both.
    """
    memory.require(nbytes, what, "Use fewer samples, a smaller pad, or complex64 data.", SamplingError)
