"""Lytro containers (`.lfp`, `.lfr`, `.lfx`) and bare raw frames (`.raw`).

A container is a row of sections: 8 bytes of magic, a version and a length (big-endian), a name of 80 bytes,
"sha1-" and the digest of the content, then the content, filled up to a multiple of 16. The first, LFM, is
the table of contents in JSON, which calls the others by name. Described in public by N. Patel, *Lytro Light
Field File Format* (2012), and in the documentation of lfptools and of the Light Field Toolbox.

Parts, for ``open(path, what=...)``: "raw" (a Bayer frame; "raw-1" ... for further ones), "calibration" (the
nominal lattice), "stack" (pictures focused at several lambda), "depth" and "confidence" (maps), "lut" (the
coarse depth map of a stack), "thumbnail".
"""

import hashlib
import io
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from PIL import JpegImagePlugin

from lumigraph.core.calibration import Calibration
from lumigraph.core.raw import RawImage
from lumigraph.core.stack import Stack
from lumigraph.errors import FormatError
from lumigraph.io import bits, lytro_metadata, source
from lumigraph.io.jpeg import MOST_PIXELS, check_scans
from lumigraph.io.lytro_metadata import field, parse, whole

_MAGIC = re.compile(rb"\x89LF[PMC]\r\n\x1a\n")
_NAME = re.compile(rb"(sha1-[0-9a-f]{40})\0*")
_MOST = 10_000  # sections
_LARGEST_PICTURE = 64 << 20  # pixels of one JPEG
_BARE = {
    3280 * 3280 * 3 // 2: ((3280, 3280), 12, "big", "BGGR"),
    7728 * 5368 * 5 // 4: ((5368, 7728), 10, "little", "GRBG"),
}
"""Bytes of a bare frame to its shape, packing and Bayer pattern: F01 and Illum."""
_DEPTH, _STACK = "com.lytro.acceleration.depthMap", "com.lytro.acceleration.refocusStack"


@dataclass(frozen=True, slots=True)
class Container:
    """The sections of a file: its table of contents, and (offset, length) of each content by name."""

    path: Path
    table: dict[str, Any]
    sections: dict[str, tuple[int, int]]

    def content(self, name: Any) -> bytes:
        """Content of a section, its digest checked.

        Raises
        ------
        FormatError
            No such section in this file, or damage.
        """
        if not isinstance(name, str) or name not in self.sections:
            raise FormatError(f"its part {str(name)[:50]} is not in this file. Open the file that has it.")
        offset, length = self.sections[name]
        with self.path.open("rb") as file:
            file.seek(offset)
            content = file.read(length)
        if name != f"sha1-{hashlib.sha1(content, usedforsecurity=False).hexdigest()}":
            raise FormatError(
                f"its part {name[:13]}... does not fit its digest: damaged. Copy the file again."
            )
        return content

    def has(self, name: Any) -> bool:
        """True if the file has a section of this name."""
        return isinstance(name, str) and name in self.sections


def load(
    path: Path, *, what: str | None = None, max_pixels: int = source.MAX_PIXELS
) -> RawImage | Stack | Calibration:
    """One part of a Lytro file: `what`, or the first of raw, stack, depth and thumbnail that it has.

    A raw image keeps what was recorded in its metadata, see `lytro_metadata.Frame`; a depth map is a raw
    image of float32 in Lytro's lambda.

    Raises
    ------
    FormatError
        Not a Lytro file, damaged, too large, or without that part.
    """
    path = source.regular_file(path)
    with path.open("rb") as file:
        start = file.read(16)
    if path.suffix.lower() == ".raw" and not _MAGIC.match(start):
        if what not in (None, "raw"):
            raise FormatError(f"{path} is a bare raw frame: what={what!r} is not in it.")
        with source.decoding(path, "a raw frame"):
            return _bare(path, max_pixels)
    with source.decoding(path, "a Lytro container"):
        container = read(path)
        parts = _parts(container)
        if not parts:
            raise FormatError("it holds nothing that is read here.")
        name = what if what is not None else next(iter(parts))
        if name not in parts:
            raise FormatError(f"it has no part {what!r}. It holds {', '.join(parts)}.")
        reader, where = parts[name]
        return reader(container, where, max_pixels)


def contents(path: Path) -> list[tuple[str, str, str]]:
    """The parts of a file: (name, noun, about) each."""
    path = source.regular_file(path)
    with path.open("rb") as file:
        if path.suffix.lower() == ".raw" and not _MAGIC.match(file.read(16)):
            return [("raw", "RawImage", f"bare frame of {path.stat().st_size} bytes")]
    with source.decoding(path, "a Lytro container"):
        nouns = {"stack": "Stack", "calibration": "Calibration"}
        parts = _parts(read(path))
        return [(name, nouns.get(name, "RawImage"), _about(name, parts[name][1])) for name in parts]


