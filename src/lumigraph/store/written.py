"""Records of the command that wrote a file, in the user's cache folder: another command's output is kept.

A record holds as long as the file is as it was written. Without a cache folder nothing is known.
"""

import hashlib
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from lumigraph.errors import FormatError
from lumigraph.store.array_cache import folder
from lumigraph.store.notes import read_note, write_note
from lumigraph.store.sealed import DamagedError

MOST = 2000
"""Records that are kept; the oldest go."""


def note_writer(path: Path, command: Sequence[str]) -> None:
    """Record the words of the command that has just written a file; a full disk is no error."""
    place = _place(path)
    if place is None:
        return
    with suppress(OSError, FormatError):
        place.parent.mkdir(parents=True, exist_ok=True)
        write_note(place, {"file": _as_it_is(path), "command": list(command)}, flush=False)
        records = list(place.parent.iterdir())
        if len(records) > MOST:
            for old in sorted(records, key=lambda one: one.stat().st_mtime)[: len(records) - MOST * 9 // 10]:
                old.unlink()


def writer_of(path: Path) -> list[str] | None:
    """Words of the command that wrote a file; None if that is not known, or the file has changed since."""
    place = _place(path)
    if place is None:
        return None
    try:
        found = read_note(place)
        return [str(word) for word in found["command"]] if found["file"] == _as_it_is(path) else None
    except (OSError, DamagedError, KeyError, TypeError):
        return None


def _place(path: Path) -> Path | None:
    where = folder()
    name = hashlib.sha256(str(path.resolve()).encode("utf-8", "surrogateescape")).hexdigest()[:32]
    return None if where is None else where / "written" / f"{name}.json"


def _as_it_is(path: Path) -> list[Any]:
    about = path.stat()
    return [about.st_size if path.is_file() else 0, about.st_mtime_ns]
