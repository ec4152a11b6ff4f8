"""Arrays kept between runs: dear to compute, cheap to read.

They lie in sealed files named by a hash of all that they depend on, under ``LUMIGRAPH_CACHE``, or the user's
cache folder; ``LUMIGRAPH_CACHE=off`` keeps nothing. They are read as memory maps, which processes share.
The ones that were not used for longest go when they hold more than `LIMIT`.
"""

import os
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path

import numpy as np

from lumigraph.errors import FormatError
from lumigraph.store import sealed

LIMIT = 8 * 2**30
"""Bytes that all files in the user's cache folder may hold together."""

_ENDING = ".kept.npz"


def folder() -> Path | None:
    """Folder of the stored arrays; None if arrays are not stored, as for a user without a home."""
    chosen = os.environ.get("LUMIGRAPH_CACHE", "")
    if chosen.lower() == "off":
        return None
    if chosen:
        return Path(chosen)
    base = os.environ.get("XDG_CACHE_HOME") or os.environ.get("LOCALAPPDATA")
    try:
        return Path(base or Path.home() / ".cache") / "lumigraph"
    except RuntimeError:  # a container may run under a number that no user has
        return None


def kept(
    key: str, build: Callable[[], Mapping[str, np.ndarray]], where: Path | None = None
) -> dict[str, np.ndarray]:
    """Arrays by name: read where they are kept under a key, else built, kept and read back.

    Values, type and order in memory (C or Fortran) are those that were built. Where they can be kept they
    are read-only memory maps, the first time too: the same bits come of a computation with arrays that
    were built and with arrays that were found. A damaged file is removed and its arrays are built again.
    In the user's cache folder, a disk that is full or may not be written to is no error.

    Parameters
    ----------
    key
        Names all that the arrays depend on; a file name.
    build
        Computes them.
    where
        A folder of the caller's, which has no limit; the user's cache folder if left out.

    Raises
    ------
    FormatError
        They cannot be written into the caller's folder.
    """
    place = folder() if where is None else where
    path = None if place is None else place / f"{key}{_ENDING}"
    found = None if path is None else _found(path)
    if found is None:
        found = _own(build())
        if path is not None and where is not None:
            sealed.write(path, found)
            found = sealed.read(path, mapped=True, written=True)
        elif path is not None and sum(array.nbytes for array in found.values()) <= LIMIT:
            found = _keep(path, found) or found
    return found


def _found(path: Path) -> dict[str, np.ndarray] | None:
    """Content of a file; None if there is none or it is damaged, in which case it is removed."""
    try:
        found = sealed.read(path, mapped=True)
    except OSError:
        return None
    except FormatError:
        with suppress(OSError):
            path.unlink()
        return None
    with suppress(OSError):
        os.utime(path)
    return found


def _keep(path: Path, arrays: Mapping[str, np.ndarray]) -> dict[str, np.ndarray] | None:
    with suppress(OSError, FormatError):
        path.parent.mkdir(parents=True, exist_ok=True)
        sealed.write(path, arrays)
        _tidy(path.parent)
        return sealed.read(path, mapped=True, written=True)
    return None


def _own(arrays: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The arrays as a file would give them: contiguous, in C or Fortran order, read-only."""
    found = {}
    for name, array in arrays.items():
        array = np.asarray(array)
        found[name] = array if array.flags.f_contiguous else np.ascontiguousarray(array)
        found[name] = found[name].view()
        found[name].flags.writeable = False
    return found


def _tidy(where: Path) -> None:
    """Remove the files that were not used for longest, until the rest fits; only what `sealed.write` made."""
    files = [(path, path.lstat()) for path in where.glob(f"*{_ENDING}") if sealed.is_own(path)]
    total = 0
    for path, status in sorted(files, key=lambda pair: pair[1].st_mtime, reverse=True):
        total += status.st_size
        if total > LIMIT:
            path.unlink(missing_ok=True)
