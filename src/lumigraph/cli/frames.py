"""Frames of a batch, and the output of a verb for each."""

import glob
import os
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import redirect_stderr
from dataclasses import dataclass, is_dataclass
from functools import lru_cache, partial
from importlib import import_module
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lumigraph.cli import files
from lumigraph.cli.options import PARAMETER
from lumigraph.core.result import Result
from lumigraph.errors import FormatError

if TYPE_CHECKING:
    from inspect import BoundArguments


@dataclass(frozen=True)
class FrameKind:
    """Output of a verb for one frame.

    Parameters
    ----------
    ending
        Ending of the file that it writes; empty for one that writes none.
    leading
        Words before its input.
    is_table
        True if its numbers are wanted.
    """

    ending: str
    leading: int = 0
    is_table: bool = False


KINDS = {
    "simulate": FrameKind(".tiff"),
    "decode": FrameKind(".zarr"),
    "render": FrameKind(".tiff"),
    "refocus": FrameKind(".tiff"),
    "depth": FrameKind(".tiff"),
    "deconvolve": FrameKind(".zarr"),
    "calibrate": FrameKind(".toml", is_table=True),
    "measure": FrameKind("", 1, is_table=True),
}
"""Verbs that are taken."""

_INPUTS = {"calibration", "white", "dark"}
"""Files that come with each frame."""

_WRITTEN = {"output", "report", "overlay", "confidence", "checkpoint"}
"""Options that name what is written; any other file that a line names is one that it reads."""

SIDE = 4
"""Frames of 'deconvolve' that a worker is given at a time; how many of them share products, it finds out."""


@dataclass(frozen=True)
class Frames:
    """A verb as the work of a batch.

    Parameters
    ----------
    verb
        Name of the verb.
    options
        Words of its command but for the input, the page and the output.
    folder
        Folder that paths among them are relative to.
    """

    verb: str
    options: tuple[str, ...]
    folder: str

    def __call__(self, item: dict[str, Any]) -> Any:
        """Output of the verb for one frame, as if it had been run for it alone."""
        from lumigraph.cluster import Values
        from lumigraph.cluster.task import FrameGroup

        if "frames" in item:
            return FrameGroup(item["first"], item["count"], self._run(item["frames"]))
        from lumigraph.cluster.inputs import check_unchanged

        os.chdir(self.folder)
        check_unchanged([item])
        with tempfile.TemporaryDirectory(prefix="lumigraph-") as place, redirect_stderr(StringIO()):
            command, bound = self.bound(item, Path(place))
            result = command(*bound.args, **bound.kwargs)
        check_unchanged([item])
        if KINDS[self.verb].is_table:
            return Values({"file": item["file"], **_numbers(result)})
        return result.thing

    def check(self, item: dict[str, Any]) -> None:
        """Refuse a line that is wrong, or names files that are not there, before any worker starts.

        Raises
        ------
        CycloptsError
            Words that the verb does not take.
        FormatError
            No such file, or no such camera.
        """
        from lumigraph.instruments import load_camera
        from lumigraph.io.source import existing

        with tempfile.TemporaryDirectory(prefix="lumigraph-") as place:
            given = _flat(self.bound(item, Path(place))[1].arguments)
        if given.get("camera") is not None:
            load_camera(given["camera"])
        for name in _INPUTS & given.keys():
            found = given[name]
            for path in found if isinstance(found, list | tuple) else [found]:
                if path is not None:
                    existing(path)

    def inputs(self, item: dict[str, Any]) -> list[str]:
        """Files and folders that the line names besides its frames: all that may change what comes out."""
        with tempfile.TemporaryDirectory(prefix="lumigraph-") as place:
            given = _flat(self.bound(item, Path(place))[1].arguments)
        named = (one for name, value in given.items() if name not in _WRITTEN for one in _paths(value))
        return sorted({path for path in named if path != item["file"]})

    @property
    def side_by_side(self) -> int:
        """Frames that are taken together, at most."""
        return SIDE if self.verb == "deconvolve" and "--warm" not in self.options else 1

    def several(self, items: Sequence[dict[str, Any]]) -> Iterator[list[Any]]:
        """Outputs of the verb for frames, or the errors that ended it; some are computed at a time."""
        from lumigraph.cli.deconvolve import side_by_side

        if self.side_by_side == 1:
            yield from ([self(item)] for item in items)
            return
        os.chdir(self.folder)
        with tempfile.TemporaryDirectory(prefix="lumigraph-") as place:
            line = {**_line(self), "output": Path(place) / f"frame{KINDS[self.verb].ending}"}
            groups = side_by_side(line, [partial(_place, item) for item in items])
            while True:
                with redirect_stderr(StringIO()):
                    found = next(groups, None)
                if found is None:
                    return
                yield found

    def _run(self, items: Sequence[dict[str, Any]]) -> Iterator[Any]:
        """Results of frames of which each begins with the one before."""
        from lumigraph.cli.deconvolve import pages_apart

        with pages_apart():
            yield from map(self, items)

    def bound(self, item: dict[str, Any], folder: Path) -> "tuple[Callable[..., Result], BoundArguments]":
        """The verb and its arguments, by which it writes into a folder and gives its `Result`.

        Raises
        ------
        CycloptsError
            Words that the verb does not take.
        """
        from cyclopts import App

        app, kind = App(default_parameter=PARAMETER), KINDS[self.verb]
        app.command(getattr(import_module(f"lumigraph.cli.{self.verb}"), self.verb))
        words = [self.verb, *self.options[: kind.leading], item["file"], *self.options[kind.leading :]]
        words += [] if item["page"] is None else ["--page", str(item["page"])]
        words += ["--output", str(folder / f"frame{kind.ending}")] if kind.ending else []
        command, bound, _ = app.parse_args(words, exit_on_error=False, print_error=False)
        return command, bound


