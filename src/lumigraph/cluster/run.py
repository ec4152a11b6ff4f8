"""`batch`: one piece of work for each of many items, on one machine or many, resumable at any time."""

import math
import os
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Protocol

from lumigraph.cluster import inputs as files
from lumigraph.cluster.entry import Entry
from lumigraph.cluster.estimate import Estimate, many
from lumigraph.cluster.ledger import LINK, PAGE, Ledger, require_free
from lumigraph.cluster.pool import Pool
from lumigraph.cluster.task import BUSY, FULL, Outcome, Task, Work
from lumigraph.core import arrays, checks
from lumigraph.core.progress import Progress, Stage, silent
from lumigraph.errors import LumigraphError

_TRIED, _TRIAL, _PART = 16, 5.0, 4
"""Frames of each worker that are done before the others are estimated, at most, the seconds that they take,
at most, if more than one; and one of so many frames at most."""

_TOLD = 16
"""Frames that are checked for each call of the progress callback."""

_ROUNDS, _PATIENCE = 600, 1.0
"""How often, and after how many seconds, frames that another worker claims are tried again."""


class Group(Protocol):
    """Workers of one task."""

    @property
    def count(self) -> int:
        """Number of workers."""
        ...

    def each(self, numbers: Iterable[int]) -> Iterator[Outcome]:
        """Outcomes of frames, in the order in which they end."""
        ...


class Cluster(Protocol):
    """Protocol of a source of workers: this machine, or a scheduler."""

    @property
    def is_here(self) -> bool:
        """True if workers share this machine's memory."""
        ...

    def group(self, task: Task) -> AbstractContextManager[Group]:
        """Context in which they are ready for a task."""
        ...


@dataclass(frozen=True, slots=True)
class Local:
    """Processes of this machine.

    Parameters
    ----------
    count
        Number of workers.
    """

    count: int
    is_here: bool = field(default=True, init=False)

    def group(self, task: Task) -> Pool:
        """Context in which they are ready for a task."""
        return Pool(task, self.count)


@dataclass(frozen=True, slots=True)
class Report:
    """State of a job.

    Parameters
    ----------
    count
        Frames in all.
    entries
        Entries of the frames done, by number.
    failures
        Why frames failed, by number.
    seconds
        Time since this start [s].
    pace
        Frames a second, of late; 0 where it is not known.
    link
        Link to the scheduler's own page, while it is in use.
    page
        File that shows how it stands, where there is one.
    noun
        Name of an item.
    """

    count: int
    entries: dict[int, Entry] = field(repr=False)
    failures: dict[int, str] = field(repr=False)
    seconds: float = 0.0
    pace: float = 0.0
    link: str = ""
    page: Path | None = None
    noun: str = "frame"

    @property
    def stand(self) -> str:
        """Number of frames done, in words."""
        return f"{self.done} of {self.count} {many(self.noun, self.count)}"

    @property
    def done(self) -> int:
        """Frames that are done."""
        return len(self.entries)

    @property
    def is_whole(self) -> bool:
        """True if all frames are done."""
        return self.done == self.count


