"""TIFF: grey or colour, whole numbers or floats; fields of the raw image as JSON in ImageDescription."""

import logging
from math import ceil
from pathlib import Path

import numpy as np
import tifffile

from lumigraph.core.raw import RawImage
from lumigraph.errors import FormatError
from lumigraph.io import header, source, target

_TYPES = frozenset(f"{kind}{bits}" for kind in ("uint", "int") for bits in (8, 16, 32)) | {
    "float16",
    "float32",
    "float64",
}
# tifffile logs what it finds odd; whoever wants that adds a handler, others get our one-line errors.
logging.getLogger("tifffile").addHandler(logging.NullHandler())


def load(path: Path, *, page: int | None = None, max_pixels: int = source.MAX_PIXELS) -> RawImage:
    """One page of a TIFF file (y, x) or (y, x, c); transparency is left out.

    Raises
    ------
    FormatError
        Not a TIFF, damaged, cut short, too large, of several pages, or compressed in a way that needs
        a codec which is not installed.
    """
    path = source.regular_file(path)
    with path.open("rb") as file:
        source.check_signature(path, file.read(8), "TIFF")
    with source.decoding(path, "a TIFF"), tifffile.TiffFile(path) as file:
        image = _page(path, file, page)
        _check_page(path, image, max_pixels)
        found = header.loads(image.description)
        data = _pixels(image)
        depth = image.bitspersample if data.dtype.kind in "iu" else None
    if found is not None and "shape" in found and data.size == np.prod(found["shape"]):
        data = data.reshape(found["shape"])
    return header.restore(data, found, depth)


def save(raw: RawImage, path: Path) -> None:
    """Write a raw image; the resolution tags hold its pixel pitch for other programs.

    Raises
    ------
    FormatError
        Complex numbers, or another type that TIFF readers do not share.
    """
    data = _checked(raw.data)
    pixels = data[..., 0] if data.shape[2:] == (1,) else data
    with target.replacing(path) as temporary, tifffile.TiffWriter(temporary) as file:
        file.write(
            pixels,
            photometric="rgb" if pixels.shape[2:] in ((3,), (4,)) else "minisblack",
            planarconfig="contig" if pixels.ndim == 3 else None,
            description=header.dumps(raw, shape=list(data.shape)),
            metadata=None,
            software="lumigraph",
            **_resolution(raw.pixel_pitch),
        )


def save_stack(images: list[np.ndarray], path: Path) -> None:
    """Write pictures of one shape and type as the pages of one file.

    Raises
    ------
    FormatError
        No pictures, or pictures of several shapes.
    """
    if not images:
        raise FormatError(f"there are no pictures to write to {path}.")
    if len(shapes := {image.shape for image in images}) > 1:
        raise FormatError(f"the pictures of a stack have shapes {sorted(shapes)} but must have one.")
    with target.replacing(path) as temporary, tifffile.TiffWriter(temporary) as file:
        for image in images:
            colour = image.shape[2:] == (3,)
            file.write(_checked(image), photometric="rgb" if colour else "minisblack", metadata=None)


def _page(path: Path, file: tifffile.TiffFile, page: int | None) -> tifffile.TiffPage:
    count = len(file.pages)
    if count == 0:
        raise FormatError(f"{path} is a TIFF without a picture. Copy or save it again.")
    if page is None and count > 1 and file.pages.get(1).shape == file.pages.first.shape:
        raise FormatError(
            f"{path} holds {count} pages where one picture is needed. Choose one by page=0 ... {count - 1}."
        )
    if page is not None and not 0 <= page < count:
        raise FormatError(f"page is {page} but {path} has {count}. Choose 0 ... {count - 1}.")
    image = file.pages.get(page or 0)
    if not isinstance(image, tifffile.TiffPage):
        raise FormatError(f"{path} has a page of an unknown kind.")
    return image


def _check_page(path: Path, image: tifffile.TiffPage, max_pixels: int) -> None:
    """Refuse what would be large, cut short or undecodable, before it is decoded."""
    if len(image.shape) not in (2, 3) or image.dtype is None:
        raise FormatError(f"{path} holds data of shape {image.shape}, not a picture (y, x) or (y, x, c).")
    channels = (image.samplesperpixel,) if image.samplesperpixel > 1 else ()
    source.check_size(path, (image.imagelength, image.imagewidth, *channels), max_pixels)
    if image.is_tiled:
        source.check_size(path, (image.tilelength, image.tilewidth), max(max_pixels, 1 << 24))
    size = path.stat().st_size
    last = max((a + n for a, n in zip(image.dataoffsets, image.databytecounts, strict=False)), default=0)
    stored = sum(image.databytecounts)
    expected = ceil(image.imagelength * image.imagewidth * image.samplesperpixel * image.bitspersample / 8)
    if last > size or (image.compression == 1 and stored < expected):
        raise FormatError(
            f"{path} is cut short: its pixels need {max(last, expected)} bytes but the file has {size}. "
            "Copy it again."
        )


def _pixels(image: tifffile.TiffPage) -> np.ndarray:
    try:
        data = image.asarray()
    except ValueError as error:
        if "imagecodecs" in str(error):
            name = getattr(image.compression, "name", image.compression)
            raise FormatError(
                f"its compression {name} cannot be read here. Save it uncompressed or with Deflate, "
                "or install the package imagecodecs."
            ) from error
        raise
    if image.planarconfig == 2 and data.ndim == 3 and image.samplesperpixel > 1:
        data = np.moveaxis(data, 0, -1)
    if image.photometric == tifffile.PHOTOMETRIC.MINISWHITE and data.dtype.kind == "u":
        data = (2**image.bitspersample - 1) - data
    if image.extrasamples and header.loads(image.description) is None:
        data = data[..., : image.samplesperpixel - len(image.extrasamples)]
        data = data[..., 0] if data.shape[-1] == 1 else data
    return np.ascontiguousarray(data, dtype=data.dtype.newbyteorder("="))


def _checked(data: np.ndarray) -> np.ndarray:
    if data.dtype.name not in _TYPES:
        raise FormatError(f"TIFF cannot hold {data.dtype} here. Save real numbers, such as an intensity.")
    return np.ascontiguousarray(data)


def _resolution(pixel_pitch: float | None) -> dict:
    if pixel_pitch is None or not 1e-11 < pixel_pitch < 1e3:  # what a TIFF rational can hold
        return {}
    return {"resolution": (0.01 / pixel_pitch,) * 2, "resolutionunit": "CENTIMETER"}
