"""MATLAB files: version 7.3, which is HDF5, and version 5 (SciPy reads its numbers); read, not written.

The variable ``LF`` of the Light Field Toolbox is (row, column, y, x, c), its last colour the weight of a
sample.
"""

from collections.abc import Iterator
from math import prod
from pathlib import Path

import numpy as np
import scipy.io

from lumigraph.core.lightfield import LightField
from lumigraph.core.raw import RawImage
from lumigraph.core.stack import Stack
from lumigraph.core.volume import Volume
from lumigraph.errors import FormatError
from lumigraph.io import arrays, hdf5, source

_TEXT, _COMPRESSED, _MOST = 128, 15, 1000
"""Bytes of text in front, the type of a packed variable, variables that are looked at."""

_SIZES = {
    "double": 8, "single": 4, "int8": 1, "uint8": 1, "int16": 2, "uint16": 2, "int32": 4, "uint32": 4,
    "int64": 8, "uint64": 8, "logical": 1,
}  # fmt: skip
_SPARE = 1 << 16  # bytes of headers in a packed variable
Shapes = dict[str, tuple[tuple[int, ...], str]]


def load(
    path: Path, *, what: str | None = None, axes: str | None = None, max_pixels: int = source.MAX_PIXELS
) -> RawImage | LightField | Stack | Volume:
    """A picture, a stack or the light field in a variable of a MATLAB file.

    Parameters
    ----------
    path
        A .mat file.
    what
        Name of the variable; "LF", or the only array of numbers, if left out.
    axes
        What its axes are, as MATLAB's `size` orders them in version 5, as HDF5 stores them (reverse) in 7.3.
    max_pixels
        Larger ones are refused.

    Raises
    ------
    FormatError
        Neither version, damaged, too large, no such variable, or several and no choice.
    """
    if _is_hdf5(path := source.regular_file(path)):
        return hdf5.load(path, what=what, axes=axes, max_pixels=max_pixels)
    with source.decoding(path, "a MATLAB file"):
        found = _variables(path)
        name = _chosen(path, found, what)
        shape, kind = found[name]
        source.check_size(path, shape, max_pixels)
        size = path.stat().st_size
        # Whole numbers are stored in as few bytes as hold them: one at least for each.
        source.check_stored(path, prod(shape), size)
        source.check_held(path, prod(shape) * _SIZES[kind], size, max_pixels)
        _check_packed(path, max(prod(shape) * 8 + _SPARE, 64 << 20))
        data = scipy.io.loadmat(path, variable_names=[name], appendmat=False)[name]
        if not isinstance(data, np.ndarray) or data.dtype.kind not in "iufb" or data.shape != shape:
            raise FormatError(f"{path}: {name} is not an array of real numbers of {shape}.")
        data = data.astype(data.dtype.newbyteorder("="), copy=False)
        letters = arrays.arrangement(f"{name} of {path}", shape, axes=axes, reverse=False, weighted=True)
        return arrays.as_noun(data, letters, {}, weighted=name == "LF")


def contents(path: Path) -> list[tuple[str, str, str]]:
    """The arrays of numbers of a file: (name, noun, about) each."""
    if _is_hdf5(path := source.regular_file(path)):
        return hdf5.contents(path)
    with source.decoding(path, "a MATLAB file"):
        return [
            (
                name,
                arrays.noun_of(arrays.arrangement("", shape, reverse=False, weighted=True)),
                f"{_times(shape)}, {kind}",
            )
            for name, (shape, kind) in _variables(path).items()
        ]


def _is_hdf5(path: Path) -> bool:
    with path.open("rb") as file:
        start = file.read(520)
    if hdf5.SIGNATURE in (start[:8], start[512:]):
        return True
    source.check_signature(path, start[:10], "MATLAB")
    return False


def _variables(path: Path) -> Shapes:
    """Shape and class of each array of numbers with 2 to 5 axes."""
    _check_packed(path, _largest(path))
    listed = scipy.io.whosmat(path, appendmat=False)
    return {
        name: (tuple(int(n) for n in shape), kind)
        for name, shape, kind in listed[:_MOST]
        if kind in _SIZES and 2 <= len(shape) <= 5 and prod(shape) > 1
    }


def _chosen(path: Path, found: Shapes, what: str | None) -> str:
    if what is not None and what not in found:
        near = ", ".join(list(found)[:8]) or "nothing that is read"
        raise FormatError(f"{path} has no array of numbers {what!r}. It holds {near}.")
    if what is not None or "LF" in found:
        return what or "LF"
    if len(found) == 1:
        return next(iter(found))
    if not found:
        raise FormatError(f"{path} holds no array of 2 to 5 axes of real numbers. Check the file.")
    raise FormatError(f"{path} holds {', '.join(list(found)[:8])}. Choose one by what=.")


def _largest(path: Path) -> int:
    return source.MAX_PIXELS * 8 + path.stat().st_size


def _check_packed(path: Path, most: int) -> None:
    """Refuse packed variables that become more than that."""
    for start, size in _packed(path):
        if size * source.MOST_INFLATED > most:
            with path.open("rb") as file:
                file.seek(start)
                source.check_inflated(path, file.read(size), most)


def _packed(path: Path) -> Iterator[tuple[int, int]]:
    """Where packed variables stand, and their bytes."""
    size, at = path.stat().st_size, _TEXT
    with path.open("rb") as file:
        order = "little" if file.read(_TEXT)[126:128] == b"IM" else "big"
        for _ in range(_MOST):
            file.seek(at)
            tag = file.read(8)
            if len(tag) < 8:
                return
            kind, count = (int.from_bytes(tag[k : k + 4], order) for k in (0, 4))
            if at + 8 + count > size:
                raise FormatError(
                    f"{path} is cut short: a variable ends behind its {size} bytes. Copy it again."
                )
            if kind == _COMPRESSED:
                yield at + 8, count
            at += 8 + count


def _times(shape: tuple[int, ...]) -> str:
    return " x ".join(map(str, shape))