def batch(
    work: Work,
    items: Sequence[Any],
    output: str | os.PathLike[str],
    *,
    what: Mapping[str, Any] | None = None,
    inputs: Iterable[str | os.PathLike[str]] = (),
    workers: int | Cluster = 1,
    part: tuple[int, int] = (1, 1),
    progress: Progress = silent,
    estimated: Callable[[Estimate], None] | None = None,
) -> Report:
    """Do a piece of work for each of many items, and write the results as one series.

    What is done is noted in a ledger beside the output. Kill it at any time: the same call goes on where it
    was, on this machine or another. The results are the same bits whatever the number of workers and
    interruptions, if `work` gives the same bits of the same item.

    Parameters
    ----------
    work
        Called with an item in another process: a function of a module, or an object that can be pickled.
        It gives a picture, several, views, a volume, a depth map or arrays by name, of one shape for all
        items, which go into shards of a Zarr store; `Several` of them; or `Values`, which stay in the ledger.
    items
        Items that JSON can hold: paths, numbers, mappings of them.
    output
        A Zarr store, which others can open while it grows.
    what
        What the work is, as JSON values: a start with another one is refused.
    inputs
        Files, or folders, that the work reads besides its items. Their size, time and hash are noted: a start
        with another content is refused, and a frame fails while which one changed.
    workers
        Processes on this machine; or a `Dask` cluster.
    part
        Part of the items to do, of how many equal ones, counted from 1, as the jobs of a queue share them.
    progress
        Called with the fraction that is done.
    estimated
        Called with what the rest will need, once the first frames are done.

    Returns
    -------
    Report
        With the failures of this part: an item whose work raises an error is noted and left out, and tried
        again at the next start.

    Raises
    ------
    FormatError
        Another job has begun this output, or another version of lumigraph; an input has changed since; or
        another start works on it.
    SamplingError
        The first frames show that memory or disk do not suffice.

    Notes
    -----
    In a script, call it under ``if __name__ == "__main__":``, as Python's multiprocessing wants it.
    """
    began, output = time.perf_counter(), Path(output)
    cluster = Local(checks.whole("workers", workers)) if isinstance(workers, int) else workers
    known = files.all_known(inputs)
    task = Task(work, dict(enumerate(items)), output, len(items), tuple(known))
    first, last = _share(part, task.count)
    require_free(output)
    task.ledger.open({**(what or {}), **({"inputs": known} if known else {})}, items)
    with task.ledger.started(first, last):
        if output.is_dir():  # a table's output is a file that is made in the end
            task.ledger.mend_store(output)
        left = list(_left(task, first, last, progress))
        with cluster.group(task) as group:
            if left:
                rest = _begin(task, (cluster, group), left, progress, estimated)
                _do(task, group, rest, len(left) - len(rest), len(left), progress)
    found = status(output)
    mine = {number: why for number, why in found.failures.items() if first <= number < last}
    return replace(found, failures=mine, seconds=time.perf_counter() - began)


@contextmanager
def rows(output: str | os.PathLike[str]) -> Iterator[list[dict[str, Any]]]:
    """Context that gives the values of all items that are done, in their order; nobody else is in it.

    Raises
    ------
    FormatError
        No job's output, or a damaged entry.
    """
    ledger = Ledger.beside(Path(output))
    ledger.job()  # refused where there is none
    with ledger.alone():
        yield [entry.values for _, entry in sorted(ledger.all_entries().items())]


def status(output: str | os.PathLike[str]) -> Report:
    """State of a job, by its output or its ledger, while it runs or afterwards.

    Raises
    ------
    FormatError
        Neither.
    """
    path = Path(output)
    ledger = Ledger(path) if (path / "job.json").exists() else Ledger.beside(path)
    entries = ledger.entries()
    failures = {number: why for number, why in ledger.failures().items() if number not in entries}
    link, page = ledger.folder / LINK, ledger.folder / PAGE
    return Report(
        len(ledger.job()["items"]), entries, failures, pace=ledger.pace(), noun=ledger.noun,
        link=_line(link), page=page if page.exists() else None,
    )  # fmt: skip


def _line(path: Path) -> str:
    """The one line of a small file; empty where there is none, or it is something else."""
    try:
        return path.read_text().strip()[:200] if path.is_file() and path.stat().st_size < 4096 else ""
    except (OSError, ValueError):
        return ""


def page(output: str | os.PathLike[str]) -> Path:
    """Path of the page that shows the state of a job, by its output or its ledger."""
    path = Path(output)
    return (path if (path / "job.json").exists() else Ledger.beside(path).folder) / PAGE


def _begin(
    task: Task, who: tuple[Cluster, Group], left: list[int], progress: Progress,
    estimated: Callable[[Estimate], None] | None,
) -> list[int]:  # fmt: skip
    """Do some frames, report the estimated needs of the rest, and return the rest.

    The first one makes what they share; after it, some from all over the job by all workers side by side.

    Raises
    ------
    SamplingError
        The others cannot fit.
    """
    began, (_, group) = time.perf_counter(), who
    done = _do(task, group, left[:1], 0, len(left), progress)
    first, rest = _entries(task, done), left[1:]
    starting = max(time.perf_counter() - began - sum(one.seconds for one in first), 0.0)
    if first and rest:
        _need(task, who, len(rest), first, starting)  # refused before other workers take as much memory
    for _ in range(2):  # in the first round each worker makes what it keeps
        tried = _tried(rest, len(done), group.count, _quickest(_entries(task, done)))
        done += _do(task, group, tried, len(done), len(left), progress)
        rest = [number for number in rest if number not in set(tried)]
    known = _entries(task, done)
    if known and rest:
        _need(task, who, len(rest), known, starting, estimated)
    return rest


