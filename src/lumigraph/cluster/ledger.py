"""Record of a job's finished frames: a folder beside its output, written by any number of processes.

Each entry is a separate file, written in one step after the frame's shards, and names their checksums: it
counts while the shards are as it says. A worker claims a frame by a lock on one byte of a file; the system
gives it back when the worker ends, however it ends.
"""

import json
import os
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from datetime import datetime
from itertools import pairwise
from pathlib import Path
from typing import Any

from lumigraph import store
from lumigraph.errors import FormatError

try:
    import fcntl
except ImportError:  # Windows: two starts at once are not told apart
    fcntl = None

FORMAT = 1
ENDING = ".ledger"
_DONE, _FAILED = "done", "failed"
_LATEST, _PAUSE = 65, 10
"""Frames whose times say how fast it goes, and what is longer than the usual step by this is none."""

PAGE, LINK = "status.html", "dashboard.txt"
"""A page that says how it stands, and the address of the scheduler's own."""

_MEMORY = 1 << 26
"""Bytes of a job's description that are read at most."""


@dataclass(frozen=True, slots=True)
class Entry:
    """Record of a frame that is done.

    Parameters
    ----------
    number
        Number of the frame.
    seconds
        Time that it took [s].
    memory
        Most that its worker had held until then [bytes].
    size
        Size of its files [bytes].
    where
        Machine and process.
    files
        Size and CRC-32 of each file that it wrote, by its name in the output.
    values
        Numbers by name, of jobs that give a table.
    notes
        Warnings.
    busy
        Processor time that it took [s].
    """

    number: int
    seconds: float = 0.0
    memory: int = 0
    size: int = 0
    where: str = ""
    files: dict[str, tuple[int, int]] = field(default_factory=dict)
    values: dict[str, Any] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    busy: float = 0.0


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
        asked = {"format": FORMAT, "what": dict(what), "items": list(items)}
        asked = json.loads(json.dumps(asked))  # as it will be read back
        if not (self.folder / "job.json").exists():
            for name in (_DONE, _FAILED):
                (self.folder / name).mkdir(parents=True, exist_ok=True)
            store.write_bytes(self.folder / "job.json", json.dumps(asked).encode())
        begun = self.job()
        for name in ("format", "what", "items"):
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
            No ledger, or a damaged one.
        """
        path = self.folder / "job.json"
        try:
            if path.stat().st_size > _MEMORY:
                raise ValueError(f"it has {path.stat().st_size} bytes")
            found = json.loads(path.read_bytes())
            return {name: found[name] for name in ("format", "what", "items")}
        except OSError:
            raise FormatError(f"{self.folder} is not the ledger of a job. Check the path.") from None
        except (ValueError, KeyError, TypeError) as error:
            raise FormatError(f"{path} is damaged ({error}). Remove the ledger and the output.") from None

    @property
    def noun(self) -> str:
        """Name of an item: a frame, or a run of as many as the job says."""
        run = self.job()["what"].get("run")
        return f"run of {run} frames" if run else "frame"

    def entry(self, number: int) -> Entry | None:
        """Entry of a frame; None if there is none, or it is incomplete."""
        with suppress(OSError, ValueError, TypeError, AttributeError):
            found = json.loads(self._path(_DONE, number).read_bytes())
            found["files"] = {name: tuple(pair) for name, pair in found["files"].items()}
            return Entry(**found)
        return None

    def entries(self) -> dict[int, Entry]:
        """All of them, by the numbers of their frames."""
        found = ((number, self.entry(number)) for number in self._numbers(_DONE))
        return {number: entry for number, entry in found if entry is not None}

    def failures(self) -> dict[int, str]:
        """Why frames failed that are not done, by their numbers."""
        found = {}
        for number in self._numbers(_FAILED):
            with suppress(OSError, ValueError, KeyError, TypeError):
                found[number] = str(json.loads(self._path(_FAILED, number).read_bytes())["error"])
        return found

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
        store.write_bytes(self._path(_DONE, entry.number), json.dumps(content).encode(), flush=False)
        self._path(_FAILED, entry.number).unlink(missing_ok=True)

    def fail(self, number: int, error: str) -> None:
        """Note why a frame failed."""
        store.write_bytes(self._path(_FAILED, number), json.dumps({"error": error}).encode(), flush=False)

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
            return sorted(int(name) for name in names if name.isdecimal())
        return []

    def _path(self, kind: str, number: int) -> Path:
        return self.folder / kind / f"{number:06}.json"


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


def _difference(begun: Any, asked: Any, name: str) -> str:
    """The first place where two descriptions differ, in words."""
    if isinstance(begun, Mapping) and isinstance(asked, Mapping):
        for key in [*begun, *asked]:
            if begun.get(key) != asked.get(key):
                found = _difference(begun.get(key), asked.get(key), key)
                return _of_file(begun, asked) if key in ("size", "modified") and "file" in begun else found
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
    when = [
        datetime.fromtimestamp(one.get("modified", 0) / 1e9).isoformat(" ", "milliseconds")
        for one in (begun, asked)
    ]
    return f"{name} was modified at {when[0]}, now at {when[1]}"


def require_free(output: Path) -> None:
    """Refuse an output that no job can have begun, before anything is written.

    Raises
    ------
    FormatError
        Its folder does not exist, or it is somebody else's.
    """
    if not output.parent.is_dir():
        raise FormatError(f"the folder {output.parent} for {output.name} does not exist. Make it first.")
    if output.exists() and not (Ledger.beside(output).folder / "job.json").exists():
        raise FormatError(f"{output} exists and has no ledger. Remove it, or give another output.")
