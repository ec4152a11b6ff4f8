"""Work on one frame, wherever it runs: claim it, compute it, write it, record it."""

import errno
import os
import platform
import sys
import time
import warnings
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

from lumigraph.cluster.entry import Entry
from lumigraph.cluster.inputs import Known, check_unchanged
from lumigraph.cluster.ledger import Ledger
from lumigraph.core.threads import single_products
from lumigraph.errors import LumigraphError
from lumigraph.io import series

Work = Callable[[Any], Any]
"""Gives what is wanted of one item: a picture, views, a volume, a depth map, arrays by name; or `Values`."""

Outcome = tuple[int, str]
"""Number of a frame and how it ended."""

DONE, FAILED, BUSY, FULL = "done", "failed", "busy", "full"
"""Outcomes of a frame: noted as done, noted as failed, claimed by somebody else."""

_LONGEST = 400
"""Characters of an error that are kept."""


@dataclass(frozen=True, slots=True)
class Values:
    """Numbers and words by name: a row of a table instead of arrays."""

    row: Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class FrameGroup:
    """Results of frames in a row, which one item makes: all are done, or none.

    Parameters
    ----------
    first
        Number of the first one in the output.
    count
        Frames of the whole output.
    things
        Results, taken and written one after the other.
    """

    first: int
    count: int
    things: Iterable[Any]


@runtime_checkable
class BatchedWork(Protocol):
    """Work that does some items in less time than one after the other."""

    @property
    def side_by_side(self) -> int:
        """Number of items to compute at a time, at most."""
        ...

    def several(self, items: Sequence[Any]) -> Iterator[Sequence[Any]]:
        """Results of each item in order, or the exception that ended it; some are computed at a time.

        Which items there are does not change a bit of what it gives of one.
        """
        ...


@dataclass(frozen=True)
class Task:
    """A job for a worker; it is sent to other processes and machines.

    Parameters
    ----------
    work
        Called with an item; what it keeps between calls belongs to the process.
    items
        Items of the frames, by their numbers.
    output
        A store of shards, beside which the ledger lies.
    count
        Items of the job.
    inputs
        Files that the work reads besides, as they were when the job began.
    """

    work: Work
    items: Mapping[int, Any]
    output: Path
    count: int
    inputs: tuple[Known, ...] = ()

    @cached_property
    def ledger(self) -> Ledger:
        """Ledger of the frames done."""
        return Ledger.beside(self.output)

    @property
    def side_by_side(self) -> int:
        """Frames that a worker is given at a time, at most."""
        return self.work.side_by_side if isinstance(self.work, BatchedWork) else 1

    def do(self, numbers: Sequence[int]) -> Iterator[Outcome]:
        """Compute frames unless they are done or somebody does so: `DONE`, `FAILED`, `BUSY`, `FULL`."""
        with ExitStack() as claims:
            mine = []
            for number in numbers:
                if not claims.enter_context(self.ledger.claimed(number)):
                    yield number, BUSY
                elif self.is_done(number):
                    yield number, DONE
                else:
                    mine.append(number)
            yield from self._do(mine)

    def _do(self, numbers: list[int]) -> Iterator[Outcome]:
        """Frames that nobody else does."""
        results, left = self._results([self.items[number] for number in numbers]), deque(numbers)
        while left:
            with _measured() as cost:
                found = _tried(next, results)
            if isinstance(found, BaseException):  # of the work as a whole
                found = [found] * len(left)
            cost.share(len(found))
            for thing in found:
                number = left.popleft()
                yield number, self._noted(number, thing, cost)

    def _results(self, items: list[Any]) -> Iterator[Sequence[Any]]:
        """Results of some items at a time, or the exceptions that they raise."""
        if isinstance(self.work, BatchedWork):
            yield from self.work.several(items)
        else:
            yield from ([_tried(self.work, item)] for item in items)

    def _noted(self, number: int, thing: Any, cost: "_Cost") -> str:
        """Write a result, and note it or why there is none."""
        noted = thing if isinstance(thing, BaseException) else _tried(self._record, number, thing, cost)
        if noted is None:
            return DONE
        if noted is not thing and _is_full(noted):
            return FULL
        if (error := _tried(self.ledger.fail, number, _line(noted))) is None:
            return FAILED
        if _is_full(error):
            return FULL
        raise error

    def _record(self, number: int, thing: Any, made: "_Cost") -> None:
        check_unchanged(self.inputs)  # after the work: what it has read is what was noted
        with _measured() as cost:
            files, values = self._written_of(number, thing)
        notes = list(dict.fromkeys(made.notes + cost.notes))
        self.ledger.record(Entry(
            number, made.seconds + cost.seconds, peak(), sum(size for size, _ in files.values()),
            f"{platform.node()}:{os.getpid()}", files, values, notes, made.busy + cost.busy,
        ))  # fmt: skip

    def is_done(self, number: int, *, content: bool = False) -> bool:
        """True if a frame is recorded and its files are there; with `content`, with their checksums."""
        entry = self.ledger.entry(number)
        return entry is not None and series.is_whole(self.output, entry.files, content=content)

    def _written_of(self, number: int, found: Any) -> tuple[series.Checksums, dict[str, Any]]:
        """Files that were written, and values."""
        if isinstance(found, Values):
            return {}, dict(found.row)
        if not isinstance(found, FrameGroup):
            return self._written(number, series.SeriesFrame.of(found), self.count), {}
        files: series.Checksums = {}
        for place, thing in enumerate(found.things, found.first):
            files |= self._written(place, series.SeriesFrame.of(thing), found.count)
        return files, {}

    def _written(self, number: int, frame: series.SeriesFrame, count: int) -> series.Checksums:
        if not (self.output / "zarr.json").exists():
            with self.ledger.alone():
                if not (self.output / "zarr.json").exists():
                    series.create(self.output, frame, count, self.ledger.keep_store)
        return series.write(self.output, number, frame)


