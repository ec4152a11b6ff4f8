"""Log of an alignment: a folder with every step's picture and numbers, from which it resumes."""

from collections.abc import Mapping
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from lumigraph import store
from lumigraph.core.picture import png
from lumigraph.errors import FormatError
from lumigraph.io.png import load

_RUN, _STEP = "run.json", "step-{:04d}"
_WIDEST = 1000  # pixels of a logged picture


@dataclass(frozen=True, slots=True)
class AlignmentLog:
    """Steps of an alignment.

    Parameters
    ----------
    folder
        Folder of the log.
    """

    folder: Path

    @classmethod
    def at(cls, folder: str | PathLike[str]) -> "AlignmentLog":
        """Log in a folder, which is made if it is missing."""
        found = cls(Path(folder))
        found.folder.mkdir(parents=True, exist_ok=True)
        return found

    def open(self, what: Mapping[str, Any]) -> None:
        """Note what is aligned, or compare it with what was noted.

        Raises
        ------
        FormatError
            The log is that of another bench or camera.
        """
        path = self.folder / _RUN
        if not path.exists():
            store.write_note(path, dict(what))
            return
        begun = store.read_note(path)
        for name, value in what.items():
            if begun.get(name) != value:
                raise FormatError(
                    f"{self.folder} is the log of another {name}. Give another --log, or remove it."
                )

    def record(self, number: int, values: Mapping[str, Any], picture: np.ndarray) -> None:
        """Write one step: its picture first, then its numbers, which make it count."""
        every = -(-max(picture.shape) // _WIDEST)
        small = np.asarray(picture, float)[::every, ::every]
        grey = np.rint(255 * np.clip(small / (small.max() or 1.0), 0, 1)).astype(np.uint8)
        store.write_bytes(self.folder / (_STEP.format(number) + ".png"), png(grey))
        store.write_note(self.folder / (_STEP.format(number) + ".json"), dict(values))

    def picture(self, number: int) -> bytes:
        """PNG of a step."""
        return (self.folder / (_STEP.format(number) + ".png")).read_bytes()

    def image(self, number: int) -> np.ndarray:
        """Picture (y, x) of a step, as logged."""
        return np.asarray(load(self.folder / (_STEP.format(number) + ".png")).data)

    def step(self, number: int) -> dict[str, Any]:
        """Numbers of a step."""
        return store.read_note(self.folder / (_STEP.format(number) + ".json"))

    def count(self) -> int:
        """Number of steps that are written."""
        number = 0
        while (self.folder / (_STEP.format(number) + ".json")).exists():
            number += 1
        return number

    def steps(self) -> list[dict[str, Any]]:
        """Numbers of all steps."""
        return [self.step(number) for number in range(self.count())]

    def stopped(self, why: str, left: str, positions: Mapping[str, float]) -> None:
        """Note why an alignment ended, and where the bench was left."""
        store.write_note(
            self.folder / "stopped.json", {"why": why, "left": left, "positions": dict(positions)}
        )
