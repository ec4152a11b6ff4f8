"""Work on several threads, and the BLAS limit around it."""

import threading

import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from lumigraph.core.threads import each


def blas():
    """Threads of each BLAS library."""
    return {found["num_threads"] for found in threadpool_info() if found["user_api"] == "blas"}


def test_calls_that_overlap_leave_blas_as_it_was():
    """The first to begin ends first: the second must neither run unlimited nor keep the limit."""
    with threadpool_limits(3, "blas"):
        first, second = each(abs, range(2)), each(abs, range(2))
        next(first), next(second)
        list(first)
        assert blas() == {1}
        list(second)
        assert blas() == {3}


def test_an_error_of_one_piece_reaches_the_caller_and_lifts_the_limit():
    with threadpool_limits(3, "blas"):
        with pytest.raises(ZeroDivisionError):
            list(each(lambda n: 1 / n, [1, 0, 2]))
        assert blas() == {3}


def test_callers_on_several_threads_get_their_own_results():
    results = {}

    def call(k):
        results[k] = list(each(lambda n: n + k, range(5)))

    threads = [threading.Thread(target=call, args=(k,)) for k in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert results == {k: [n + k for n in range(5)] for k in range(4)}
