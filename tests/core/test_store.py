"""Arrays kept on disk: whole or not at all, shared, limited, and never in the way."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from lumigraph.core import store

ARRAYS = {"left": np.arange(6.0).reshape(2, 3), "right": np.array([1, 2], np.int32)}


@pytest.fixture(autouse=True)
def kept(tmp_path, monkeypatch):
    """A folder of this test's own."""
    monkeypatch.setenv("LUMIGRAPH_CACHE", str(tmp_path / "kept"))
    return tmp_path / "kept"


def test_what_is_saved_is_loaded_as_read_only_maps(kept):
    store.save("key", ARRAYS)
    found = store.load("key", ARRAYS)
    assert found is not None
    assert set(found) == set(ARRAYS)
    for name, array in ARRAYS.items():
        np.testing.assert_array_equal(found[name], array)
        assert found[name].dtype == array.dtype
        assert isinstance(found[name], np.memmap)
        assert not found[name].flags.writeable
    assert [path.name for path in kept.iterdir()] == ["key"]


def test_nothing_is_found_under_another_key():
    assert store.load("key", ARRAYS) is None
    store.save("key", ARRAYS)
    assert store.load("another", ARRAYS) is None


def test_off_keeps_nothing(kept, monkeypatch):
    monkeypatch.setenv("LUMIGRAPH_CACHE", "OFF")
    store.save("key", ARRAYS)
    assert store.folder() is None
    assert store.load("key", ARRAYS) is None
    assert not kept.exists()


@pytest.mark.parametrize("name", ["XDG_CACHE_HOME", "LOCALAPPDATA"])
def test_without_a_choice_it_is_the_users_cache_folder(name, tmp_path, monkeypatch):
    for other in ("LUMIGRAPH_CACHE", "XDG_CACHE_HOME", "LOCALAPPDATA"):
        monkeypatch.delenv(other, raising=False)
    assert store.folder() == Path.home() / ".cache" / "lumigraph"
    monkeypatch.setenv(name, str(tmp_path))
    assert store.folder() == tmp_path / "lumigraph"


def test_a_half_written_folder_is_not_seen(kept, monkeypatch):
    """A process that dies while it writes, and one that reads meanwhile."""
    seen, write = [], np.save

    def dies(file, array, **options):
        write(file, array, **options)
        seen.append(store.load("key", ARRAYS))
        if len(seen) == 2:
            raise KeyboardInterrupt

    monkeypatch.setattr(np, "save", dies)
    with pytest.raises(KeyboardInterrupt):
        store.save("key", ARRAYS)
    assert seen == [None, None]
    assert store.load("key", ARRAYS) is None
    assert list(kept.iterdir()) == []


@pytest.mark.parametrize("damage", [b"", b"not an array", None])
def test_a_damaged_folder_counts_as_none_and_goes(kept, damage):
    store.save("key", ARRAYS)
    file = kept / "key" / "left.npy"
    file.write_bytes(file.read_bytes()[:-8] if damage is None else damage)
    assert store.load("key", ARRAYS) is None
    assert not (kept / "key").exists()
    store.save("key", ARRAYS)
    assert store.load("key", ARRAYS) is not None


def test_pickles_are_neither_written_nor_read(kept):
    with pytest.raises(ValueError, match="Object arrays cannot be saved"):
        store.save("key", {"left": np.array([{}])})
    assert store.load("key", ARRAYS) is None
    (kept / "key").mkdir()
    np.save(kept / "key" / "left.npy", np.array([{}]), allow_pickle=True)
    assert store.load("key", ARRAYS) is None


def test_the_folders_not_used_for_longest_go(kept, monkeypatch):
    monkeypatch.setattr(store, "LIMIT", 3300)  # three of 1000 bytes and their headers
    for age, key in enumerate(("oldest", "older", "old")):
        store.save(key, {"data": np.zeros(1000 - 128, np.uint8)})
        os.utime(kept / key, (1000 + age, 1000 + age))
    assert store.load("oldest", ["data"]) is not None  # which is a use
    store.save("new", {"data": np.zeros(1000 - 128, np.uint8)})
    assert sorted(path.name for path in kept.iterdir()) == ["new", "old", "oldest"]


def test_what_is_larger_than_the_limit_is_not_kept(kept, monkeypatch):
    monkeypatch.setattr(store, "LIMIT", 47)
    store.save("key", {"left": ARRAYS["left"]})
    assert not kept.exists()
    monkeypatch.setattr(store, "LIMIT", 48 + 128)
    store.save("key", {"left": ARRAYS["left"]})
    assert store.load("key", ["left"]) is not None


def test_a_disk_that_cannot_be_written_is_no_error(kept):
    kept.write_text("a file where the folder should be")
    store.save("key", ARRAYS)
    assert store.load("key", ARRAYS) is None


def test_two_processes_that_keep_the_same_do_not_disturb_each_other(kept):
    """Each writes and reads one key many times; whoever reads finds all of it or nothing."""
    program = """
import numpy as np
from lumigraph.core import store
for _ in range(30):
    store.save("key", {"a": np.full(5000, 7.0), "b": np.full(5000, 7.0)})
    found = store.load("key", ["a", "b"])
    assert found is not None and set(found) == {"a", "b"}, found
    assert all((array == 7).all() and array.shape == (5000,) for array in found.values())
"""
    running = [subprocess.Popen([sys.executable, "-c", program], stderr=subprocess.PIPE) for _ in range(2)]
    errors = [process.communicate()[1].decode() for process in running]
    assert [process.returncode for process in running] == [0, 0], errors
    assert [path.name for path in kept.iterdir()] == ["key"]
