"""Check that a Zarr store's chunks decode to the size its metadata declares, before one is decoded."""

import struct
import zipfile
from collections.abc import Iterator
from math import prod
from pathlib import Path
from typing import Any, BinaryIO

import zarr

from lumigraph.errors import FormatError
from lumigraph.io import source

_PLAIN = {"bytes", "transpose", "crc32c"}
_PACKED = {"zstd", "gzip"}  # not blosc: its decoder dies on some damaged chunks
_MOST_CHUNKS = 1_000_000
_NAMES = 26  # where a ZIP entry's header gives the lengths of its name and of its extra fields


def check_entries(path: Path, limit: int) -> None:
    """Refuse a zipped store with entries that inflate to more than `limit` bytes or more than they can."""
    if path.is_dir():
        source.check_folder(path, 2 * _MOST_CHUNKS)
        for file in [path / "zarr.json", *path.glob("*/zarr.json")][:1000]:
            _check_metadata(path, file.stat().st_size if file.exists() else 0)
        return
    size, held = path.stat().st_size, 0
    with path.open("rb") as packed, zipfile.ZipFile(packed) as file:
        for entry in file.infolist():
            held += max(entry.compress_size, 0)
            if entry.compress_size < 0 or held > size:  # entries may also share their bytes: a bomb
                raise FormatError(
                    f"{path} is cut short: {entry.filename[:60]!r} is not all there. Copy it again."
                )
            if entry.file_size > limit:
                raise FormatError(
                    f"{path} holds {entry.filename[:60]!r} of {entry.file_size} bytes: too many."
                )
            if entry.filename.endswith("zarr.json"):
                _check_metadata(path, entry.file_size)
                _check_packing(path, packed, entry)


def _check_packing(path: Path, file: BinaryIO, entry: zipfile.ZipInfo) -> None:
    """Refuse an entry that becomes more than it declares: whoever reads it would inflate all of it first."""
    if entry.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        raise FormatError(
            f"{path} holds {entry.filename[:60]!r} packed by method {entry.compress_type} of ZIP. "
            "Pack it by Deflate, or not at all."
        )
    if entry.compress_type == zipfile.ZIP_STORED:
        source.check_stored(path, entry.file_size, entry.compress_size, 1)
        return
    source.check_stored(path, entry.file_size, entry.compress_size)
    file.seek(entry.header_offset + _NAMES)
    name, extra = struct.unpack("<HH", file.read(4))
    file.seek(name + extra, 1)
    source.check_inflated(path, file.read(entry.compress_size), entry.file_size, wbits=-15)


