"""Hostile structure: values of the wrong type, numbers without end, white space, names, links, archives.

Bytes flipped at random hardly ever make these. Each function takes a tree of files and gives another one.
"""

import io
import json
import re
import zipfile
from collections.abc import Callable
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
    if name.endswith(".zip"):
        return {**tree, name: _archive(content, rng)}
    if name.endswith((".json", ".txt")):
        return {**tree, name: _json(content, rng)}
    if name.endswith((".toml", ".ini", ".cfg", ".xml")) or content.startswith(b"ply"):
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
            tree: Tree = {name: file.read(name) for name in file.namelist() if not name.endswith("/")}
    except Exception:
        return content
    kind, packing = rng.integers(6), zipfile.ZIP_STORED
    extra: list[tuple[str, bytes]] = []
    if kind == 0:
        extra = [(NAMES[rng.integers(len(NAMES))], content)]
    elif kind == 1:
        extra = [(name, b"{}") for name in tree]
    elif kind == 2:
        extra, packing = [("data/c/0/0", bytes(20 << 20))], zipfile.ZIP_DEFLATED
    elif kind == 3:
        extra = [(f"../x{k}", b"") for k in range(2000)]
    else:
        tree = structural(tree, rng) if tree else tree
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", packing) as file:
        for name, each in [*tree.items(), *extra]:
            file.writestr(zipfile.ZipInfo(name), each, packing)
    return buffer.getvalue()


def _deep(levels: int) -> Any:
    value: Any = []
    for _ in range(levels):
        value = [value]
    return value
