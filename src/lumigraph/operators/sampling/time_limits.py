"""Limits on the operations of a run, and a warning of long ones."""

import warnings

from lumigraph.errors import SamplingWarning

LONGEST = 3e14
"""Operations that building may take, or a streamed image: 50 minutes of one processor at 1e11 a second."""

A_MINUTE = 6e12


def said(operations: float, what: str) -> None:
    """Warn of what takes longer than a minute."""
    if operations > A_MINUTE:
        message = (
            f"{what} some {operations / A_MINUTE:.2g} min of a processor that does 1e11 operations a second. "
            "Ask for a coarser accuracy where that is too long."
        )
        warnings.warn(message, SamplingWarning, stacklevel=3)
