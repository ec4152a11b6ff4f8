"""Output files: where they may be written, and writing them atomically."""

import os
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from lumigraph import store
from lumigraph.errors import FormatError

VIEWS = "views.json"
"""Marker of a folder of views that lumigraph wrote."""

_ZARR = ("zarr.json", ".zgroup", ".zarray", ".zattrs", ".zmetadata")
_CLUTTER = re.compile(r"\.DS_Store|\._.*|Thumbs\.db|desktop\.ini")
_VIEW = re.compile(r"view_\d+_\d+\.(png|tif)")


def check_target(path: str | os.PathLike[str], endings: Sequence[str] = (), *, folder: bool = False) -> Path:
    """The path, refused where writing would fail in the end; called before a long computation.

    Parameters
    ----------
    path
        Path of a result.
    endings
        Extensions that suit the result, such as ``(".tiff", ".png")``; empty for any.
    folder
        True if the result is a folder of views.

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
        _check_foreign(path, lambda entry: entry.name == VIEWS or _VIEW.fullmatch(entry.name) is not None)
        return path
    if path.is_dir() and not name.endswith(".zarr"):
        raise FormatError(f"{path} is a folder. Give the name of a file.")
    if path.is_dir() and any(path.iterdir()) and not (path / "zarr.json").is_file():
        raise FormatError(f"{path} is a folder that holds no Zarr store. Choose another name.")
    _check_foreign(path, _is_zarr)
    return path


def _is_zarr(entry: Path) -> bool:
    """Whether an entry of a store is Zarr's: what describes it, chunks, or an array or a group inside."""
    if entry.name in _ZARR:
        return True
    if not entry.is_dir() or entry.is_symlink():
        return False
    return entry.name == "c" or any((entry / name).is_file() for name in _ZARR)


def _check_foreign(path: Path, ours: Callable[[Path], bool]) -> None:
    """Refuse a folder that holds more than is replaced, as notes beside views or a folder ``.git``."""
    if path.is_dir():
        store.sweep(path)
    for entry in path.iterdir() if path.is_dir() else ():
        if not (is_clutter(entry) or ours(entry)):
            raise FormatError(
                f"writing {path} would remove {entry.name}, which it holds too. Move that, or choose another."
            )


def is_clutter(entry: Path) -> bool:
    """Whether an entry of a folder may go with it: file managers leave it everywhere."""
    return _CLUTTER.fullmatch(entry.name) is not None


def write_bytes(path: str | os.PathLike[str], content: bytes) -> None:
    """Write a file atomically: under another name in its folder, flushed to the disk, then renamed."""
    with replacing(path) as temporary:
        temporary.write_bytes(content)


@contextmanager
def replacing(path: str | os.PathLike[str], *, folder: bool = False) -> Iterator[Path]:
    """Context that gives a temporary path, which takes the place of `path` at the end; see `store.replacing`.

    Raises
    ------
    FormatError
        As `check_target`; the disk is full or may not be written to, and the old file stays.
    """
    with store.replacing(check_target(path, folder=folder)) as temporary:
        yield temporary
