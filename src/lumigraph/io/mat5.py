"""MATLAB files of version 5: `variables`, and the `values` of one; every count is checked first.

A file is 128 bytes of text and one element a variable: a tag (type, bytes), then parts with their own tags:
flags, dimensions, name, numbers. Numbers lie column by column, in as few bytes as hold all of them.

References
----------
MathWorks, *MAT-File Format*; of the classes that it leaves out, the numbers that SciPy's `loadmat` knows.
"""

import zlib
from dataclasses import dataclass
from math import prod
from pathlib import Path
from typing import BinaryIO, Literal

import numpy as np

from lumigraph.errors import FormatError
from lumigraph.io import source

_TEXT, _MATRIX, _COMPRESSED, _LOGICAL, _COMPLEX = 128, 14, 15, 0x200, 0x800
_FLAGS, _LENGTHS, _LETTERS = (6,), (5, 6), (1, 2, 16)
"""Types that these parts may have: some programs store dimensions unsigned, and names as UTF-8."""

_STORED = {
    1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8",
}  # fmt: skip
_NUMBERS = {
    6: ("double", "f8"), 7: ("single", "f4"), 8: ("int8", "i1"), 9: ("uint8", "u1"), 10: ("int16", "i2"),
    11: ("uint16", "u2"), 12: ("int32", "i4"), 13: ("uint32", "u4"), 14: ("int64", "i8"),
    15: ("uint64", "u8"),
}  # fmt: skip
_OPAQUE = 17
_OTHERS = {
    1: "cell", 2: "struct", 3: "object", 4: "char", 5: "sparse", 16: "function", _OPAQUE: "object",
    18: "object",
}  # fmt: skip
_MOST, _MOST_AXES, _LONGEST, _PIECE = 10_000, 32, 4096, 1 << 20
"""Variables in a file, axes of one, bytes of its name, bytes that are read at once."""


@dataclass(frozen=True)
class Variable:
    """Name, class, shape and place of a variable, and the type of its numbers (None if not real ones)."""

    name: str
    kind: str
    shape: tuple[int, ...]
    dtype: np.dtype | None
    start: int
    size: int
    is_packed: bool


def variables(path: Path) -> list[Variable]:
    """Heads of all variables of a file that have a name; structs, cells, text and objects among them.

    Raises
    ------
    FormatError
        Not version 5, cut short, damaged, or more than 10,000 variables.
    """
    found, at, size = [], _TEXT, path.stat().st_size
    with path.open("rb") as file:
        order = _byte_order(path, file)
        while at < size:
            if len(found) == _MOST:
                raise FormatError(f"{path} holds more than {_MOST} variables. Save those that you need.")
            element = _Element(path, file, order, at)
            found.append(_head(element))
            at += 8 + element.size
    return [each for each in found if each.name]  # MATLAB keeps what its objects refer to without a name


def values(path: Path, variable: Variable, *, max_pixels: int = source.MAX_PIXELS) -> np.ndarray:
    """Numbers of a variable, of the type of its class whatever they are stored as; truth values as 0 and 1.

    Raises
    ------
    FormatError
        No real numbers, too many for `max_pixels` or for the bytes stored, another count than its dimensions
        say, numbers that its class cannot hold, or damaged.
    """
    name, shape, dtype = variable.name, variable.shape, variable.dtype
    if dtype is None:
        raise FormatError(f"{path}: {name} is {variable.kind}, not real numbers. Choose another variable.")
    source.check_size(path, shape, max_pixels)
    # One byte at least for each number.
    most = source.MOST_INFLATED if variable.is_packed else 1
    source.check_stored(path, prod(shape), variable.size, most)
    source.check_held(path, prod(shape) * dtype.itemsize, variable.size, max_pixels)
    with path.open("rb") as file:
        order = _byte_order(path, file)
        element = _Element(path, file, order, variable.start)
        _head(element)
        kind, size, _ = element.begin()
        stored = np.dtype(_STORED.get(kind, "V1"))
        if stored.kind == "V" or stored.itemsize > dtype.itemsize:
            raise FormatError(f"{path} is damaged: {name} is {variable.kind} but stored as type {kind}.")
        if size != prod(shape) * stored.itemsize:
            raise FormatError(
                f"{path} is damaged: {name} has {' x '.join(map(str, shape))} = {prod(shape)} numbers but "
                f"{size} bytes of {stored.itemsize} each. Copy it again."
            )
        numbers = np.frombuffer(element.take(size), stored.newbyteorder(order))
        element.finish()
    return _exact(f"{path} is damaged: {name}", numbers, dtype).reshape(shape, order="F")


def _exact(what: str, numbers: np.ndarray, dtype: np.dtype) -> np.ndarray:
    with np.errstate(invalid="ignore"):
        found = numbers.astype(dtype, copy=False)
    if not np.can_cast(numbers.dtype, dtype) and not np.array_equal(found, numbers):
        raise FormatError(f"{what} is stored as {numbers.dtype.name} that {dtype.name} cannot hold.")
    return found


