"""Results on standard output, progress on standard error."""

import json
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

from lumigraph.cli.options import Common

Count = Callable[[float, int], None]
"""Called with what is done and the total."""

Stages = Callable[[str, float], None]
"""Called with what goes on and the fraction of the whole that is done."""


def report(common: Common, text: str, values: Mapping[str, Any] | Sequence[Any]) -> None:
    """Print the result of a verb: text for people, or with `--json` one object, or a list of them."""
    if common.json:
        print(json.dumps(values, default=_plain, ensure_ascii=False))
    else:
        print(text)


@contextmanager
def progress(task: str) -> Iterator[Count]:
    """Context that gives a function of (done, total) which moves a bar, shown on a terminal only.

    Until it is called, and where it never is, the bar only shows that something goes on.
    """
    with _bar(task) as update:
        yield lambda done, total: update(completed=done, total=total)


@contextmanager
def stages(task: str) -> Iterator[Stages]:
    """Context that gives a function of (what, fraction) which moves a bar, shown on a terminal only."""
    with _bar(task) as update:
        yield lambda what, fraction: update(description=f"{task}: {what}", completed=fraction, total=1.0)


@contextmanager
def _bar(task: str) -> Iterator[Callable[..., None]]:
    if not sys.stderr.isatty():
        yield lambda **_: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeRemainingColumn

    columns = (SpinnerColumn(), TextColumn("{task.description}"), BarColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        number = bar.add_task(task, total=None)
        yield lambda **changes: bar.update(number, **changes)


def _plain(value: Any) -> Any:
    if hasattr(value, "tolist"):
        return value.tolist()
    return list(value) if isinstance(value, tuple | set) else str(value)
