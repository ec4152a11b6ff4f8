"""Workers in processes of this machine: one that dies is replaced, and its frame is done again."""

import multiprocessing
import os
import signal
import traceback
from collections import Counter, deque
from collections.abc import Iterable, Iterator
from contextlib import suppress
from multiprocessing.connection import Connection, wait
from typing import Any

from lumigraph.cluster.task import FAILED, Task

DEATHS = 3
"""Times that workers may die of one frame before it counts as failed."""

Outcome = tuple[int, str]
"""Number of a frame and how it ended."""


class Pool:
    """A number of worker processes for one task.

    Parameters
    ----------
    task
        That they share.
    count
        Workers.
    """

    def __init__(self, task: Task, count: int) -> None:
        self.task, self.count = task, count
        self._context = multiprocessing.get_context("spawn")
        self._workers: dict[Connection, tuple[Any, int | None]] = {}
        self._deaths: Counter[int] = Counter()

    def __enter__(self) -> "Pool":
        return self

    def __exit__(self, *_: object) -> None:
        """Stop all workers; what they had not noted is not done."""
        for pipe, work in self._workers.items():
            work[0].kill()
            pipe.close()
        for work in self._workers.values():
            work[0].join()
        self._workers.clear()

    def each(self, numbers: Iterable[int]) -> Iterator[Outcome]:
        """How each frame ended, in the order in which they do."""
        waiting = deque(numbers)
        while waiting or self._busy():
            for pipe in self._idle(len(waiting)):
                self._give(pipe, waiting.popleft())
            for pipe in wait(list(self._workers)):
                assert isinstance(pipe, Connection)
                yield from self._ended(pipe, waiting)

    def _busy(self) -> int:
        return sum(number is not None for _, number in self._workers.values())

    def _idle(self, wanted: int) -> list[Connection]:
        """At most so many workers that have nothing to do; new ones while there are too few."""
        idle = [pipe for pipe, (_, number) in self._workers.items() if number is None][:wanted]
        while len(idle) < wanted and len(self._workers) < self.count:
            idle.append(self._started())
        return idle

    def _started(self) -> Connection:
        mine, its = self._context.Pipe()
        process = self._context.Process(target=_serve, args=(its, self.task), daemon=True)
        process.start()
        its.close()
        self._workers[mine] = process, None
        return mine

    def _give(self, pipe: Connection, number: int) -> None:
        self._workers[pipe] = self._workers[pipe][0], number
        with suppress(OSError):  # it has died: `wait` says so, too
            pipe.send(number)

    def _ended(self, pipe: Connection, waiting: "deque[int]") -> Iterator[Outcome]:
        process, number = self._workers[pipe]
        try:
            outcome = pipe.recv()
        except (EOFError, OSError):
            del self._workers[pipe]
            pipe.close()
            process.join()
            if number is not None:
                yield from self._died(number, process.exitcode, waiting)
            return
        self._workers[pipe] = process, None
        assert number is not None
        yield number, outcome

    def _died(self, number: int, code: int | None, waiting: "deque[int]") -> Iterator[Outcome]:
        self._deaths[number] += 1
        if self._deaths[number] < DEATHS:
            waiting.append(number)
            return
        cause = f"by signal {-code}" if code and code < 0 else f"with code {code}"
        why = f"its worker ended {cause}, {DEATHS} times: too little memory? Use fewer workers."
        self.task.ledger.fail(number, why)
        yield number, FAILED


def _serve(pipe: Connection, task: Task) -> None:
    """Answer numbers of frames with how they ended, until the pipe is closed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches all processes: the first one decides
    while True:
        try:
            number = pipe.recv()
        except (EOFError, OSError):  # who started it has ended
            return
        try:
            pipe.send(task.do(number))
        except BrokenPipeError:
            return
        except BaseException:  # the ledger itself cannot be written
            traceback.print_exc()
            os._exit(1)
