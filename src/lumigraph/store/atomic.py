"""Atomic writing: a kill leaves the old file or the new one; what else it leaves goes at the next start.

What is new is written in a workplace, a hidden folder beside the target that its writer holds locked. The
system gives the lock back when the writer ends, however it ends: an unlocked workplace is a dead writer's.

Somebody else's folder may have such a name. A workplace is removed only where this user owns it, its name is
one that a writer draws, it holds a mark with that name, and nothing but what a writer puts there. It is
opened once, without following links, and what is in it is reached through that opening alone.
"""

import ctypes
import errno
import os
import re
import secrets
import shutil
import stat
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from lumigraph.errors import FormatError

try:
    import fcntl
except ImportError:  # Windows: what a killed writer left stays
    fcntl = None

PREFIX = ".lumigraph-"
"""Names of workplaces begin with it; 12 hexadecimal digits follow."""

_NAME = re.compile(re.escape(PREFIX) + "[0-9a-f]{12}")
_NEW, _OLD, _MARK = "new", "old", "workplace"
_EXCHANGE = 2  # RENAME_EXCHANGE of Linux' renameat2, RENAME_SWAP of macOS' renamex_np
_HERE = -100  # AT_FDCWD
_SWEPT: set[Path] = set()
"""Folders that this process has cleared of dead writers' workplaces."""

_PATIENCE = 2.0
"""Longest time between the two steps of a living writer [s]."""


def write_bytes(path: str | os.PathLike[str], content: bytes, *, flush: bool = True) -> None:
    """Write a file atomically.

    Parameters
    ----------
    path, content
        Path and content of the file.
    flush
        True to wait until the disk has it. Without, a cut of the power may leave a torn file, though a
        kill does not: for files whose checksum is kept elsewhere.

    Raises
    ------
    FormatError
        The disk is full or may not be written to; the old file stays.
    """
    with replacing(path, flush=flush) as temporary:
        temporary.write_bytes(content)


@contextmanager
def replacing(path: str | os.PathLike[str], *, flush: bool = True) -> Iterator[Path]:
    """Context that gives a temporary path, which takes the place of `path` at the end.

    The temporary path does not exist yet: write a file there, or make a folder. If the block fails it
    is removed and what was at `path` stays. The new file takes over the old one's mode and group.

    Raises
    ------
    FormatError
        The disk is full or may not be written to; the old file stays.
    """
    target = Path(path)
    if target.is_symlink():
        target = target.resolve()
    with _told(target), _workplace(target.parent) as place:
        # A folder in between: encoders read the ending, and a name of 255 bytes cannot be lengthened.
        temporary = place / _NEW
        yield temporary
        _take_over(target, temporary)
        if flush:
            _flush(temporary)
        _take_place(temporary, target)
    if flush:
        _flush_entry(target.parent)


def sweep(folder: Path) -> None:
    """Remove the workplaces of dead writers; what they had set aside and not yet replaced goes back.

    Anything else is left alone, whatever its name.
    """
    with suppress(OSError):
        for name in [entry.name for entry in os.scandir(folder) if _NAME.fullmatch(entry.name)]:
            with suppress(OSError):
                _clear(folder / name)


def sweep_once(folder: Path) -> None:
    """Run `sweep`, unless this process has done so."""
    if folder not in _SWEPT:
        _SWEPT.add(folder)
        sweep(folder)


def restored(path: Path) -> bool:
    """True if `path` exists after all: a writer may pause, or have died, between two steps."""
    end = time.monotonic() + _PATIENCE
    while not path.exists() and _set_aside(path) and time.monotonic() < end:
        sweep(path.parent)
        time.sleep(0.01)
    return path.exists()


def _set_aside(path: Path) -> bool:
    try:
        names = [entry.name for entry in os.scandir(path.parent) if _NAME.fullmatch(entry.name)]
        olds = [path.parent / name / _OLD for name in names]
        return any(os.path.lexists(old / path.name) for old in olds if not old.parent.is_symlink())
    except OSError:  # a writer has ended meanwhile
        return True


@contextmanager
def _told(target: Path) -> Iterator[None]:
    """Context in which what the system refuses becomes one `FormatError` naming the target."""
    try:
        yield
    except (OSError, FormatError) as error:
        cause = error if isinstance(error, OSError) else error.__cause__
        if not isinstance(cause, OSError):
            raise
        # A file inside a folder that is written goes by the folder's name.
        raise FormatError(f"{target} was not written: {_reason(cause, target.parent)}") from cause


def _reason(error: OSError, folder: Path) -> str:
    full = error.errno in (errno.ENOSPC, errno.EDQUOT)
    with suppress(OSError):  # NumPy gives no number: "120000 requested and 73436 written"
        full = full or (error.errno is None and shutil.disk_usage(folder).free < 1 << 20)
    if full:
        return f"the disk of {folder} is full. Free some space, or choose another folder."
    if error.errno == errno.EFBIG or "requested and" in str(error):
        return "the system takes no file as large as that. Raise the limit, or choose another folder."
    return f"{error.strerror or error}. Choose another folder."


@contextmanager
def _workplace(folder: Path) -> Iterator[Path]:
    sweep_once(folder)
    place, lock = _locked_folder(folder)
    try:
        yield place
    finally:
        shutil.rmtree(place, ignore_errors=True)
        if lock is not None:
            os.close(lock)


def _locked_folder(folder: Path) -> tuple[Path, int | None]:
    """A new folder, and the descriptor that holds its lock; None where the file system has no locks."""
    place, lock = folder, None
    for _ in range(3):  # another process may clear it before it is locked
        place = folder / f"{PREFIX}{secrets.token_hex(6)}"
        place.mkdir(mode=0o700)
        lock = _lock(place, wait=True)
        if lock is not None or place.exists():
            break
    try:
        (place / _MARK).write_bytes(_mark(place.name))
    except OSError:
        shutil.rmtree(place, ignore_errors=True)
        if lock is not None:
            os.close(lock)
        raise
    return place, lock


