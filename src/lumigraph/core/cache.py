"""Remembering what is dearer to compute than to keep, within a bound of memory."""

from collections import OrderedDict
from collections.abc import Callable, Hashable
from threading import Lock
from typing import Any


class ByteCache:
    """Arrays by key; the one unused for longest goes first when they hold more than `limit` bytes.

    Parameters
    ----------
    limit
        Bytes that the kept arrays may hold together; a larger array is returned but not kept.

    Examples
    --------
    >>> import numpy as np
    >>> cache = ByteCache(limit=100)
    >>> cache.get("ones", lambda: np.ones(8)).sum(), cache.used
    (np.float64(8.0), 64)
    """

    def __init__(self, limit: int) -> None:
        self.limit = limit
        self.used = 0
        self._kept: OrderedDict[Hashable, tuple[Any, int]] = OrderedDict()
        self._lock = Lock()

    def get(self, key: Hashable, build: Callable[[], Any]) -> Any:
        """The array, or what has ``nbytes``, kept under `key`; built where there is none. To be read only."""
        with self._lock:
            if key in self._kept:
                self._kept.move_to_end(key)
                return self._kept[key][0]
        array = build()
        size = _bytes(array)
        with self._lock:
            if key not in self._kept and size <= self.limit:
                self._kept[key] = array, size
                self.used += size
                while self.used > self.limit:
                    self.used -= self._kept.popitem(last=False)[1][1]
        return array

    def clear(self) -> None:
        """Forget everything."""
        with self._lock:
            self._kept.clear()
            self.used = 0


def _bytes(array: Any) -> int:
    if (told := getattr(array, "nbytes", None)) is not None:
        return int(told)
    size = 1
    for n in array.shape:
        size *= n
    return size * next((k for name, k in _WIDTHS if str(array.dtype).endswith(name)), 16)


_WIDTHS = (("complex128", 16), ("complex64", 8), ("float64", 8), ("float32", 4))
