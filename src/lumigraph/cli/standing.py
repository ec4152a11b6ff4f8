"""Status page of a batch, beside its ledger; a browser reloads it by itself."""

import time
from pathlib import Path
from typing import TYPE_CHECKING

from lumigraph.core import memory
from lumigraph.core.progress import Progress

if TYPE_CHECKING:
    from lumigraph.cluster import Report

_EVERY, _SHARE = 2.0, 0.01
"""Seconds between two pages at least, and the part of the time that writing them may take."""

_REFRESH = 3
"""Seconds after which a browser reads the page again."""

_SHOWN = 50
"""Failures and warnings that are listed."""


class Standing:
    """Progress that also writes the page now and then.

    Parameters
    ----------
    output
        Output of the batch.
    shown
        Progress that it passes on.
    """

    def __init__(self, output: Path, shown: Progress) -> None:
        self.output, self.shown, self.next = output, shown, 0.0

    def __call__(self, fraction: float) -> None:
        """Pass on a fraction, and write the page when it is time."""
        self.shown(fraction)
        began = time.perf_counter()
        if began >= self.next:
            write(self.output, going_on=True)
            now = time.perf_counter()
            self.next = now + max(_EVERY, (now - began) / _SHARE)


def write(output: Path, *, going_on: bool = False) -> Path:
    """Write the page of an output; one that goes on is read again by browsers."""
    from lumigraph import cluster
    from lumigraph.report import Page

    found = cluster.status(output)
    page = Page(f"{output.name}: {found.stand}", refresh=_REFRESH * going_on)
    page.section("How it stands").table(_rows(found, going_on))
    if found.link:
        page.sections[-1].text(f"The scheduler's own page: {found.link}")
    if found.failures:
        failed = sorted(found.failures.items())
        told = f"{len(failed)} in all; the next start tries again."
        page.section("Failed").table(failed[:_SHOWN], header=("frame", "why"), caption=told)
    notes = dict.fromkeys(note for entry in found.entries.values() for note in entry.notes)
    if notes:
        page.section("Warnings").table([(note,) for note in list(notes)[:_SHOWN]])
    path = cluster.page(output)
    page.write(path)
    return path


def _rows(found: "Report", going_on: bool) -> dict[str, str]:
    entries, left = list(found.entries.values()), found.count - found.done - len(found.failures)
    rows = {
        "done": f"{found.done} of {found.count}, {100 * found.done / found.count:.3g} %",
        "failed": str(len(found.failures)),
    }
    if found.pace >= 1:
        rows["pace"] = f"{found.pace:.3g} frames a second"
    elif found.pace:
        rows["pace"] = f"{1 / found.pace:.3g} s a frame"
    if going_on and found.pace and left:
        rows["time left"] = duration(left / found.pace)
    if entries:
        middle = sorted(entry.seconds for entry in entries)[len(entries) // 2]
        rows |= {
            "seconds of a worker": f"{middle:.3g} a frame",
            "memory": f"{memory.told(max(entry.memory for entry in entries))} a worker, at most",
            "on the disk": memory.told(sum(entry.size for entry in entries)),
            "workers": str(len({entry.where for entry in entries})),
        }
    return rows | {"state": "running" if going_on else "ended", "written": time.strftime("%Y-%m-%d %H:%M:%S")}


def duration(seconds: float) -> str:
    """A time to go, in words.

    >>> duration(40), duration(600), duration(9000)
    ('40 s', '10 minutes', '2.5 hours')
    """
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} minutes" if seconds < 5400 else f"{seconds / 3600:.1f} hours"