def check_chunks(path: Path, array: zarr.Array[Any], name: str) -> int:
    """Bytes of the chunks; codecs that may be unbounded and chunks that inflate to more are refused.

    Raises
    ------
    FormatError
        Which of them it is.
    """
    codecs = [str(codec["name"]) for codec in array.metadata.to_dict().get("codecs", ())]  # pyright: ignore
    packed = [codec for codec in codecs if codec in _PACKED]
    if not set(codecs) <= _PLAIN | _PACKED or len(packed) > 1:
        raise FormatError(f"{path} is packed by {', '.join(codecs)}; only zstd or gzip is read.")
    if array.nchunks > _MOST_CHUNKS:
        raise FormatError(f"{path} declares {array.nchunks} chunks, at most {_MOST_CHUNKS} are read.")
    limit, stored = prod(array.chunks) * array.dtype.itemsize, 0
    for content in _contents(path, name, limit + limit // 100 + 1024):  # what cannot be packed grows a little
        stored += len(content)
        inner = content[:-4] if codecs[-1:] == ["crc32c"] else content
        if packed == ["gzip"]:
            source.check_inflated(path, inner, limit)
            continue
        size = _declared(inner) if packed else len(inner)
        if size is None or size > limit:
            raise FormatError(
                f"{path} is damaged: a chunk becomes {size or 'an unknown number of'} bytes where {limit} "
                "are declared. Copy it again."
            )
    return stored


def check_shard(path: Path, file: Path, array: zarr.Array[Any]) -> None:
    """Refuse a shard whose chunks are not all there, or become more than declared.

    Raises
    ------
    FormatError
        Another packing than `lumigraph.io.series` writes, or damage.
    """
    found: Any = array.metadata.to_dict().get("codecs", ())
    inner = found[0].get("configuration", {}) if len(found) == 1 else {}
    packed = [[codec["name"] for codec in inner.get(part, ())] for part in ("codecs", "index_codecs")]
    ours = packed == [["bytes", "zstd"], ["bytes", "crc32c"]] and inner.get("index_location") == "end"
    if array.shards is None or not ours:
        raise FormatError(f"{path} is packed in another way than lumigraph packs series. Save it again.")
    count = prod(whole // part for whole, part in zip(array.shards, array.chunks, strict=True))
    limit, index = prod(array.chunks) * array.dtype.itemsize, 16 * count + 4
    _check_chunk(path, file.name, file.stat().st_size, count * (limit + limit // 100 + 1024) + index)
    content = file.read_bytes()
    places = (
        struct.unpack(f"<{2 * count}Q", content[-index:-4]) if len(content) >= index else (0,) * 2 * count
    )
    for start, size in zip(places[::2], places[1::2], strict=True):
        whole = start + size <= len(content) - index
        if not whole or (_declared(content[start : start + size]) or limit + 1) > limit:
            raise FormatError(f"{path} is damaged: {file.name} in it is incomplete. Make that frame again.")


def _contents(path: Path, name: str, most: int) -> Iterator[bytes]:
    """Bytes of every chunk of an array; one of more than `most` is refused before it is read."""
    if path.is_dir():
        for file in (path / name).rglob("*"):
            if file.name != "zarr.json" and file.is_file():
                _check_chunk(path, file.name, file.stat().st_size, most)
                yield file.read_bytes()
        return
    with path.open("rb") as packed, zipfile.ZipFile(packed) as file:
        for entry in file.infolist():
            if entry.filename.startswith(f"{name}/") and not entry.filename.endswith(("zarr.json", "/")):
                _check_chunk(path, entry.filename, entry.file_size, most)
                _check_packing(path, packed, entry)
                yield file.read(entry)


def _check_chunk(path: Path, name: str, size: int, most: int) -> None:
    if size > most:
        raise FormatError(
            f"{path} is damaged: its chunk {name[:60]!r} holds {size} bytes, {most} suffice. Copy it again."
        )


def _declared(content: bytes) -> int | None:
    """Bytes that a lone zstd frame says it becomes (RFC 8878, 3.1.1); None where it does not say."""
    if len(content) < 6 or content[:4] != b"\x28\xb5\x2f\xfd":
        return None
    flags = content[4]
    single, size = flags >> 5 & 1, (0, 2, 4, 8)[flags >> 6]
    start = 5 + (not single) + (0, 1, 2, 4)[flags & 3]
    size = size or single
    if size == 0 or _end_of_blocks(content, start + size) + 4 * (flags >> 2 & 1) != len(content):
        return None
    return int.from_bytes(content[start : start + size], "little") + (256 if size == 2 else 0)


def _end_of_blocks(content: bytes, at: int) -> int:
    """End of the blocks of a zstd frame that begin at a place; blocks of one repeated byte hold one."""
    last = 0
    while not last and at + 3 <= len(content):
        head = int.from_bytes(content[at : at + 3], "little")
        last, kind = head & 1, head >> 1 & 3
        at += 3 + (1 if kind == 1 else head >> 3)
    return at


def _check_metadata(path: Path, size: int) -> None:
    if size > 16 << 20:
        raise FormatError(f"{path} has {size} bytes of metadata: too many for a store. Copy it again.")
