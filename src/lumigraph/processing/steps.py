"""A folder of results that knows which of its files stand and are unchanged."""

import json
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

from lumigraph.core.progress import Progress
from lumigraph.deconvolution.checkpoint import fingerprint
from lumigraph.errors import FormatError, SamplingWarning
from lumigraph.io.target import write_bytes

RECORD = "process.json"
"""File of the folder that says what each step was made from."""


@dataclass(frozen=True)
class Step:
    """Something to make.

    Parameters
    ----------
    name
        What people call it.
    files
        Names of the files that it writes.
    make
        Writes them into a folder.
    source
        Digest of what it is made from.
    share
        Part of the whole time that it usually takes.
    """

    name: str
    files: tuple[str, ...]
    make: Callable[[Path, Progress], None]
    source: str
    share: float = 1.0


@contextmanager
def heard() -> Iterator[list[str]]:
    """Context that gives a list of the texts of all sampling warnings, once it ends; others go on."""
    notes: list[str] = []
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", SamplingWarning)
        yield notes
    for one in caught:
        if issubclass(one.category, SamplingWarning):
            notes.append(str(one.message))
        else:
            warnings.warn(one.message, one.category, stacklevel=3)


class Steps:
    """The folder, with the record of what was made.

    Raises
    ------
    FormatError
        The record is damaged.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        path = folder / RECORD
        try:
            self._known: dict = json.loads(path.read_text("utf-8")) if path.is_file() else {}
        except ValueError as error:
            raise FormatError(f"{path} is damaged: {error}. Remove it, or give another folder.") from error

    def stands(self, step: Step) -> bool:
        """True if the files of a step are there, unchanged, and made from the same things."""
        known = self._known.get(step.name, {})
        return known.get("source") == _digest(step) and known.get("files") == self._stamps(step)

    def check(self, step: Step) -> None:
        """Refuse to take the place of files that somebody else has written or changed.

        Raises
        ------
        FormatError
            The first of them.
        """
        known = self._known.get(step.name, {}).get("files", {})
        for name, stamp in self._stamps(step).items():
            if stamp is not None and known.get(name) != stamp:
                changed = "was changed since" if name in known else "was not written by process"
                raise FormatError(
                    f"{self.folder / name} {changed}. Move it away, or give another folder."
                )  # fmt: skip

    def run(self, step: Step, progress: Progress) -> bool:
        """Make a step unless it stands; True if it was made."""
        if self.stands(step):
            return False
        self.check(step)
        with heard() as notes:
            step.make(self.folder, progress)
        self._known[step.name] = {"source": _digest(step), "files": self._stamps(step), "notes": notes}
        write_bytes(self.folder / RECORD, json.dumps(self._known, indent=1).encode())
        return True

    def notes(self, step: Step) -> list[str]:
        """Warnings of the run that made a step."""
        return self._known.get(step.name, {}).get("notes", [])

    def _stamps(self, step: Step) -> dict[str, list[int] | None]:
        return {name: _stamp(self.folder / name) for name in step.files}


def _digest(step: Step) -> str:
    return fingerprint(step.source, step.name, version("lumigraph"))


def _stamp(path: Path) -> list[int] | None:
    """Size and time of modification of a file, or of a Zarr store's description; None where there is none."""
    path = path / "zarr.json" if path.is_dir() else path
    if not path.is_file():
        return None
    known = path.stat()
    return [known.st_size, known.st_mtime_ns]
