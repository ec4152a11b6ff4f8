"""Experiments: their registry by id, their context and their outcome."""

import re
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from lumigraph import store
from lumigraph.core.progress import Progress, Stage
from lumigraph.errors import FormatError, LumigraphError

Tolerance = float | tuple[float, float]

Kind = Literal["waves", "closed form", "told"]
"""Kind of proof: a computed wave or picture against theory, a formula against itself or its printed
value, or nothing, where a number has no theory."""


@dataclass(frozen=True, slots=True)
class ResultRow:
    """One line of the table of an experiment.

    Parameters
    ----------
    quantity
        Computed quantity, such as "first zero, band limited".
    got
        Computed value, in `unit`.
    unit
        Unit as it is shown: "µm", "dB", "1/m"; empty for a pure number.
    thesis
        Value printed in the thesis, in the same unit; text where no number is; None where nothing is.
    expected
        Correct value; None for a number that is only shown.
    tolerance
        Largest absolute difference from `expected`, or the largest ones (below, above); may be infinite.
    note
        Why this number, in a few words.
    kind
        "waves": what was simulated or processed, against a closed form, an exact integral or a known scene.
        "closed form": a formula against printed digits or another form of itself. "told": no theory is
        known, and `expected`, if given, is what an earlier run found.

    Examples
    --------
    >>> ResultRow("first zero", 48.9, "µm", thesis=67.0, expected=48.8, tolerance=0.3).passed
    True
    >>> ResultRow("SNR", 70.0, "dB", expected=57.0, tolerance=(0.0, np.inf)).passed
    True
    """

    quantity: str
    got: float
    unit: str = ""
    thesis: float | str | None = None
    expected: float | None = None
    tolerance: Tolerance | None = None
    note: str = ""
    kind: Kind = "waves"

    def __post_init__(self) -> None:
        if self.expected is None:
            object.__setattr__(self, "kind", "told")

    @property
    def passed(self) -> bool | None:
        """True if `got` is within the tolerance; None if nothing is expected."""
        if self.expected is None:
            return None
        below, above = self.margins
        return bool(self.expected - below <= self.got <= self.expected + above)

    @property
    def margins(self) -> tuple[float, float]:
        """Tolerance (below, above); zero where none is given."""
        if isinstance(self.tolerance, tuple):
            return self.tolerance
        margin = self.tolerance or 0.0
        return margin, margin


@dataclass(frozen=True, slots=True)
class ExperimentOutcome:
    """Result of an experiment.

    Parameters
    ----------
    rows
        Rows of its table.
    figures
        (image (y, x[, 3]) or figure of `lumigraph.plots`, caption).
    why
        One or two sentences: why the thesis, the expected and the computed numbers differ.
    """

    rows: tuple[ResultRow, ...]
    figures: tuple[tuple[Any, str], ...] = ()
    why: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "rows", tuple(self.rows))
        object.__setattr__(self, "figures", tuple(self.figures))


@dataclass(frozen=True, slots=True)
class Context:
    """Size, output folder and progress callback of an experiment's run.

    Parameters
    ----------
    quick
        Run a reduced size of the same physics, in some seconds.
    folder
        Folder for finished parts; None keeps nothing.
    tell
        Called as ``tell(fraction)``, a `core.progress.Stage`.
    """

    quick: bool = True
    folder: Path | None = None
    tell: Progress | None = None

    def progress(self, fraction: float, what: str = "") -> None:
        """Say which fraction of the experiment is done."""
        if self.tell is not None:
            self.tell(Stage(min(max(fraction, 0.0), 1.0), what))

    def cached(self, name: str, function: Callable[[], Any]) -> Any:
        """Result of `function`, an array or a dictionary of arrays, computed once per output folder.

        An interrupted run finds the part again and goes on with the same numbers: what is returned is
        the same whether it was computed or read.

        Parameters
        ----------
        name
            Name of the part; letters, digits, "-", "_" and ".".
        function
            Computes it.

        Raises
        ------
        LumigraphError
            A name that is no file name.
        """
        if not re.fullmatch(r"[\w.-]+", name):
            raise LumigraphError(
                f"the name of a part is {name!r} but must consist of letters, digits, '-', '_' and '.'."
            )
        path = None if self.folder is None else self.folder / f"{name}.npz"
        if path is not None and path.exists():
            with suppress(FormatError):  # damaged: computed again
                return _value(store.read(path))
        parts = _parts(function())
        if path is not None:
            path.parent.mkdir(parents=True, exist_ok=True)
            store.write(path, parts)
            parts = store.read(path)  # of one layout in memory, whether computed or found
        return _value(parts)


_ALONE = "__array__"


def _parts(value: Any) -> dict[str, Any]:
    items: Iterable[tuple[str, Any]] = value.items() if isinstance(value, Mapping) else ((_ALONE, value),)
    return {key: np.asarray(item) for key, item in items}


def _value(parts: dict[str, Any]) -> Any:
    return parts[_ALONE] if set(parts) == {_ALONE} else parts


@dataclass(frozen=True, slots=True)
class Experiment:
    """A table or a figure of the thesis, and the function that makes it.

    Parameters
    ----------
    id
        Such as "figure-3.2", "table-5.4" or "5.6".
    title
        Subject of the experiment.
    question
        Question that it answers, a sentence.
    thesis
        Place in the thesis.
    function
        Takes a `Context`, returns an `ExperimentOutcome`.
    camera
        Name of the bundled camera that it uses, which the report draws; empty for none.
    shows
        What that place in the thesis shows, a sentence that the report sets beside the pictures.
    """

    id: str
    title: str
    question: str
    thesis: str
    function: Callable[[Context], ExperimentOutcome]
    camera: str = ""
    shows: str = ""

    @property
    def module(self) -> str:
        """The module that holds it."""
        return self.function.__module__

    def run(self, context: Context) -> ExperimentOutcome:
        """Rows and figures."""
        return self.function(context)


def closed_forms(rows: Iterable[ResultRow]) -> tuple[ResultRow, ...]:
    """The same rows, marked as formulas against printed digits or against themselves."""
    return tuple(replace(row, kind="closed form") for row in rows)


REGISTERED: dict[str, Experiment] = {}

Function = Callable[[Context], ExperimentOutcome]


def experiment(
    id: str,  # noqa: A002
    title: str,
    *,
    question: str,
    thesis: str,
    shows: str = "",
    camera: str = "",
) -> Callable[[Function], Function]:
    """Decorator that registers a function of a `Context`; see `Experiment`.

    Raises
    ------
    LumigraphError
        Another module has registered the id.
    """

    def register(function: Function) -> Function:
        known = REGISTERED.get(id)
        if known is not None and known.module != function.__module__:
            raise LumigraphError(
                f"experiment {id!r} is defined in {known.module} and in {function.__module__}. Rename one."
            )
        REGISTERED[id] = Experiment(id, title, question, thesis, function, camera, shows)
        return function

    return register
