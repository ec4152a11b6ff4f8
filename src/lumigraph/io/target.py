"""Where a result may be written, and atomic writing: a kill leaves the old file or the new one."""

import ctypes
import os
import secrets
import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from lumigraph.errors import FormatError

_EXCHANGE = 2  # RENAME_EXCHANGE of Linux' renameat2
_HERE = -100  # AT_FDCWD


VIEWS = "views.json"
"""What marks a folder of views that lumigraph wrote."""


def check_target(path: str | os.PathLike[str], endings: Sequence[str] = (), *, folder: bool = False) -> Path:
    """The path, refused where writing would fail in the end; called before a long computation.

    Parameters
    ----------
    path
        Where a result is to be written.
    endings
        Extensions that suit the result, such as ``(".tiff", ".png")``; empty for any.
    folder
        Whether the result is a folder of views.

    Raises
    ------
    FormatError
        Another extension, a folder that is missing or may not be written to, or a folder in the way.
    """
    path = Path(path)
    name = path.name.lower()
    if endings and not name.endswith(tuple(endings)):
        raise FormatError(f"{path} has the wrong extension for this result. Use one of {', '.join(endings)}.")
    if not path.parent.is_dir():
        raise FormatError(f"the folder {path.parent} for {path.name} does not exist. Make it first.")
    if not os.access(path.parent, os.W_OK):
        raise FormatError(f"the folder {path.parent} may not be written to. Choose another one.")
    if folder:
        if path.is_dir() and any(path.iterdir()) and not (path / VIEWS).is_file():
            raise FormatError(f"{path} is a folder that holds other things. Choose another name.")
        return path
    if path.is_dir() and not name.endswith(".zarr"):
        raise FormatError(f"{path} is a folder. Give the name of a file.")
    if path.is_dir() and any(path.iterdir()) and not (path / "zarr.json").is_file():
        raise FormatError(f"{path} is a folder that holds no Zarr store. Choose another name.")
    return path


def write_bytes(path: str | os.PathLike[str], content: bytes) -> None:
    """Write a file atomically: under another name in its folder, flushed to the disk, then renamed."""
    with replacing(path) as temporary:
        temporary.write_bytes(content)


@contextmanager
def replacing(path: str | os.PathLike[str], *, folder: bool = False) -> Iterator[Path]:
    """Context that gives a temporary path beside `path`, which takes its place at the end.

    The temporary path does not exist yet: write a file there, or make a folder. If the block fails it
    is removed and what was at `path` stays.
    """
    target = check_target(path, folder=folder)
    if target.is_symlink():
        target = target.resolve()
    temporary = target.with_name(f".{target.name}.{secrets.token_hex(6)}.tmp")
    try:
        yield temporary
        _flush(temporary)
        _take_place(temporary, target)
    except BaseException:
        _remove(temporary)
        raise
    _flush_entry(target.parent)


def _take_place(temporary: Path, target: Path) -> None:
    if not temporary.is_dir() or not target.exists():
        temporary.replace(target)  # for files this replaces an old one in one step
    elif _exchanged(temporary, target):
        _remove(temporary)
    else:  # no renameat2 here: two steps, and the old store is kept until the second
        old = temporary.with_suffix(".old")
        target.rename(old)
        temporary.rename(target)
        _remove(old)


def _exchanged(one: Path, other: Path) -> bool:
    """Swap two paths in one step where the system can."""
    try:
        swap = ctypes.CDLL(None, use_errno=True).renameat2
    except (AttributeError, OSError):
        return False
    return swap(_HERE, os.fsencode(one), _HERE, os.fsencode(other), _EXCHANGE) == 0


def _flush(path: Path) -> None:
    for file in path.rglob("*") if path.is_dir() else [path]:
        if file.is_file():
            _flush_entry(file)


def _flush_entry(path: Path) -> None:
    with suppress(OSError):  # some file systems cannot flush a folder
        descriptor = os.open(path, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def _remove(path: Path) -> None:
    if path.is_dir():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)
