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


LENSES = ("speed-panchro", "thesis-prototype")


def lens_path(name: str = "speed-panchro") -> AbstractContextManager[Path]:
    """Context that gives the path of a lens' prescription, a ZMX file.

    Parameters
    ----------
    name
        "speed-panchro", a double Gauss of 50 mm, f/2.5; or "thesis-prototype", two plano-convex lenses of
        120 mm with their flat sides outwards, 60.1 mm at 630 nm.

    Raises
    ------
    GeometryError
        Another name.
    """
    checks.choice("name", name, LENSES)
    return as_file(files("lumigraph.samples").joinpath(f"{name}.zmx"))
