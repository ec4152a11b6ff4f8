"""Reading inputs, checking outputs before a computation, writing them."""

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lumigraph.cli.options import COMMAND
from lumigraph.errors import FormatError

if TYPE_CHECKING:
    from lumigraph.core.calibration import Calibration
    from lumigraph.core.lightfield import LightField
    from lumigraph.core.raw import RawImage

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


def _check_inputs(path: Path) -> None:
    """Refuse an output that would take the place of an input, or of another output."""
    place, same = path.resolve(), 0
    for word in COMMAND.get():
        other = Path(word.partition("=")[2] if word.startswith("--") else word).absolute()
        with suppress(OSError):
            other = other.resolve()
        same += other == place
        if same > 1 or (place in other.parents and other.exists() and place.is_dir()):
            raise FormatError(
                f"writing {path} would destroy {word}, which the command names too. Choose another."
            )


def read_raw(path: Path) -> "RawImage":
    """A raw image of finite values.

    Raises
    ------
    FormatError
        Something else, or NaN.
    """
    import lumigraph.io as io
    from lumigraph.core import checks
    from lumigraph.core.raw import RawImage

    raw = io.open(path)
    if not isinstance(raw, RawImage):
        raise FormatError(f"{path} holds a {type(raw).__name__} where a raw image is needed.")
    checks.finite_array(str(path), raw.data, FormatError)
    return raw


def read_views(path: Path) -> "LightField | RawImage":
    """A light field, or the raw image it can be decoded from.

    Raises
    ------
    FormatError
        Something else, or NaN.
    """
    import lumigraph.io as io
    from lumigraph.core import checks
    from lumigraph.core.lightfield import LightField
    from lumigraph.core.raw import RawImage

    found = io.open(path)
    if not isinstance(found, LightField | RawImage):
        held = type(found).__name__.lower()
        raise FormatError(f"{path} holds a {held} where views or a raw image are needed.")
    checks.finite_array(str(path), found.data, FormatError)
    return found


def read_calibration(path: Path, shape: tuple[int, int] | None = None) -> "Calibration":
    """A calibration: our own, or one by a camera's maker, which needs the raw images' shape.

    Raises
    ------
    FormatError
        Another kind of file.
    """
    import lumigraph.io as io

    ending = path.suffix.lower()
    if ending in (".xml", ".ini"):
        return io.open(path, shape=shape)
    if ending in (".lfp", ".lfr", ".lfx"):
        return io.open(path, what="calibration")
    return io.open(path) if ending == ".json" else io.load_calibration(path)


def save_figure(figure: Any, path: Path) -> None:
    """Write a matplotlib figure atomically; its extension says which format."""
    from lumigraph.io.target import replacing

    with replacing(path) as temporary:
        figure.savefig(temporary, format=path.suffix[1:].lower(), dpi=130)
