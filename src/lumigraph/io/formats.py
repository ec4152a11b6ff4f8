"""`open` and `save`: the extension says which format."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from lumigraph.core.arrays import to_numpy
from lumigraph.core.calibration import Calibration
from lumigraph.core.lightfield import LightField
from lumigraph.core.raw import RawImage
from lumigraph.errors import FormatError
from lumigraph.io import source
from lumigraph.io.calibration import load_calibration, save_calibration
from lumigraph.io.source import MAX_PIXELS
from lumigraph.io.target import check_target

PICTURES = (".tif", ".tiff", ".png", ".zarr", ".zarr.zip")
"""Endings that a picture or a raw image may have."""

LIGHT_FIELDS = (".zarr", ".zarr.zip")
"""Endings that a light field may have."""

ENDINGS = (*PICTURES, ".toml")
"""Every ending that can be opened; `.toml` holds a calibration."""


def ending(path: str | os.PathLike[str]) -> str:
    """The known extension that a path ends in, in small letters.

    Raises
    ------
    FormatError
        None of `ENDINGS`.
    """
    name = source.as_path(path).name.lower()
    for known in ENDINGS:
        if name.endswith(known):
            return known
    raise FormatError(f"{path} has no extension that lumigraph knows. Known are {', '.join(ENDINGS)}.")


def open(  # noqa: A001  lumigraph.open is meant to read like the builtin
    path: str | os.PathLike[str], *, page: int | None = None, max_pixels: int = MAX_PIXELS
) -> RawImage | LightField | Calibration:
    """What a file holds: a raw image, a light field (Zarr) or a calibration (TOML).

    The size is read from the header and checked before anything is decoded.

    Parameters
    ----------
    path
        A file that ends in `.tif`, `.tiff`, `.png`, `.zarr`, `.zarr.zip` or `.toml`.
    page
        Which page of a TIFF stack; needed only where there are several.
    max_pixels
        Larger pictures are refused; four channels, or four values of a light field, count as one pixel.

    Raises
    ------
    FormatError
        Nothing there, another kind of file than its name says, damaged, or too large.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> path = Path(tempfile.mkdtemp()) / "raw.tiff"
    >>> save(RawImage(np.eye(4, dtype=np.uint16), pixel_pitch=1e-6, bit_depth=12), path)
    >>> raw = open(path)
    >>> raw.shape, raw.pixel_pitch, raw.bit_depth
    ((4, 4), 1e-06, 12)
    """
    path = source.existing(path)
    kind = ending(path)
    if kind == ".toml":
        return load_calibration(path)
    if kind == ".png":
        from lumigraph.io import png

        return png.load(path, max_pixels=max_pixels)
    if kind in (".tif", ".tiff"):
        from lumigraph.io import tiff

        return tiff.load(path, page=page, max_pixels=max_pixels)
    from lumigraph.io import zarr

    return zarr.load(path, max_pixels=max_pixels)


def save(thing: Any, path: str | os.PathLike[str], *, white: float | None = None) -> None:
    """Write a raw image, a picture, a stack of pictures, a light field or a calibration; atomically.

    Integers are written as they are. Floats go into TIFF and Zarr as they are (a bare array into TIFF
    as float32); into PNG, which holds whole numbers, 0 ... `white` becomes 0 ... 65535 (grey) or
    0 ... 255 (colour) and what lies outside is clipped.

    Parameters
    ----------
    thing
        `RawImage`; an array (y, x) or (y, x, c); a list of arrays, which become the pages of a TIFF;
        `LightField` (Zarr only); `Calibration` (TOML only).
    path
        Its extension says which format: `.tif`, `.tiff`, `.png`, `.zarr`, `.zarr.zip` or `.toml`.
    white
        Float that becomes white in a PNG; the maximum if left out.

    Raises
    ------
    FormatError
        A format that cannot hold the thing, or a folder that does not exist.
    """
    kind = ending(path)
    if isinstance(thing, Calibration):
        check_target(path, (".toml",))
        save_calibration(thing, path)
    elif isinstance(thing, LightField):
        from lumigraph.io import zarr

        zarr.save_light_field(thing, check_target(path, LIGHT_FIELDS))
    elif isinstance(thing, list | tuple):
        from lumigraph.io import tiff

        tiff.save_stack([_raw(page).data for page in thing], check_target(path, (".tif", ".tiff")))
    else:
        _save_raw(_raw(thing, single="zarr" not in kind), check_target(path, PICTURES), white)


def _save_raw(raw: RawImage, path: Path, white: float | None) -> None:
    kind = ending(path)
    if kind == ".png":
        from lumigraph.io import png

        png.save(raw, path, white=white)
    elif kind in (".tif", ".tiff"):
        from lumigraph.io import tiff

        tiff.save(raw, path)
    else:
        from lumigraph.io import zarr

        zarr.save_raw(raw, path)


def _raw(thing: Any, *, single: bool = True) -> RawImage:
    """`thing` as a raw image on the CPU; of a bare array floats become float32, truth values 0 and 255."""
    if isinstance(thing, RawImage):
        return RawImage(to_numpy(thing.data), thing.pixel_pitch, thing.bit_depth, thing.bayer, thing.metadata)
    if isinstance(thing, Sequence) or not hasattr(thing, "shape"):
        raise FormatError(
            f"a {type(thing).__name__} cannot be written to a file. Give a RawImage, an array (y, x[, c]), "
            "a list of arrays, a LightField or a Calibration."
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
