"""Record of a job's finished frames: a folder beside its output, written by any number of processes.

An entry is a file of its own, written in one step after the frame's shards, with a checksum of itself and
those of the shards: it counts while all are as it says. The files that describe the store are kept here, too,
and put back where they differ. A worker claims a frame by a lock on one byte of a file; the system
gives it back when the worker ends, however it ends.
"""

import json
import os
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from datetime import datetime
from itertools import pairwise
from pathlib import Path
from typing import Any

import lumigraph
from lumigraph import store
from lumigraph.cluster.entry import Entry, is_entry, is_inside, is_kind
from lumigraph.errors import FormatError

try:
    import fcntl
except ImportError:  # Windows: two starts at once are not told apart
    fcntl = None

FORMAT = 2
ENDING = ".ledger"
_DONE, _FAILED, _JOB, _STORE = "done", "failed", "job.json", "store.json"
_LATEST, _PAUSE = 65, 10
"""Frames whose times say how fast it goes, and what is longer than the usual step by this is none."""

PAGE, LINK = "status.html", "dashboard.txt"
"""A page that says how it stands, and the address of the scheduler's own."""

_LONGEST = 2000
"""Characters of a reason or a warning that are shown at most."""


@dataclass(frozen=True, slots=True)
class Ledger:
    """The entries of a job.

    Parameters
    ----------
    folder
        Folder of the ledger's files.
    """

    folder: Path

    @classmethod
    def beside(cls, output: Path) -> "Ledger":
        """Ledger of an output."""
        return cls(output.with_name(output.name + ENDING))

    def open(self, what: Mapping[str, Any], items: Sequence[Any]) -> None:
        """Note what the job is and what its frames are, or compare them with what was noted.

        Raises
        ------
        FormatError
            The output was begun by another command, or its inputs have changed since.
        """
        asked = {"format": FORMAT, "version": lumigraph.__version__, "what": dict(what), "items": list(items)}
        asked = json.loads(json.dumps(asked))  # as it will be read back
        if not (self.folder / _JOB).exists():
            for name in (_DONE, _FAILED):
                (self.folder / name).mkdir(parents=True, exist_ok=True)
            store.write_note(self.folder / _JOB, asked)
        begun = self.job()
        for name in asked:
            if begun[name] != asked[name]:
                raise FormatError(
                    f"{self.folder} belongs to another job: {_difference(begun[name], asked[name], name)}. "
                    "Give another output, or remove this one and its ledger."
                )

    def job(self) -> dict[str, Any]:
        """Description of the job.

        Raises
        ------
        FormatError
            No ledger, a damaged one, or one of a lumigraph that noted other things.
        """
        path = self.folder / _JOB
        try:
            found = store.read_note(path)
        except OSError:
            raise FormatError(f"{self.folder} is not the ledger of a job. Check the path.") from None
        except store.DamagedError as error:
            raise FormatError(
                f"{path} is damaged, or of another version of lumigraph. Remove the ledger and the output."
            ) from error
        kinds = {"format": int, "version": str, "what": dict, "items": list}
        wrong = [
            name for name in kinds if not is_kind(found, dict) or not is_kind(found.get(name), kinds[name])
        ]
        if wrong:
            raise FormatError(f"{path} is damaged ({wrong[0]}). Remove the ledger and the output.")
        return {name: found[name] for name in kinds}

    @property
    def noun(self) -> str:
        """Name of an item: a frame, or a run of as many as the job says."""
        run = self.job()["what"].get("run")
        return f"run of {run} frames" if is_kind(run, int) and run > 0 else "frame"

    def entry(self, number: int) -> Entry | None:
        """That of a frame; None where there is none, or a damaged one."""
        with suppress(OSError, FormatError):
            return self._read(number)
        return None

    def _read(self, number: int) -> Entry:
        """That of a frame.

        Raises
        ------
        DamagedError
            It is not as it was written.
        OSError
            There is none.
        """
        path = self._path(_DONE, number)
        found = store.read_note(path)
        if not is_entry(found, number):
            raise store.DamagedError(f"{path} is damaged: it is no entry of frame {number}. Remove it.")
        return Entry(**{**found, "files": {name: tuple(pair) for name, pair in found["files"].items()}})

    def entries(self) -> dict[int, Entry]:
        """All of them, by the numbers of their frames; damaged ones are left out."""
        found = ((number, self.entry(number)) for number in self._numbers(_DONE))
        return {number: entry for number, entry in found if entry is not None}

    def all_entries(self) -> dict[int, Entry]:
        """All of them, for a table.

        Raises
        ------
        DamagedError
            One is not as it was written; the next start makes it again.
        """
        found = {}
        for number in self._numbers(_DONE):
            try:
                found[number] = self._read(number)
            except store.DamagedError as error:
                raise store.DamagedError(f"{str(error).partition(': ')[0]}. Start the same again.") from None
        return found

    def failures(self) -> dict[int, str]:
        """Why frames failed that are not done, by their numbers."""
        found = {}
        for number in self._numbers(_FAILED):
            with suppress(OSError, FormatError, KeyError, TypeError):
                found[number] = str(store.read_note(self._path(_FAILED, number))["error"])[:_LONGEST]
        return found

    def keep_store(self, files: Mapping[str, str]) -> None:
        """Keep the files that describe the store, by their names in it, before it takes its place."""
        store.write_note(self.folder / _STORE, dict(files))

    def mend_store(self, output: Path) -> None:
        """Put back what describes a store where it is not as it was made.

        Raises
        ------
        FormatError
            What it was is not known.
        """
        path = self.folder / _STORE
        try:
            kept = store.read_note(path)
            if not is_kind(kept, dict) or not all(
                is_inside(name) and is_kind(kept[name], str) for name in kept
            ):
                raise store.DamagedError(f"{path} is damaged. Remove it.")
        except FileNotFoundError:
            if output.exists():
                raise FormatError(
                    f"{path} is missing, so nobody knows whether {output} is whole. {_ANEW}"
                ) from None
            return
        except (OSError, store.DamagedError) as error:
            raise FormatError(
                f"{path} is damaged: nobody knows whether {output} is whole. {_ANEW}"
            ) from error
        for name, text in kept.items() if output.exists() else ():
            _put(output / name, text.encode())

    def pace(self) -> float:
        """Frames a second by when the last ones were noted, by whatever worker; 0 while that is not known.

        Times without work, as between two starts, are left out: those ten times as long as the usual one.
        """
        times = []
        for number in self._numbers(_DONE):
            with suppress(OSError):
                times.append(self._path(_DONE, number).stat().st_mtime)
        times = sorted(times)[-_LATEST:]
        steps = sorted(late - early for early, late in pairwise(times))
        usual = steps[len(steps) // 2] if steps else 0.0
        kept = [step for step in steps if step <= max(_PAUSE * usual, 1.0)]
        return len(kept) / sum(kept) if sum(kept) > 0 else 0.0

    def record(self, entry: Entry) -> None:
        """Note that a frame is done; its shards are in place."""
        content = {name: getattr(entry, name) for name in Entry.__slots__}
        store.write_note(self._path(_DONE, entry.number), content, flush=False)
        self._path(_FAILED, entry.number).unlink(missing_ok=True)

    def fail(self, number: int, error: str) -> None:
        """Note why a frame failed."""
        store.write_note(self._path(_FAILED, number), {"error": error}, flush=False)

    def forget(self, number: int) -> None:
        """Take back what was noted of a frame."""
        for kind in (_DONE, _FAILED):
            self._path(kind, number).unlink(missing_ok=True)

    @contextmanager
    def claimed(self, number: int) -> Iterator[bool]:
        """Context that says whether a frame is this process' own: nobody else works on it."""
        with _locked(self.folder / "claims", number, 1) as mine:
            yield mine

    @contextmanager
    def started(self, first: int, last: int) -> Iterator[None]:
        """Context in which frames from `first` up to `last` are this start's own.

        Raises
        ------
        FormatError
            Another start works on some of them.
        """
        with _locked(self.folder / "starts", first, max(last - first, 1)) as mine:
            if not mine:
                raise FormatError(f"{self.folder} is in use by another run. Wait for it, or stop it first.")
            yield

    @contextmanager
    def alone(self) -> Iterator[None]:
        """Context in which no other process makes what all of them need."""
        with _locked(self.folder / "making", 0, 1, wait=True):
            yield

    def _numbers(self, kind: str) -> list[int]:
        with suppress(OSError):
            names = (entry.name.partition(".")[0] for entry in os.scandir(self.folder / kind))
            return sorted(
                {int(name) for name in names if name.isascii() and name.isdecimal() and len(name) < 10}
            )
        return []

    def _path(self, kind: str, number: int) -> Path:
        return self.folder / kind / f"{number:06}.json"


_ANEW = "Remove it and its ledger, and begin anew."


def _put(path: Path, content: bytes) -> None:
    """Write a file that does not hold this."""
    try:
        if path.is_file() and path.stat().st_size == len(content) and path.read_bytes() == content:
            return
    except OSError:
        pass
    path.parent.mkdir(parents=True, exist_ok=True)
    store.write_bytes(path, content)


_HELD: set[tuple[str, int]] = set()
_GUARD = threading.Lock()
"""Locks of files are the process' own: threads of one are distinguished here."""


@contextmanager
def _locked(path: Path, first: int, count: int, *, wait: bool = False) -> Iterator[bool]:
    keys = {(str(path), k) for k in range(first, first + count)}
    while not (mine := _take(keys)) and wait:
        time.sleep(0.02)
    try:
        yield mine and _lock(path, first, count, wait)
    finally:
        if mine:
            _unlock(path, first, count)
            with _GUARD:
                _HELD.difference_update(keys)


def _take(keys: set[tuple[str, int]]) -> bool:
    with _GUARD:
        free = not (keys & _HELD)
        if free:
            _HELD.update(keys)
        return free


_FILES: dict[str, int] = {}
"""Descriptors stay open: closing one would give back all locks of this process on its file."""


def _lock(path: Path, first: int, count: int, wait: bool) -> bool:
    if fcntl is None:
        return True
    with _GUARD:
        name = str(path)
        if name not in _FILES or not _is_same(path, _FILES[name]):
            _FILES[name] = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
    try:
        fcntl.lockf(_FILES[name], fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB), count, first)
        return True
    except OSError:
        return False


