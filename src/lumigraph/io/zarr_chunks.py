"""Whether the chunks of a Zarr store become what its metadata declares, before one is decoded."""

import zipfile
from collections.abc import Iterator
from math import prod
from pathlib import Path
from typing import Any

import zarr

from lumigraph.errors import FormatError
from lumigraph.io import source

_PLAIN = {"bytes", "transpose", "crc32c"}
_PACKED = {"zstd", "gzip"}  # not blosc: its decoder dies on some damaged chunks
_MOST_CHUNKS = 1_000_000


def check_entries(path: Path, limit: int) -> None:
    """Refuse a zipped store with entries that inflate to more than `limit` bytes or more than they can."""
    if path.is_dir():
        source.check_folder(path, 2 * _MOST_CHUNKS)
        for file in [path / "zarr.json", *path.glob("*/zarr.json")][:1000]:
            _check_metadata(path, file.stat().st_size if file.exists() else 0)
        return
    with zipfile.ZipFile(path) as file:
        for entry in file.infolist():
            if not 0 <= entry.compress_size <= path.stat().st_size:
                raise FormatError(
                    f"{path} is cut short: {entry.filename[:60]!r} is not all there. Copy it again."
                )
            source.check_stored(path, entry.file_size, entry.compress_size)
            if entry.file_size > limit:
                raise FormatError(
                    f"{path} holds {entry.filename[:60]!r} of {entry.file_size} bytes: too many."
                )
            if entry.filename.endswith("zarr.json"):
                _check_metadata(path, entry.file_size)


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
    for content in _contents(path, name):
        stored += len(content)
        inner = content[:-4] if codecs[-1:] == ["crc32c"] else content
        size = len(inner) if not packed else _declared(inner, packed[0])
        if packed == ["gzip"]:
            source.check_inflated(path, inner, limit)
        elif size is None or size > limit:
            raise FormatError(
                f"{path} is damaged: a chunk becomes {size or 'an unknown number of'} bytes where {limit} "
                "are declared. Copy it again."
            )
    return stored


def _contents(path: Path, name: str) -> Iterator[bytes]:
    """Bytes of every chunk of an array."""
    if path.is_dir():
        for file in (path / name).rglob("*"):
            if file.name != "zarr.json" and file.is_file():
                yield file.read_bytes()
        return
    with zipfile.ZipFile(path) as file:
        for entry in file.infolist():
            if entry.filename.startswith(f"{name}/") and not entry.filename.endswith(("zarr.json", "/")):
                yield file.read(entry)


def _declared(content: bytes, codec: str) -> int | None:
    """Bytes that a zstd frame says it becomes (RFC 8878, 3.1.1.1); None where it does not say."""
    if codec == "gzip":
        return 0
    if len(content) < 6 or content[:4] != b"\x28\xb5\x2f\xfd":
        return None
    flags = content[4]
    single, size = flags >> 5 & 1, (0, 2, 4, 8)[flags >> 6]
    start = 5 + (not single) + (0, 1, 2, 4)[flags & 3]
    size = size or single
    if size == 0 or len(content) < start + size:
        return None
    return int.from_bytes(content[start : start + size], "little") + (256 if size == 2 else 0)


def _check_metadata(path: Path, size: int) -> None:
    if size > 16 << 20:
        raise FormatError(f"{path} has {size} bytes of metadata: too many for a store. Copy it again.")
