"""The camera files of the samples, and a lens."""

from contextlib import AbstractContextManager
from importlib.resources import as_file, files
from pathlib import Path

from lumigraph.core import checks

KINDS = ("plenoptic", "focused-plenoptic", "microscope")


def camera_file(kind: str) -> str:
    """Text of the camera file of a sample, one of `KINDS`."""
    with camera_path(kind) as path:
        return path.read_text("utf-8")


def camera_path(kind: str) -> AbstractContextManager[Path]:
    """Context that gives the path of a sample's camera file, one of `KINDS`.

    Raises
    ------
    GeometryError
        Another kind.
    """
    checks.choice("kind", kind, KINDS)
    return as_file(files("lumigraph.samples").joinpath(f"{kind}.toml"))


def lens_path() -> AbstractContextManager[Path]:
    """Context that gives the path of a lens' prescription: a double Gauss of 50 mm, f/2.5, as a ZMX file."""
    return as_file(files("lumigraph.samples").joinpath("speed-panchro.zmx"))