def _unlock(path: Path, first: int, count: int) -> None:
    if fcntl is not None and str(path) in _FILES:
        with suppress(OSError):
            fcntl.lockf(_FILES[str(path)], fcntl.LOCK_UN, count, first)


def _is_same(path: Path, descriptor: int) -> bool:
    with suppress(OSError):
        return os.path.samestat(path.stat(), os.fstat(descriptor))
    return False


_OF_FILES = ("size", "modified", "blake2b")


def _difference(begun: Any, asked: Any, name: str) -> str:
    """The first place where two descriptions differ, in words."""
    if isinstance(begun, Mapping) and isinstance(asked, Mapping):
        for key in [*begun, *asked]:
            if begun.get(key) != asked.get(key):
                found = _difference(begun.get(key), asked.get(key), key)
                return _of_file(begun, asked) if key in _OF_FILES and "file" in begun else found
    if isinstance(begun, list) and isinstance(asked, list):
        if len(begun) != len(asked):
            return f"it has {len(begun)} {name}, now {len(asked)}"
        for k, (one, other) in enumerate(zip(begun, asked, strict=True)):
            if one != other:
                before = str(begun[k - 1]) if k else ""
                return _difference(one, other, before if before.startswith("-") else name)
    return f"its {name} is {str(begun)[:80]}, now {str(asked)[:80]}"


