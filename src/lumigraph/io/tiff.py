"""TIFF and OME-TIFF: any bit depth, grey or colour, whole numbers or floats, one page or several.

Fields of a raw image stand as JSON in ImageDescription. Stacks and volumes become OME-TIFF, whose physical
sizes microscopy programs read. Compression: none, Deflate, PackBits; LZW and JPEG through Pillow.
"""

import json
import logging
from dataclasses import replace
from math import ceil
from pathlib import Path
from typing import Any

import numpy as np
import tifffile

from lumigraph.core.arrays import to_numpy
from lumigraph.core.grid import Grid
from lumigraph.core.raw import RawImage
from lumigraph.core.stack import Stack
from lumigraph.core.volume import Volume
from lumigraph.errors import FormatError
from lumigraph.io import header, ome, source, target
from lumigraph.io.hyperstack import Declared, declared
from lumigraph.io.tiff_planes import PlaneReader, opened, page_of

_TYPES = frozenset(f"{kind}{bits}" for kind in ("uint", "int") for bits in (8, 16, 32)) | {
    "float16",
    "float32",
    "float64",
}
_COLOURS = (3, 4)
_FIRST = 8  # byte at which pixels can begin at the earliest
# tifffile logs what it finds odd; whoever wants that adds a handler, others get our one-line errors.
logging.getLogger("tifffile").addHandler(logging.NullHandler())


def load(
    path: Path, *, page: int | None = None, max_pixels: int = source.MAX_PIXELS
) -> RawImage | Stack | Volume:
    """The picture in a TIFF file (y, x) or (y, x, c), or its pages; transparency is left out.

    Several pages of one size open as a `Stack`, or as a `Volume` where the file gives the size of a voxel
    (OME-XML with PhysicalSizeX, Y and Z and neither channels nor times). Depths of a volume by another
    program count from its middle plane unless it gives positions.

    Raises
    ------
    FormatError
        Not a TIFF, damaged, cut short, too large, no such page, or compressed in a way that is not read.
    """
    path = source.regular_file(path)
    with path.open("rb") as file:
        source.check_signature(path, file.read(8), "TIFF")
    with source.decoding(path, "a TIFF"), tifffile.TiffFile(path) as file:
        planes, told = _said(path, file, page)
        with opened(path, file, planes, told) as reader:
            count = reader.count
            if page is not None and (
                isinstance(page, bool) or not isinstance(page, int) or not 0 <= page < count
            ):
                raise FormatError(f"page is {page!r} but {path} has {count}. Choose 0 ... {count - 1}.")
            if page is None and (count > 1 or (planes is not None and planes.note)):
                return _pages(reader, planes, told, max_pixels)
            found = _single(reader, page or 0, max_pixels)
        return _of_stack(found, planes, told, count)


def _said(
    path: Path, file: tifffile.TiffFile, page: int | None
) -> tuple[ome.OmePlanes | None, Declared | None]:
    """Planes as the first page describes them, in OME-XML or otherwise.

    A page that the file itself holds opens whatever else is missing: then nothing is said.
    """
    if len(file.pages) == 0:
        return None, None
    first = page_of(path, file, 0)
    try:
        planes = ome.parse(first.description, path.name)
        told = None if planes is not None else declared(path, first)
        if page is not None:
            with opened(path, file, planes, told):
                pass
    except FormatError:
        if page is None:
            raise
        return None, None
    return planes, told if told is not None and told.count >= len(file.pages) else None


def save(thing: RawImage | Stack | Volume, path: Path) -> None:
    """Write a raw image as plain TIFF, a stack or a volume as OME-TIFF.

    Resolution tags and OME physical sizes hold the pitches for other programs.

    Raises
    ------
    FormatError
        Complex numbers, or another type that TIFF readers do not share.
    """
    if isinstance(thing, Volume):
        _save_volume(thing, path)
    elif isinstance(thing, Stack):
        _save_stack(thing, path)
    else:
        _save_raw(thing, path)


