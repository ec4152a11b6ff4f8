"""`lumigraph reproduce`."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from lumigraph.cli.console import progress
from lumigraph.cli.options import COMMON, Common, Output
from lumigraph.core.printable import printable
from lumigraph.core.progress import Progress, Stage
from lumigraph.core.result import Result
from lumigraph.errors import FormatError

if TYPE_CHECKING:
    from lumigraph.studies.thesis.registry import Experiment
    from lumigraph.studies.thesis.run import StoredResult as Computed

Flag = Annotated[bool, Parameter(negative="")]


def reproduce(
    *ids: str,
    list_: Annotated[bool, Parameter(name="--list", negative="")] = False,
    quick: Flag = False,
    fresh: Flag = False,
    workers: Annotated[int | None, Parameter(allow_leading_hyphen=True)] = None,
    output: Output = Path("reproduce"),
    common: Common = COMMON,
) -> Result:
    """Recompute the tables and figures of the thesis, beside the printed and the correct values.

    Writes report.html and results.json. Each row says what it proves: "waves", a simulation against theory;
    "closed form", a formula against the printed digits; "told", a number without theory. Finished parts of
    an interrupted run are not computed again.
    With --json prints a list of rows. The exit code is 1 if any row is out of tolerance.

    Example: `lumigraph reproduce 5.4 --quick`

    Parameters
    ----------
    ids
        Experiments, or how their names end: 5.4 is table-5.4. All if left out.
    list_
        Print the experiments and run nothing.
    quick
        Run reduced sizes of the same physics, in minutes.
    fresh
        Compute everything again.
    workers
        Processes that run experiments side by side; as many as the machine has processors if left out.
    output
        Folder for the results; made if it does not exist.
    """
    from lumigraph.studies import thesis

    chosen = thesis.find(ids)
    if list_:
        return _listed(chosen)
    _check_folder(output)
    if workers is not None and workers < 1:
        raise FormatError(f"--workers is {workers} but must be at least 1.")
    from lumigraph.core.arrays import WORKERS
    from lumigraph.studies.thesis import pages, run

    output.mkdir(parents=True, exist_ok=True)
    with progress("reproduce") as shown:
        results = _results(chosen, output, workers or WORKERS, (quick, fresh), shown)
        shown(Stage(1.0, "report"))
        pages.write_report(chosen, results, output / "report.html", quick=quick)
        run.write_records(results, output / "results.json")
    text = "\n\n".join([*map(_table, results), pages.counted(results), f"Open {output / 'report.html'}"])
    return Result(
        "Reproduce",
        "",
        results,
        tuple(text.split("\n")),
        rows=run.records(results),
        failure=_failure(results, output),
    )


def _results(
    chosen: "tuple[Experiment, ...]", output: Path, workers: int, how: tuple[bool, bool], shown: Progress
) -> "list[Computed]":
    """Results of all experiments, by one process or several."""
    from lumigraph.studies.thesis import run, side_by_side

    quick, fresh = how
    if workers == 1 or len(chosen) == 1:
        return run.run(chosen, output, quick=quick, fresh=fresh, progress=shown, finished=_tell)
    results: list[Computed] = []
    for results in side_by_side.run_side_by_side(
        chosen, output, workers, quick=quick, fresh=fresh, finished=_tell
    ):
        shown(Stage(0.99 * len(results) / len(chosen), f"{len(results)} of {len(chosen)} experiments"))
    return results


def _check_folder(output: Path) -> None:
    if output.exists() and not output.is_dir():
        raise FormatError(f"--output {output} is a file. Give a folder.")
    from lumigraph.io.target import check_parent

    check_parent(output)


def _listed(chosen: "tuple[Experiment, ...]") -> Result:
    width = max((len(one.id) for one in chosen), default=0)
    lines = tuple(f"{one.id:<{width}}  {one.title} ({one.thesis})" for one in chosen)
    fields = ("id", "title", "question", "thesis")
    rows = [{field: getattr(one, field) for field in fields} for one in chosen]
    return Result("Experiments", "", chosen, lines, rows=rows)


def _tell(result: "Computed") -> None:
    """One line on standard error as soon as an experiment is finished."""
    failed = f"{len(result.failed)} FAIL" if result.failed else "none fails"
    took = "from an earlier run" if result.stored else f"{result.seconds:.1f} s"
    line = printable(f"{result.id}: {len(result.rows)} rows, {failed}, {took}")
    print(line, file=sys.stderr, flush=True)


def _table(result: "Computed") -> str:
    """Rows of an experiment in columns."""
    from lumigraph.studies.thesis import pages

    lines = [pages.HEADER[:-1], *(pages.cells(row)[:-1] for row in result.rows)]
    widths = [max(len(line[k]) for line in lines) for k in range(len(lines[0]))]
    rows = ["  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)) for line in lines]
    return "\n".join([result.id, *(f"  {row}".rstrip() for row in rows), *result.error.splitlines()])


def _failure(results: "list[Computed]", output: Path) -> str:
    """Reason for the exit code 1, or an empty text."""
    failed = [result for result in results if result.failed]
    if not failed:
        return ""
    rows = sum(len(result.failed) for result in failed)
    names = ", ".join(result.id for result in failed)
    return f"{rows} row{'s' * (rows > 1)} out of tolerance in {names}. See {output / 'report.html'}."
