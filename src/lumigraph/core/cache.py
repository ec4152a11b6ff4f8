"""Caches of results that are costly to compute, within one memory budget for all."""

import os
import sys
from collections import OrderedDict
from collections.abc import Callable, Hashable
from functools import wraps
from threading import Lock
from typing import Any, ParamSpec, TypeVar

from lumigraph.core import memory

_P = ParamSpec("_P")
_R = TypeVar("_R")

_SHARE, _LEAST, _MOST = 0.25, 2**28, 4 * 2**30
"""Part of the machine's memory that all caches may hold together, and its bounds [bytes]."""


class Budget:
    """Shared memory budget of several caches: the entry used longest ago is dropped first.

    Parameters
    ----------
    limit
        Bytes; those of `shared_limit` where it is None.
    """

    def __init__(self, limit: int | None = None) -> None:
        self._limit = limit
        self.used = 0
        self._kept: OrderedDict[tuple[Hashable, Hashable], tuple[Any, int]] = OrderedDict()
        self._lock = Lock()

    @property
    def limit(self) -> int:
        """Bytes that all caches may hold together."""
        if self._limit is None:
            self._limit = shared_limit()
        return self._limit

    def found(self, key: tuple[Hashable, Hashable]) -> Any:
        """Entry under a key, now the last to be dropped; None if there is none."""
        with self._lock:
            if key not in self._kept:
                return None
            self._kept.move_to_end(key)
            return self._kept[key][0]

    def keep(self, key: tuple[Hashable, Hashable], thing: Any, size: int) -> None:
        """Keep a thing of `size` bytes unless it exceeds the limit; what was unused for longest goes."""
        with self._lock:
            if key in self._kept or size > self.limit:
                return
            self._kept[key] = thing, size
            self.used += size
            while self.used > self.limit:
                self.used -= self._kept.popitem(last=False)[1][1]

    def forget(self, cache: Hashable) -> None:
        """Remove the entries of one cache."""
        with self._lock:
            for key in [key for key in self._kept if key[0] is cache]:
                self.used -= self._kept.pop(key)[1]

    def empty(self) -> None:
        """Remove the entries of all caches."""
        with self._lock:
            self._kept.clear()
            self.used = 0

    def held(self, cache: Hashable) -> int:
        """Bytes that one cache holds."""
        with self._lock:
            return sum(size for key, (_, size) in self._kept.items() if key[0] is cache)


def shared_limit() -> int:
    """``LUMIGRAPH_MEMORY`` in MiB, or a quarter of the memory, from 256 MiB to 4 GiB [bytes]."""
    chosen = os.environ.get("LUMIGRAPH_MEMORY", "")
    if chosen.isdecimal():
        return int(chosen[:9]) * 2**20
    whole = memory.total()
    return _MOST if whole is None else int(min(max(whole * _SHARE, _LEAST), _MOST))


SHARED = Budget()
"""The budget of every cache of this process."""


class ByteCache:
    """Arrays by key; all caches share one budget, and what was not used for longest goes first.

    Parameters
    ----------
    budget
        Another one than all caches share.

    Examples
    --------
    >>> import numpy as np
    >>> cache = ByteCache(Budget(limit=100))
    >>> cache.get("ones", lambda: np.ones(8)).sum(), cache.used
    (np.float64(8.0), 64)
    """

    def __init__(self, budget: Budget = SHARED) -> None:
        self._budget = budget

    @property
    def used(self) -> int:
        """Bytes that this cache holds."""
        return self._budget.held(self)

    def get(self, key: Hashable, build: Callable[[], Any]) -> Any:
        """The array, or what has ``nbytes``, kept under `key`; built where there is none. To be read only.

        An array larger than the budget is returned but not kept.
        """
        found = self._budget.found((self, key))
        if found is None:
            found = build()
            self._budget.keep((self, key), found, _bytes(found))
        return found

    def clear(self) -> None:
        """Remove everything from this cache."""
        self._budget.forget(self)


def remembered(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """The function, its results kept by its arguments within the budget of all caches, and to be read only.

    Examples
    --------
    >>> import numpy as np
    >>> ramp = remembered(lambda n: np.arange(n))
    >>> ramp(3) is ramp(3)
    True
    """
    cache = ByteCache()

    @wraps(function)
    def found(*args: _P.args, **words: _P.kwargs) -> _R:
        key = (args, tuple(sorted(words.items())))
        return cache.get(key, lambda: function(*args, **words))

    return found


def _bytes(thing: Any) -> int:
    if (told := getattr(thing, "nbytes", None)) is not None:
        return int(told)
    if isinstance(thing, tuple | list):
        return sum(map(_bytes, thing))
    if hasattr(thing, "data") and not hasattr(thing, "dtype"):  # a picture, a volume
        return _bytes(thing.data)
    if not hasattr(thing, "dtype"):
        return sys.getsizeof(thing)
    size = 1
    for n in thing.shape:
        size *= n
    return size * next((k for name, k in _WIDTHS if str(thing.dtype).endswith(name)), 16)


_WIDTHS = (("complex128", 16), ("complex64", 8), ("float64", 8), ("float32", 4))
