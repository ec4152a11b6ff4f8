"""Writers that die, meet, or find another's leftovers."""

import os
import signal
import subprocess
import sys
import time

import pytest

from lumigraph import store
from lumigraph.errors import FormatError
from lumigraph.store import atomic


@pytest.fixture(autouse=True)
def fresh(monkeypatch):
    """As at the start of a process."""
    monkeypatch.setattr(atomic, "_SWEPT", set())


WRITER = """
import sys, time
from lumigraph import store
with store.replacing(sys.argv[1]) as temporary:
    temporary.write_bytes(b"new")
    print("writing", flush=True)
    time.sleep(60)
"""


def writer(path):
    process = subprocess.Popen([sys.executable, "-c", WRITER, str(path)], stdout=subprocess.PIPE)
    assert process.stdout is not None
    process.stdout.readline()
    return process


def test_what_a_dead_writer_left_goes_at_the_next_start_and_a_living_ones_stays(tmp_path):
    dead, living = writer(tmp_path / "a"), writer(tmp_path / "b")
    try:
        dead.send_signal(signal.SIGKILL)
        dead.communicate()
        os.utime(next(tmp_path.iterdir()), (0, 0))  # age says nothing
        assert len(list(tmp_path.iterdir())) == 2
        store.write_bytes(tmp_path / "c", b"c")
        left = sorted(path.name for path in tmp_path.iterdir())
        assert len(left) == 2
        assert left[0].startswith(".lumigraph-")
        assert left[1] == "c"
        assert (tmp_path / left[0] / "new").read_bytes() == b"new"
    finally:
        living.kill()
        living.communicate()


def test_a_folder_set_aside_by_a_dead_writer_goes_back(tmp_path):
    """Where the system cannot swap folders, a kill may fall between the two steps."""
    place = tmp_path / ".lumigraph-0123456789ab"
    place.mkdir(mode=0o700)
    (place / "workplace").write_bytes(atomic._mark(place.name))
    for name in ("old/a.zarr", "new"):
        (place / name).mkdir(parents=True)
    (place / "old" / "a.zarr" / "x").write_text("kept")
    assert store.restored(tmp_path / "a.zarr")
    assert (tmp_path / "a.zarr" / "x").read_text() == "kept"
    assert not place.exists()
    begin = time.monotonic()
    assert not store.restored(tmp_path / "none")
    assert time.monotonic() - begin < 0.5


def test_readers_wait_for_a_living_writer_between_two_steps(tmp_path):
    program = """
import sys
from pathlib import Path
from lumigraph.store.atomic import _workplace
with _workplace(Path(sys.argv[1])) as place:
    (place / "old" / "a.zarr").mkdir(parents=True)
    print("between", flush=True)
    sys.stdin.readline()
    (place / "old" / "a.zarr").rename(Path(sys.argv[1]) / "a.zarr")
"""
    process = subprocess.Popen(
        [sys.executable, "-c", program, str(tmp_path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    )
    assert process.stdout is not None
    assert process.stdin is not None
    process.stdout.readline()
    process.stdin.write(b"go\n")
    process.stdin.flush()
    assert store.restored(tmp_path / "a.zarr")
    process.communicate()


def test_mode_and_group_of_the_old_file_stay(tmp_path):
    path = tmp_path / "a"
    path.write_bytes(b"old")
    path.chmod(0o604)
    groups = [group for group in os.getgroups() if group != path.stat().st_gid]
    if os.geteuid() == 0:
        groups = [12345]
    if groups:
        os.chown(path, -1, groups[0])
    store.write_bytes(path, b"new")
    assert path.read_bytes() == b"new"
    assert path.stat().st_mode & 0o7777 == 0o604
    if groups:
        assert path.stat().st_gid == groups[0]


def test_modes_inside_a_folder_stay_and_a_program_does_not_run_as_another_user(tmp_path):
    folder, program = tmp_path / "v", tmp_path / "program"
    for content in ("old", "new"):
        with store.replacing(folder) as temporary:
            (temporary / "c").mkdir(parents=True)
            (temporary / "c" / "0").write_text(content)
        if content == "old":
            (folder / "c" / "0").chmod(0o640)
            (folder / "c").chmod(0o2750)
    assert (folder / "c" / "0").read_text() == "new"
    assert [path.stat().st_mode & 0o7777 for path in (folder / "c", folder / "c" / "0")] == [0o2750, 0o640]
    program.write_bytes(b"old")
    program.chmod(0o4755)
    store.write_bytes(program, b"new")
    assert program.stat().st_mode & 0o7777 == 0o755


def test_a_legal_name_of_255_bytes_is_written(tmp_path):
    path = tmp_path / ("a" * 250 + ".png")
    for content in (b"old", b"new"):
        store.write_bytes(path, content)
    assert path.read_bytes() == b"new"
    folder = tmp_path / ("b" * 250)
    for _ in range(2):
        with store.replacing(folder) as temporary:
            temporary.mkdir()
    assert folder.is_dir()


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (OSError(28, "No space left on device"), "the disk of .* is full. Free some space"),
        (OSError(27, "File too large"), "the system takes no file as large as that"),
        (OSError("120000 requested and 73436 written"), "the system takes no file as large as that"),
        (PermissionError(13, "Permission denied"), "Permission denied. Choose another folder"),
    ],
)
def test_what_the_system_refuses_is_one_line_that_names_the_file(tmp_path, error, said):
    (tmp_path / "a").write_bytes(b"old")
    with pytest.raises(FormatError, match=rf"a was not written: {said}"), store.replacing(tmp_path / "a"):
        raise error
    assert (tmp_path / "a").read_bytes() == b"old"
    assert [path.name for path in tmp_path.iterdir()] == ["a"]
