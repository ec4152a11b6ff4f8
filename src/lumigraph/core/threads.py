"""Independent pieces of work side by side, each on one thread."""

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from threading import Lock
from typing import TypeVar

from threadpoolctl import threadpool_limits

from lumigraph.core import arrays

Item = TypeVar("Item")
Result = TypeVar("Result")


def each(function: Callable[[Item], Result], items: Iterable[Item]) -> Iterator[Result]:
    """``function(item)`` of every item, in order, on as many threads as there are processors.

    Matrix products inside `function` take one thread each: many small ones run faster so, the more on a busy
    machine, and their result does not depend on the number of processors. An interruption drops what has
    not begun.

    Examples
    --------
    >>> list(each(abs, [-1, 2]))
    [1, 2]
    """
    with _BLAS:
        pool = ThreadPoolExecutor(arrays.WORKERS, thread_name_prefix="lumigraph")
        try:
            yield from pool.map(function, items)
        finally:
            pool.shutdown(cancel_futures=True)


class _OneThread:
    """BLAS on one thread from the first `with` to the end of the last: the limit is the whole process'."""

    def __init__(self) -> None:
        self._lock, self._users, self._limits = Lock(), 0, None

    def __enter__(self) -> None:
        with self._lock:
            if not self._users:
                self._limits = threadpool_limits(1, "blas")
            self._users += 1

    def __exit__(self, *_: object) -> None:
        with self._lock:
            self._users -= 1
            if not self._users and self._limits is not None:
                self._limits.restore_original_limits()


_BLAS = _OneThread()
