"""Workers of a running dask cluster: the only home of dask."""

import math
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from threading import Lock
from typing import Any
from uuid import uuid4

from lumigraph.cluster.ledger import LINK
from lumigraph.cluster.pool import DEATHS
from lumigraph.cluster.task import FAILED, Outcome, Task
from lumigraph.errors import LumigraphError

_WAIT = 20.0
"""Longest time until the scheduler answers, or has a worker [s]."""

_ONE = Lock()
"""A worker of several threads takes one frame at a time: what a piece of work keeps is not made for more."""


@dataclass(frozen=True, slots=True)
class Dask:
    """A running dask cluster, whose workers have lumigraph and access to the same files.

    Parameters
    ----------
    address
        Of its scheduler, such as "tcp://10.0.0.1:8786", or "tls://..." with dask's own configuration of
        certificates.
    """

    address: str
    is_here: bool = field(default=False, init=False)

    @contextmanager
    def group(self, task: Task) -> "Iterator[_Group]":
        """Context in which its workers are ready for a task.

        Raises
        ------
        LumigraphError
            distributed is not installed, nobody answers, or there are no workers.
        """
        try:
            from distributed import Client  # pyright: ignore[reportMissingImports] - an extra
        except ImportError:
            raise LumigraphError(
                "a scheduler needs dask's distributed. Install it: pip install 'lumigraph[cluster]'."
            ) from None
        try:
            client = Client(self.address, timeout=_WAIT, set_as_default=False)
        except (OSError, ValueError, TypeError, RuntimeError) as error:  # the last two: no certificates
            raise LumigraphError(
                f"no dask scheduler answers at {self.address} ({type(error).__name__}). Check it, and "
                "for tls:// the certificates of dask's configuration (distributed.comm.tls)."
            ) from None
        try:
            client.wait_for_workers(1, timeout=_WAIT)
            link = task.ledger.folder / LINK
            link.write_text(client.dashboard_link or "")
            try:
                yield _Group(client, task)
            finally:
                link.unlink(missing_ok=True)
        except TimeoutError:
            raise LumigraphError(f"the scheduler at {self.address} has no workers. Start some.") from None
        finally:
            client.close(timeout=2)


class _Group:
    def __init__(self, client: Any, task: Task) -> None:
        self.client, self.task, self.key = client, task, uuid4().hex

    @property
    def count(self) -> int:
        """Workers."""
        return max(len(self.client.scheduler_info(n_workers=-1)["workers"]), 1)

    def each(self, numbers: Iterable[int]) -> Iterator[Outcome]:
        """Outcomes of frames, in the order in which they end.

        Raises
        ------
        LumigraphError
            The scheduler has ended.
        """
        from distributed import as_completed  # pyright: ignore[reportMissingImports] - an extra

        left = list(numbers)
        side = min(self.task.side_by_side, math.ceil(len(left) / self.count))
        parts = (left[k : k + side] for k in range(0, len(left), max(side, 1)))
        futures = {self._begun(part): part for part in parts}
        running = as_completed(futures, loop=self.client.loop)
        for future in running:
            if future.status == "finished":
                yield from future.result()
            elif future.status == "error" and len(futures[future]) > 1:  # of one of them: each alone
                more = {self._begun([number]): [number] for number in futures[future]}
                futures |= more
                running.update(more)
            elif future.status == "error":
                (number,) = futures[future]
                self.task.ledger.fail(number, f"its worker ended: {future.exception()}"[:400])
                yield number, FAILED
            else:
                raise LumigraphError(
                    f"the scheduler was lost ({future.status}). What is done is kept: start it again."
                )

    def _begun(self, numbers: list[int]) -> Any:
        items = {number: self.task.items[number] for number in numbers}  # the other items stay here
        task = replace(self.task, items=items)
        return self.client.submit(_do, task, numbers, self.key, pure=False, retries=DEATHS)


_WORK: dict[str, Any] = {}


def _do(task: Task, numbers: list[int], key: str) -> list[Outcome]:
    """Outcomes of frames on a worker; the work is cached by process, as each frame brings a fresh copy."""
    with _ONE:
        if key not in _WORK:
            _WORK.clear()
            _WORK[key] = task.work
        return list(replace(task, work=_WORK[key]).do(numbers))
