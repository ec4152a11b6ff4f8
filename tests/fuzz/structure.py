"""Hostile structure: values of the wrong type, numbers without end, white space, names, links, archives.

Bytes flipped at random hardly ever make these. Each function takes a tree of files and gives another one.
"""

import io
import json
import re
import struct
import warnings
import zipfile
import zlib
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

Tree = dict[str, bytes]
Rng = np.random.Generator


class Link(bytes):
    """A symbolic link to the path that these bytes are."""


class Pipe(bytes):
    """A pipe, which nobody writes to."""


VALUES: tuple[Callable[[], Any], ...] = (
    lambda: None, lambda: True, lambda: -1, lambda: 0, lambda: 1e308, lambda: 5e-324, lambda: 1e-320,
    lambda: 10**400, lambda: 2**63, lambda: float("nan"), lambda: float("inf"), lambda: "",
    lambda: "x" * 10**5,
    lambda: "\0", lambda: "9" * 5000, lambda: "\ud800", lambda: [], lambda: {}, lambda: [[]] * 50,
    lambda: [0] * 10**5, lambda: {"": {}}, lambda: "1" + " " * 10**5 + "!", lambda: [1, "a", None],
    lambda: {str(k): k for k in range(2000)}, lambda: "../../etc/passwd", lambda: _deep(200), lambda: 1e-3,
)  # fmt: skip
TEXTS = (
    b"1" + b" " * 10**5 + b"!", b"9" * 5000, b"1e308", b"5e-324", b"nan", b"-0", b"a." * 3000 + b"b = 1",
    b"[" * 5000, b"[[[[", b'""', b'"' * 3 + b"x" * 10**5, b"{a={a={a=1}}}", b"<a>" * 2000, b"&a;&b;", b"\0",
    b"\xff\xfe", b" " * 10**5, b"= " * 10**4, b"[x]\n" * 10**4, b"k = 1\n" * 10**4, b"0x" + b"f" * 1000,
    b"1_0",
    b"element vertex 999999999", b"property list uchar int x", b"true", b"1979-05-27T07:32:00Z",
)  # fmt: skip
NAMES = (
    "out_9999_9999_0_0_.png", "out_00_00_-1e9_0_.png", "view_0000_9999.png", "view_9999_9999.tif",
    "input_Cam999999.png", "input_Cam000.png", "é" * 100 + "_00_00.png", " .png", "zarr.json", "c",
    "parameters.cfg", "views.json", "a" * 250, "0", "data/c/9/9",
)  # fmt: skip


def structural(tree: Tree, rng: Rng) -> Tree:
    """The tree with one thing in it that is of the wrong kind."""
    name = sorted(tree)[rng.integers(len(tree))]
    if len(tree) > 1 and rng.random() < 0.3:
        return _renamed(tree, name, rng)
    content = tree[name]
    if rng.random() < 0.02:
        return {**tree, name: _swollen(content)}
    if name.endswith(".zip"):
        return {**tree, name: _archive(content, rng)}
    if name.endswith((".json", ".txt")):
        return {**tree, name: _json(content, rng)}
    if name.endswith((".toml", ".ini", ".cfg", ".xml", ".csv")) or content.startswith(b"ply"):
        return {**tree, name: _lines(content, rng)}
    return {**tree, name: _embedded(content, rng)}


def _renamed(tree: Tree, name: str, rng: Rng) -> Tree:
    """A file has another name, is a link or a pipe, or comes twice."""
    folder, _, _ = name.rpartition("/")
    other = f"{folder}/{NAMES[rng.integers(len(NAMES))]}".lstrip("/")
    kind = rng.integers(5)
    content: bytes = tree[name]
    rest = {key: value for key, value in tree.items() if key != name}
    if any(key.startswith(f"{other}/") or other.startswith(f"{key}/") for key in rest):
        return rest
    if kind == 0:
        return {**rest, other: content}
    if kind == 1:
        return {**tree, other: content}
    if kind == 2:
        return {**rest, name: Link((b"/etc/passwd", b"/dev/zero", b".", b"..", b"nothing")[rng.integers(5)])}
    return {**rest, name: Pipe()} if kind == 3 else rest


def _json(content: bytes, rng: Rng) -> bytes:
    try:
        found = json.loads(content)
    except ValueError:
        return content
    return json.dumps(_replaced(found, rng)).encode()


def _replaced(value: Any, rng: Rng) -> Any:
    """The value with one of those inside it of another type, gone, or under another name."""
    if not isinstance(value, dict | list) or not value or rng.random() < 0.15:
        return VALUES[rng.integers(len(VALUES))]()
    if isinstance(value, list):
        k = int(rng.integers(len(value)))
        return [*value[:k], *([] if rng.random() < 0.1 else [_replaced(value[k], rng)]), *value[k + 1 :]]
    key = list(value)[rng.integers(len(value))]
    if rng.random() < 0.15:
        rest = {name: each for name, each in value.items() if name != key}
        return rest if rng.random() < 0.5 else {**rest, "x" * int(rng.integers(1, 1000)): value[key]}
    return {**value, key: _replaced(value[key], rng)}


