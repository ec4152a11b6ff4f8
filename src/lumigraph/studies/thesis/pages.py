"""The report of a run: each experiment with its question, its set-up, its table and its figures."""

from collections.abc import Sequence
from functools import cache
from pathlib import Path

from lumigraph import plots, report
from lumigraph.instruments import load_camera
from lumigraph.report.pictures import Picture, picture
from lumigraph.studies.thesis.registry import Experiment, ResultRow
from lumigraph.studies.thesis.run import StoredResult, compact, kinds

INTRODUCTION = """
Every table and figure of the thesis that lumigraph started from, computed again. "Thesis" is what is printed
there, "expected" what is right (from closed forms, exact integrals or independent calculations), "got" what
lumigraph computed in this run. A row fails where got and expected differ by more than the tolerance.
The last but one column says what a row proves. "waves": a simulated wave or a picture made of it agrees with
theory. "closed form": a formula agrees with the printed digits or with another form of itself. "told": no
theory gives this number; where one is expected, it is what an earlier run found.
"""
HEADER = ("quantity", "unit", "thesis", "expected", "tolerance", "got", "", "kind", "note")
_GIB = 2**30


def write_report(
    chosen: Sequence[Experiment], results: Sequence[StoredResult], path: Path, *, quick: bool
) -> None:
    """Write one self-contained HTML page.

    Parameters
    ----------
    chosen, results
        Experiments and what they answered, in the same order.
    path
        Path of the page.
    quick
        True for reduced sizes, which the page mentions.
    """
    page = report.Page("The thesis, reproduced", INTRODUCTION)
    _overview(page, chosen, results, quick)
    drawn: dict[str, str] = {}
    for one, result in zip(chosen, results, strict=True):
        _section(page.section(f"{one.id}: {one.title}"), one, result, drawn)
    page.write(path)


def _overview(
    page: report.Page, chosen: Sequence[Experiment], results: Sequence[StoredResult], quick: bool
) -> None:
    section = page.section("Overview")
    checked = [row for result in results for row in result.rows if row.passed is not None]
    failed = sum(not row.passed for row in checked)
    seconds, memory = sum(one.seconds for one in results), max(one.memory for one in results)
    section.text(counted(results))
    section.text(
        f"{len(checked)} rows were checked: {len(checked) - failed} pass, {failed} fail. "
        f"{'Reduced' if quick else 'Full'} sizes took {seconds:.0f} s"
        + (f" and at most {memory / _GIB:.1f} GiB of memory." if memory else ".")
    )
    rows = [
        (one.id, one.title, len(result.rows), len(result.failed) or "none", f"{result.seconds:.1f} s")
        for one, result in zip(chosen, results, strict=True)
    ]
    section.table(rows, header=("experiment", "what it is about", "rows", "fail", "time"))


def counted(results: Sequence[StoredResult]) -> str:
    """Sentence that says how many rows prove what."""
    found = kinds(results)
    return (
        f"{sum(found.values())} rows: {found['waves']} proven by waves, {found['closed form']} closed forms "
        f"and {found['told']} told, which have no theory."
    )


def _section(section: report.Section, one: Experiment, result: StoredResult, drawn: dict[str, str]) -> None:
    """Question, set-up (a camera is drawn where it comes first), pictures beside the thesis' words, rows."""
    section.text(one.question)
    if one.camera in drawn:
        section.text(f"The set-up is the camera {one.camera}, drawn under {drawn[one.camera]}.")
    elif one.camera:
        section.parts.append(_drawn(one.camera))
        drawn[one.camera] = one.id
    there = f"In the thesis ({one.thesis}): {one.shows}" if one.shows else f"In the thesis: {one.thesis}."
    if result.pictures:
        section.beside(there, result.pictures)
    else:
        section.text(there)
    section.table([cells(row) for row in result.rows], header=HEADER)
    if result.why:
        section.text(f"Why they differ: {result.why}")
    if result.error:
        section.lines(result.error)


@cache
def _drawn(camera: str) -> Picture:
    caption = f"The set-up: camera {camera}; heights are exaggerated"
    return compact(picture(plots.layout(load_camera(camera)), caption, wide=True))


def cells(row: ResultRow) -> tuple[str, ...]:
    """A row as texts under `HEADER`."""
    verdict = {True: "passes", False: "FAILS", None: ""}[row.passed]
    return (
        row.quantity, row.unit, _text(row.thesis), _text(row.expected), _tolerance(row), _text(row.got),
        verdict, row.kind, row.note,
    )  # fmt: skip


def _text(value: float | str | None) -> str:
    if value is None:
        return "–"
    return value if isinstance(value, str) else f"{value:.5g}"


def _tolerance(row: ResultRow) -> str:
    if row.expected is None:
        return ""
    below, above = row.margins
    return f"± {below:.3g}" if below == above else f"- {below:.3g}, + {above:.3g}".replace("inf", "any")