@lru_cache(maxsize=4)
def _line(frames: Frames) -> dict[str, Any]:
    """Arguments that all frames of a command share; parsing takes as long as an iteration of one."""
    line = frames.bound({"file": "frame", "page": None}, Path())[1]
    line.apply_defaults()
    return dict(line.arguments)


def _flat(arguments: dict[str, Any]) -> dict[str, Any]:
    """Values by name, those of groups of options among them."""
    own = {name: value for name, value in arguments.items() if not is_dataclass(value)}
    return own | {
        name: one for value in arguments.values() if is_dataclass(value) for name, one in vars(value).items()
    }


def _paths(value: Any) -> Iterator[str]:
    """Files and folders that an option's value names, by patterns too."""
    from lumigraph.cluster.inputs import is_file

    if isinstance(value, list | tuple):
        for one in value:
            yield from _paths(one)
    elif isinstance(value, str | Path):
        text = str(value)
        if is_file(text) or (isinstance(value, Path) and value.is_dir()):
            yield text
        elif glob.has_magic(text):
            yield from files.matching(text)


def items_of(paths: Sequence[str], pages: str | None) -> Iterator[dict[str, Any]]:
    """Items of files and patterns, with the chosen pages of a stack; None for files as a whole."""
    for path in paths:
        found = [path] if Path(path).exists() else files.matching(path)
        if not found:
            raise FormatError(f"{path} is not a file, and no file matches it. Check the path.")
        for name in found:
            yield from _frames(Path(name), pages)


def runs(items: Sequence[dict[str, Any]], length: int) -> list[dict[str, Any]]:
    """Frames in a row, `length` in each but the last: the same ones whoever does them.

    >>> [(run["first"], len(run["frames"])) for run in runs([{}] * 5, 2)]
    [(0, 2), (2, 2), (4, 1)]
    """
    if length < 2:
        raise FormatError(f"--run is {length} but must be at least 2: --warm needs a frame before.")
    starts = range(0, len(items), length)
    return [{"first": k, "count": len(items), "frames": list(items[k : k + length])} for k in starts]


def _frames(path: Path, pages: str | None) -> Iterator[dict[str, Any]]:
    from lumigraph.cluster.inputs import known
    from lumigraph.preparation.given import pages_of

    about = known(path)
    for number in [None] if pages is None or path.is_dir() else pages_of(path, pages):
        yield {**about, "page": number}


def _place(item: dict[str, Any]) -> tuple[Path, str | None]:
    """File and page of a frame."""
    from lumigraph.cluster.inputs import check_unchanged

    check_unchanged([item])
    return Path(item["file"]), None if item["page"] is None else str(item["page"])


def _numbers(result: Result) -> dict[str, Any]:
    """Row of a table: numbers and words, lengths in metres."""
    import json

    from lumigraph.cli.console import plain

    found = {one.name: json.loads(json.dumps(one.value, default=plain)) for one in result.quantities}
    return {name: value for name, value in found.items() if not isinstance(value, list | dict)}
