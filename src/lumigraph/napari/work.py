# pyright: reportMissingImports=false
"""A computation in a separate thread, with its progress, which can be stopped."""

from collections.abc import Callable
from typing import Any

from napari.qt.threading import create_worker
from qtpy.QtCore import QTimer

from lumigraph.core.progress import Progress, what_of

EVERY = 50
"""Time between two looks at the progress [ms]."""

Job = Callable[[Progress], Any]


class Stopped(KeyboardInterrupt):
    """Raised inside a computation that is to stop, where it reports its progress."""


class Work:
    """One computation at a time.

    Parameters
    ----------
    done
        Called in the main thread with what was found; None where it was stopped before it had anything.
    failed
        Called in the main thread with the error.
    shown
        Called in the main thread with the fraction that is done and the present step.
    """

    def __init__(
        self, done: Callable[[Any], None], failed: Callable[[BaseException], None],
        shown: Callable[[float, str], None],
    ) -> None:  # fmt: skip
        self._done, self._failed, self._shown = done, failed, shown
        self._fraction: float = 0.0
        self._stop = False
        self._worker: Any = None
        self._timer = QTimer()
        self._timer.setInterval(EVERY)
        self._timer.timeout.connect(self._look)

    @property
    def is_running(self) -> bool:
        """True while a computation runs."""
        return self._worker is not None

    def start(self, job: Job) -> None:
        """Begin; ``job(progress)`` runs in a thread."""
        self._fraction, self._stop = 0.0, False
        self._worker = create_worker(self._run, job)
        self._worker.returned.connect(self._ended)
        self._timer.start()
        self._worker.start()

    def stop(self) -> None:
        """Stop the computation at its next report of progress; its result does not count then."""
        self._stop = True

    def _run(self, job: Job) -> tuple[Any, BaseException | None]:
        try:
            return job(self._tell), None
        except Stopped:
            return None, None
        except Exception as error:
            return None, error

    def _tell(self, fraction: float) -> None:
        if self._stop:
            raise Stopped
        self._fraction = fraction

    def _look(self) -> None:
        self._shown(float(self._fraction), what_of(self._fraction))

    def _ended(self, result: tuple[Any, BaseException | None]) -> None:
        self._timer.stop()
        self._worker = None
        found, error = result
        if error is not None:
            self._failed(error)
        else:
            self._done(found)
