import importlib
import os
import subprocess
import sys

import numpy as np
import pytest

from lumigraph.core.cache import SHARED, Budget, ByteCache, remembered, shared_limit


def test_a_cache_builds_once_and_forgets_the_least_recently_used_first():
    cache, built = ByteCache(Budget(limit=200)), []

    def get(key):
        return cache.get(key, lambda: built.append(key) or np.zeros(10))

    get("a"), get("b"), get("a"), get("c")  # c takes the place of b
    assert built == ["a", "b", "c"]
    assert cache.used == 160
    get("a"), get("b")
    assert built == ["a", "b", "c", "b"]


def test_what_is_larger_than_the_limit_is_returned_but_not_kept():
    cache = ByteCache(Budget(limit=100))
    small = cache.get("small", lambda: np.zeros(5))
    assert cache.get("big", lambda: np.zeros(100)).shape == (100,)
    assert cache.used == 40
    assert cache.get("small", lambda: np.ones(5)) is small


def test_clear_forgets_everything(xp):
    cache = ByteCache(Budget(limit=1000))
    cache.get("a", lambda: xp.asarray(np.zeros(3, np.complex64)))
    assert cache.used == 24
    cache.clear()
    assert cache.used == 0


def test_several_caches_stay_within_one_budget():
    budget = Budget(limit=200)
    ByteCache(budget).get(1, lambda: np.zeros(10))
    assert budget.used == 80
    budget.empty()
    assert budget.used == 0
    caches = [ByteCache(budget) for _ in range(3)]
    for cache in caches:
        cache.get("same key", lambda: np.zeros(10))
    assert [cache.used for cache in caches] == [0, 80, 80]
    assert budget.used == 160
    assert caches[1].get("same key", lambda: np.ones(10)).sum() == 0
    caches[1].clear()
    assert [cache.used for cache in caches] == [0, 0, 80]


def test_every_cache_of_the_package_shares_the_budget_that_the_user_chose():
    """Six of them could once hold 6.5 GiB, each within a limit of its own."""
    program = """
import gc, lumigraph, lumigraph.operators.periodic.kernels, lumigraph.operators.microscope.volume_operator
from lumigraph.core.cache import SHARED, ByteCache
caches = [thing for thing in gc.get_objects() if isinstance(thing, ByteCache)]
assert len(caches) >= 4 and all(cache._budget is SHARED for cache in caches), caches
print(SHARED.limit)
"""
    environment = {**os.environ, "LUMIGRAPH_MEMORY": "100"}
    said = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, env=environment)
    assert said.stdout.strip() == str(100 * 2**20), said.stderr
    assert 2**28 <= shared_limit() <= 2**32


def test_results_of_a_function_are_kept_by_its_arguments_within_the_shared_budget():
    built = []

    @remembered
    def both(n, *, scale=1.0):
        built.append(n)
        return np.full(n, scale), [(n, np.zeros(n))]

    before = SHARED.used
    assert both(1000) is both(1000)
    assert both(1000, scale=2.0)[0][0] == 2
    assert built == [1000, 1000]
    assert 32_000 <= SHARED.used - before < 33_000
    assert both.__name__ == "both"


@pytest.mark.parametrize(
    ("module", "name", "arguments"),
    [
        ("deconvolution.filters", "lanczos", (307, 41.5)),
        ("operators.microscope.cell", "parts", (411,)),
        ("operators.microscope.patterns", "all_patterns", (61,)),  # sizes that no other test has used
    ],
)
def test_tables_that_grow_with_the_image_count_in_the_budget(module, name, arguments):
    """64 filters of 4096 px could hold 8.6 GB, outside every budget."""
    before = SHARED.used
    getattr(importlib.import_module(f"lumigraph.{module}"), name)(*arguments)
    assert SHARED.used - before >= 4 * arguments[0] ** 2
