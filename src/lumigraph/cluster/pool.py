"""Workers in processes of this machine: one that dies is replaced, and its frame is done again."""

import math
import multiprocessing
import os
import signal
import traceback
from collections import Counter, deque
from collections.abc import Iterable, Iterator
from contextlib import suppress
from multiprocessing.connection import Connection, wait
from typing import Any

from lumigraph.cluster.task import FAILED, Outcome, Task
from lumigraph.core import memory

DEATHS = 3
"""Times that workers may die of one frame before it counts as failed."""


class Pool:
    """A number of worker processes for one task.

    Parameters
    ----------
    task
        Task that the workers share.
    count
        Workers.
    """

    def __init__(self, task: Task, count: int) -> None:
        self.task, self.count = task, count
        self._context = multiprocessing.get_context("spawn")
        self._workers: dict[Connection, tuple[Any, list[int]]] = {}
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
        """Outcomes of frames, in the order in which they end."""
        waiting = deque(numbers)
        while waiting or self._busy():
            while waiting and (pipe := self._idle()) is not None:
                self._give(pipe, self._next(waiting))
            for pipe in wait(list(self._workers)):
                assert isinstance(pipe, Connection)
                yield from self._ended(pipe, waiting)

    def _next(self, waiting: "deque[int]") -> list[int]:
        """Frames for one worker: few at the end, for all to have some; alone if one died of it."""
        most = min(self.task.side_by_side, math.ceil(len(waiting) / self.count))
        numbers = [waiting.popleft()]
        while len(numbers) < most and not self._deaths[numbers[0]] + self._deaths[waiting[0]]:
            numbers.append(waiting.popleft())
        return numbers

    def _busy(self) -> bool:
        return any(numbers for _, numbers in self._workers.values())

    def _idle(self) -> Connection | None:
        """A worker that has nothing to do, a new one while there are too few."""
        for pipe, (_, numbers) in self._workers.items():
            if not numbers:
                return pipe
        return self._started() if len(self._workers) < self.count else None

    def _started(self) -> Connection:
        mine, its = self._context.Pipe()
        process = self._context.Process(target=_serve, args=(its, self.task), daemon=True)
        process.start()
        its.close()
        self._workers[mine] = process, []
        return mine

    def _give(self, pipe: Connection, numbers: list[int]) -> None:
        self._workers[pipe] = self._workers[pipe][0], numbers
        with suppress(OSError):  # it has died: `wait` says so, too
            pipe.send(numbers)

    def _ended(self, pipe: Connection, waiting: "deque[int]") -> Iterator[Outcome]:
        process, numbers = self._workers[pipe]
        try:
            number, outcome = pipe.recv()
        except (EOFError, OSError):
            del self._workers[pipe]
            pipe.close()
            process.join()
            for number in numbers:
                yield from self._died(number, process.exitcode, waiting)
            return
        numbers.remove(number)
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
    """Answer numbers of frames with how each ended, until the pipe is closed."""
    memory.keep()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches all processes: the first one decides
    while True:
        try:
            numbers = pipe.recv()
        except (EOFError, OSError):  # who started it has ended
            return
        try:
            for outcome in task.do(numbers):
                pipe.send(outcome)
        except BrokenPipeError:
            return
        except BaseException:  # the ledger itself cannot be written
            traceback.print_exc()
            os._exit(1)
