"""A short run of tests/fuzz/faults.py: writers that are killed, and bits that flip."""

import os
import sys

import numpy as np
import pytest

from fuzz import faults, run, scenarios
from lumigraph import store


@pytest.fixture(scope="module", autouse=True)
def readers():
    run.preload()


@pytest.mark.skipif(sys.gettrace() is not None, reason="lines are already traced, for coverage")
@pytest.mark.parametrize("name", faults.WRITERS)
def test_killed_writers_leave_the_old_content_or_the_new_and_nothing_else(name):
    count, failures = faults.kills(name, 8)
    assert failures == []
    assert count >= 4


def test_flipped_bits_are_found_and_healed():
    files = {"one": {"a": np.arange(50.0)}, "two": {"b": np.ones((3, 4), np.float32), "c": np.eye(2)}}
    assert faults.flips(files, 60) == (60, 0, 0)


@pytest.mark.parametrize("processes", [2, 8])
def test_processes_that_share_a_cache_are_killed_and_lose_nothing(processes):
    assert scenarios.cache(processes, 6) == (6, [])


def test_a_run_that_is_killed_ends_with_the_same_bits_and_the_harness_sees_others(tmp_path):
    def summed(folder):
        found = [store.kept(f"k{k}", lambda k=k: {"a": np.arange(40_000.0) ** k}) for k in range(4)]
        return sum(one["a"] for one in found).tobytes()

    assert scenarios.killed(summed, 2)[1] == []
    assert "other bits" in scenarios.killed(lambda folder: summed(folder) + os.urandom(4), 1)[1]


def test_the_harness_sees_a_torn_file_and_leftovers(monkeypatch):
    def slowly(path, value):
        with path.open("r+b" if path.exists() else "wb", buffering=0) as file:
            for _ in range(6):
                file.write(bytes([value]) * 1000)
                faults._lattice(1)  # lines of the package, at which it is killed

    torn = faults.Writer(slowly, faults.WRITERS["page.html"].value)
    monkeypatch.setitem(faults.WRITERS, "torn", torn)
    assert len(faults.kills("torn", 12)[1]) > 3


@pytest.mark.parametrize("name", ["done/000001.json", "job.json", "store.json", "zarr.json", "a/zarr.json"])
def test_flipped_bits_of_a_batch_are_healed_or_refused(name):
    found, wrong = faults.flipped_batches(name, 12)
    assert wrong == []
    assert found >= 10  # a bit that says the same, as of a blank, is none
