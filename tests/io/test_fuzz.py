"""A short run of the fuzzer (tests/fuzz/run.py, `make fuzz`): damaged files are opened or refused."""

import os
from datetime import UTC, datetime

import pytest

from fuzz import run, seeds

READERS = (
    "tiff", "png", "jpeg", "zarr", "zarr.zip", "hdf5", "pfm", "ply", "lytro", "lytro raw", "lytro json",
    "toml", "xml", "ini", "views", "eslf", "camera", "checkpoint", "metric",
    "bmp", "pnm", "mat", "npy", "npz",
)  # fmt: skip
SEED = int(os.environ.get("LUMIGRAPH_FUZZ_SEED", f"{datetime.now(UTC):%Y%m%d}"))
"""Other mutants every day, the same ones for all workers; printed, so that a failure can be made again."""


@pytest.fixture(scope="module")
def found():
    run.preload()
    return run.in_child(seeds.seeds)


def test_every_reader_has_seeds(found):
    assert sorted(found) == sorted(READERS)


@pytest.mark.parametrize("reader", READERS)
def test_damaged_files_are_opened_or_refused(found, reader):
    trees, mend = found[reader]
    held = run.memory()[1]  # by tests before this one, and by the children that are forked here
    print(f"the seed of the day is {SEED}: python tests/fuzz/run.py --readers {reader!r} --seed {SEED}")
    score = run.run(trees, mend, 60 if reader == "zarr" else 200, seed=SEED)
    assert score.failures == []
    assert score.opened + score.refused == (60 if reader == "zarr" else 200)
    assert score.most_memory < max(run.MEMORY, held + run.MEMORY // 2)
    assert score.slowest < 5


@pytest.mark.parametrize("reader", READERS)
def test_the_seeds_themselves_are_opened(found, reader, tmp_path):
    for tree in found[reader][0]:
        if reader == "eslf":
            with pytest.warns(UserWarning, match="a guess"):
                run.read(tree, tmp_path / "seed")
        else:
            run.read(tree, tmp_path / "seed")


def test_the_fuzzer_sees_a_crash_a_hang_and_a_wrong_error(monkeypatch):
    def read(tree, folder):
        kind = tree["a"][0] % 4
        if kind == 0:
            os.kill(os.getpid(), 9)
        if kind == 1:
            while True:
                pass
        if kind == 2:
            raise KeyError("x")

    monkeypatch.setattr(run, "read", read)
    monkeypatch.setattr(run, "SECONDS", 1)
    monkeypatch.setattr(run, "mutant", lambda trees, mend, rng: {"a": bytes([trees.pop(0)])})
    told = []
    for kind in range(4):
        told += [message for _, message in run.run([kind], None, 1).failures]
    assert told == ["died with -9", "hung for 1 s", "KeyError: 'x'"]
