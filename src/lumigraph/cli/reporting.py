"""`--report`: every verb's page has its figures, its numbers with units, the command and the versions."""

import shlex
from collections.abc import Callable
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cyclopts import Parameter

from lumigraph.cli import console, files
from lumigraph.cli.options import COMMAND, WARNED, Common, section
from lumigraph.core.printable import printable
from lumigraph.core.result import Result
from lumigraph.errors import LumigraphError

if TYPE_CHECKING:
    from lumigraph.report import Page


@Parameter(name="*", group=section("Output"))
@dataclass(frozen=True)
class ReportOptions(Common):
    """Options of every verb that computes.

    Parameters
    ----------
    json
        Print one JSON object, lengths in metres.
    debug
        Show the traceback of an error.
    overwrite
        Replace outputs that another command, or the same one for other inputs, has written.
    report
        Write a page with figures, numbers, the command and the versions into this file (.html).
    """

    report: Path | None = None

    def check(self) -> None:
        """Refuse a report that could not be written, before anything is computed."""
        if self.report is not None:
            files.check_output(self.report, (".html", ".htm"))


REPORTED = ReportOptions()

Verb = Callable[..., Result | None]

_SMALL = 240


def enlarged(image: Any) -> int | None:
    """Times that a picture of few pixels is shown larger; None where that is not needed."""
    times = _SMALL // max(image.shape[:2])
    return times if times > 1 else None


def telling(verb: Verb) -> Verb:
    """The verb as the command line runs it: its result is printed, and written as a report where asked.

    Raises
    ------
    LumigraphError
        The result's failure, after it is printed.
    """

    @wraps(verb)
    def run(*arguments: Any, **options: Any) -> None:
        result = verb(*arguments, **options)
        if result is not None:
            tell(options.get("common", REPORTED), result)
            if result.failure:
                raise LumigraphError(result.failure)

    return run


def tell(common: Common, result: Result) -> None:
    """Print a result as text or as JSON, and write its report if one is requested."""
    text, values = result.text(WARNED.get([])), result.values()
    if isinstance(common, ReportOptions) and common.report is not None:
        page(result).write(common.report)
        text, values = f"{text}\nwritten {printable(common.report)}", {**values, "report": str(common.report)}
        files.note_written([common.report])
    files.note_written(result.written)
    console.report(common, text, values if result.rows is None else result.rows)


def page(result: Result) -> "Page":
    """A result as a page: its figures, its numbers, what to know, and how it was made."""
    from lumigraph.report import Page

    found, sections = Page(result.title, result.about), {}
    for figure in result.figures():
        if figure.section not in sections:
            sections[figure.section] = found.section(figure.section)
        section = sections[figure.section]
        match figure.image:
            case str() as text:
                section.lines(text)
            case list() as rows:
                section.table(rows[1:], header=rows[0])
            case image:
                section.figure(image, figure.caption, **figure.options)
    if result.quantities:
        found.section("Numbers").table([(one.label, str(one)) for one in result.quantities])
    if result.notes:
        found.section("What to know").text("\n\n".join(result.notes))
    found.made_by(shlex.join(("lumigraph", *COMMAND.get())))
    return found
