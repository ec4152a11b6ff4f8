"""`--report`: every verb's page has its figures, its numbers with units, the command and the versions."""

import shlex
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cyclopts import Parameter

from lumigraph.cli import console, files
from lumigraph.cli.options import COMMAND, Common

if TYPE_CHECKING:
    from lumigraph.report import Page


@Parameter(name="*")
@dataclass(frozen=True)
class Reported(Common):
    """Options of every verb that computes.

    Parameters
    ----------
    json
        Print one JSON object, lengths in metres.
    debug
        Show the traceback of an error.
    report
        Write a page with figures, numbers, the command and the versions into this file (.html).
    """

    report: Path | None = None

    def check(self) -> None:
        """Refuse a report that could not be written, before anything is computed."""
        if self.report is not None:
            files.check_output(self.report, (".html", ".htm"))


REPORTED = Reported()


_SMALL = 240


def enlarged(image: Any) -> int | None:
    """Times that a picture of few pixels is shown larger; None for one that needs it not."""
    times = _SMALL // max(image.shape[:2])
    return times if times > 1 else None


def told(
    common: Reported, text: str, values: Mapping[str, Any], page: Callable[[], "Page"],
    numbers: Sequence[tuple[str, str]] = (),
) -> None:  # fmt: skip
    """Print a verb's result, and write its report where one is asked for.

    Parameters
    ----------
    common
        Of the command.
    text, values
        As `console.report` takes them.
    page
        Gives the title and the figures; called only for a report.
    numbers
        Names, and values with their units, told under "Numbers".
    """
    if common.report is not None:
        written = page()
        if numbers:
            written.section("Numbers").table(list(numbers))
        written.made_by(shlex.join(("lumigraph", *COMMAND.get())))
        written.write(common.report)
        text = f"{text}\nwritten {common.report}"
        values = {**values, "report": str(common.report)}
    console.report(common, text, values)
