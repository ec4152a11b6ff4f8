"""The threads that stay: forks, and calls from several threads at once."""

import multiprocessing
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from lumigraph.core.field import Field
from lumigraph.core.grid import Grid
from lumigraph.propagation import propagate


def wave(n=700):
    data = np.random.default_rng(1).random((n, n)).astype(np.complex64)
    return Field(data, Grid.square(n, 5e-6), 633e-9)


def total(_=0):
    return float(propagate(wave(), 0.05).power)


def test_several_threads_may_propagate_at_once():
    expected = total()
    with ThreadPoolExecutor(4) as pool:
        assert list(pool.map(total, range(8))) == [expected] * 8


@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")  # Python 3.12 warns of threads
def test_a_forked_process_makes_its_own_threads():
    """The parent's threads do not live in the child: without a new pool it would wait for ever."""
    expected = total()
    with multiprocessing.get_context("fork").Pool(1) as pool:
        assert pool.apply_async(total).get(timeout=60) == expected