def contents(path: Path) -> list[tuple[str, str, str]]:
    """The pages of a TIFF file: (name, noun, about) each; nothing is decoded."""
    path = source.regular_file(path)
    with path.open("rb") as file:
        source.check_signature(path, file.read(8), "TIFF")
    with source.decoding(path, "a TIFF"), tifffile.TiffFile(path) as file:
        planes, told = _said(path, file, None)
        with opened(path, file, planes, told) as reader:
            count = reader.count
        first = file.pages.first
        size = " x ".join(map(str, first.shape))
        if count == 1:
            return [("", "RawImage", f"{size}, {first.dtype}")]
        noun = "Volume" if _is_volume(planes, told, count) else "Stack"
        along = _along(planes, told, count)
        several = f" ({along})" if along else ""
        about = f"{count} pages{several} of {size}, {first.dtype}; page=0 ... {count - 1} opens one"
        return [("", noun, about)]


def count(path: Path) -> int:
    """Pages of a TIFF file that open as a stack; 1 where it is one picture, with or without thumbnails."""
    path = source.regular_file(path)
    with path.open("rb") as file:
        source.check_signature(path, file.read(8), "TIFF")
    with source.decoding(path, "a TIFF"), tifffile.TiffFile(path) as file:
        planes, told = _said(path, file, None)
        with opened(path, file, planes, told) as reader:
            found = reader.count
            return found if found > 1 and not _has_thumbnails(reader.page(0)[1], reader.page(1)[1]) else 1


def _single(reader: PlaneReader, k: int, max_pixels: int) -> RawImage:
    path, image = reader.page(k)
    _check_page(path, image, max_pixels)
    found = header.loads(image.description)
    data = reader.pixels(k, transparent=found is not None)
    depth = _depth(image, data)
    if found is not None and "shape" in found and data.size == np.prod(found["shape"]):
        data = data.reshape(found["shape"])
    return header.restore(data, found, depth)


def _pages(
    reader: PlaneReader, planes: ome.OmePlanes | None, told: Declared | None, max_pixels: int
) -> RawImage | Stack | Volume:
    path, first = reader.page(0)
    count = reader.count
    _check_page(path, first, max_pixels)
    if count > 1 and _has_thumbnails(first, reader.page(1)[1]):
        return _single(reader, 0, max_pixels)
    channels = (first.samplesperpixel,) if first.samplesperpixel > 1 else ()
    source.check_size(path, (count * first.imagelength, first.imagewidth, *channels), max_pixels)
    data = None
    for k in range(count):
        place, image = reader.page(k)
        if image.shape != first.shape or image.dtype != first.dtype:
            raise FormatError(
                f"page {k} has another size or type than the first. Choose one by page=0 ... {count - 1}."
            )
        _check_page(place, image, max_pixels)
        plane = reader.pixels(k, transparent=planes is not None and bool(planes.note))
        data = np.empty((count, *plane.shape), plane.dtype) if data is None else data
        data[k] = plane
    assert data is not None  # count is at least 1
    return _noun(data, planes, told, first)


def _has_thumbnails(first: tifffile.TiffPage, second: tifffile.TiffPage) -> bool:
    """True if the first page is the picture and the others are small ones of it."""
    small = second.imagelength < first.imagelength and second.imagewidth < first.imagewidth
    return not first.is_reduced and (small or (second.is_reduced and second.shape != first.shape))


def _of_stack(page: RawImage, planes: ome.OmePlanes | None, told: Declared | None, count: int) -> RawImage:
    """A page with what the first one says of the whole stack."""
    found = header.loads(planes.note) if planes is not None else None
    if found is not None and found.get("kind") == "Stack":
        known = header.restore_planes(page.data[None], {**found, "positions": ()})
        assert isinstance(known, Stack)  # restore_planes goes by the kind
        return RawImage(page.data, known.pixel_pitch, known.bit_depth, metadata=known.metadata)
    if found is not None or (planes is None and told is None):
        return page
    about = {name: value for name, value in _about(planes, told).items() if not name.startswith("axes")}
    depth = _bits(planes, page.bit_depth)
    pitch = None if _is_volume(planes, told, count) and count > 1 else _pitch(planes, told)
    return replace(page, pixel_pitch=pitch, bit_depth=depth, metadata={**page.metadata, **about})


