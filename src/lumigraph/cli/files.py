"""Reading inputs, checking outputs before a computation, writing them."""

import glob
from collections.abc import Iterable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from lumigraph.cli.options import COMMAND
from lumigraph.errors import FormatError

PICTURES = (".png", ".tif", ".tiff", ".zarr", ".zarr.zip")
VIEWS = (".zarr", ".zarr.zip", ".h5", ".hdf5", "_eslf.png")
MOVIES = (".gif", ".mp4")
FIGURES = (".png", ".svg", ".pdf")


def check_output(path: Path, endings: Sequence[str]) -> None:
    """Refuse an output that could not be written in the end.

    Raises
    ------
    FormatError
        Another extension, or a folder that does not exist.
    """
    from lumigraph.io.target import check_target

    _check_inputs(path)
    if endings == VIEWS and not path.suffix:
        check_target(path, folder=True)
    else:
        check_target(path, endings)


def matching(pattern: str) -> list[str]:
    """Files that match a pattern, in order of their names."""
    return sorted(glob.glob(pattern, recursive=True))  # noqa: PTH207 - Path.glob takes no absolute patterns


def check_page(path: Path) -> None:
    """Refuse a folder into which a page could not be written in the end.

    Raises
    ------
    FormatError
        The folder above does not exist, or it holds other things, or an input.
    """
    from lumigraph.viewer import check_folder

    _check_inputs(path)
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