def _of_file(begun: Mapping[str, Any], asked: Mapping[str, Any]) -> str:
    """Difference between two files of the same name, in words."""
    name = Path(str(begun["file"])).name
    if begun.get("size") != asked.get("size"):
        return f"{name} had {begun.get('size')} bytes, now {asked.get('size')}"
    if begun.get("modified") == asked.get("modified"):
        return f"{name} has another content, though its size and time are the same"
    when = [_when(one.get("modified")) for one in (begun, asked)]
    return f"{name} was modified at {when[0]}, now at {when[1]}"


def _when(modified: Any) -> str:
    """A time in words; what a damaged ledger says instead of one as it is."""
    try:
        return datetime.fromtimestamp(modified / 1e9).isoformat(" ", "milliseconds")
    except (TypeError, ValueError, OverflowError, OSError):
        return str(modified)[:80]


def require_free(output: Path) -> None:
    """Refuse an output that no job can have begun, before anything is written.

    Raises
    ------
    FormatError
        Its folder does not exist, or it is somebody else's.
    """
    if not output.parent.is_dir():
        raise FormatError(f"the folder {output.parent} for {output.name} does not exist. Make it first.")
    if output.exists() and not (Ledger.beside(output).folder / _JOB).exists():
        raise FormatError(f"{output} exists and has no ledger. Remove it, or give another output.")