def _noun(
    data: np.ndarray, planes: ome.OmePlanes | None, told: Declared | None, first: tifffile.TiffPage
) -> RawImage | Stack | Volume:
    found = header.loads(planes.note) if planes is not None else None
    if found is not None:
        return header.restore_planes(data, found)
    pitches = planes.pitch if planes is not None else told.pitch if told is not None else (None,) * 3
    depths = planes.depths if planes is not None and planes.axes == "z" else ()
    if _is_volume(planes, told, len(data)):
        dz, dy, dx = (value or 1.0 for value in pitches)
        depths = depths or tuple((np.arange(len(data)) - len(data) // 2) * dz)
        return Volume(data, Grid(data.shape[1:3], (dy, dx)), depths)
    if told is not None and told.writer == "tifffile" and data.shape[-1] in _COLOURS and data.ndim < 5:
        # Planes three pixels wide are the rows of pictures whose colours come last.
        data = data.reshape(*told.sizes, *data.shape[1:])
        return (
            RawImage(data, bit_depth=_depth(first, data))
            if data.ndim == 3
            else Stack(data, bit_depth=_depth(first, data))
        )
    depth = _bits(planes, _depth(first, data))
    axes = _along(planes, told, len(data))
    quantity = "dz [m]" if depths else f"page ({axes})" if axes else "page"
    return Stack(data, depths, quantity, _pitch(planes, told), depth, _about(planes, told))


def _pitch(planes: ome.OmePlanes | None, told: Declared | None) -> float | None:
    """Distance of the pixels [m], where it is known and the same along both axes."""
    pitch = planes.pitch if planes is not None else told.pitch if told is not None else (None,) * 3
    return pitch[2] if pitch[1] == pitch[2] else None


def _bits(planes: ome.OmePlanes | None, stored: int | None) -> int | None:
    bits = None if planes is None else planes.bits
    return stored if bits is None or stored is None else min(bits, stored)


def _depth(image: tifffile.TiffPage, data: np.ndarray) -> int | None:
    """Bits of the numbers that a page became; those of the file unless they were drawn by a palette."""
    if data.dtype.kind not in "iu":
        return None
    drawn = image.photometric == tifffile.PHOTOMETRIC.PALETTE or image.bitspersample == 1
    return 8 * data.dtype.itemsize if drawn else image.bitspersample


def _along(planes: ome.OmePlanes | None, told: Declared | None, count: int) -> str:
    """Axes of the pages of a stack, the slowest first, such as "2 t x 3 z"; empty where not known."""
    axes, sizes = (planes.axes, planes.counts) if planes is not None else ("", ())
    axes, sizes = (told.axes, told.sizes) if told is not None else (axes, sizes)
    if len(axes) < 2 or np.prod(sizes) != count:
        return ""
    return " x ".join(f"{size} {axis}" for axis, size in zip(axes, sizes, strict=True))


def _about(planes: ome.OmePlanes | None, told: Declared | None) -> dict[str, Any]:
    """Metadata of axes and places that a stack has no fields for."""
    axes, sizes = (planes.axes, planes.counts) if planes is not None else ("", ())
    axes, sizes = (told.axes, told.sizes) if told is not None else (axes, sizes)
    found: dict[str, Any] = (
        {"axes": f"{axes.upper()}YX", "axes_sizes": list(sizes)} if axes.strip("n") else {}
    )
    if planes is not None and None not in planes.center:
        found["position"] = [*planes.depths[:1], *planes.center]
    return found


def _is_volume(planes: ome.OmePlanes | None, told: Declared | None, count: int) -> bool:
    if planes is None:
        return told is not None and told.axes == "z" and None not in told.pitch and told.count == count
    if (found := header.loads(planes.note)) is not None:
        return found.get("kind") == "Volume"
    sizes, alone = planes.sizes, planes.axes in ("", "z")
    return None not in planes.pitch and sizes[0] == count and sizes[2] == 1 and alone


def _check_page(path: Path, image: tifffile.TiffPage, max_pixels: int) -> None:
    """Refuse what would be large, cut short or undecodable, before it is decoded."""
    if image.imagedepth > 1:
        raise FormatError(f"{path} holds {image.imagedepth} planes in one page. Save one page for each.")
    if len(image.shape) not in (2, 3) or image.bitspersample < 1:
        raise FormatError(f"{path} holds data of shape {image.shape}, not a picture (y, x) or (y, x, c).")
    channels = (image.samplesperpixel,) if image.samplesperpixel > 1 else ()
    source.check_size(path, (image.imagelength, image.imagewidth, *channels), max_pixels)
    if image.is_tiled:
        source.check_size(path, (image.tilelength, image.tilewidth), max(max_pixels, 1 << 24))
    size = path.stat().st_size
    if min(image.dataoffsets, default=0) < _FIRST or min(image.databytecounts, default=0) < 1:
        raise FormatError(f"{path} is damaged: a strip of its pixels has no place in it. Copy it again.")
    last = max((a + n for a, n in zip(image.dataoffsets, image.databytecounts, strict=False)), default=0)
    stored = min(sum(image.databytecounts), size * max(1, len(image.databytecounts)))
    expected = ceil(image.imagelength * image.imagewidth * image.samplesperpixel * image.bitspersample / 8)
    if last > size or (image.compression == 1 and stored < expected):
        raise FormatError(
            f"{path} is cut short: its pixels need {max(last, expected)} bytes but the file has {size}. "
            "Copy it again."
        )
    # LZW makes at most 1365 bytes from one; JPEG has no bound, its decoder stops at the picture's size.
    source.check_stored(path, expected, size if image.compression == 1 else stored, 1 << 16)
    source.check_held(path, expected, stored, max_pixels)


def _save_raw(raw: RawImage, path: Path) -> None:
    data = _checked(raw.data)
    values = data[..., 0] if data.shape[2:] == (1,) else data
    with target.replacing(path) as temporary, tifffile.TiffWriter(temporary) as file:
        file.write(
            values,
            photometric="rgb" if values.shape[2:] in ((3,), (4,)) else "minisblack",
            planarconfig="contig" if values.ndim == 3 else None,
            description=header.dumps(raw, shape=list(data.shape)),
            metadata=None,
            software="lumigraph",
            **_resolution(raw.pixel_pitch),
        )


def _save_stack(stack: Stack, path: Path) -> None:
    data = _checked(stack.data)
    lengths = stack.positions if stack.quantity == "dz [m]" else ()
    step = abs(lengths[1] - lengths[0]) if len(lengths) > 1 else None
    note = json.dumps(header.describe_stack(stack))
    pitch = (step or None, stack.pixel_pitch, stack.pixel_pitch)
    text = ome.text(data.shape, data.dtype.name, pitch=pitch, depths=lengths, name=stack.quantity, note=note)
    _write_planes(data, path, text, stack.pixel_pitch)


def _save_volume(volume: Volume, path: Path) -> None:
    data = _checked(to_numpy(volume.data))
    dz, dy, dx = volume.spacing
    text = ome.text(
        data.shape, data.dtype.name, pitch=(dz or None, dy, dx), depths=volume.depths, name="volume",
        note=json.dumps(header.describe_volume(volume)),
    )  # fmt: skip
    _write_planes(data, path, text, dx)


def _write_planes(data: np.ndarray, path: Path, description: str, pitch: float | None) -> None:
    colour, common = data.shape[3:] == (3,), _resolution(pitch)
    big = data.nbytes > 3.9e9
    with target.replacing(path) as temporary, tifffile.TiffWriter(temporary, bigtiff=big) as file:
        for k, plane in enumerate(data):
            file.write(
                plane,
                photometric="rgb" if colour else "minisblack",
                planarconfig="contig" if plane.ndim == 3 else None,
                description=description if k == 0 else None,
                metadata=None,
                software="lumigraph" if k == 0 else None,
                **common,
            )


def _checked(data: np.ndarray) -> np.ndarray:
    if data.dtype.name not in _TYPES:
        raise FormatError(f"TIFF cannot hold {data.dtype} here. Save real numbers, such as an intensity.")
    return np.ascontiguousarray(data)


def _resolution(pixel_pitch: float | None) -> dict[str, Any]:
    if pixel_pitch is None or not 1e-11 < pixel_pitch < 1e3:  # what a TIFF rational can hold
        return {}
    return {"resolution": (0.01 / pixel_pitch,) * 2, "resolutionunit": "CENTIMETER"}
