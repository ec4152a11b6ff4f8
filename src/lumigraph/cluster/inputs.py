"""Files that a job reads, as they were when it began: size, time and a hash of their content.

A job whose white image changes between two starts, or while it runs, would mix the results of both.
"""

import hashlib
import os
import stat
import tomllib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from lumigraph.errors import FormatError

Known = dict[str, Any]
"""Path, size [bytes], time of the last change [ns] and BLAKE2b of a file, or of all files of a folder."""

_CAMERA = 1 << 20
"""Bytes of a TOML file whose texts may name other files, at most."""


def known(path: str | os.PathLike[str]) -> Known:
    """A file or a folder as it is, as JSON values: its name, size, time and hash.

    Raises
    ------
    FormatError
        There is none, it may not be read, or it is a pipe.
    """
    place = Path(path).absolute()
    try:
        size, modified = stamp(place)
        return {"file": str(place), "size": size, "modified": modified, "blake2b": _hash(place)}
    except OSError as error:
        raise FormatError(f"{place} cannot be read: {error.strerror or error}. Check the path.") from None


def all_known(paths: Iterable[str | os.PathLike[str]]) -> list[Known]:
    """Files as they are, each once and sorted, and those that camera files among them name."""
    found = {str(Path(path).absolute()) for path in paths}
    found |= {str(other) for path in sorted(found) for other in named_by(Path(path))}
    return [known(path) for path in sorted(found)]


def check_unchanged(files: Sequence[Known]) -> None:
    """Refuse files whose size or time is not what it was; a frame is compared before and after its work.

    Raises
    ------
    FormatError
        One has changed, or is gone; it is named.
    """
    for one in files:
        try:
            now = stamp(Path(one["file"]))
        except OSError:
            raise FormatError(f"{one['file']} is gone since the batch began. Put it back.") from None
        if now != (one["size"], one["modified"]):
            raise FormatError(f"{one['file']} has changed since the batch began.")


def named_by(path: Path) -> Iterator[Path]:
    """Files that a TOML file names, as a camera its prescription; none for any other file."""
    try:
        if path.suffix.lower() == ".toml" and path.is_file() and path.stat().st_size <= _CAMERA:
            yield from named_in(path.read_text(encoding="utf-8"), path.absolute().parent)
    except (OSError, ValueError, RecursionError):  # its reader says what is wrong
        return


def named_in(text: str, folder: Path | None = None) -> Iterator[Path]:
    """Files that the text of a camera file names, from a folder on."""
    for one in texts(tomllib.loads(text)):
        other = (folder or Path()) / one
        if is_file(other):
            yield other


def texts(value: Any) -> Iterator[str]:
    """All texts inside of mappings and sequences, at any depth."""
    left = [value]
    while left:
        one = left.pop()
        if isinstance(one, str):
            yield one
        elif isinstance(one, Mapping):
            left += one.values()
        elif isinstance(one, list | tuple):
            left += one


def is_file(path: str | os.PathLike[str]) -> bool:
    """Whether a text is the path of a file; most texts are none, and some no path can be."""
    try:
        return Path(path).is_file()
    except (OSError, ValueError):
        return False


def stamp(path: Path) -> tuple[int, int]:
    """Size [bytes] and time of the last change [ns]; of a folder their sum and the latest."""
    about = path.stat()
    if not stat.S_ISDIR(about.st_mode):
        return about.st_size, about.st_mtime_ns
    each = [one.stat() for one in _inside(path)]
    return sum(one.st_size for one in each), max((one.st_mtime_ns for one in each), default=0)


def _inside(folder: Path) -> Iterator[Path]:
    """Files of a folder, in the order of their names; folders that links lead to, too, each once."""
    seen: set[tuple[int, int]] = set()
    for place, folders, names in os.walk(folder, followlinks=True):
        about = Path(place).stat()
        if (about.st_dev, about.st_ino) in seen:
            folders.clear()
            continue
        seen.add((about.st_dev, about.st_ino))
        folders.sort()
        yield from (path for name in sorted(names) if (path := Path(place) / name).is_file())


def _hash(place: Path) -> str:
    """Hash of a file, or of names and content of all files of a folder."""
    if not place.is_dir():
        if not place.is_file():
            raise OSError("it is neither a file nor a folder")
        return _content(place)
    digest = _blake()
    for one in _inside(place):
        digest.update(os.fsencode(one.relative_to(place)) + b"\0" + _content(one).encode() + b"\n")
    return digest.hexdigest()


def _content(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, _blake).hexdigest()


def _blake() -> "hashlib.blake2b":
    return hashlib.blake2b(digest_size=16)
