"""Checks before a file is decoded: that it exists, its format, and the size that it declares."""

import difflib
import os
import re
import tomllib
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from math import ceil, prod
from pathlib import Path
from typing import Any

import numpy as np

from lumigraph import store
from lumigraph.core import memory
from lumigraph.core.lattice import Lattice
from lumigraph.errors import FormatError, LumigraphError

MAX_PIXELS = 178_956_970
"""Largest picture that is opened unless the caller allows more: the figure Pillow refuses at."""

_SIGNATURES = (
    (b"\x89PNG\r\n\x1a\n", "PNG", ".png"),
    (b"II*\0", "TIFF", ".tiff"),
    (b"MM\0*", "TIFF", ".tiff"),
    (b"II+\0", "TIFF", ".tiff"),
    (b"MM\0+", "TIFF", ".tiff"),
    (b"PK\x03\x04", "ZIP", ".zarr.zip"),
    (b"\xff\xd8\xff", "JPEG", ".jpg"),
    (b"GIF8", "GIF", ".gif"),
    (b"%PDF", "PDF", ".pdf"),
    (b"PF\n", "PFM", ".pfm"),
    (b"Pf\n", "PFM", ".pfm"),
    (b"ply", "PLY", ".ply"),
    (b"\x89HDF\r\n\x1a\n", "HDF5", ".h5"),
    (b"\x89LFP", "Lytro", ".lfp"),
    (b"BM", "BMP", ".bmp"),
    *((b"P%d" % kind, "PNM", ".pgm or .ppm") for kind in range(1, 7)),
    (b"\x93NUMPY", "NumPy", ".npy"),
    (b"MATLAB 5.0", "MATLAB", ".mat"),
)

_MOST_LENSLETS = 1_000_000

_PLAUSIBLE, _SMALL = 1000, 64 << 20
"""Bytes of pixels for one stored byte that are believed, and bytes of pixels that always are."""

_MOST_PARTS, _BREAKS = 100, re.compile(r"[\n,=\[\]{}]")

MOST_INFLATED = 1032
"""Bytes that one byte of Deflate can become at most (P. Deutsch, RFC 1951: 258 bytes from two bits)."""


def as_path(path: str | os.PathLike[str]) -> Path:
    """The path, refused where it is no text and no path."""
    try:
        return Path(path)
    except TypeError:
        raise FormatError(f"the path is {path!r} but must be text, such as 'raw.tiff'.") from None


def existing(path: str | os.PathLike[str]) -> Path:
    """The path, refused where nothing lies there; near names are suggested.

    Raises
    ------
    FormatError
        No such file, or a folder on the way that does not exist.
    """
    path = as_path(path)
    if path.exists() or store.restored(path):
        return path
    if not path.parent.is_dir():
        raise FormatError(f"{path} does not exist: there is no folder {path.parent}. Check the path.")
    near = difflib.get_close_matches(path.name, [p.name for p in path.parent.iterdir()], n=3, cutoff=0.6)
    hint = (
        f"Did you mean {' or '.join(near)}?"
        if near
        else f"Check the name; the folder is {path.parent.resolve()}."
    )
    raise FormatError(f"{path} does not exist. {hint}")


def regular_file(path: str | os.PathLike[str]) -> Path:
    """The path, refused unless it is a file that holds something.

    Raises
    ------
    FormatError
        Nothing there, a folder, something that is not a plain file, or an empty file.
    """
    path = existing(path)
    if path.is_dir():
        raise FormatError(f"{path} is a folder, not a file. Give the file inside it.")
    if not path.is_file():
        raise FormatError(f"{path} is not a plain file (a device or a pipe). Copy it to a file first.")
    if path.stat().st_size == 0:
        raise FormatError(f"{path} is empty (0 bytes). Copy or save it again.")
    return path


def check_signature(path: Path, start: bytes, kind: str) -> None:
    """Refuse a file whose first bytes are not those of `kind` ("PNG", "TIFF", "ZIP").

    Raises
    ------
    FormatError
        It is another known kind of file, or none; the message shows how it begins.
    """
    found = next(((name, ending) for magic, name, ending in _SIGNATURES if start.startswith(magic)), None)
    if found is None:
        raise FormatError(f"{path} is not a {kind} file: it begins with {start[:8]!r}. Check its name.")
    if found[0] != kind:
        raise FormatError(f"{path} is a {found[0]} file, not {kind}. Rename it to end in {found[1]}.")


