"""How operators are made."""

from dataclasses import dataclass
from os import PathLike

from lumigraph.core.progress import Progress


@dataclass(frozen=True, slots=True)
class Making:
    """How an operator is made: how exactly, where it is kept, and who hears of its progress."""

    accuracy: float
    folder: str | PathLike[str] | None
    progress: Progress | None
