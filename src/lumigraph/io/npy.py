"""NumPy's `.npy` and `.npz`: arrays of numbers; pickled objects are never read, nothing is written."""

import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from math import prod
from pathlib import Path
from typing import IO, Any

import numpy as np

from lumigraph.core.lightfield import LightField
from lumigraph.core.raw import RawImage
from lumigraph.core.stack import Stack
from lumigraph.errors import FormatError
from lumigraph.io import arrays, source

_MOST, _LONGEST = 1000, 10_000
"""Arrays of an archive, characters of a header."""

_READERS = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}
Header = tuple[tuple[int, ...], bool, np.dtype]


def load(
    path: Path, *, what: str | None = None, axes: str | None = None, max_pixels: int = source.MAX_PIXELS
) -> RawImage | LightField | Stack:
    """A picture, a stack or the light field of an array.

    Parameters
    ----------
    path
        A .npy or .npz file.
    what
        Name of the array in a .npz file that holds several.
    axes
        What its axes are, such as "vuyxc", where the shape does not say.
    max_pixels
        Larger ones are refused.

    Raises
    ------
    FormatError
        Neither format, damaged, pickled objects, too large, or several arrays and no choice.
    """
    path = source.regular_file(path)
    with source.decoding(path, "a NumPy file"), _streams(path) as found:
        name = _chosen(path, list(found), what)
        stored, packed, file = found[name]()
        with file:
            shape, fortran, dtype = _header(path, file)
            what = f"{name or 'the array'} of {path}"
            letters = arrays.arrangement(what, shape, axes=axes)
            needed = prod(shape) * dtype.itemsize
            source.check_size(path, shape, max_pixels)
            source.check_stored(path, needed, stored, source.MOST_INFLATED if packed else 1)
            source.check_held(path, needed, stored, max_pixels)
            content = file.read(needed)
    if len(content) != needed:
        raise FormatError(f"{path} is cut short: it holds {len(content)} of {needed} bytes. Copy it again.")
    data = arrays.unpacked(content, shape[::-1] if fortran else shape, dtype)
    return arrays.as_noun(data.T if fortran else data, letters, {})


def contents(path: Path) -> list[tuple[str, str, str]]:
    """The arrays of a file: (name, noun, about) each."""
    path, parts = source.regular_file(path), []
    with source.decoding(path, "a NumPy file"), _streams(path) as found:
        for name, opened in found.items():
            with opened()[2] as file:
                shape, _, dtype = _header(path, file)
            try:
                noun = arrays.noun_of(arrays.arrangement(name, shape))
            except FormatError:
                noun = "array"
            parts.append((name, noun, f"{' x '.join(map(str, shape))}, {dtype}"))
    return parts


@contextmanager
def _streams(path: Path) -> Iterator[dict[str, Any]]:
    """By name: what gives the bytes stored, whether they are packed, and a stream of the array."""
    with path.open("rb") as file:
        start = file.read(6)
    if path.suffix.lower() == ".npy":
        source.check_signature(path, start, "NumPy")
        yield {"": lambda: (path.stat().st_size, False, path.open("rb"))}
        return
    source.check_signature(path, start, "ZIP")
    with zipfile.ZipFile(path) as archive:
        entries = [one for one in archive.infolist() if one.filename.endswith(".npy")][:_MOST]
        yield {
            one.filename.removesuffix(".npy"): lambda one=one: (
                min(one.compress_size, path.stat().st_size), bool(one.compress_type), archive.open(one)
            )
            for one in entries
        }  # fmt: skip


def _chosen(path: Path, names: list[str], what: str | None) -> str:
    if what is not None and what not in names:
        raise FormatError(f"{path} has no array {what!r}. It holds {', '.join(names[:8]) or 'none'}.")
    if what is not None or len(names) == 1:
        return names[0] if what is None else what
    if not names:
        raise FormatError(f"{path} holds no arrays. Check the file.")
    raise FormatError(f"{path} holds {', '.join(names[:8])}. Choose one by what=.")


def _header(path: Path, file: IO[bytes]) -> Header:
    version = np.lib.format.read_magic(file)
    if version not in _READERS:
        raise FormatError(f"{path} has version {version} of NumPy's format. Save it again.")
    shape, fortran, dtype = _READERS[version](file, max_header_size=_LONGEST)
    if dtype.kind not in "iufb" or not 2 <= len(shape) <= 5:
        what = "pickled objects, which are never read" if dtype.hasobject else f"{dtype} of {shape}"
        raise FormatError(f"{path} holds {what}. Save an array of real numbers with 2 to 5 axes.")
    return tuple(int(n) for n in shape), fortran, dtype