def check_size(path: Path, shape: tuple[int, ...], max_pixels: int) -> None:
    """Refuse data (rows, columns[, channels]) larger than allowed, as the file's header declares it.

    Four channels count as one pixel.

    Raises
    ------
    FormatError
        No pixels, or more than `max_pixels`.
    """
    if min(shape, default=0) < 1:
        raise FormatError(f"{path} has no pixels: its header says {_times(shape)}. The file is damaged.")
    if (count := pixels(shape)) > max_pixels:
        raise FormatError(
            f"{path} declares {_times(shape)} = {count:.3g} pixels but at most {max_pixels:.3g} are read. "
            f"If that is right, call lumigraph.io.open(path, max_pixels={count})."
        )


def pixels(shape: tuple[int, ...]) -> int:
    """Pixels of data (rows, columns[, channels]) or of more axes; four channels count as one."""
    return prod(shape[:2]) * ceil(prod(shape[2:]) / 4) if len(shape) < 4 else ceil(prod(shape) / 4)


def nominal_indices(path: Path, lattice: Lattice, shape: tuple[int, int]) -> np.ndarray:
    """Indices (k, 2) of all lattice points on a picture, for calibrations that were computed, not measured.

    Raises
    ------
    FormatError
        A pitch below 2 px or wider than the picture, or more than a million lenslets.
    """
    count = shape[0] * shape[1] / lattice.cell_area
    if not 2 <= lattice.pitch <= max(shape) or count > _MOST_LENSLETS:
        raise FormatError(
            f"{path} gives lenslets {lattice.pitch:g} px wide on {shape[0]} x {shape[1]} px: from 2 px to "
            f"the picture's width and up to {_MOST_LENSLETS} lenslets are read. Check the file."
        )
    # A stretched or sheared lattice runs through many more indices than it has points on the picture.
    corners = np.array([(y, x) for y in (0, shape[0]) for x in (0, shape[1])]) - np.asarray(lattice.origin)
    if np.prod(np.ptp(corners @ np.linalg.inv(lattice.matrix).T, axis=0) + 3) > 10 * _MOST_LENSLETS:
        raise FormatError(f"{path} gives lenslets {lattice.pitch:g} px wide that are sheared beyond use.")
    return lattice.indices((0, shape[0] - 1), (0, shape[1] - 1))


def check_stored(path: Path, needed: float, stored: int, most: float = MOST_INFLATED) -> None:
    """Refuse a file that declares more bytes of pixels than its own bytes can hold, before any is allocated.

    Parameters
    ----------
    path
        The file.
    needed
        Bytes of the pixels that its header declares.
    stored
        Bytes there are for them.
    most
        Bytes that one stored byte can become: 1 if nothing is compressed.

    Raises
    ------
    FormatError
        The file is cut short or its header is wrong.
    """
    if needed > stored * most + (64 if most > 1 else 0):
        raise FormatError(
            f"{path} is cut short or damaged: it declares {needed:.0f} bytes of pixels but its {stored} "
            "bytes cannot hold them. Copy it again."
        )


def check_held(path: Path, needed: float, stored: int, max_pixels: int) -> None:
    """Refuse pixels that do not fit in memory, or that a file a thousand times smaller declares.

    The latter only of files that declare more than 64 MiB, and only as long as the caller has not asked for
    more than `MAX_PIXELS`: constant pictures pack as tightly.

    Parameters
    ----------
    path
        The file.
    needed
        Bytes of the pixels.
    stored
        Bytes there are for them.
    max_pixels
        Limit set by the caller.

    Raises
    ------
    FormatError
        Both sizes, and what to do.
    """
    if needed > max(_PLAUSIBLE * stored, _SMALL) and max_pixels <= MAX_PIXELS:
        raise FormatError(
            f"{path} declares {needed:.3g} bytes of pixels from {stored}, over {_PLAUSIBLE} times as many: "
            f"made to fill the memory? If not, call lumigraph.io.open(path, max_pixels={MAX_PIXELS + 1})."
        )
    memory.require(needed, f"{path}: its picture", "Crop it, or use a larger machine.", FormatError)


