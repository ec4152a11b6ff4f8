import numpy as np

from lumigraph.core.cache import ByteCache


def test_a_cache_builds_once_and_forgets_the_least_recently_used_first():
    cache, built = ByteCache(limit=200), []

    def get(key):
        return cache.get(key, lambda: built.append(key) or np.zeros(10))

    get("a"), get("b"), get("a"), get("c")  # c takes the place of b
    assert built == ["a", "b", "c"]
    assert cache.used == 160
    get("a"), get("b")
    assert built == ["a", "b", "c", "b"]


def test_what_is_larger_than_the_limit_is_returned_but_not_kept():
    cache = ByteCache(limit=100)
    small = cache.get("small", lambda: np.zeros(5))
    assert cache.get("big", lambda: np.zeros(100)).shape == (100,)
    assert cache.used == 40
    assert cache.get("small", lambda: np.ones(5)) is small


def test_clear_forgets_everything(xp):
    cache = ByteCache(limit=1000)
    cache.get("a", lambda: xp.asarray(np.zeros(3, np.complex64)))
    assert cache.used == 24
    cache.clear()
    assert cache.used == 0
