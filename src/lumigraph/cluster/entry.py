"""What is noted of a frame that is done, and whether what was read back is such a note."""

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any


@dataclass(frozen=True, slots=True)
class Entry:
    """What is known of a frame that is done.

    Parameters
    ----------
    number
        Of the frame.
    seconds
        That it took [s].
    memory
        Most that its worker had held until then [bytes].
    size
        Of what it wrote [bytes].
    where
        Machine and process.
    files
        Size and CRC-32 of each file that it wrote, by its name in the output.
    values
        Numbers by name, of jobs that give a table.
    notes
        Warnings.
    busy
        Processor time that it took [s].
    """

    number: int
    seconds: float = 0.0
    memory: int = 0
    size: int = 0
    where: str = ""
    files: dict[str, tuple[int, int]] = field(default_factory=dict)
    values: dict[str, Any] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    busy: float = 0.0


def is_kind(value: Any, kind: type) -> bool:
    """Whether a value of JSON is of a type; true and false are no numbers."""
    return isinstance(value, kind) and (kind is bool or not isinstance(value, bool))


def _is_amount(value: Any) -> bool:
    return (is_kind(value, int) or is_kind(value, float)) and 0 <= value < math.inf


def is_inside(name: str) -> bool:
    """Whether a file's name leads into a store and not out of it."""
    return bool(name) and "\0" not in name and not Path(name).is_absolute() and ".." not in Path(name).parts


def is_entry(found: Any, number: int) -> bool:
    """Whether a note is the entry of a frame: every field is there, and of its type."""
    if not is_kind(found, dict) or set(found) != set(Entry.__slots__) or found["number"] != number:
        return False
    return (
        all(_is_amount(found[name]) for name in ("seconds", "busy"))
        and all(is_kind(found[name], int) and found[name] >= 0 for name in ("number", "memory", "size"))
        and is_kind(found["where"], str)
        and is_kind(found["files"], dict)
        and all(map(is_inside, found["files"]))
        and all(map(_is_pair, found["files"].values()))
        and is_kind(found["values"], dict)
        and is_kind(found["notes"], list)
        and all(is_kind(note, str) for note in found["notes"])
    )  # fmt: skip


def _is_pair(value: Any) -> bool:
    return is_kind(value, list) and len(value) == 2 and all(is_kind(one, int) for one in value)
