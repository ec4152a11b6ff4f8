"""Options of making an operator."""

from dataclasses import dataclass
from os import PathLike

from lumigraph.core.progress import Progress


@dataclass(frozen=True, slots=True)
class Making:
    """Options of making an operator: accuracy, folder to keep it in, and progress callback."""

    accuracy: float
    folder: str | PathLike[str] | None
    progress: Progress | None
