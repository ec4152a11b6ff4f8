"""Arrays kept on disk: whole or not at all, checked, shared, limited, and never in the way."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from lumigraph import store
from lumigraph.errors import FormatError
from lumigraph.store import array_cache

ARRAYS = {"left": np.arange(6.0).reshape(2, 3), "right": np.array([1, 2], np.int32)}


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """A folder of this test's own."""
    monkeypatch.setenv("LUMIGRAPH_CACHE", str(tmp_path / "kept"))
    return tmp_path / "kept"


def built():
    return ARRAYS


def never():
    raise AssertionError("built although it is kept")


def test_what_is_kept_is_found_as_read_only_maps_and_so_is_what_was_just_built(folder):
    for found in (store.kept("key", built), store.kept("key", never)):
        assert set(found) == set(ARRAYS)
        for name, array in ARRAYS.items():
            np.testing.assert_array_equal(found[name], array)
            assert found[name].dtype == array.dtype
            assert isinstance(found[name], np.memmap)
            assert not found[name].flags.writeable
    assert [path.name for path in folder.iterdir()] == ["key.kept.npz"]


def test_nothing_is_found_under_another_key():
    store.kept("key", built)
    with pytest.raises(AssertionError, match="although"):
        store.kept("another", never)


def test_off_keeps_nothing(folder, monkeypatch):
    monkeypatch.setenv("LUMIGRAPH_CACHE", "OFF")
    assert store.folder() is None
    found = store.kept("key", built)
    np.testing.assert_array_equal(found["left"], ARRAYS["left"])
    assert not found["left"].flags.writeable
    assert ARRAYS["left"].flags.writeable
    assert not folder.exists()


@pytest.mark.parametrize("name", ["XDG_CACHE_HOME", "LOCALAPPDATA"])
def test_without_a_choice_it_is_the_users_cache_folder(name, tmp_path, monkeypatch):
    for other in ("LUMIGRAPH_CACHE", "XDG_CACHE_HOME", "LOCALAPPDATA"):
        monkeypatch.delenv(other, raising=False)
    assert store.folder() == Path.home() / ".cache" / "lumigraph"
    monkeypatch.setenv(name, str(tmp_path))
    assert store.folder() == tmp_path / "lumigraph"


