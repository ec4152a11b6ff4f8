"""Transfer functions and chirps that were built before: building one costs more than the transforms."""

from collections import OrderedDict
from collections.abc import Callable, Hashable
from threading import Lock

from lumigraph.core.arrays import Array


class ByteCache:
    """Least recently used arrays, as many as fit into `limit` bytes.

    Examples
    --------
    >>> import numpy as np
    >>> cache = ByteCache(limit=100)
    >>> for key in "ab":
    ...     _ = cache.get(key, lambda: np.zeros(10))
    >>> len(cache), cache.size
    (1, 80)
    """

    def __init__(self, limit: int) -> None:
        self.limit, self.size = limit, 0
        self._arrays: OrderedDict[Hashable, Array] = OrderedDict()
        self._lock = Lock()

    def __len__(self) -> int:
        return len(self._arrays)

    def get(self, key: Hashable, build: Callable[[], Array]) -> Array:
        """Array stored under `key`, built if it is not there; larger than the limit, it is not stored."""
        with self._lock:
            if key in self._arrays:
                self._arrays.move_to_end(key)
                return self._arrays[key]
        array = build()
        with self._lock:
            if nbytes(array) <= self.limit and key not in self._arrays:
                self._arrays[key] = array
                self.size += nbytes(array)
            while self.size > self.limit:
                self.size -= nbytes(self._arrays.popitem(last=False)[1])
        return array

    def clear(self) -> None:
        """Forget everything."""
        with self._lock:
            self._arrays.clear()
            self.size = 0


def nbytes(array: Array) -> int:
    """Bytes of a complex array of any library."""
    count = 1
    for n in array.shape:
        count *= int(n)
    return count * (8 if "complex64" in str(array.dtype) or "float64" in str(array.dtype) else 16)


CACHE = ByteCache(limit=1 << 30)
"""The one cache of this package: 1 GiB."""
