"""The threads that stay: forks, and calls from several threads at once."""

import multiprocessing
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from lumigraph.core.arrays import to_numpy
from lumigraph.core.field import Field
from lumigraph.core.grid import Grid
from lumigraph.propagation import Propagate, propagate

pytestmark = pytest.mark.filterwarnings(  # noise fills its window, and all of its frequencies
    "ignore:.* of the light left the window:lumigraph.errors.SamplingWarning",
)


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


@pytest.mark.parametrize("method", ["band_limited", "angular_spectrum", "fresnel"])
def test_the_intensity_without_the_field_is_the_fields(method, xp):
    grid, rng = Grid((40, 30), 5e-6), np.random.default_rng(1)
    data = (rng.random((2, 40, 30)) + 1j * rng.random((2, 40, 30))).astype(np.complex64)
    step = Propagate(2e-3, method)
    wave = Field(xp.asarray(data), grid, 633e-9)
    found = step.intensity(wave)
    assert str(found.dtype).endswith("float32")
    np.testing.assert_array_equal(to_numpy(found), to_numpy(step(wave).intensity))
