"""Whoever is stopped while writing leaves the old file or the new one, never half of one."""

import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

import lumigraph.io as io
from lumigraph.core.grid import Grid
from lumigraph.core.lightfield import LightField
from lumigraph.errors import FormatError
from lumigraph.store import atomic

NAMES = ["a.png", "a.tiff", "a.zarr", "a.zarr.zip", "a.h5", "a.pfm"]


@pytest.mark.parametrize("name", NAMES)
def test_an_old_file_is_replaced_and_nothing_else_stays(tmp_path, name):
    for value in (1, 2):
        io.save(np.full((4, 4), value, np.uint8), tmp_path / name)
    assert io.open(tmp_path / name).data.max() == 2
    assert [path.name for path in tmp_path.iterdir()] == [name]


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("failure", [OSError("disk full"), KeyboardInterrupt()])
def test_a_failure_before_the_end_keeps_the_old_file(tmp_path, monkeypatch, name, failure):
    io.save(np.ones((4, 4), np.uint8), tmp_path / name)

    def fail(*_):
        raise failure

    monkeypatch.setattr(atomic, "_take_place", fail)
    with pytest.raises(FormatError if isinstance(failure, OSError) else type(failure)):
        io.save(np.full((4, 4), 2, np.uint8), tmp_path / name)
    assert io.open(tmp_path / name).data.max() == 1
    assert [path.name for path in tmp_path.iterdir()] == [name]


def test_a_store_is_replaced_where_the_system_cannot_swap_folders(tmp_path, monkeypatch):
    monkeypatch.setattr(atomic, "_exchanged", lambda *_: False)
    for value in (1, 2):
        io.save(np.full((4, 4), value, np.uint8), tmp_path / "a.zarr")
    assert io.open(tmp_path / "a.zarr").data.max() == 2
    assert [path.name for path in tmp_path.iterdir()] == ["a.zarr"]


def test_a_link_stays_a_link(tmp_path):
    (tmp_path / "folder").mkdir()
    (tmp_path / "link.png").symlink_to(tmp_path / "folder" / "a.png")
    io.save(np.ones((4, 4), np.uint8), tmp_path / "link.png")
    assert (tmp_path / "link.png").is_symlink()
    assert (tmp_path / "folder" / "a.png").is_file()


def test_a_folder_that_is_no_store_is_never_replaced(tmp_path):
    (tmp_path / "a.zarr").mkdir()
    (tmp_path / "a.zarr" / "precious.txt").write_text("mine")
    with pytest.raises(FormatError, match="is a folder that holds no Zarr store"):
        io.save(np.ones((4, 4)), tmp_path / "a.zarr")
    (tmp_path / "a.png").mkdir()
    with pytest.raises(FormatError, match=r"is a folder. Give the name of a file"):
        io.save(np.ones((4, 4)), tmp_path / "a.png")
    assert (tmp_path / "a.zarr" / "precious.txt").read_text() == "mine"


@pytest.mark.parametrize("name", ["v", "a.zarr"])
def test_notes_beside_views_or_in_a_store_are_not_removed(tmp_path, name):
    views = LightField(np.ones((2, 2, 3, 4), np.uint8), Grid((2, 2), 1e-3), Grid((3, 4), 1e-4), 0.01)
    for _ in range(2):
        io.save(views, tmp_path / name)
    (tmp_path / name / ".DS_Store").write_text("by the system")
    (tmp_path / name / "notes.txt").write_text("mine")
    with pytest.raises(FormatError, match=r"would remove notes\.txt, which it holds too"):
        io.save(views, tmp_path / name)
    assert (tmp_path / name / "notes.txt").read_text() == "mine"
    (tmp_path / name / "notes.txt").unlink()
    io.save(views, tmp_path / name)


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_a_folder_that_may_not_be_written_to_is_named(tmp_path):
    tmp_path.chmod(0o500)
    with pytest.raises(FormatError, match="may not be written to"):
        io.check_target(tmp_path / "a.png")


LOOP = """
import sys, numpy as np, lumigraph.io as io
value = 0
while True:
    value = value % 200 + 1
    io.save(np.full((256, 256), value, np.uint8), sys.argv[1])
    print("saved", flush=True)
"""


@pytest.mark.parametrize("name", ["a.tiff", "a.zarr"])
def test_a_kill_leaves_a_whole_file(tmp_path, name):
    path = tmp_path / name
    for delay in (0.003, 0.011):
        process = subprocess.Popen([sys.executable, "-c", LOOP, str(path)], stdout=subprocess.PIPE)
        assert process.stdout is not None
        process.stdout.readline()
        time.sleep(delay)
        process.send_signal(signal.SIGKILL)
        process.communicate()
        data = io.open(path).data
        assert data.shape == (256, 256)
        assert data.min() == data.max() > 0