def _byte_order(path: Path, file: BinaryIO) -> Literal["little", "big"]:
    text = file.read(_TEXT)
    if text[124:] == b"\0\1IM":
        return "little"
    if text[124:] == b"\1\0MI":
        return "big"
    raise FormatError(
        f"{path} is damaged or no MATLAB file of version 5: its version and byte order are "
        f"{text[124:]!r}. Copy or save it again."
    )


def _head(element: "_Element") -> Variable:
    """Flags, dimensions and name of a variable; its numbers are next."""
    path, order = element.path, element.order
    flags = int.from_bytes(element.part(_FLAGS, 8)[:4], order)
    code, shape = flags & 0xFF, ()
    if code != _OPAQUE:
        lengths = np.frombuffer(element.part(_LENGTHS, 4 * _MOST_AXES), np.dtype("i4").newbyteorder(order))
        shape = tuple(lengths.tolist())
        if len(shape) < 2 or min(shape) < 0:
            raise FormatError(f"{path} is damaged: a variable has dimensions {shape}. Copy it again.")
    name = element.part(_LETTERS, _LONGEST).decode("utf-8", "replace")
    if not name.isprintable():
        raise FormatError(f"{path} is damaged: a variable is called {name[:40]!r}. Copy it again.")
    kind, dtype = _NUMBERS.get(code, (_OTHERS.get(code, f"class {code}"), None))
    if dtype is not None and flags & _COMPLEX:
        kind, dtype = f"complex {kind}", None
    elif dtype is not None and flags & _LOGICAL:
        kind = "logical"
    dtype = None if dtype is None else np.dtype(dtype)
    return Variable(name, kind, shape, dtype, element.start, element.size, element.is_packed)


class _Element:
    """Bytes of a variable, inflated where they are packed, never more than are left of what it declares."""

    def __init__(self, path: Path, file: BinaryIO, order: Literal["little", "big"], start: int) -> None:
        self.path, self.start, self._file = path, start, file
        self.order: Literal["little", "big"] = order
        self._engine, self._behind = None, path.stat().st_size
        self.left = self._behind - start
        file.seek(start)
        kind, self.size = self._word(), self._word()
        if self.size > self.left:
            raise FormatError(
                f"{path} is cut short: a variable ends behind its {self._behind} bytes. Copy it again."
            )
        self.left, self.is_packed = self.size, kind == _COMPRESSED
        if self.is_packed:
            self._engine, self._behind, self.left = zlib.decompressobj(), start + 8 + self.size, 8
            kind, self.left = self._word(), self._word()
        if kind != _MATRIX:
            raise FormatError(f"{path} is damaged: a variable has type {kind}, not {_MATRIX}. Copy it again.")

    def take(self, count: int) -> bytearray:
        """The next bytes."""
        if count > self.left:
            raise FormatError(
                f"{self.path} is damaged: a variable needs {count} bytes where {self.left} are left. "
                "Copy it again."
            )
        self.left -= count
        content, done = bytearray(count), 0
        while done < count:
            piece = self._piece(min(count - done, _PIECE))
            if not piece:
                raise FormatError(f"{self.path} is cut short: a variable lacks {count - done} bytes.")
            content[done : done + len(piece)] = piece
            done += len(piece)
        return content

    def begin(self) -> tuple[int, int, int]:
        """Type of the next part, its bytes, and the bytes that fill it up; small ones lie inside the tag."""
        kind = self._word()
        if kind >> 16 == 0:
            count = self._word()
            return kind, count, -count % 8
        if kind >> 16 > 4:
            raise FormatError(f"{self.path} is damaged: a small part has {kind >> 16} bytes, not up to 4.")
        return kind & 0xFFFF, kind >> 16, 4 - (kind >> 16)

    def part(self, kinds: tuple[int, ...], most: int) -> bytes:
        """Bytes of the next part, which is of one of these types."""
        kind, count, fill = self.begin()
        if kind not in kinds or count > most:
            raise FormatError(
                f"{self.path} is damaged: a part has type {kind} and {count} bytes, not type {kinds[0]} and "
                f"up to {most}. Copy it again."
            )
        content = self.take(count)
        self.take(fill)
        return bytes(content)

    def finish(self) -> None:
        """Check that nothing follows, and the checksum of what was packed."""
        if self.left < 8:
            self.take(self.left)
        if self.left or (self._engine is not None and (self._piece(1) or not self._engine.eof)):
            raise FormatError(f"{self.path} is damaged: a variable does not end with its numbers.")

    def _word(self) -> int:
        return int.from_bytes(self.take(4), self.order)

    def _piece(self, most: int) -> bytes:
        if self._engine is None:
            return self._file.read(most)
        while not self._engine.eof:
            packed = self._engine.unconsumed_tail
            packed = packed or self._file.read(min(_PIECE, self._behind - self._file.tell()))
            try:
                piece = self._engine.decompress(packed, most)
            except zlib.error as error:
                raise FormatError(
                    f"{self.path} is damaged: a packed variable is not zlib's: {error}. Copy it again."
                ) from error
            if piece or not packed:
                return piece
        return b""
