"""Refuse what would not fit, before it is allocated."""

import os

from lumigraph.errors import LumigraphError

SHARE = 0.8
"""Part of the free memory that one call may use."""


def free_bytes() -> int:
    """Free memory of this machine [bytes]; a terabyte where the system does not say."""
    try:
        return os.sysconf("SC_AVPHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (ValueError, OSError, AttributeError):
        return 1 << 40


def require(what: str, size: float, remedy: str) -> None:
    """Refuse an allocation of `size` bytes that would not fit.

    `remedy` may hold ``{factor:.1f}``: how many times too large the allocation is.

    Raises
    ------
    LumigraphError
        With the size needed, the size that fits, and what to do.
    """
    limit = SHARE * free_bytes()
    if size > limit:
        raise LumigraphError(
            f"{what} needs {size / 2**30:.1f} GiB but {limit / 2**30:.1f} GiB fit in memory. "
            + remedy.format(factor=size / limit)
        )
