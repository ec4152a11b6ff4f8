"""What a worker does for one frame, wherever it runs: claim it, compute it, write it, note it."""

import os
import platform
import sys
import time
import warnings
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from lumigraph.cluster.ledger import Entry, Ledger
from lumigraph.core.threads import single_products
from lumigraph.errors import LumigraphError
from lumigraph.io import series

Work = Callable[[Any], Any]
"""Gives what is wanted of one item: a picture, views, a volume, a depth map, arrays by name; or `Values`."""

DONE, FAILED, BUSY = "done", "failed", "busy"
"""How a frame ended: noted as done, noted as failed, claimed by somebody else."""

_LONGEST = 400
"""Characters of an error that are kept."""


@dataclass(frozen=True, slots=True)
class Values:
    """Numbers and words by name: a row of a table instead of arrays."""

    row: Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class Several:
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


@dataclass(frozen=True)
class Task:
    """A job as a worker sees it; it is sent to other processes and machines.

    Parameters
    ----------
    work
        Called with an item; what it keeps between calls belongs to the process.
    items
        Of the frames, by their numbers.
    output
        A store of shards, beside which the ledger lies.
    count
        Items of the job.
    """

    work: Work
    items: Mapping[int, Any]
    output: Path
    count: int

    @cached_property
    def ledger(self) -> Ledger:
        """What is done."""
        return Ledger.beside(self.output)

    def do(self, number: int) -> str:
        """Compute one frame unless it is done or somebody does so: `DONE`, `FAILED` or `BUSY`."""
        with self.ledger.claimed(number) as mine:
            if not mine:
                return BUSY
            if self.is_done(number):
                return DONE
            try:
                self.ledger.record(self._made(number))
                return DONE
            except (KeyboardInterrupt, SystemExit):
                raise
            except BaseException as error:
                self.ledger.fail(number, _line(error))
                return FAILED

    def is_done(self, number: int, *, content: bool = False) -> bool:
        """Whether a frame is noted, and what it wrote is there; as its checksums say, if `content`."""
        entry = self.ledger.entry(number)
        return entry is not None and series.is_whole(self.output, entry.files, content=content)

    def _made(self, number: int) -> Entry:
        began, busy = time.perf_counter(), time.process_time()
        with warnings.catch_warnings(record=True) as caught, single_products():
            warnings.simplefilter("default")
            files, values = self._done(number, self.work(self.items[number]))
        notes = list(dict.fromkeys(str(one.message)[:_LONGEST] for one in caught))
        return Entry(
            number, time.perf_counter() - began, peak(), sum(size for size, _ in files.values()),
            f"{platform.node()}:{os.getpid()}", files, values, notes, time.process_time() - busy,
        )  # fmt: skip

    def _done(self, number: int, found: Any) -> tuple[series.Checksums, dict[str, Any]]:
        """Files that were written, and values."""
        if isinstance(found, Values):
            return {}, dict(found.row)
        if not isinstance(found, Several):
            return self._written(number, series.Frame.of(found), self.count), {}
        files: series.Checksums = {}
        for place, thing in enumerate(found.things, found.first):
            files |= self._written(place, series.Frame.of(thing), found.count)
        return files, {}

    def _written(self, number: int, frame: series.Frame, count: int) -> series.Checksums:
        if not (self.output / "zarr.json").exists():
            with self.ledger.alone():
                if not (self.output / "zarr.json").exists():
                    series.create(self.output, frame, count)
        return series.write(self.output, number, frame)


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
