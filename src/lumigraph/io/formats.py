"""`open`, `save` and `contents`: the extension says which format; `FORMATS` is the table of them."""

import os
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path
from typing import Any, TypeVar, overload

import numpy as np

from lumigraph.core.arrays import to_numpy
from lumigraph.core.calibration import Calibration
from lumigraph.core.cloud import PointCloud
from lumigraph.core.depth_map import DepthMap
from lumigraph.core.lightfield import LightField
from lumigraph.core.raw import RawImage
from lumigraph.core.short_repr import called
from lumigraph.core.stack import Stack
from lumigraph.core.volume import Volume
from lumigraph.errors import FormatError
from lumigraph.io import source, view_order
from lumigraph.io.source import MAX_PIXELS
from lumigraph.io.target import check_target

Noun = RawImage | LightField | Stack | Volume | DepthMap | Calibration | PointCloud
"""Type of a file's content."""

N = TypeVar("N", bound=Noun)

FOLDER = "/"
"""Stands for the ending of a folder of views, which has none."""


@dataclass(frozen=True, slots=True)
class FilePart:
    """One thing in a file: `name` is what ``open(path, what=name)`` takes; its noun, and a few words."""

    name: str
    noun: str
    about: str


@dataclass(frozen=True, slots=True)
class Format:
    """A row of the table.

    Parameters
    ----------
    name
        Name of the format.
    endings
        Endings of its files, in small letters.
    module
        Module of `lumigraph.io`, which has ``load`` and, if it writes, ``save``; imported on first use.
    writes
        Nouns that ``save`` takes; empty if the format is only read.
    reads
        Nouns that ``load`` gives; empty if the format is only written.
    options
        Keywords of `open` that ``load`` takes.
    """

    name: str
    endings: tuple[str, ...]
    module: str
    writes: tuple[str, ...]
    reads: tuple[str, ...]
    options: tuple[str, ...] = ()

    def imported(self) -> Any:
        """The module."""
        return import_module(f"lumigraph.io.{self.module}")


_ALL = ("RawImage", "LightField", "Volume")
_STORED = (*_ALL, "DepthMap")
_LYTRO = ("RawImage", "Stack", "Calibration")
_PLANES = ("RawImage", "Stack", "Volume")
_ARRAYS = ("RawImage", "LightField", "Stack")
_ESLF = tuple(f"{mark}eslf.{end}" for end in ("png", "jpg", "jpeg") for mark in "_.")
FORMATS = (
    Format("TIFF", (".tif", ".tiff"), "tiff", _PLANES, _PLANES, ("page", "views")),
    Format("Lytro ESLF", _ESLF[:2], "eslf", ("LightField",), ("LightField",), ("views",)),
    Format("Lytro ESLF, JPEG", _ESLF[2:], "eslf", (), ("LightField",), ("views",)),
    Format("PNG", (".png",), "png", ("RawImage",), ("RawImage",), ("views",)),
    Format("JPEG", (".jpg", ".jpeg"), "jpeg", ("RawImage",), ("RawImage",), ("views",)),
    Format("BMP", (".bmp",), "bmp", (), ("RawImage",), ("views",)),
    Format("PGM, PPM", (".pgm", ".ppm", ".pnm"), "pnm", (), ("RawImage",), ("views",)),
    Format("Zarr", (".zarr", ".zarr.zip"), "zarr", _STORED, _STORED, ("page",)),
    Format("HDF5", (".h5", ".hdf5"), "hdf5", _ALL, (*_ALL, "Stack"), ("what", "axes")),
    Format("MATLAB", (".mat",), "mat", (), (*_ALL, "Stack"), ("what", "axes")),
    Format("NumPy", (".npy", ".npz"), "npy", (), _ARRAYS, ("what", "axes")),
    Format("PFM", (".pfm",), "pfm", ("RawImage",), ("RawImage",)),
    Format("PLY", (".ply",), "ply", ("PointCloud",), ("PointCloud",)),
    Format("Lytro", (".lfp", ".lfr", ".lfx", ".raw"), "lytro", (), _LYTRO, ("what",)),
    Format("GIF, MP4", (".gif", ".mp4"), "movie", ("Stack",), ()),
    Format("calibration", (".toml",), "calibration", ("Calibration",), ("Calibration",)),
    Format("Raytrix calibration", (".xml",), "raytrix", ("Calibration",), ("Calibration",), ("shape",)),
    Format("plenoptomos geometry", (".ini",), "plenoptomos", (), ("Calibration",), ("shape",)),
    Format("Lytro metadata", (".json", ".txt"), "lytro_metadata", (), ("Calibration",)),
    Format("folder of views", (FOLDER,), "views", ("LightField",), ("LightField",)),
)  # fmt: skip
"""Every format; where two endings fit, the longer one counts."""


