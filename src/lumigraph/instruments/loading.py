"""A camera of any kind, from a file or from the catalogue."""

from os import PathLike
from pathlib import Path

from lumigraph.instruments import files
from lumigraph.instruments.instrument import Instrument
from lumigraph.instruments.microscope import LightFieldMicroscope
from lumigraph.instruments.plenoptic1 import PlenopticCamera
from lumigraph.instruments.plenoptic2 import FocusedPlenopticCamera
from lumigraph.instruments.single_lens import SingleLensCamera

_CLASSES: tuple[type[Instrument], ...] = (
    SingleLensCamera, PlenopticCamera, FocusedPlenopticCamera, LightFieldMicroscope
)  # fmt: skip

AnyCamera = SingleLensCamera | PlenopticCamera | FocusedPlenopticCamera | LightFieldMicroscope


def load_camera(path: str | PathLike[str]) -> AnyCamera:
    """The camera that a TOML file describes, or one of the catalogue by its name.

    Parameters
    ----------
    path
        A file, or a name such as "thesis-plenoptic-1" where there is no such file; see `catalogue`.

    Raises
    ------
    FormatError
        No such file or name, damaged TOML, an unknown kind or key, a missing key, or a wrong unit.
    GeometryError
        Values that no camera can have.

    Examples
    --------
    >>> load_camera("thesis-plenoptic-2-m050").lenslet_magnification
    0.5
    """
    name = str(path)
    if not Path(name).exists() and not name.endswith(".toml") and "/" not in name:
        return camera_of(files.read_catalogue(name), name)
    return camera_of(files.read(path), name)


def camera_of(table: dict, origin: str) -> AnyCamera:
    """The camera of a table; errors name its `origin`."""
    kind = files.kind(table, origin)
    camera_class = next(each for each in _CLASSES if kind == each.KIND)
    return camera_class.from_table(table, origin)  # type: ignore[return-value]
