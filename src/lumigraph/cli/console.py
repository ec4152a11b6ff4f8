"""Results on standard output, progress on standard error."""

import json
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from typing import Any

from lumigraph.cli.options import Common
from lumigraph.core.printable import printable, printable_json, printable_lines
from lumigraph.core.progress import Needs, Progress, what_of

FIRST_LINE = 10.0
"""Seconds before progress is written where there is no terminal."""


_interrupted = threading.Event()


def report(common: Common, text: str, values: Mapping[str, Any] | Sequence[Any]) -> None:
    """Print the result of a verb: text for people, or with `--json` one object, or a list of them."""
    if common.json:
        print(printable_json(json.dumps(values, default=plain, ensure_ascii=False)))
    else:
        print(printable_lines(text))


@contextmanager
def progress(task: str) -> Iterator[Progress]:
    """Context that gives a function which moves a bar on a terminal, or writes a line now and then.

    Until it is called, and where it never is, the bar only shows that something goes on.
    """
    with _bar(task) as update:

        def tell(fraction: float) -> None:
            if _interrupted.is_set():
                raise KeyboardInterrupt
            text = printable(": ".join(filter(None, (task, what_of(fraction)))))
            if isinstance(fraction, Needs):
                line(text)
            update(description=text, completed=fraction, total=1.0)

        yield tell


@contextmanager
def interrupts() -> Iterator[None]:
    """Context in which no Ctrl-C is lost: what Python drops in a finaliser is raised again by progress.

    After one, finalisers of what libraries had begun to make do not complain into the one line that is said.
    """
    complain = sys.unraisablehook

    def stop(*_: object) -> None:
        _interrupted.set()
        sys.unraisablehook = lambda _: None
        raise KeyboardInterrupt

    _interrupted.clear()
    signal.signal(signal.SIGINT, stop)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)
        sys.unraisablehook = complain
        _interrupted.clear()


@contextmanager
def _bar(task: str) -> Iterator[Callable[..., None]]:
    if not sys.stderr.isatty():
        yield _ProgressLines(task)
        return
    from rich.console import Console
    from rich.progress import BarColumn, SpinnerColumn, TextColumn, TimeRemainingColumn
    from rich.progress import Progress as Bar

    columns = (
        SpinnerColumn(),
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        TimeRemainingColumn(),
    )
    with Bar(*columns, console=Console(stderr=True), transient=True) as bar:
        number = bar.add_task(printable(task), total=None)
        yield lambda **changes: bar.update(number, **changes)


class _ProgressLines:
    """Progress where there is no terminal: a line after ten seconds, then each time as long again."""

    def __init__(self, task: str) -> None:
        self.task, self.began, self.next = task, time.monotonic(), FIRST_LINE

    def __call__(self, *, description: str = "", completed: float = 0.0, **_: object) -> None:
        """Write the fraction done, if it is time to."""
        passed = time.monotonic() - self.began
        if passed >= self.next and completed < 1:
            self.next = 2 * passed
            line(f"{description or self.task}: {completed:.0%} after {passed:.0f} s")


def line(text: str) -> None:
    """One line on standard error, such as what a long run needs."""
    if sys.stderr is not None:
        with suppress(OSError):
            print(f"lumigraph: {printable(text)}", file=sys.stderr, flush=True)


def plain(value: Any) -> Any:
    """JSON equivalent of a value that JSON cannot hold."""
    if hasattr(value, "tolist"):
        return value.tolist()
    return list(value) if isinstance(value, tuple | set) else str(value)
