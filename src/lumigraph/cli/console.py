"""Results on standard output, progress on standard error."""

import json
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

from lumigraph.cli.options import Common
from lumigraph.core.progress import Progress, what_of


def report(common: Common, text: str, values: Mapping[str, Any] | Sequence[Any]) -> None:
    """Print the result of a verb: text for people, or with `--json` one object, or a list of them."""
    if common.json:
        print(json.dumps(values, default=_plain, ensure_ascii=False))
    else:
        print(text)


@contextmanager
def progress(task: str) -> Iterator[Progress]:
    """Context that gives a function which moves a bar, shown on a terminal only.

    Until it is called, and where it never is, the bar only shows that something goes on.
    """
    with _bar(task) as update:
        yield lambda fraction: update(
            description=": ".join(filter(None, (task, what_of(fraction)))), completed=fraction, total=1.0
        )


@contextmanager
def _bar(task: str) -> Iterator[Callable[..., None]]:
    if not sys.stderr.isatty():
        yield lambda **_: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, SpinnerColumn, TextColumn, TimeRemainingColumn
    from rich.progress import Progress as Bar

    columns = (SpinnerColumn(), TextColumn("{task.description}"), BarColumn(), TimeRemainingColumn())
    with Bar(*columns, console=Console(stderr=True), transient=True) as bar:
        number = bar.add_task(task, total=None)
        yield lambda **changes: bar.update(number, **changes)


def _plain(value: Any) -> Any:
    if hasattr(value, "tolist"):
        return value.tolist()
    return list(value) if isinstance(value, tuple | set) else str(value)
