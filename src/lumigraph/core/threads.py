"""Independent pieces of work side by side, each on one thread."""

import sys
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from threading import Lock
from typing import TypeVar

from threadpoolctl import ThreadpoolController

from lumigraph.core import arrays

Item = TypeVar("Item")
Result = TypeVar("Result")


def each(
    function: Callable[[Item], Result], items: Iterable[Item], workers: int = arrays.WORKERS
) -> Iterator[Result]:
    """``function(item)`` of every item, in order, on some threads: by default one for each processor.

    Matrix products inside `function` take one thread each: many small ones run faster so, the more on a busy
    machine, and their result does not depend on the number of processors. No more than two for each thread
    are begun, or wait to be taken, at a time; an interruption drops what has not begun.

    Examples
    --------
    >>> list(each(abs, [-1, 2]))
    [1, 2]
    """
    with single_products():
        pool = ThreadPoolExecutor(workers, thread_name_prefix="lumigraph")
        try:
            begun: deque[Future[Result]] = deque()
            for item in items:
                begun.append(pool.submit(function, item))
                if len(begun) >= 2 * workers:
                    yield begun.popleft().result()
            while begun:
                yield begun.popleft().result()
        finally:
            pool.shutdown(cancel_futures=True)


class _Limit:
    """The process' one limit of BLAS threads: set by the first who wants it, lifted by the last.

    Libraries are looked for again, in a millisecond, only when modules have come that may have loaded some.
    """

    def __init__(self) -> None:
        self.lock, self.users, self.set = Lock(), 0, None
        self.modules, self.libraries = 0, None

    def change(self, users: int) -> None:
        with self.lock:
            if self.users == 0:
                if self.libraries is None or self.modules != len(sys.modules):
                    self.modules, self.libraries = len(sys.modules), ThreadpoolController()
                self.set = self.libraries.limit(limits=1, user_api="blas")
            self.users += users
            if self.users == 0 and self.set is not None:
                self.set.restore_original_limits()


_LIMIT = _Limit()


@contextmanager
def single_products() -> Iterator[None]:
    """Context, or decorator, in which matrix products take one thread each."""
    _LIMIT.change(1)
    try:
        yield
    finally:
        _LIMIT.change(-1)
