"""Calibrations in files."""

from pathlib import Path

from lumigraph import io
from lumigraph.core.calibration import Calibration
from lumigraph.core.short_repr import called
from lumigraph.errors import FormatError

_MAKERS = (".xml", ".ini")  # which do not say how large their raw images are


def read_calibration(path: Path, shape: tuple[int, int] | None = None) -> Calibration:
    """A calibration: our own, or one by a camera's maker, which needs the raw images' shape.

    Raises
    ------
    FormatError
        Another kind of file.
    """
    ending = path.suffix.lower()
    if ending in _MAKERS:
        found = io.open(path, shape=shape)
    elif ending in (".lfp", ".lfr", ".lfx"):
        found = io.open(path, what="calibration")
    else:
        found = io.open(path)
    if not isinstance(found, Calibration):
        raise FormatError(f"{path} holds a {called(found)} where a calibration is needed.")
    return found