def unlinked(path: Path) -> Path:
    """The path of a file inside a folder, refused where it is a link, or no plain file.

    Raises
    ------
    FormatError
        Which of them it is.
    """
    if path.is_symlink() or (path.exists() and not path.is_file()):
        what = "a link" if path.is_symlink() else "no plain file"
        raise FormatError(f"{path} is {what}, which is not followed. Copy what it leads to.")
    return path


def check_folder(path: Path, most: int) -> None:
    """Refuse a folder that holds links, devices or pipes, or more than `most` files, at any depth.

    Raises
    ------
    FormatError
        The first of them.
    """
    folders, count = [path], 0
    while folders:
        with os.scandir(folders.pop()) as entries:
            for entry in entries:
                count += 1
                if entry.is_dir(follow_symlinks=False):
                    folders.append(Path(entry.path))
                else:
                    unlinked(Path(entry.path))
                if count > most:
                    raise FormatError(f"{path} holds more than {most} files. Check the path.")


def toml(path: Path, text: str) -> dict[str, Any]:
    """The table in a TOML text, in a time that grows with its length.

    Raises
    ------
    FormatError
        No TOML, keys of over a hundred parts, or tables nested without end.
    """
    run = 0
    for part in text.split("."):  # tomllib takes time with the square of a key's parts
        run = 0 if _BREAKS.search(part) else run + 1
        if run > _MOST_PARTS:
            raise FormatError(f"{path} is damaged TOML: a key has over {_MOST_PARTS} parts. Check the file.")
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise FormatError(f"{path} is damaged TOML: nested too deeply. Check the file.") from None
    except ValueError as error:  # TOMLDecodeError, and whole numbers of over 4,300 digits
        raise FormatError(f"{path} is damaged TOML: {error}. Correct that line.") from error


def check_inflated(path: Path, packed: bytes, limit: int, *, wbits: int = 47) -> None:
    """Refuse Deflate data that becomes more than `limit` bytes; little memory is used.

    Parameters
    ----------
    path
        The file.
    packed
        Compressed bytes with the header of zlib or gzip, or without one where `wbits` is -15.
    limit
        Bytes.
    wbits
        As `zlib.decompressobj` takes it.

    Raises
    ------
    FormatError
        It becomes more, as a file made to fill the memory does.
    """
    if len(packed) * MOST_INFLATED <= limit:
        return
    engine, total, rest = zlib.decompressobj(wbits), 0, packed
    while rest:
        total += len(engine.decompress(rest, 1 << 20))
        rest = engine.unconsumed_tail
        if engine.eof:  # gzip files may follow each other, and are read as one
            rest = engine.unused_data.lstrip(b"\0")
            rest, engine = rest if rest.startswith(b"\x1f\x8b") else b"", zlib.decompressobj(wbits)
        if total > limit:
            raise FormatError(
                f"{path} holds {len(packed)} bytes that become more than the {limit} its header declares: "
                "damaged, or made to fill the memory. Do not open it."
            )


@contextmanager
def decoding(path: Path, kind: str) -> Iterator[None]:
    """Context in which every failure of a decoder becomes one `FormatError` naming the file."""
    try:
        with ours(path, kind):
            yield
    except FormatError as error:
        message = str(error)
        raise (error if str(path) in message else FormatError(f"{path}: {message}")) from error.__cause__
    except LumigraphError as error:
        raise FormatError(f"{path} is damaged: {error}") from error


@contextmanager
def ours(path: Path, kind: str) -> Iterator[None]:
    """Context in which what is not raised on purpose becomes one `FormatError` naming the file."""
    try:
        yield
    except LumigraphError:
        raise
    except MemoryError as error:
        raise FormatError(f"{path} does not fit into memory. Crop it, or use a larger machine.") from error
    except Exception as error:
        reason = " ".join(str(error).split())[:160] or type(error).__name__
        if isinstance(error, OSError) and error.strerror and error.filename:
            raise FormatError(f"{path} cannot be read: {error.strerror}. Check its permissions.") from error
        raise FormatError(f"{path} is damaged or is not {kind} that can be read: {reason}.") from error


def _times(shape: tuple[int, ...]) -> str:
    return " x ".join(map(str, shape))
