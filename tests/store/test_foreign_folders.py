"""What carries the name of a writer's workplace and is none: it stays, wherever it leads."""

import os
import stat

import numpy as np
import pytest

import lumigraph as lg
from lumigraph import store
from lumigraph.store import atomic

DRAWN = ".lumigraph-0123456789ab"
"""A name that a writer could have drawn."""

pytestmark = pytest.mark.skipif(atomic.fcntl is None, reason="nothing is removed without locks")


@pytest.fixture(autouse=True)
def fresh(monkeypatch):
    """As at the start of a process."""
    monkeypatch.setattr(atomic, "_SWEPT", set())


def workplace(folder, name=DRAWN, **files):
    """What a killed writer leaves."""
    place = folder / name
    place.mkdir(mode=0o700)
    (place / "workplace").write_bytes(atomic._mark(name))
    for path, text in files.items():
        (place / path).parent.mkdir(parents=True, exist_ok=True)
        (place / path).write_text(text)
    return place


def saved_beside(folder):
    lg.save(np.eye(8, dtype=np.uint8), folder / "out.png")


def test_what_a_killed_writer_leaves_goes(tmp_path):
    workplace(tmp_path, new="half")
    (tmp_path / ".lumigraph-aaaaaaaaaaaa").mkdir(mode=0o700)  # it died before it left its mark
    saved_beside(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["out.png"]


@pytest.mark.parametrize(
    "name",
    [
        ".lumigraph-notes", ".lumigraph-cache", ".lumigraph-", ".lumigraph-0", DRAWN, DRAWN[:-1], DRAWN + "0",
        DRAWN.upper(), DRAWN + "\n",
    ],
)  # fmt: skip
def test_folders_of_such_names_stay_with_all_that_is_in_them(tmp_path, name):
    for inside in ("thesis.tex", "new", "old/letters/a.txt", "workplace"):
        (tmp_path / name / inside).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name / inside).write_text("precious")
    (tmp_path / name).chmod(0o700)
    before = sorted(path for path in tmp_path.rglob("*"))
    saved_beside(tmp_path)
    assert sorted(tmp_path.rglob("*")) == sorted([*before, tmp_path / "out.png"])


def harmed_extra(place, away):
    (place / "thesis.tex").write_text("precious")


def harmed_renamed(place, away):
    """A copy under another name, such as a backup."""
    place.rename(place.with_name(".lumigraph-ba9876543210"))


def harmed_open(place, away):
    place.chmod(0o755)


def harmed_mark_link(place, away):
    (away / "mark").write_bytes((place / "workplace").read_bytes())
    (place / "workplace").unlink()
    (place / "workplace").symlink_to(away / "mark")


def harmed_mark_twice(place, away):
    os.link(place / "workplace", away / "mark")


def harmed_mark_pipe(place, away):
    (place / "workplace").unlink()
    os.mkfifo(place / "workplace")


def harmed_old_link(place, away):
    (away / "letters").mkdir()
    (away / "letters" / "a.txt").write_text("precious")
    (place / "old").symlink_to(away / "letters")


def harmed_old_two(place, away):
    for name in ("a", "b"):
        (place / "old" / name).mkdir(parents=True)


def harmed_old_file(place, away):
    (place / "old").mkdir()
    (place / "old" / "a").write_text("precious")


HARMS = [value for name, value in sorted(globals().items()) if name.startswith("harmed_")]


@pytest.mark.parametrize("harm", HARMS, ids=lambda harm: harm.__name__)
def test_a_workplace_with_anything_of_somebody_else_stays_whole(tmp_path, harm):
    here, away = tmp_path / "here", tmp_path / "away"
    here.mkdir()
    away.mkdir()
    harm(workplace(here, new="half"), away)
    before = sorted(tmp_path.rglob("*"))
    saved_beside(here)
    assert sorted(tmp_path.rglob("*")) == sorted([*before, here / "out.png"])


def test_links_of_such_a_name_lead_nowhere(tmp_path):
    here, away = tmp_path / "here", tmp_path / "away"
    here.mkdir()
    away.mkdir()
    place = workplace(away, new="half")
    (here / DRAWN).symlink_to(place)
    (here / ".lumigraph-000000000000").symlink_to(away)
    (away / "old").mkdir()
    (away / "old" / "letters.txt").write_text("precious")
    saved_beside(here)
    assert (place / "new").read_text() == "half"
    assert (away / "old" / "letters.txt").read_text() == "precious"
    assert (here / DRAWN).is_symlink()


def test_links_inside_a_workplace_go_and_what_they_lead_to_stays(tmp_path):
    (tmp_path / "away").mkdir()
    (tmp_path / "away" / "a").write_text("precious")
    here = tmp_path / "here"
    here.mkdir()
    (workplace(here) / "new").symlink_to(tmp_path / "away")
    saved_beside(here)
    assert [path.name for path in here.iterdir()] == ["out.png"]
    assert (tmp_path / "away" / "a").read_text() == "precious"


@pytest.mark.skipif(os.name == "nt" or os.geteuid() != 0, reason="only root gives files to others")
@pytest.mark.parametrize("of", ["", "workplace"])
def test_a_workplace_of_another_user_stays(tmp_path, of):
    place = workplace(tmp_path, new="half")
    os.chown(place / of, 12345, -1)
    saved_beside(tmp_path)
    assert (place / "new").read_text() == "half"


def test_readers_do_not_wait_for_folders_of_others(tmp_path):
    (tmp_path / ".lumigraph-notes" / "old" / "a.zarr").mkdir(parents=True)
    assert not store.restored(tmp_path / "a.zarr")
    assert (tmp_path / ".lumigraph-notes" / "old" / "a.zarr").is_dir()


def test_a_folder_whose_group_is_inherited_is_swept_too(tmp_path):
    tmp_path.chmod(stat.S_IMODE(tmp_path.stat().st_mode) | stat.S_ISGID)
    workplace(tmp_path, new="half")
    saved_beside(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["out.png"]


@pytest.mark.parametrize("hidden", [".git", ".notes.txt", ".lumigraph-notes"])
def test_an_output_folder_with_hidden_files_of_others_is_not_replaced(tmp_path, hidden):
    output = tmp_path / "a.zarr"
    lg.save(np.eye(8, dtype=np.uint8), output)
    (output / hidden).write_text("precious")
    with pytest.raises(lg.FormatError, match=r"would remove \.\w"):
        lg.save(np.eye(8, dtype=np.uint8), output)
    (output / hidden).unlink()
    (output / ".DS_Store").write_text("of a file manager")
    lg.save(np.eye(8, dtype=np.uint8), output)


def test_a_store_with_a_folder_of_photographs_is_not_replaced(tmp_path):
    output = tmp_path / "a.zarr"
    lg.save(np.eye(8, dtype=np.uint8), output)
    (output / "photographs").mkdir()
    with pytest.raises(lg.FormatError, match="would remove photographs"):
        lg.save(np.eye(8, dtype=np.uint8), output)