def read(path: Path) -> Container:
    """The table of contents and the places of the sections; contents are not read.

    Raises
    ------
    FormatError
        No container, or sections that end behind the file.
    """
    size, table, sections, at = path.stat().st_size, None, {}, 0
    with path.open("rb") as file:
        while at + 16 <= size:
            file.seek(at)
            start = file.read(96)
            if not _MAGIC.match(start):
                if at == 0:
                    source.check_signature(path, start[:8], "Lytro")
                break
            length = int.from_bytes(start[12:16], "big")
            at += 16
            if length == 0:
                continue
            name = _NAME.fullmatch(start[16:])
            if name is None or at + 80 + length > size or len(sections) > _MOST:
                raise FormatError(
                    f"it is cut short or damaged: a section at byte {at - 16} needs {length} bytes but the "
                    f"file has {size}. Copy it again."
                )
            sections[name[1].decode()] = (at + 80, length)
            if table is None and start[3:4] == b"M":
                file.seek(at + 80)
                table = parse(file.read(min(length, 16 << 20)))
            at += 80 + -(-length // 16) * 16
    if table is None:
        raise FormatError("it has no table of contents. Copy the file again.")
    return Container(path, table, sections)


def _parts(container: Container) -> dict[str, tuple[Any, Any]]:
    """Name to (reader, where it is described) of every part whose contents are in the file."""
    raws: dict[str, tuple[Any, Any]] = {}
    rest: dict[str, tuple[Any, Any]] = {}
    for k, frame in enumerate(_frames(container.table)):
        suffix = f"-{k}" if k else ""
        if container.has(frame.get("metadataRef")):
            if container.has(frame.get("imageRef")):
                raws[f"raw{suffix}"] = (_raw, frame)
            rest[f"calibration{suffix}"] = (_calibration, frame)
    stacks, maps = {}, {}
    for each in _list(field(container.table, "picture.accelerationArray")):
        content = field(each, "vendorContent")
        if field(each, "type") == _STACK and isinstance(content, dict):
            stacks["stack"] = (_stack, content)
            if container.has(field(content, "depthLut.imageRef")):
                maps["lut"] = (_map, (content["depthLut"], content["depthLut"]))
        if field(each, "type") == _DEPTH and isinstance(content, dict):
            for name, key in (("depth", "depthMap"), ("confidence", "confidenceMap")):
                if container.has(field(content, f"{key}.imageRef")):
                    maps[name] = (_map, (content[key], content))
    thumbnails = [*_list(container.table.get("thumbnailArray")), *_list(container.table.get("thumbnails"))]
    for each in thumbnails[:1]:
        if container.has(field(each, "imageRef")):
            rest["thumbnail"] = (_thumbnail, each)
    return {**raws, **stacks, **maps, **rest}


def _frames(table: dict[str, Any]) -> list[dict[str, Any]]:
    """Frames of the F01 (picture.frameArray) and of the Illum (frames)."""
    rows = [*_list(field(table, "picture.frameArray")), *_list(table.get("frames"))]
    return [frame for row in rows if isinstance(frame := field(row, "frame"), dict)]


def _list(value: Any) -> list[Any]:
    return value[:_MOST] if isinstance(value, list) else []


def _raw(container: Container, frame: dict[str, Any], max_pixels: int) -> RawImage:
    stored = lytro_metadata.frame(parse(container.content(frame["metadataRef"])))
    source.check_size(container.path, stored.shape, max_pixels)
    count = stored.shape[0] * stored.shape[1]
    needed = bits.packed_size(count, stored.bits, stored.endianness)
    if (length := container.sections[frame["imageRef"]][1]) < needed:
        size = f"{stored.shape[0]} x {stored.shape[1]}"
        raise FormatError(f"its frame of {size} pixels needs {needed} bytes but has {length}.")
    data = bits.unpack(container.content(frame["imageRef"]), count, stored.bits, stored.endianness)
    return RawImage(data.reshape(stored.shape), stored.pixel_pitch, stored.bits, stored.bayer, stored.known)


def _calibration(container: Container, frame: dict[str, Any], max_pixels: int) -> Calibration:
    found = parse(container.content(frame["metadataRef"]))
    source.check_size(container.path, lytro_metadata.frame(found).shape, max_pixels)
    return lytro_metadata.calibration(found)


def _bare(path: Path, max_pixels: int) -> RawImage:
    """A frame without a container: its metadata stands beside it (`.txt`, `.json`), or its size says."""
    size = path.stat().st_size
    beside = next((p for end in (".txt", ".TXT", ".json") if (p := path.with_suffix(end)).is_file()), None)
    known: dict[str, Any] = {}
    if beside is not None:
        with source.regular_file(beside).open("rb") as file:
            found = lytro_metadata.frame(parse(file.read(16 << 20)))
        shape, depth, order, bayer = found.shape, found.bits, found.endianness, found.bayer
        pitch, known = found.pixel_pitch, found.known
    elif size in _BARE:
        (shape, depth, order, bayer), pitch = _BARE[size], None
    else:
        raise FormatError(
            f"it is not a container, and its {size} bytes are not a frame of a Lytro F01 ({min(_BARE)}) or "
            f"Illum ({max(_BARE)}). Put its metadata beside it, as {path.stem}.txt."
        )
    source.check_size(path, shape, max_pixels)
    count = shape[0] * shape[1]
    if size < (needed := bits.packed_size(count, depth, order)):
        raise FormatError(
            f"a frame of {shape[0]} x {shape[1]} pixels needs {needed} bytes but it has {size}."
        )
    data = bits.unpack(path.read_bytes(), count, depth, order).reshape(shape)
    return RawImage(data, pitch, depth, bayer, known)


def _stack(container: Container, content: dict[str, Any], max_pixels: int) -> Stack:
    rows = _list(content.get("imageArray"))
    if not rows:
        raise FormatError(
            "its stack is packed in another way than as JPEG pictures (H.264), which is not read."
        )
    pictures = []
    for row in rows:
        position, kind = field(row, "lambda"), field(row, "representation")
        if kind != "jpeg" or isinstance(position, bool) or not isinstance(position, int | float):
            raise FormatError(
                f"its stack holds {str(kind)[:20]!r} pictures; only JPEG with a lambda is read."
            )
        pictures.append((float(position), row))
    pictures.sort(key=lambda pair: pair[0])
    size = whole(rows[0], "height"), whole(rows[0], "width")
    source.check_size(container.path, (len(rows) * size[0], size[1], 3), max_pixels)
    data = np.stack([_jpeg(container, row, size) for _, row in pictures])
    return Stack(data, tuple(p for p, _ in pictures), "lambda", bit_depth=8)


def _thumbnail(container: Container, row: dict[str, Any], max_pixels: int) -> RawImage:
    size = whole(row, "height"), whole(row, "width")
    source.check_size(container.path, (*size, 3), max_pixels)
    return RawImage(_jpeg(container, row, size), bit_depth=8)


def _jpeg(container: Container, row: Any, size: tuple[int, int]) -> np.ndarray:
    """A picture (y, x, 3) of the size that was declared."""
    content = container.content(field(row, "imageRef"))
    check_scans(content)
    with JpegImagePlugin.JpegImageFile(io.BytesIO(content)) as image:
        if image.size != (size[1], size[0]) or size[0] * size[1] > _LARGEST_PICTURE:
            found = f"{image.size[1]} x {image.size[0]}"
            raise FormatError(f"its picture has {found} pixels, not {size[0]} x {size[1]}.")
        source.check_stored(container.path, size[0] * size[1], len(content), MOST_PIXELS)
        return np.array(image.convert("RGB"))


def _map(container: Container, where: tuple[dict[str, Any], dict[str, Any]], max_pixels: int) -> RawImage:
    """A map of little-endian float32 (y, x)."""
    row, sizes = where
    shape = whole(sizes, "height"), whole(sizes, "width")
    source.check_size(container.path, shape, max_pixels)
    content = container.content(row.get("imageRef"))
    if row.get("representation") != "raw" or len(content) != 4 * shape[0] * shape[1]:
        raise FormatError(f"its map of {shape[0]} x {shape[1]} values has {len(content)} bytes, not 4 each.")
    known = {
        name: sizes[name] for name in ("minLambda", "maxLambda") if isinstance(sizes.get(name), int | float)
    }
    return RawImage(np.frombuffer(content, "<f4").reshape(shape).astype(np.float32), metadata=known)


def _about(name: str, where: Any) -> str:
    if name == "stack":
        return f"{len(_list(where.get('imageArray')))} pictures"
    row = where[1] if isinstance(where, tuple) else where
    sizes = [field(row, key) for key in ("height", "width")]
    return f"{sizes[0]} x {sizes[1]}" if None not in sizes else "of the frame"