def _endings(noun: str = "", *, read: bool = False) -> tuple[str, ...]:
    rows = [row for row in FORMATS if (row.reads if read else noun in row.writes)]
    return tuple(ending for row in rows for ending in row.endings)


PICTURES = _endings("RawImage")
"""Endings that a picture or a raw image may be saved with."""

LIGHT_FIELDS = _endings("LightField")
"""Endings that a light field may be saved with."""

ENDINGS = _endings(read=True)
"""Every ending that can be opened."""


def format_of(path: str | os.PathLike[str]) -> Format:
    """The row of `FORMATS` for a path: by its ending, or a folder of views.

    Raises
    ------
    FormatError
        None of the known endings.
    """
    place = source.as_path(path)
    name = place.name.lower()
    found = [
        (len(end), row) for row in FORMATS for end in row.endings if end[0] in "._" and name.endswith(end)
    ]
    if found:
        return max(found, key=lambda pair: pair[0])[1]
    if place.is_dir() or not place.suffix:
        return FORMATS[-1]
    known = ", ".join(sorted({end for row in FORMATS for end in row.endings if end.startswith(".")}))
    raise FormatError(f"{path} has an unknown extension. Known extensions are {known}.")


@overload
def open(  # noqa: A001  lumigraph.open is meant to read like the builtin
    path: str | os.PathLike[str],
    noun: type[N],
    *,
    what: str | None = None,
    page: int | None = None,
    views: int | tuple[int, int] | None = None,
    shape: tuple[int, int] | None = None,
    axes: str | None = None,
    max_pixels: int = MAX_PIXELS,
) -> N: ...


@overload
def open(  # noqa: A001  lumigraph.open is meant to read like the builtin
    path: str | os.PathLike[str],
    noun: None = None,
    *,
    what: str | None = None,
    page: int | None = None,
    views: int | tuple[int, int] | None = None,
    shape: tuple[int, int] | None = None,
    axes: str | None = None,
    max_pixels: int = MAX_PIXELS,
) -> Noun: ...


def open(  # noqa: A001  lumigraph.open is meant to read like the builtin
    path: str | os.PathLike[str],
    noun: type[Noun] | None = None,
    *,
    what: str | None = None,
    page: int | None = None,
    views: int | tuple[int, int] | None = None,
    shape: tuple[int, int] | None = None,
    axes: str | None = None,
    max_pixels: int = MAX_PIXELS,
) -> Noun:
    """Content of a file or a folder of views; the ending tells the format; see `docs/reference/formats.md`.

    Sizes are read from the headers and checked, against the file's own size too, before anything is
    decoded.

    Parameters
    ----------
    path
        A file, a Zarr store, or a folder of views.
    noun
        Required type, such as `RawImage`: anything else is refused, and type checkers know what returns.
    what
        Part of the file, where it holds several (Lytro, HDF5, MATLAB, NumPy): `contents` lists them.
    page
        Page of a TIFF stack, or frame of a series in Zarr; without it the pages of a TIFF file
        open as a `Stack`, or as a `Volume` where they were saved as one.
    views
        Views (v, u) of a mosaic, in which each lenslet is a block of pixels (ESLF); one number for both.
    shape
        Rows and columns of the raw images, for calibration files without them (`.xml`, `.ini`).
    axes
        What the axes of an array by another program are, in the order stored, such as "vuyxc" or, as MATLAB
        writes views into HDF5, "cxyuv": v, u rows and columns of views, n pictures of a stack, c colours.
    max_pixels
        Larger pictures are refused; four channels, or four values of a light field, count as one pixel.

    Returns
    -------
    RawImage | LightField | Stack | Volume | DepthMap | Calibration | PointCloud
        By the format and by what the file says it holds.

    Raises
    ------
    FormatError
        Nothing there, another kind of file than its name says, damaged, or too large; an option that the
        format does not have.

    Warns
    -----
    SamplingWarning
        Views that agree far better in another order than their numbers give.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> path = Path(tempfile.mkdtemp()) / "raw.tiff"
    >>> save(RawImage(np.eye(4, dtype=np.uint16), pixel_pitch=1e-6, bit_depth=12), path)
    >>> raw = open(path, RawImage)
    >>> raw.shape, raw.pixel_pitch, raw.bit_depth
    ((4, 4), 1e-06, 12)
    """
    given = {"what": what, "page": page, "views": views, "shape": shape, "axes": axes}
    found = _opened(source.existing(path), max_pixels, given)
    if isinstance(found, LightField):
        view_order.check_order(found, str(path))
    if noun is not None and not isinstance(found, noun):
        raise FormatError(f"{path} holds a {called(found)} but must hold a {called(noun)}.")
    return found


