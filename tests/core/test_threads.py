"""Work on several threads: order, errors, and what becomes of BLAS' own threads."""

import sys
import threading
import types

import pytest
from threadpoolctl import ThreadpoolController, threadpool_info, threadpool_limits

from lumigraph.core import threads
from lumigraph.core.threads import each, single_products


def blas():
    return {part["filepath"]: part["num_threads"] for part in threadpool_info() if part["user_api"] == "blas"}


def test_results_come_in_order_and_errors_come_out():
    assert list(each(lambda k: k * k, range(50))) == [k * k for k in range(50)]
    with pytest.raises(ZeroDivisionError):
        list(each(lambda k: 1 / k, [1, 0]))


def test_products_take_one_thread_inside_and_as_many_as_before_afterwards():
    """Also where two callers overlap: the one that leaves last lifts the limit."""
    with threadpool_limits(2, "blas"):
        before = blas()
        first, second = each(lambda _: blas(), [0, 1]), each(lambda _: blas(), [0, 1])
        assert set(next(first).values()) == {1}
        next(second)
        first.close()
        assert set(blas().values()) == {1}
        second.close()
        assert blas() == before


def test_libraries_are_looked_for_again_when_modules_have_come(monkeypatch):
    looked = []
    monkeypatch.setattr(threads, "_LIMIT", threads._Limit())
    monkeypatch.setattr(threads, "ThreadpoolController", lambda: looked.append(1) or ThreadpoolController())
    for expected in (1, 1, 2):
        if expected == 2:
            monkeypatch.setitem(sys.modules, "with_a_library", types.ModuleType("with_a_library"))
        with single_products():
            assert set(blas().values()) == {1}
        assert len(looked) == expected


def test_an_error_drops_what_has_not_begun():
    begun, hold = [], threading.Event()

    def work(k):
        begun.append(k)
        if k == 0:
            raise ValueError("enough")
        hold.wait(0.05)

    with pytest.raises(ValueError, match="enough"):
        list(each(work, range(1000)))
    assert len(begun) < 100
