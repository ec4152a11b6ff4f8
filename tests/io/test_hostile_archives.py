"""Archives made to mislead, or to fill the memory: each was once taken."""

import copy
import time
import zipfile

import numpy as np
import pytest
from numcodecs import Zstd

import lumigraph as lg
from fuzz import structure
from lumigraph.errors import FormatError

PICTURE = np.arange(60 * 50, dtype=np.uint16).reshape(60, 50)


def archive_with(path, entries, lies):
    """A ZIP of the entries; those in `lies` become two GiB and say that they become 100 bytes."""
    with zipfile.ZipFile(path, "w") as file:
        for name, content in entries.items():
            if name in lies:
                structure._add_bomb(file, name, 100)
            else:
                file.writestr(name, content)


@pytest.mark.parametrize("name", ["zarr.json", "data/zarr.json", "data/c/0/0"])
def test_an_archive_that_lies_about_its_sizes_is_refused_before_it_fills_the_memory(tmp_path, name):
    """The reader of archives inflates all of an entry, then cuts it to what is declared: 2 MB took 2 GB."""
    lg.save(lg.RawImage(PICTURE), tmp_path / "a.zarr.zip")
    with zipfile.ZipFile(tmp_path / "a.zarr.zip") as file:
        entries = {each: file.read(each) for each in file.namelist()}
    archive_with(tmp_path / "b.zarr.zip", entries, {name})
    start = time.process_time()
    with pytest.raises(FormatError, match="become more than the 100 its header declares"):
        lg.open(tmp_path / "b.zarr.zip")
    assert time.process_time() - start < 1


def test_entries_that_nobody_reads_take_no_time(tmp_path):
    """Two GiB of zeros in 2 MB took 1.7 s to be counted."""
    lg.save(lg.RawImage(PICTURE), tmp_path / "a.zarr.zip")
    with zipfile.ZipFile(tmp_path / "a.zarr.zip", "a") as file:
        structure._add_bomb(file, "elsewhere/c/0", structure.SWOLLEN)
        file._didModify = True
    start = time.process_time()
    np.testing.assert_array_equal(lg.open(tmp_path / "a.zarr.zip").data, PICTURE)
    assert time.process_time() - start < 0.5


def test_archives_by_deflate_are_read_and_by_other_methods_refused(tmp_path):
    """Those of bzip2 and LZMA are inflated without a bound."""
    lg.save(lg.RawImage(PICTURE), tmp_path / "a.zarr.zip")
    with zipfile.ZipFile(tmp_path / "a.zarr.zip") as file:
        entries = {each: file.read(each) for each in file.namelist()}
    for method in (zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA):
        with zipfile.ZipFile(tmp_path / "b.zarr.zip", "w", method) as file:
            for each, content in entries.items():
                file.writestr(each, content)
        if method == zipfile.ZIP_DEFLATED:
            np.testing.assert_array_equal(lg.open(tmp_path / "b.zarr.zip").data, PICTURE)
        else:
            with pytest.raises(FormatError, match=f"method {method} of ZIP"):
                lg.open(tmp_path / "b.zarr.zip")


def test_entries_that_share_their_bytes_are_refused(tmp_path):
    """A thousand entries of the same two megabytes would be inflated a thousand times."""
    lg.save(lg.RawImage(PICTURE), tmp_path / "a.zarr.zip")
    with zipfile.ZipFile(tmp_path / "a.zarr.zip", "a") as file:
        first = next(entry for entry in file.infolist() if entry.file_size > 1000)
        for k in range(10):
            again = copy.copy(first)
            again.filename = f"data/c/9/{k}"
            file.filelist.append(again)
        file._didModify = True
    with pytest.raises(FormatError, match="is not all there"):
        lg.open(tmp_path / "a.zarr.zip")


def test_a_chunk_larger_than_it_can_become_is_refused_before_it_is_read(tmp_path):
    lg.save(lg.RawImage(PICTURE), tmp_path / "a.zarr")
    with (tmp_path / "a.zarr" / "data" / "c" / "0" / "0").open("r+b") as file:
        file.truncate(1 << 40)  # holds nothing
    with pytest.raises(FormatError, match=r"its chunk '0' holds 1099511627776 bytes, \d+ suffice"):
        lg.open(tmp_path / "a.zarr")


def test_a_second_frame_in_a_chunk_is_refused(tmp_path, rng):
    """The check read the size of the first one, the decoder inflated both: 48 kB took 1.5 GB."""
    noise = rng.integers(0, 60000, (60, 50), np.uint16)
    lg.save(lg.RawImage(noise), tmp_path / "a.zarr")
    chunk = tmp_path / "a.zarr" / "data" / "c" / "0" / "0"
    whole, second = chunk.read_bytes(), Zstd(3).encode(bytes(9 << 20))
    np.testing.assert_array_equal(lg.open(tmp_path / "a.zarr").data, noise)
    for content in (Zstd(3).encode(bytes(9)) + second, whole + second, whole + bytes(1), whole[:-1]):
        chunk.write_bytes(content)
        with pytest.raises(FormatError, match="a chunk becomes an unknown number of bytes"):
            lg.open(tmp_path / "a.zarr")