def _opened(path: Path, max_pixels: int, given: dict[str, Any]) -> Noun:
    row = format_of(path)
    if not row.reads:
        raise FormatError(f"{path}: {row.name} files are written, not read. Open the pictures themselves.")
    options = {name: value for name, value in given.items() if value is not None}
    for name in options:
        if name not in row.options:
            raise FormatError(f"{name}= means nothing for {path}, a {row.name} file. Leave it out.")
    if "views" in options and row.module != "eslf":
        if "page" in options:
            raise FormatError(f"page= and views= mean nothing together for {path}. Leave one of them out.")
        with source.ours(path, row.name):
            return import_module("lumigraph.io.eslf").load(path, max_pixels=max_pixels, **options)
    with source.ours(path, row.name):
        return row.imported().load(path, max_pixels=max_pixels, **options)


def contents(path: str | os.PathLike[str]) -> tuple[FilePart, ...]:
    """The parts of a file, in the order in which they stand; most formats hold one.

    Raises
    ------
    FormatError
        As `open`.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> path = Path(tempfile.mkdtemp()) / "raw.tiff"
    >>> save(np.zeros((3, 4), np.uint8), path)
    >>> contents(path)
    (FilePart(name='', noun='RawImage', about='3 x 4, uint8'),)
    """
    path = source.existing(path)
    row = format_of(path)
    listed = getattr(row.imported(), "contents", None)
    if listed is not None:
        with source.ours(path, row.name):
            return tuple(FilePart(*part) for part in listed(path))
    thing = open(path)
    data = getattr(thing, "data", None)
    if data is None:
        return (FilePart("", type(thing).__name__, row.name),)
    return (FilePart("", type(thing).__name__, f"{' x '.join(map(str, data.shape))}, {data.dtype}"),)


def pages(path: str | os.PathLike[str]) -> int:
    """Pictures of one size that a file holds one after the other; 1 where it holds anything else.

    Raises
    ------
    FormatError
        As `open`.
    """
    counted = _counted(source.existing(path))
    if counted is not None:
        return counted
    found = open(path)
    return len(found.data) if isinstance(found, Stack | Volume) else 1


def opens_pages(path: str | os.PathLike[str]) -> bool:
    """True if a file holds pages or frames that `open` reads one by one: a TIFF stack, a series in Zarr."""
    counted = _counted(source.existing(path))
    return counted is not None and (counted > 1 or format_of(path).module == "zarr")


def _counted(path: Any) -> int | None:
    row = format_of(path)
    count = getattr(row.imported(), "count", None)
    if count is None:
        return None
    with source.ours(path, row.name):
        return count(path)


