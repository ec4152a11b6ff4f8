"""Reading inputs, checking outputs before a computation, writing them."""

import glob
import shlex
from collections.abc import Iterable, Sequence
from contextlib import suppress
from itertools import takewhile
from pathlib import Path
from typing import Any

from lumigraph.cli.console import line
from lumigraph.cli.options import COMMAND
from lumigraph.errors import FormatError

PICTURES = (".png", ".tif", ".tiff", ".jpg", ".jpeg", ".zarr", ".zarr.zip")
VIEWS = (".zarr", ".zarr.zip", ".h5", ".hdf5", "_eslf.png")
MOVIES = (".gif", ".mp4")
FIGURES = (".png", ".svg", ".pdf", ".jpg", ".jpeg")

_SOURCES = ("--camera", "--white", "--dark", "--calibration")
"""Options that name what a result is made of, beside what stands before all options."""


def check_output(path: Path, endings: Sequence[str]) -> None:
    """Refuse an output that could not be written in the end, or is another command's.

    Raises
    ------
    FormatError
        Another extension, a folder that may not be written to, or the output of another verb or of other
        inputs, without --overwrite.
    """
    from lumigraph.io.target import check_target

    _check_inputs(path)
    _check_writer(path)
    if endings == VIEWS and not path.suffix:
        check_target(path, folder=True)
    else:
        check_target(path, endings)
    if path.suffix.lower() in (".jpg", ".jpeg"):
        line(f"{path} will be a JPEG, which loses detail. Write .png or .tiff to measure or process it.")


def note_written(paths: Iterable[Path]) -> None:
    """Record that the running command has written files, for `check_output` of later ones."""
    from lumigraph.store import note_writer

    if COMMAND.get():
        for path in paths:
            if path.exists():
                note_writer(path, _origin(COMMAND.get()))


def _check_writer(path: Path) -> None:
    """Refuse an output that another verb has written, or the same verb from other inputs."""
    from lumigraph.store import writer_of

    words = COMMAND.get()
    if not words or "--overwrite" in words or not path.exists():
        return
    before = writer_of(path)
    if before is not None and before != _origin(words):
        raise FormatError(
            f"{path} was written by another command, 'lumigraph {shlex.join(before)}'. Choose another name, "
            "or add --overwrite."
        )


def _origin(words: Sequence[str]) -> list[str]:
    """The verb, what stands before its options, and the files that `_SOURCES` name; paths in full."""
    found = [words[0], *takewhile(lambda word: not word.startswith("-"), words[1:])]
    for k, word in enumerate(words):
        name, equals, value = word.partition("=")
        if name in _SOURCES:
            found += [name, value if equals else words[k + 1]]
    return [str(Path(word).resolve()) if k and Path(word).exists() else word for k, word in enumerate(found)]


def matching(pattern: str) -> list[str]:
    """Files that match a pattern, in order of their names."""
    return sorted(glob.glob(pattern, recursive=True))  # noqa: PTH207 - Path.glob takes no absolute patterns


def check_page(path: Path) -> None:
    """Refuse a folder into which a page could not be written in the end.

    Raises
    ------
    FormatError
        It holds other things, or an input, or is another command's.
    """
    from lumigraph.viewer.folder import check_folder

    _check_inputs(path)
    _check_writer(path)
    check_folder(path)


def check_inside(paths: Iterable[Path]) -> None:
    """Refuse files inside an output folder that would take the place of an input.

    Raises
    ------
    FormatError
        The first of them.
    """
    for path in paths:
        _check_inputs(path, named=0)
        _check_writer(path)


def _check_inputs(path: Path, *, named: int = 1) -> None:
    """Refuse an output, `named` in the command itself, that would take the place of an input or an output."""
    place, same = path.resolve(), 0
    for word in COMMAND.get():
        other = Path(word.partition("=")[2] if word.startswith("--") else word).absolute()
        with suppress(OSError):
            other = other.resolve()
        same += other == place
        if same > named or (place in other.parents and other.exists() and place.is_dir()):
            raise FormatError(
                f"writing {path} would destroy {word}, which the command names too. Choose another."
            )


def save_figure(figure: Any, path: Path) -> None:
    """Write a matplotlib figure atomically; its extension says which format."""
    from lumigraph.io.target import replacing

    with replacing(path) as temporary:
        figure.savefig(temporary, format=path.suffix[1:].lower(), dpi=130)
