"""How far a computation has come: one kind of function is told, with the fraction that is done."""

from collections.abc import Callable

Progress = Callable[[float], None]
"""Called with the fraction that is done, from 0 to 1."""


def part(progress: Progress | None, number: int, count: int) -> Progress:
    """What one of `count` equal parts of a computation is to tell, so that the whole goes from 0 to 1.

    >>> part(print, 1, 4)(0.5)
    0.375
    """

    def tell(fraction: float) -> None:
        if progress is not None:
            progress((number + fraction) / count)

    return tell