def _lines(content: bytes, rng: Rng) -> bytes:
    """A line comes twice, goes, moves, or has another value."""
    lines = content.split(b"\n")
    k, other = (int(rng.integers(len(lines))) for _ in range(2))
    text, kind = TEXTS[rng.integers(len(TEXTS))], rng.integers(6)
    if kind == 0:
        lines[k:k] = [lines[other]]
    elif kind == 1:
        del lines[k]
    elif kind == 2:
        lines[k], lines[other] = lines[other], lines[k]
    elif kind == 3:
        lines[k:k] = [text]
    else:
        match = re.search(rb"[=>\s]\s*(\S.*?)(?:<|$)", lines[k])
        lines[k] = lines[k] if match is None else lines[k].replace(match[1], text, 1)
    return b"\n".join(lines)


def _embedded(content: bytes, rng: Rng) -> bytes:
    """JSON inside a picture, replaced by JSON that is no longer; blanks fill the rest."""
    start = content.find(b'{"lumigraph"')
    if start < 0:
        start = content.find(b'{"kind"')
    end = next((at + 1 for at in _closings(content, start) if _is_json(content[start : at + 1])), -1)
    if start < 0 or end < 0:
        return content
    for _ in range(20):
        new = json.dumps(_replaced(json.loads(content[start:end]), rng)).encode()
        if len(new) <= end - start:
            return content[:start] + new.ljust(end - start) + content[end:]
    return content


def _closings(content: bytes, start: int) -> list[int]:
    return [m.start() + max(start, 0) for m in re.finditer(rb"\}", content[max(start, 0) : start + 5000])]


def _is_json(content: bytes) -> bool:
    try:
        json.loads(content)
    except ValueError:
        return False
    return True


def _archive(content: bytes, rng: Rng) -> bytes:
    """The archive with a file inside it changed, twice in it, itself in it, or packed to nothing."""
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as file:
            names = [name for name in file.namelist() if not name.endswith("/")]
            if sum(file.getinfo(name).file_size for name in names) > 1 << 20:
                return content
            tree: Tree = {name: file.read(name) for name in names}
    except Exception:
        return content
    kind, extra = rng.random(), list[tuple[str, bytes]]()
    if kind < 0.15:
        extra = [(NAMES[rng.integers(len(NAMES))], content)]
    elif kind < 0.3:
        extra = [(name, b"{}") for name in tree]
    elif kind < 0.33:
        extra = [(f"../x{k}", b"") for k in range(2000)]
    elif kind > 0.4:
        tree = structural(tree, rng) if tree else tree
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as file, warnings.catch_warnings():
        warnings.simplefilter("ignore")  # two of one name are meant
        for name, each in [*tree.items(), *extra]:
            file.writestr(zipfile.ZipInfo(name), each)
        if 0.33 < kind < 0.36:
            _add_bomb(file, sorted(tree)[rng.integers(len(tree))], int(rng.choice((100, SWOLLEN))))
    return buffer.getvalue()


SWOLLEN = 2 << 30
"""Bytes that a bomb becomes: more than a reader may take."""


@cache
def bomb(wbits: int) -> bytes:
    """Two GiB of zeros, packed by zlib (15), gzip (31) or plain Deflate (-15), with a wrong checksum."""
    engine, piece = zlib.compressobj(9, wbits=wbits), bytes(1 << 20)
    first = engine.compress(piece) + engine.flush(zlib.Z_FULL_FLUSH)
    again = engine.compress(piece) + engine.flush(zlib.Z_FULL_FLUSH)
    return first + again * ((SWOLLEN >> 20) - 1) + engine.flush(zlib.Z_FINISH)


def _swollen(content: bytes) -> bytes:
    """The first packed part replaced by a bomb; of PNG files with the length of its chunk."""
    if (at := content.find(b"IDAT")) >= 0:
        length, packed = int.from_bytes(content[at - 4 : at], "big"), b"IDAT" + bomb(15)
        whole = struct.pack(">I", len(packed) - 4) + packed + struct.pack(">I", zlib.crc32(packed))
        return content[: at - 4] + whole + content[at + 8 + length :]
    for magic, wbits in ((b"\x1f\x8b\x08", 31), (b"\x78\x9c", 15), (b"\x78\xda", 15), (b"\x78\x5e", 15)):
        if (at := content.find(magic)) >= 0:
            return content[:at] + bomb(wbits)
    return content


def _add_bomb(file: zipfile.ZipFile, name: str, told: int) -> None:
    """Add an entry to an archive that becomes 2 GiB, and says that it becomes `told` bytes."""
    entry, packed = zipfile.ZipInfo(name), bomb(-15)
    entry.compress_type, entry.CRC = zipfile.ZIP_DEFLATED, 0
    entry.compress_size, entry.file_size = len(packed), told
    assert file.fp is not None  # the archive is open
    entry.header_offset = file.fp.tell()
    file.fp.write(entry.FileHeader(zip64=False) + packed)
    file.start_dir = file.fp.tell()
    file.filelist.append(entry)
    file.NameToInfo[name] = entry


def _deep(levels: int) -> Any:
    value: Any = []
    for _ in range(levels):
        value = [value]
    return value
