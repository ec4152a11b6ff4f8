"""A camera of any kind, from a file or from the catalogue."""

from difflib import get_close_matches
from importlib import resources
from os import PathLike
from pathlib import Path

from lumigraph.errors import FormatError
from lumigraph.instruments import files
from lumigraph.instruments.camera import Camera
from lumigraph.instruments.plenoptic1 import PlenopticCamera
from lumigraph.instruments.plenoptic2 import FocusedPlenopticCamera
from lumigraph.instruments.single_lens import SingleLensCamera

_CLASSES: tuple[type[Camera], ...] = (SingleLensCamera, PlenopticCamera, FocusedPlenopticCamera)
_FOLDER = resources.files("lumigraph.instruments") / "catalogue"


def catalogue() -> list[str]:
    """Names of the cameras that come with lumigraph, for `load_camera`.

    Examples
    --------
    >>> "thesis-plenoptic-1" in catalogue()
    True
    """
    return sorted(
        entry.name.removesuffix(".toml") for entry in _FOLDER.iterdir() if entry.name.endswith(".toml")
    )


def load_camera(path: str | PathLike[str]) -> SingleLensCamera | PlenopticCamera | FocusedPlenopticCamera:
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
        with resources.as_file(_FOLDER / f"{name}.toml") as file:
            if not file.is_file():
                raise FormatError(_unknown(name))
            return _load(files.read(file), name)
    return _load(files.read(path), name)


def _load(table: dict, origin: str) -> SingleLensCamera | PlenopticCamera | FocusedPlenopticCamera:
    kind = files.kind(table, origin)
    camera_class = next(each for each in _CLASSES if kind == each.KIND)
    return camera_class.from_table(table, origin)  # type: ignore[return-value]


def _unknown(name: str) -> str:
    names = catalogue()
    near = get_close_matches(name, names, 1, 0.6)
    hint = f"Did you mean {near[0]!r}?" if near else f"The catalogue has {', '.join(names)}."
    return f"{name!r} is neither a camera file nor in the catalogue. {hint}"
