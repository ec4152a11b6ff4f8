"""One file of arrays with a checksum over every byte: an uncompressed .npz, which NumPy reads as well.

Arrays begin at multiples of 64 bytes, so that they are read as memory maps. The comment at the end of the
archive is the seal: a word and a checksum of all bytes before its eight digits.
"""

import os
import stat
import struct
import zipfile
import zlib
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from io import BytesIO, RawIOBase
from pathlib import Path
from threading import Lock

import numpy as np

from lumigraph.core.arrays import WORKERS
from lumigraph.errors import FormatError
from lumigraph.store.atomic import replacing, sweep_once

_WORD = b"lumigraph sealed 1 "
_DIGITS = 8
_ALIGNED = 64
_PADDING = 0xD935
"""Kind of a ZIP extra field that only fills up, as zipalign writes it."""

_HEADER, _ZIP64 = 30, 20
"""Bytes of a ZIP entry's header without name and extra fields, and of the field for large entries."""

_PIECE = 1 << 22  # bytes


class DamagedError(FormatError):
    """A sealed file that is not as it was written."""


def write(path: str | os.PathLike[str], arrays: Mapping[str, np.ndarray]) -> None:
    """Write arrays into one file, atomically.

    Parameters
    ----------
    path
        Path of the file; its folder exists.
    arrays
        Arrays by name. Values, type and order in memory (C or Fortran) are kept; an array that is neither is
        written in C order.

    Raises
    ------
    FormatError
        The disk is full or may not be written to.
    ValueError
        An array of Python objects.
    """
    with replacing(path) as temporary:
        with zipfile.ZipFile(temporary, "w", zipfile.ZIP_STORED, allowZip64=True) as archive:
            for name, array in arrays.items():
                _add(archive, f"{name}.npy", np.asarray(array))
            archive.comment = _WORD + b"0" * _DIGITS
        with temporary.open("r+b", buffering=0) as file:
            checksum = _checksum_of(file, file.seek(-_DIGITS, os.SEEK_END))
            file.seek(-_DIGITS, os.SEEK_END)
            file.write(b"%08x" % checksum)


def read(
    path: str | os.PathLike[str], *, mapped: bool = False, written: bool = False
) -> dict[str, np.ndarray]:
    """The arrays of a sealed file, compared with its checksum first.

    Parameters
    ----------
    path
        Path of the file.
    mapped
        True for read-only memory maps; else the arrays are copies.
    written
        True if this process has just written it: then the checksum is not computed once more.

    Raises
    ------
    DamagedError
        It was cut short, or a bit has changed.
    FormatError
        Not a sealed file.
    OSError
        There is none, or it may not be read.
    """
    path = Path(path)
    sweep_once(path.parent)  # a run that finds all it needs writes nothing
    with path.open("rb") as file:
        whole = np.memmap(file, mode="r") if path.stat().st_size else np.empty(0, np.uint8)
        end = bytes(whole[-len(_WORD) - _DIGITS :])
        if not written and end != _WORD + b"%08x" % _checksum(whole[:-_DIGITS]):
            if end.startswith(_WORD) or _WORD in bytes(whole[:256]):  # one damage spares one of the two
                raise DamagedError(f"{path} is damaged: its checksum does not match. Remove it.")
            raise FormatError(f"{path} is not a sealed file of arrays. Give another name.")
        try:
            with zipfile.ZipFile(file) as archive:
                found = {_name(entry): _array(whole, entry) for entry in archive.infolist()}
        except Exception as error:  # a checksum is no proof that the rest was written by `write`
            raise DamagedError(f"{path} is damaged ({error}). Remove it.") from error
    return found if mapped else {name: np.array(array, order="K") for name, array in found.items()}


def is_own(path: Path) -> bool:
    """True for a sealed file of this user, with no other name; its checksum is not compared."""
    try:
        file = os.open(path, os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0))
    except OSError:
        return False
    try:
        about = os.fstat(file)
        user = os.geteuid() if hasattr(os, "geteuid") else about.st_uid  # Windows has no numbers of users
        if not stat.S_ISREG(about.st_mode) or about.st_uid != user or about.st_nlink != 1:
            return False
        os.lseek(file, max(about.st_size - len(_WORD) - _DIGITS, 0), os.SEEK_SET)
        return os.read(file, len(_WORD)) == _WORD
    finally:
        os.close(file)


def _add(archive: zipfile.ZipFile, name: str, array: np.ndarray) -> None:
    entry = zipfile.ZipInfo(name)
    fixed = _HEADER + len(name.encode()) + _ZIP64 + 4 + len(_WORD)
    assert archive.fp is not None  # the archive is open
    fill = -(archive.fp.tell() + fixed) % _ALIGNED
    entry.extra = struct.pack("<HH", _PADDING, len(_WORD) + fill) + _WORD + bytes(fill)
    with archive.open(entry, "w", force_zip64=True) as file:
        np.lib.format.write_array(file, array, allow_pickle=False)


def _name(entry: zipfile.ZipInfo) -> str:
    return entry.filename.removesuffix(".npy")


def _array(whole: np.ndarray, entry: zipfile.ZipInfo) -> np.ndarray:
    """An array as a view of the mapped file."""
    at = entry.header_offset
    name, extra = struct.unpack("<HH", bytes(whole[at + 26 : at + _HEADER]))
    start = at + _HEADER + name + extra
    head = BytesIO(bytes(whole[start : start + min(entry.file_size, 1 << 16)]))
    version = np.lib.format.read_magic(head)
    read_header = (
        np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    )
    shape, fortran, dtype = read_header(head)
    if dtype.hasobject:
        raise FormatError("Python objects are not read")
    data = whole[start + head.tell() : start + entry.file_size].view(dtype)
    return data.reshape(shape, order="F" if fortran else "C")


def _checksum(data: np.ndarray) -> int:
    """CRC-32 of the CRC-32 of each piece: pieces are summed side by side, at 3 GB/s each."""
    return _sealing(len(data), lambda start: data[start : start + _PIECE].data)


def _checksum_of(file: RawIOBase, size: int) -> int:
    """The same of the first bytes of a file, which are not mapped: a process is said to hold what it maps."""

    def piece(start: int) -> bytes:
        with lock:
            file.seek(start)
            return file.read(min(_PIECE, size - start)) or b""

    lock = Lock()
    return _sealing(size, piece)


def _sealing(size: int, piece: Callable[[int], bytes | memoryview]) -> int:
    starts = range(0, size, _PIECE)
    if len(starts) > 1:
        with ThreadPoolExecutor(WORKERS) as pool:
            sums = list(pool.map(lambda start: zlib.crc32(piece(start)), starts))
    else:
        sums = [zlib.crc32(piece(start)) for start in starts]
    return zlib.crc32(struct.pack(f"<{len(sums)}I", *sums))
