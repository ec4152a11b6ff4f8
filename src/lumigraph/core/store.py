"""Arrays kept on disk between runs: dear to compute, cheap to read.

They lie in folders named by a hash of all that they depend on, under ``LUMIGRAPH_CACHE``, or the user's cache
folder; ``LUMIGRAPH_CACHE=off`` keeps nothing. They are read as memory maps, which processes share. A folder
appears whole or not at all. The ones that were not used for longest go when they hold more than `LIMIT`.
"""

import contextlib
import os
import shutil
import tempfile
from collections.abc import Iterable
from pathlib import Path

import numpy as np

LIMIT = 4 * 2**30
"""Bytes that all folders may hold together."""


def folder() -> Path | None:
    """Where arrays are kept; None where they are not."""
    chosen = os.environ.get("LUMIGRAPH_CACHE", "")
    if chosen.lower() == "off":
        return None
    if chosen:
        return Path(chosen)
    base = os.environ.get("XDG_CACHE_HOME") or os.environ.get("LOCALAPPDATA") or Path.home() / ".cache"
    return Path(base) / "lumigraph"


def load(key: str, names: Iterable[str]) -> dict[str, np.ndarray] | None:
    """Arrays kept under a key, memory-mapped and read-only; None where one of them is missing or damaged."""
    where = folder()
    if where is None or not (where / key).is_dir():
        return None
    try:
        found = {name: np.load(where / key / f"{name}.npy", mmap_mode="r") for name in names}
        os.utime(where / key)
    except (OSError, ValueError, EOFError):
        shutil.rmtree(where / key, ignore_errors=True)
        return None
    return found


def save(key: str, arrays: dict[str, np.ndarray]) -> None:
    """Keep arrays under a key; a disk that is full or read-only is no error."""
    where = folder()
    if where is None or sum(array.nbytes for array in arrays.values()) > LIMIT:
        return
    try:
        where.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=where, prefix=".new-", ignore_cleanup_errors=True) as new:
            for name, array in arrays.items():
                with (Path(new) / f"{name}.npy").open("wb") as file:
                    np.save(file, array, allow_pickle=False)
                    file.flush()
                    os.fsync(file.fileno())
            with contextlib.suppress(OSError):  # another process has been faster
                Path(new).rename(where / key)
        _tidy(where)
    except OSError:
        return


def _tidy(where: Path) -> None:
    """Remove the folders that were not used for longest, until the rest fits."""
    folders = sorted(
        (p for p in where.iterdir() if p.is_dir()), key=lambda p: p.stat().st_mtime, reverse=True
    )
    total = 0
    for path in folders:
        total += sum(file.stat().st_size for file in path.glob("*.npy"))
        if total > LIMIT:
            shutil.rmtree(path, ignore_errors=True)
