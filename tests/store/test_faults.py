"""A short run of tests/fuzz/faults.py: writers that are killed, and bits that flip."""

import sys

import numpy as np
import pytest

from fuzz import faults, run


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


def test_the_harness_sees_a_torn_file_and_leftovers(monkeypatch):
    def slowly(path, value):
        half = bytes([value]) * 3000
        with path.open("r+b" if path.exists() else "wb") as file:
            file.write(half)
            file.flush()
            faults._lattice(1)  # lines of the package, at which it is killed
            file.write(half)

    torn = faults.Writer(slowly, faults.WRITERS["page.html"].value)
    monkeypatch.setitem(faults.WRITERS, "torn", torn)
    assert faults.kills("torn", 8)[1] != []
