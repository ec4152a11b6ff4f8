"""Sealed files: every bit counts, NumPy reads them, and layouts come back."""

import numpy as np
import pytest

from lumigraph import store
from lumigraph.errors import FormatError
from lumigraph.store import atomic

ARRAYS = {
    "c": np.arange(30.0).reshape(2, 3, 5),
    "f": np.asfortranarray(np.arange(12, dtype=">u2").reshape(3, 4)),
    "text": np.str_("α"),
    "none": np.zeros((0, 3)),
    "complex": 1j * np.arange(3, dtype=np.complex64),
}


def test_arrays_come_back_in_their_layout_and_numpy_reads_the_file_too(tmp_path):
    store.write(tmp_path / "a.npz", ARRAYS)
    with np.load(tmp_path / "a.npz") as plainly:
        for mapped in (False, True):
            found = store.read(tmp_path / "a.npz", mapped=mapped)
            assert list(found) == list(ARRAYS)
            for name, array in ((name, np.asarray(array)) for name, array in ARRAYS.items()):
                np.testing.assert_array_equal(found[name], array)
                np.testing.assert_array_equal(plainly[name], array)
                assert (found[name].dtype, found[name].shape) == (array.dtype, array.shape)
                assert found[name].flags.writeable != mapped
                if mapped and array.size:
                    assert found[name].ctypes.data % 64 == 0
                if array.size:
                    assert found[name].strides == array.strides


def test_every_flipped_bit_is_found(tmp_path):
    store.write(tmp_path / "a.npz", {"a": np.arange(4.0), "b": np.float32(1)})
    whole = (tmp_path / "a.npz").read_bytes()
    for bit in range(0, 8 * len(whole), 3):
        flipped = bytearray(whole)
        flipped[bit // 8] ^= 1 << bit % 8
        (tmp_path / "b.npz").write_bytes(flipped)
        with pytest.raises(store.DamagedError, match="checksum"):
            store.read(tmp_path / "b.npz")


def test_files_cut_short_and_files_by_others_are_told_apart(tmp_path):
    store.write(tmp_path / "a.npz", ARRAYS)
    whole = (tmp_path / "a.npz").read_bytes()
    for length in range(256, len(whole), 97):
        (tmp_path / "b.npz").write_bytes(whole[:length])
        with pytest.raises(store.DamagedError):
            store.read(tmp_path / "b.npz")
    np.savez(tmp_path / "other.npz", a=np.ones(3))
    (tmp_path / "empty.npz").write_bytes(b"")
    for name in ("other.npz", "empty.npz"):
        with pytest.raises(FormatError, match="not a sealed file") as refused:
            store.read(tmp_path / name)
        assert type(refused.value) is FormatError
    with pytest.raises(OSError, match="No such file"):
        store.read(tmp_path / "none.npz")


def test_reading_removes_what_dead_writers_left(tmp_path, monkeypatch):
    """A run that finds all it needs writes nothing, and what the last one left would stay."""
    monkeypatch.setattr(atomic, "_SWEPT", set())
    store.write(tmp_path / "a.npz", ARRAYS)
    (tmp_path / ".lumigraph-0123456789ab").mkdir(mode=0o700)
    atomic._SWEPT.clear()  # as in another process
    store.read(tmp_path / "a.npz")
    assert [path.name for path in tmp_path.iterdir()] == ["a.npz"]
