"""Results of verbs: `Result`, which text output, JSON, reports and notebooks read."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from lumigraph.core.notes import mattering
from lumigraph.core.printable import printable


@dataclass(frozen=True, slots=True)
class Quantity:
    """A named value.

    Parameters
    ----------
    name
        Name for programs, such as "pitch_px".
    value
        Number, text, or several of them; lengths in metres.
    unit
        "m", "px", "1", ...; empty for what has none.
    interval
        The range that holds it, low and high, in the same unit; None where it is not known.

    Examples
    --------
    >>> str(Quantity("spacing", 6.5e-6, "m")), Quantity("spacing", 6.5e-6, "m").label
    ('6.5 µm', 'spacing')
    >>> str(Quantity("slope", 2.0, "px", (1.9, 2.2))), str(Quantity("distance", 0.05, "m", (0.049, 0.052)))
    ('2 px (1.9 to 2.2)', '50 mm (49 mm to 52 mm)')
    >>> str(Quantity("shape", (5, 150, 150), "px")), str(Quantity("spacing", (5e-6, 3e-7, 3e-7), "m"))
    ('5 x 150 x 150 px', '5 µm, 300 nm, 300 nm')
    >>> str(Quantity("magnification", 0.5, "1"))
    '0.5'
    """

    name: str
    value: Any
    unit: str = ""
    interval: tuple[float, float] | None = None

    @property
    def label(self) -> str:
        """The name as people read it."""
        return self.name.removesuffix("_px").replace("_", " ")

    def __str__(self) -> str:
        shown = self._one if self.unit == "m" else self._bare
        text = self._several() if isinstance(self.value, tuple | list) else self._one(self.value)
        return text if self.interval is None else f"{text} ({' to '.join(map(shown, self.interval))})"

    def _several(self) -> str:
        if self.name == "shape":
            return f"{' x '.join(map(str, self.value))} {self.unit}".rstrip()
        if len(self.value) > 3:
            return f"{self._one(self.value[0])} to {self._one(self.value[-1])}"
        return ", ".join(map(self._one, self.value))

    def _one(self, value: Any) -> str:
        if self.unit == "m" and (value is None or isinstance(value, float)):
            from lumigraph.core import picture  # brings SciPy, which a command line's --help does without

            return picture.length(value)
        unit = "" if self.unit == "1" else self.unit
        return f"{self._bare(value)} {unit}".rstrip()

    @staticmethod
    def _bare(value: Any) -> str:
        return f"{value:.5g}" if isinstance(value, float) else str(value)


@dataclass(frozen=True, slots=True)
class Figure:
    """A picture of a report, under a heading of its own or beside the one before.

    Parameters
    ----------
    image
        An array (y, x[, 3]), a `RawImage`, a matplotlib figure, text that keeps its lines, or
        the rows of a table, its header first.
    caption
        Caption.
    section
        Heading that it stands under.
    options
        Options of `report.pictures.picture`.
    """

    image: Any
    caption: str = ""
    section: str = "Pictures"
    options: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, eq=False)
class Result:
    """Result of a verb: the object made, named quantities, pictures and notes.

    Parameters
    ----------
    title, about
        Heading of a report: a word, and a sentence.
    thing
        Object that was made: views, a picture, a volume, a map, ...
    headline
        Lines that people read first; a line break in one of them is not one on the terminal.
    quantities
        Named values.
    figures
        Gives the pictures of a report; called only for one.
    notes
        Notes on what was done and what to know, one sentence each.
    written
        Files.
    extra
        Values for programs only.
    rows
        Values for programs in place of named values, where they form a list.
    failure
        Reason why the command ends with an error after its output; empty if it does not.
    """

    title: str
    about: str
    thing: Any = None
    headline: tuple[str, ...] = ()
    quantities: tuple[Quantity, ...] = ()
    figures: Callable[[], Iterable[Figure]] = tuple
    notes: tuple[str, ...] = ()
    written: tuple[Path, ...] = ()
    extra: Mapping[str, Any] = field(default_factory=dict)
    rows: Sequence[Mapping[str, Any]] | None = None
    failure: str = ""

    def text(self, known: Sequence[str] = ()) -> str:
        """Text for a terminal, without the notes in `known`, printed before, and those that all is well."""
        notes = (f"note: {note}" for note in mattering(self.notes) if note not in known)
        lines = (*self.headline, *notes, *(f"written {path}" for path in self.written))
        return "\n".join(map(printable, lines))

    def values(self) -> dict[str, Any]:
        """Values for programs: by name, lengths in metres, intervals as name_interval."""
        found: dict[str, Any] = {one.name: one.value for one in self.quantities}
        found |= {f"{one.name}_interval": one.interval for one in self.quantities if one.interval}
        found |= self.extra
        if self.notes:
            found["notes"] = self.notes
        if self.written:
            paths = [str(path) for path in self.written]
            found["output"] = paths[0] if len(paths) == 1 else paths
        return found

    def _repr_html_(self) -> str:
        from lumigraph.core import picture

        return picture.card(self.title, [(one.label, str(one)) for one in self.quantities])