@dataclass(slots=True)
class _Cost:
    """Time and processor time of something [s], and the warnings of it."""

    seconds: float = 0.0
    busy: float = 0.0
    notes: list[str] = field(default_factory=list)

    def share(self, count: int) -> None:
        """Make it that of one of several frames that were done together."""
        self.seconds, self.busy = self.seconds / count, self.busy / count


@contextmanager
def _measured() -> Iterator[_Cost]:
    """Context whose cost is known when it ends."""
    cost, began, busy = _Cost(), time.perf_counter(), time.process_time()
    with warnings.catch_warnings(record=True) as caught, single_products():
        warnings.simplefilter("default")
        yield cost
    cost.notes = list(dict.fromkeys(str(one.message)[:_LONGEST] for one in caught))
    cost.seconds, cost.busy = time.perf_counter() - began, time.process_time() - busy


def _tried(function: Callable[..., Any], *given: Any) -> Any:
    """Result of a function, or the error that it raises."""
    try:
        return function(*given)
    except (KeyboardInterrupt, SystemExit):
        raise
    except BaseException as error:
        return error


def _is_full(error: BaseException | None) -> bool:
    """True if an error comes from a full disk."""
    if error is None:
        return False
    own = isinstance(error, OSError) and error.errno in (errno.ENOSPC, errno.EDQUOT)
    return own or _is_full(error.__cause__)


def peak() -> int:
    """Most memory that this process has held [bytes]; 0 where the system does not say."""
    try:
        import resource
    except ImportError:
        return 0
    used = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return used if sys.platform == "darwin" else 1024 * used


def _line(error: BaseException) -> str:
    text = " ".join(str(error).split())
    if isinstance(error, LumigraphError):
        return text[:_LONGEST]
    if isinstance(error, OSError):
        return f"{error.filename or ''}: {error.strerror or text}"[:_LONGEST].lstrip(": ")
    return f"{type(error).__name__}: {text}"[:_LONGEST]
