"""The window a calculation runs on: large enough, a quick size to transform, and within memory."""

import math
from typing import Any

import scipy.fft

from lumigraph.core import memory
from lumigraph.core.grid import Grid
from lumigraph.errors import SamplingError

FARTHEST = 16
"""An aligned output may lie this many times (input + output window) off before it is refused, and
as far as a window of `LARGEST_EMPTY` samples reaches in any case."""
LARGEST_EMPTY = 20_000


def smooth_size(n: int, *, even: bool = False) -> int:
    """Smallest quick FFT size from `n` upwards, away from large powers of two.

    Sizes are products of primes up to 11. A multiple of 512 is passed over where another size within
    3 % exists, because rows a power of two apart share cache lines: 2000² takes 1.3 to 1.7 times less
    than 2048².

    Examples
    --------
    >>> smooth_size(1999), smooth_size(2048), smooth_size(4001)
    (2000, 2058, 4032)
    """
    first = size = _next_fast(n, even)
    while size % 512 == 0 and size <= 1.03 * n:
        size = _next_fast(size + 1, even)
    return size if size <= 1.03 * n else first


def _next_fast(n: int, even: bool) -> int:
    size: Any = scipy.fft.next_fast_len((n + 1) // 2 if even else n)
    return 2 * size if even else size


def reach(n_in: int, first: int, n_out: int) -> int:
    """Largest distance between an input and an output sample [samples]."""
    return max(abs(first - (n_in - 1)), abs(first + n_out - 1))


def window_shape(
    grid: Grid, output: Grid, pad: float, first: tuple[int, int], *, even: bool = False
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
    even
        Whether both numbers must be even.

    Raises
    ------
    SamplingError
        The output lies so far from the input that the window would be mostly empty.
    """
    shape = []
    for n_in, n_out, offset in zip(grid.shape, output.shape, first, strict=True):
        farthest = reach(n_in, offset, n_out)
        if 2 * farthest + 1 > max(2 * FARTHEST * (n_in + n_out), LARGEST_EMPTY):
            raise SamplingError(
                f"the output reaches {farthest} samples from the input, which has only {n_in}: "
                f"the window would need {2 * farthest + 1} samples. Use method='zoom', or move grid nearer."
            )
        hull = max(n_in, offset + n_out) - min(0, offset)
        linear = max(2 * farthest + 1, hull)
        size = math.ceil(max(hull + min(pad, 1.0) * (linear - hull), (1 + pad) * n_in) - 1e-6)
        shape.append(smooth_size(size, even=even) if pad > 0 or (even and size % 2) else size)
    return shape[0], shape[1]


def check_memory(nbytes: float, what: str) -> None:
    """Refuse a calculation that needs more memory than the machine has free.

    Raises
    ------
    SamplingError
        The estimate is above the free memory; the message gives both.
    """
    memory.require(nbytes, what, "Use fewer samples, a smaller pad, or complex64 data.", SamplingError)
