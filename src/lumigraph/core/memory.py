"""Refusing work that cannot fit in memory, before it is allocated."""

import ctypes
import os
import shutil
from contextlib import suppress
from pathlib import Path

from lumigraph.errors import LumigraphError, SamplingError

_GROUP = Path("/sys/fs/cgroup")
"""Files of this process' control group, version 2: a container's bounds."""


def available() -> int | None:
    """Memory that can be allocated now [bytes], in this control group; None where the system does not say."""
    return min((size for size in (_free(), _free_of_group()) if size is not None), default=None)


def _free() -> int | None:
    try:
        with open("/proc/meminfo", encoding="ascii") as lines:  # noqa: PTH123 - not a file of the user's
            for line in lines:
                if line.startswith("MemAvailable:"):
                    return int(line.split()[1]) * 1024
        return os.sysconf("SC_AVPHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (OSError, ValueError, AttributeError, IndexError):
        return None


def _free_of_group() -> int | None:
    """Memory that the control group may still use [bytes], the cache of unused file pages included."""
    try:
        most, used = (
            int((_GROUP / f"memory.{name}").read_text(encoding="ascii")) for name in ("max", "current")
        )
        counted = dict(line.split() for line in (_GROUP / "memory.stat").read_text("ascii").splitlines())
        return max(most - used + int(counted.get("inactive_file", 0)), 0)
    except (OSError, ValueError):  # "max" where there is no bound
        return None


def total() -> int | None:
    """Memory of the machine or of this control group [bytes]; None where the system does not say."""
    sizes = []
    with suppress(OSError, ValueError, AttributeError):
        sizes.append(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    with suppress(OSError, ValueError):  # "max" where there is no bound
        sizes.append(int((_GROUP / "memory.max").read_text(encoding="ascii")))
    return min(sizes, default=None)


def told(size: float) -> str:
    """Text of a number of bytes, with a suitable unit.

    >>> told(512), told(5.5 * 2**20), told(3 * 2**30)
    ('512 B', '5.5 MiB', '3 GiB')
    """
    for unit in ("B", "KiB", "MiB"):
        if size < 1000:
            return f"{size:.3g} {unit}"
        size /= 1024
    return f"{size:.3g} GiB"


def require_plane(shape: tuple[int, int], itemsize: int, what: str) -> None:
    """Refuse to draw one plane (ny, nx) that needs more memory than there is.

    Raises
    ------
    SamplingError
        What needs how much, how much there is.
    """
    needed = float(shape[0]) * shape[1] * itemsize
    require(needed, f"{what} of {shape[0]} x {shape[1]} samples", "Use fewer samples.", SamplingError)


def give_back() -> None:
    """Return memory that was let go to the system, where C's library (glibc) keeps it for later."""
    with suppress(AttributeError, OSError, TypeError):
        ctypes.CDLL(None).malloc_trim(0)


_TRIM, _MAPPED, _ARENAS, _MOST = -1, -3, -8, 2**31 - 1
"""Options of glibc's `mallopt`: what is free at the end before it is given back, size of memory mapped by
itself, how many heaps there are; and its largest number."""


def keep() -> None:
    """Hold on to memory that is let go, for what is asked for next, where C's library (glibc) returns it.

    For workers, whose frames all need the same: the system clears each page that it gives, which took a
    sixth of the time of arrays that pass through several threads.
    """
    with suppress(AttributeError, OSError, TypeError):
        for option, value in ((_TRIM, _MOST), (_MAPPED, _MOST), (_ARENAS, 1)):
            ctypes.CDLL(None).mallopt(option, value)


def require(needed: float, what: str, remedy: str, error: type[LumigraphError] = LumigraphError) -> None:
    """Refuse `what` when it needs more memory [bytes] than there is.

    `remedy` may hold ``{factor:.1f}``: how many times too large it is.

    Raises
    ------
    LumigraphError
        Or the given child: what needs how much, how much there is, and the remedy.
    """
    free = available()
    if free is not None and needed > free:
        advice = remedy.format(factor=needed / max(free, 1))
        raise error(f"{what} needs {needed / 2**30:.3g} GiB but {free / 2**30:.3g} GiB are free. {advice}")


def require_disk(
    needed: float, folder: str | os.PathLike[str], what: str, error: type[LumigraphError]
) -> None:
    """Refuse `what` when it needs more than is free on the disk of a folder, which may not exist yet [bytes].

    Raises
    ------
    LumigraphError
        Or the given child: what needs how much, how much there is.
    """
    place = Path(folder).absolute()
    while not place.exists() and place != place.parent:
        place = place.parent
    free = shutil.disk_usage(place).free
    if needed > free:
        raise error(
            f"{what} need up to {told(needed)} but the disk of {folder} has {told(free)} "
            "free. Use fewer slices or samples, or another folder."
        )
