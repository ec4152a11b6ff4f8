"""Notes on results: which of them matter to people."""

import re
from collections.abc import Iterable

_USUAL = (
    re.compile(r".*: \d+ of \d+ pixels, 0 lenslets"),
    re.compile(r"left out: 0 of \d+ lenslets"),
    re.compile(r".* slips by 0\.0\d of a pitch .*"),
    re.compile(r".* they agree"),
)
"""Notes that say that all is as it should be."""


def mattering(notes: Iterable[str], usual: Iterable[re.Pattern[str]] = ()) -> tuple[str, ...]:
    """Notes without those that say that all is as it should be, each once; `usual`: more of these.

    >>> mattering(["left out: 0 of 540 lenslets", "left out: 3 of 540 lenslets"])
    ('left out: 3 of 540 lenslets',)
    """
    known = (*_USUAL, *usual)
    return tuple(dict.fromkeys(one for one in notes if not any(kind.fullmatch(one) for kind in known)))