def save(
    thing: Any, path: str | os.PathLike[str], *, white: float | None = None, fps: float | None = None
) -> None:
    """Write a picture, a stack, a light field, a volume, a calibration or points; atomically.

    Integers are written as they are. Floats go into TIFF, HDF5 and Zarr as they are (a bare array into
    TIFF as float32); into PNG and films, which hold whole numbers, 0 ... `white` becomes 0 ... 65535
    (grey PNG) or 0 ... 255 (colour, films, JPEG) and what lies outside is clipped. JPEG, of quality 95, loses
    detail.

    Parameters
    ----------
    thing
        `RawImage`; an array (y, x) or (y, x, c); `DepthMap`, of which other formats than Zarr keep the values
        alone; `Stack`, or a list of arrays; `LightField`, `Volume`, `Calibration`, `PointCloud`.
    path
        File whose ending says which format; a light field goes into a folder of views where it has none.
    white
        Float that becomes white in a PNG, a JPEG or a film; the maximum if left out.
    fps
        Pictures per second of a film (GIF, MP4); 10 if left out.

    Raises
    ------
    FormatError
        A format that cannot hold the thing, or a folder that may not be written to.
    """
    row = format_of(path)
    if not isinstance(thing, DepthMap) or "DepthMap" not in row.writes:
        thing = _noun(thing, single=row.module == "tiff")
    noun = type(thing).__name__
    if noun not in row.writes or (isinstance(thing, LightField) and row.module == "png"):
        fitting = tuple("a name without extension" if end == FOLDER else end for end in _endings(noun))
        raise FormatError(
            f"{path} has the wrong extension for this result, a {noun}. Use one of {', '.join(fitting)}."
        )
    options = {"white": white} if row.module in ("png", "jpeg", "movie", "eslf", "views") else {}
    if row.module == "movie" and fps is not None:
        options["fps"] = fps
    elif fps is not None:
        raise FormatError(f"fps= means nothing for {path}. Use .gif or .mp4 for a film.")
    row.imported().save(thing, check_target(path, folder=row.endings == (FOLDER,)), **options)


def _noun(thing: Any, *, single: bool) -> Noun:
    """`thing` as a noun; of bare arrays floats become float32 if `single`, truth values 0 and 255."""
    if isinstance(thing, LightField | Volume | Calibration | PointCloud):
        return thing
    if isinstance(thing, RawImage | Stack):
        return replace(thing, data=to_numpy(thing.data))
    if isinstance(thing, list | tuple):
        return _stack([_picture(page, single=single) for page in thing])
    return _picture(thing, single=single)


def _stack(pages: list[RawImage]) -> Stack:
    if not pages:
        raise FormatError("there are no pictures to write: the list is empty.")
    if len(shapes := {page.data.shape for page in pages}) > 1:
        raise FormatError(f"the pictures of a stack have shapes {sorted(shapes)} but must have one.")
    first = pages[0]
    return Stack(np.stack([page.data for page in pages]), (), "page", first.pixel_pitch, first.bit_depth)


def _picture(thing: Any, *, single: bool) -> RawImage:
    if isinstance(thing, RawImage):
        return thing
    if isinstance(thing, DepthMap):
        known = {"quantity": thing.quantity, "unit": thing.unit}
        return RawImage(to_numpy(thing.values).astype(np.float32), metadata=known)
    if not hasattr(thing, "shape"):
        raise FormatError(
            f"a {type(thing).__name__} cannot be written to a file. Give a RawImage, an array (y, x[, c]), "
            "a list of arrays, a LightField, a Volume, a Stack, a PointCloud or a Calibration."
        )
    data = to_numpy(thing)
    if data.ndim not in (2, 3) or data.size == 0:
        raise FormatError(
            f"an array of shape {data.shape} is not a picture (y, x) or (y, x, c). Save one plane of it, "
            "or a list of planes as a TIFF stack."
        )
    if data.dtype == bool:
        return RawImage(data.astype(np.uint8) * np.uint8(255), bit_depth=8)
    if data.dtype.kind == "f" and single:
        return RawImage(data.astype(np.float32, copy=False))
    return RawImage(data, bit_depth=data.dtype.itemsize * 8 if data.dtype.kind in "iu" else None)