def test_a_user_without_a_home_keeps_nothing(monkeypatch):
    def homeless():
        raise RuntimeError("Could not determine home directory.")

    for name in ("LUMIGRAPH_CACHE", "XDG_CACHE_HOME", "LOCALAPPDATA"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(Path, "home", homeless)
    assert store.folder() is None
    np.testing.assert_array_equal(store.kept("key", built)["left"], ARRAYS["left"])


@pytest.mark.parametrize("damage", [b"", b"not an array", None, "bit"])
def test_a_damaged_file_is_built_again(folder, damage):
    store.kept("key", built)
    file = folder / "key.kept.npz"
    whole = bytearray(file.read_bytes())
    if damage == "bit":
        whole[len(whole) // 2] ^= 4
    file.write_bytes(whole if damage == "bit" else whole[:-8] if damage is None else damage)
    np.testing.assert_array_equal(store.kept("key", built)["left"], ARRAYS["left"])
    np.testing.assert_array_equal(store.kept("key", never)["left"], ARRAYS["left"])


@pytest.mark.parametrize("order", ["C", "F"])
@pytest.mark.parametrize("where", ["kept", "off"])
def test_the_order_in_memory_is_the_one_that_was_built(order, where, monkeypatch):
    if where == "off":
        monkeypatch.setenv("LUMIGRAPH_CACHE", "off")
    array = np.arange(24.0).reshape(2, 3, 4).astype(">f4", order=order)
    for _ in range(2):
        found = store.kept("key", lambda: {"array": array, "part": array[:, 1:], "one": np.float32(3)})
        assert found["array"].strides == array.strides
        assert found["array"].dtype == array.dtype
        assert found["part"].flags.c_contiguous or found["part"].flags.f_contiguous
        assert found["one"].shape == ()
        np.testing.assert_array_equal(found["part"], array[:, 1:])


def test_pickles_are_neither_written_nor_read():
    with pytest.raises(ValueError, match="Object arrays cannot be saved"):
        store.kept("key", lambda: {"left": np.array([{}])})


def test_the_files_not_used_for_longest_go(folder, monkeypatch):
    monkeypatch.setattr(array_cache, "LIMIT", 5000)  # three of 1000 bytes and their headers
    folder.mkdir()
    (folder / "mine.npz").write_bytes(bytes(9000))

    def data():
        return {"data": np.zeros(1000, np.uint8)}

    for age, key in enumerate(("oldest", "older", "old")):
        store.kept(key, data)
        os.utime(folder / f"{key}.kept.npz", (1000 + age, 1000 + age))
    store.kept("oldest", never)  # which is a use
    store.kept("new", data)
    assert sorted(path.name.split(".")[0] for path in folder.iterdir()) == ["mine", "new", "old", "oldest"]


def precious_text(path, away):
    path.write_bytes(b"precious" * 2000)


def precious_link(path, away):
    store.write(away, {"a": np.zeros(9000)})
    path.symlink_to(away)


def precious_link_to_nothing(path, away):
    path.symlink_to(away)


def precious_second_name(path, away):
    store.write(away, {"a": np.zeros(9000)})
    os.link(away, path)


def precious_folder(path, away):
    path.mkdir()


def precious_of_another_user(path, away):
    if os.name == "nt" or os.geteuid() != 0:
        pytest.skip("only root gives files to others")
    store.write(path, {"a": np.zeros(9000)})
    os.chown(path, 12345, -1)


@pytest.mark.parametrize("made", [value for name, value in sorted(globals().items()) if "precious_" in name])
def test_a_full_cache_removes_only_what_it_has_made(folder, tmp_path, monkeypatch, made):
    monkeypatch.setattr(array_cache, "LIMIT", 3000)
    folder.mkdir()
    made(folder / "mine.kept.npz", tmp_path / "away")
    before = sorted(tmp_path.rglob("*"))
    for key in ("old", "new"):
        store.kept(key, lambda: {"data": np.zeros(1000, np.uint8)})
        os.utime(folder / f"{key}.kept.npz", (1000, 1000))
    store.kept("newest", lambda: {"data": np.zeros(1000, np.uint8)})
    left = {path for path in tmp_path.rglob("*") if path not in before}
    assert set(before) <= set(tmp_path.rglob("*"))
    assert folder / "newest.kept.npz" in left
    assert len(left) == 2  # two of 1400 bytes fit


def test_clocks_that_jump_change_nothing_but_what_goes_first(folder):
    store.kept("key", built)
    for moment in (0, 2**31 - 1, 4e9):
        os.utime(folder / "key.kept.npz", (moment, moment))
        store.kept("key", never)


def test_what_is_larger_than_the_limit_is_not_kept(folder, monkeypatch):
    monkeypatch.setattr(array_cache, "LIMIT", 47)
    store.kept("key", lambda: {"left": ARRAYS["left"]})
    assert not folder.exists()


def test_a_disk_that_cannot_be_written_is_no_error_unless_the_folder_is_the_callers(folder, tmp_path):
    folder.write_text("a file where the folder should be")
    np.testing.assert_array_equal(store.kept("key", built)["left"], ARRAYS["left"])
    with pytest.raises(FormatError, match="was not written"):
        store.kept("key", built, folder / "none")


def test_a_folder_of_the_callers_has_no_limit(tmp_path, monkeypatch):
    monkeypatch.setattr(array_cache, "LIMIT", 1)
    for build in (built, never):
        np.testing.assert_array_equal(store.kept("key", build, tmp_path)["left"], ARRAYS["left"])


@pytest.mark.parametrize("count", [2, 8])
def test_processes_that_keep_the_same_do_not_disturb_each_other(folder, count):
    """Each keeps, damages and removes one key many times; whoever reads finds what was built."""
    program = """
import sys
import numpy as np
from pathlib import Path
from lumigraph import store
path = store.folder() / "key.kept.npz"
for k in range(20):
    found = store.kept("key", lambda: {"a": np.full(5000, 7.0), "b": np.full(5000, 7.0)})
    assert set(found) == {"a", "b"}, found
    assert all((array == 7).all() and array.shape == (5000,) for array in found.values())
    if k % 5 == int(sys.argv[1]) % 5:
        path.unlink(missing_ok=True)
"""
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    running = [
        subprocess.Popen([sys.executable, "-c", program, str(k)], stderr=subprocess.PIPE, env=environment)
        for k in range(count)
    ]
    errors = [process.communicate()[1].decode() for process in running]
    assert [process.returncode for process in running] == [0] * count, errors
    assert {path.name for path in folder.iterdir()} <= {"key.kept.npz"}