def _tried(rest: list[int], done: int, workers: int, seconds: float) -> list[int]:
    """Some of the frames, evenly spaced as costs may change along a job.

    One for each worker at first; then as many as the quickest of those that are done lets them do in time.

    >>> _tried(list(range(1, 24)), 1, 2, 9.0), _tried([7, 8], 1, 4, 60.0)
    ([6, 18], [8])
    >>> [len(_tried(list(range(n)), 3, 2, 0.5)) for n in (21, 397)], _tried(list(range(397)), 3, 2, 9.0)
    ([3, 20], [])
    """
    each = 1 if done == 1 else min(_TRIED, int(_TRIAL / max(seconds, 1e-3)))
    most = max((len(rest) + done - 1) // _PART, 1) - (done - 1)
    count = max(min(workers * each, most, len(rest)), 0)
    return [rest[(2 * k + 1) * len(rest) // (2 * count)] for k in range(count)]


def _quickest(known: list[Entry]) -> float:
    """Least time of a frame [s]: those that made what their worker keeps took more."""
    return min((entry.seconds for entry in known), default=math.inf)


def _entries(task: Task, numbers: list[int]) -> list[Entry]:
    """Entries of the frames that did not fail."""
    return [entry for number in numbers if (entry := task.ledger.entry(number)) is not None]


def _need(
    task: Task, who: tuple[Cluster, Group], frames: int, known: list[Entry], starting: float,
    estimated: Callable[[Estimate], None] | None = None,
) -> None:  # fmt: skip
    """Tell what so many frames need, by those that are known, and refuse what cannot fit."""
    cluster, group = who
    processors = arrays.WORKERS if cluster.is_here else math.inf
    needed = Estimate.of(known, frames, group.count, processors=processors, starting=starting)
    needed = replace(needed, noun=task.ledger.noun)
    if estimated is not None:
        estimated(needed)
    needed.require(group.count if cluster.is_here else 1, task.output)


def _do(task: Task, group: Group, numbers: list[int], done: int, total: int, progress: Progress) -> list[int]:
    """Do some frames; those claimed by another worker are tried until they are done.

    Their numbers are given in the order in which they ended.

    Raises
    ------
    LumigraphError
        The disk is full, or others do not end.
    """
    ended, began, waiting = list[int](), time.perf_counter(), numbers
    for _ in range(_ROUNDS):
        busy = []
        for number, outcome in group.each(waiting):
            if outcome == FULL:
                raise LumigraphError(
                    f"the disk of {task.output} is full. What is done is kept. Free some space, start again."
                )
            if outcome == BUSY:
                busy.append(number)
                continue
            ended.append(number)
            rate = len(ended) / (time.perf_counter() - began)
            whole = done + len(ended)
            progress(Stage(whole / total, f"{whole} of {total} done, {_pace(rate)}"))
        if not busy:
            return ended
        waiting = busy
        time.sleep(_PATIENCE)
    raise LumigraphError(
        f"{len(waiting)} frames are still being computed by other runs. Start again when they have ended."
    )


def _pace(rate: float) -> str:
    return f"{rate:.2g} a second" if rate >= 1 else f"{1 / rate:.2g} s each"


def _left(task: Task, first: int, last: int, progress: Progress) -> Iterator[int]:
    """Frames that are still to do, by the checksums of all that is there."""
    for number in range(first, last):
        if not _kept(task, number):
            yield number
        elif number % _TOLD == 0:
            progress(Stage((number + 1) / task.count, f"frame {number} of {task.count} is whole"))


def _kept(task: Task, number: int) -> bool:
    """True if a frame is done and its shards are intact; the record of one that is not is removed."""
    if task.is_done(number, content=True):
        return True
    task.ledger.forget(number)
    return False


def _share(part: tuple[int, int], count: int) -> tuple[int, int]:
    number, parts = part
    if not 1 <= number <= parts:
        raise LumigraphError(f"part is {number} of {parts} but must be from 1 to {parts}.")
    return (number - 1) * count // parts, number * count // parts