def _mark(name: str) -> bytes:
    """What a workplace of this name says of itself: another folder with a copy of it is none."""
    return f"workplace of a writer of lumigraph, {name}; removed when the writer has ended\n".encode()


def _lock(place: Path, *, wait: bool = False) -> int | None:
    """A descriptor that holds a folder's lock; None where it is held, gone, or locks do not exist."""
    if fcntl is None:
        return None
    with suppress(OSError):
        lock = os.open(place, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
            if os.path.samestat(os.fstat(lock), os.lstat(place)):
                return lock
        except OSError:
            pass
        os.close(lock)
    return None


def _clear(place: Path) -> None:
    """Remove a workplace if its writer is dead."""
    lock = _lock(place)
    if lock is None:
        return
    try:
        if not _is_ours(lock, place.name):
            return
        _put_back(lock, place.parent)
        for name in (_NEW, _OLD):
            _remove(name, lock)
        with suppress(FileNotFoundError):
            os.unlink(_MARK, dir_fd=lock)  # last: a kill before it leaves what is still known as ours
        place.rmdir()
    finally:
        os.close(lock)


def _is_ours(folder: int, name: str) -> bool:
    """Whether an open folder is a workplace of this user, to the last entry.

    An empty one counts: its writer died before it left its mark, and only an empty folder is removed then.
    """
    about, inside = os.fstat(folder), set(os.listdir(folder))
    if about.st_uid != os.geteuid() or stat.S_IMODE(about.st_mode) & 0o5077:
        return False
    if not inside:
        return True
    return inside <= {_NEW, _OLD, _MARK} and _marked(folder, name) and _is_aside(folder, inside)


def _marked(folder: int, name: str) -> bool:
    """Whether the mark of this name lies in an open folder, a file of this user with no second name."""
    try:
        mark = os.open(_MARK, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK, dir_fd=folder)
    except OSError:
        return False
    try:
        about, expected = os.fstat(mark), _mark(name)
        if not stat.S_ISREG(about.st_mode) or about.st_uid != os.geteuid() or about.st_nlink != 1:
            return False
        found = os.read(mark, len(expected) + 1)
        # A writer that dies while it marks has put nothing else there yet.
        return found == expected or (expected.startswith(found) and os.listdir(folder) == [_MARK])
    finally:
        os.close(mark)


def _is_aside(folder: int, inside: set[str]) -> bool:
    """Whether what is set aside is as a writer leaves it: one folder at most, in a folder, and no links."""
    if _OLD not in inside:
        return True
    try:
        old = os.open(_OLD, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW, dir_fd=folder)
    except OSError:
        return False
    try:
        kinds = [entry.is_dir(follow_symlinks=False) for entry in os.scandir(old)]
        return len(kinds) <= 1 and all(kinds)
    finally:
        os.close(old)


def _put_back(folder: int, parent: Path) -> None:
    """Move what a dead writer had set aside to where it was, unless the new one has taken its place."""
    with suppress(FileNotFoundError):
        old = os.open(_OLD, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW, dir_fd=folder)
        try:
            for name in os.listdir(old):  # noqa: PTH208 - of an open folder
                if not os.path.lexists(parent / name):
                    os.rename(name, parent / name, src_dir_fd=old)
        finally:
            os.close(old)


def _remove(name: str, folder: int) -> None:
    """Remove a file or a folder from an open folder, without following links."""
    with suppress(FileNotFoundError):
        if stat.S_ISDIR(os.stat(name, dir_fd=folder, follow_symlinks=False).st_mode):
            shutil.rmtree(name, dir_fd=folder)
        else:
            os.unlink(name, dir_fd=folder)


def _take_over(target: Path, temporary: Path) -> None:
    """Give what is new the mode and, where this user may, the group of what it replaces, in folders too."""
    inside = temporary.rglob("*") if temporary.is_dir() else ()
    for path in (temporary, *inside):
        with suppress(OSError):
            old, new = (target / path.relative_to(temporary)).stat(), path.stat()
            if old.st_gid != new.st_gid:
                with suppress(OSError):
                    os.chown(path, -1, old.st_gid)
            path.chmod(old.st_mode & (0o7777 if path.is_dir() else 0o777))


def _take_place(temporary: Path, target: Path) -> None:
    if not temporary.is_dir() or not target.exists():
        temporary.replace(target)  # for files this replaces an old one in one step
    elif not _exchanged(temporary, target):  # two steps, and the old folder is kept until the second
        old = temporary.with_name(_OLD) / target.name
        old.parent.mkdir()
        _flush_entry(temporary.with_name(_MARK))  # after a cut of the power, too, the old folder goes back
        target.rename(old)
        temporary.rename(target)


def _exchanged(one: Path, other: Path) -> bool:
    """Swap two paths in one step where the system can."""
    first, second = os.fsencode(one), os.fsencode(other)
    try:
        system = ctypes.CDLL(None, use_errno=True)
        if sys.platform == "darwin":
            return system.renamex_np(first, second, _EXCHANGE) == 0
        return system.renameat2(_HERE, first, _HERE, second, _EXCHANGE) == 0
    except (AttributeError, OSError):
        return False


def _flush(path: Path) -> None:
    for entry in [*path.rglob("*"), path] if path.is_dir() else [path]:
        _flush_entry(entry)


def _flush_entry(path: Path) -> None:
    with suppress(OSError):  # some file systems cannot flush a folder
        descriptor = os.open(path, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
