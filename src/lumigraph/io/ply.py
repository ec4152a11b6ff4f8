"""PLY: points with colours, and the triangles of a mesh; ASCII and both byte orders are read.

Binary little-endian is written. G. Turk, *The PLY Polygon File Format* (1994). Faces are read where all of
them are triangles in a binary file that follow the points, as most programs write them; else they are left.
"""

import io
from pathlib import Path

import numpy as np

from lumigraph.core.arrays import to_numpy
from lumigraph.core.cloud import PointCloud
from lumigraph.errors import FormatError
from lumigraph.io import source, target

_TYPES = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4",
    "float": "f4", "double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2",
    "int32": "i4", "uint32": "u4", "float32": "f4", "float64": "f8",
}  # fmt: skip
_ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">", "ascii": ""}
_FACE = ("<u1", "<i4")  # how many corners a face has, and each of them, as written
_COLOURS, _LONGEST = ("red", "green", "blue"), 1 << 14


def load(path: Path, *, max_pixels: int = source.MAX_PIXELS) -> PointCloud:
    """Points of a PLY file, and its triangles.

    Raises
    ------
    FormatError
        Not a PLY, cut short, too large, or without x, y and z.
    """
    path = source.regular_file(path)
    with path.open("rb") as file:
        start = file.read(_LONGEST)
        if not start.startswith(b"ply"):
            source.check_signature(path, start[:8], "PLY")
        header, end, _ = start.partition(b"end_header")
        if not end:
            raise FormatError(f"{path} is a damaged PLY: its header has no end. Copy or save it again.")
        order, count, kind = _declared(path, header.decode("ascii", "replace"))
        source.check_size(path, (count, 1), max_pixels)
        file.seek(len(header) + len(end))
        file.readline(8)
        with source.decoding(path, "a PLY"):
            table = _table(path, file, order, count, kind)
            return _cloud(table, _faces(path, file, header.decode("ascii", "replace"), max_pixels))


def save(cloud: PointCloud, path: Path) -> None:
    """Write points: float32 x, y, z, then uint8 red, green, blue and float32 confidence where known.

    Faces follow, each as the number of its corners, 3, and int32 numbers of points.
    """
    points = to_numpy(cloud.points)
    kind = [(name, "<f4") for name in "xyz"]
    kind += [(name, "u1") for name in _COLOURS] if cloud.colours is not None else []
    kind += [("confidence", "<f4")] if cloud.confidence is not None else []
    table = np.zeros(len(cloud), kind)
    for k, name in enumerate("zyx"):
        table[name] = points[:, k]
    if cloud.colours is not None:
        colours = to_numpy(cloud.colours)
        colours = np.rint(colours * 255) if colours.dtype.kind == "f" else colours
        for k, name in enumerate(_COLOURS):
            table[name] = colours[:, k]
    if cloud.confidence is not None:
        table["confidence"] = to_numpy(cloud.confidence)
    names = [f"property {'uchar' if form == 'u1' else 'float'} {name}" for name, form in kind]
    lines = ["ply", "format binary_little_endian 1.0", "comment x right, y down, z away from the camera"]
    lines += [f"element vertex {len(table)}", *names]
    faces = np.zeros(0 if cloud.faces is None else len(cloud.faces), _face_type(*_FACE))
    if cloud.faces is not None:
        faces["count"], faces["corners"] = 3, to_numpy(cloud.faces)
        lines += [f"element face {len(faces)}", "property list uchar int vertex_indices"]
    lines += ["end_header", ""]
    target.write_bytes(path, "\n".join(lines).encode() + table.tobytes() + faces.tobytes())


def _face_type(count: str, corner: str) -> np.dtype:
    return np.dtype([("count", count), ("corners", corner, 3)])


def _faces(path: Path, file: io.BufferedReader, header: str, max_pixels: int) -> np.ndarray | None:
    """Triangles (m, 3) that follow the points; None where there are none, or other polygons."""
    lines = [line.split() for line in header.splitlines()]
    after = [k for k, words in enumerate(lines) if words[:1] == ["element"]][1:2]
    if not after or lines[after[0]][1:2] != ["face"]:
        return None
    words = lines[after[0]]
    properties = [line for line in lines[after[0] + 1 :] if line[:1] in (["property"], ["element"])]
    mine = properties[: next((k for k, line in enumerate(properties) if line[0] == "element"), None)]
    order = next(_ORDERS[line[1]] for line in lines if line[:1] == ["format"])
    if not order or len(mine) != 1 or mine[0][1:2] != ["list"] or len(mine[0]) != 5 or len(words) != 3:
        return None
    if not words[2].isascii() or not words[2].isdecimal() or not {mine[0][2], mine[0][3]} <= set(_TYPES):
        return None
    count, kind = int(words[2]), _face_type(*(order + _TYPES[name] for name in mine[0][2:4]))
    source.check_size(path, (count, 1), max_pixels)
    content = file.read(count * kind.itemsize)
    table = np.frombuffer(content, kind, len(content) // kind.itemsize)
    if len(table) and (table["count"] != 3).any():
        return None  # polygons: shorter or longer than triangles
    if len(table) < count:
        raise FormatError(f"{path} is cut short: {len(table)} of {count} faces are there. Copy it.")
    return table["corners"].astype(np.int32) if table["corners"].dtype.kind in "iu" else None


def _declared(path: Path, header: str) -> tuple[str, int, list[tuple[str, str]]]:
    """Byte order ("" for ASCII), number of points and (name, type) of their properties."""
    order, count, kind, inside = None, None, [], False
    for words in (line.split() for line in header.splitlines()):
        if words[:1] == ["format"] and len(words) == 3:
            order = _ORDERS.get(words[1])
        elif words[:1] == ["element"] and len(words) == 3:
            inside = words[1] == "vertex"
            if not inside and count is None:
                raise FormatError(f"{path} has {words[1]!r} before its points. Save the points alone.")
            count = int(words[2]) if inside and words[2].isascii() and words[2].isdecimal() else count
        elif words[:1] == ["property"] and inside:
            if len(words) != 3 or words[1] not in _TYPES:
                raise FormatError(f"{path} is a PLY with {' '.join(words)[:40]!r}, which is not read here.")
            kind.append((words[2], _TYPES[words[1]]))
    names = [name for name, _ in kind]
    if order is None or count is None or not {"x", "y", "z"} <= set(names) or len(set(names)) < len(names):
        raise FormatError(f"{path} is a damaged PLY, or holds no points x, y, z. Save it again.")
    return order, count, kind


def _table(
    path: Path, file: io.BufferedReader, order: str, count: int, kind: list[tuple[str, str]]
) -> np.ndarray:
    stored = path.stat().st_size - file.tell()
    form = np.dtype([(name, order + code) for name, code in kind])
    wanted = count * (2 * len(kind) if not order else form.itemsize)  # ASCII: a digit and a blank at least
    if stored + 1 < wanted:
        raise FormatError(
            f"{path} is cut short: {count} points need {wanted} bytes but it has {stored}. Copy it."
        )
    if order:
        return np.frombuffer(file.read(wanted), form)
    table = np.empty(count, [(name, "f8") for name, _ in kind])
    for k in range(count):  # one line at a time: the words of all take sixty times their bytes
        table[k] = tuple(map(float, file.readline(4096).split()[: len(kind)]))
    return table


def _cloud(table: np.ndarray, faces: np.ndarray | None) -> PointCloud:
    names = table.dtype.names or ()
    wide = "f8" if table["x"].dtype.itemsize == 8 else "f4"
    points = np.stack([table[name].astype(wide) for name in "zyx"], -1)
    colours = np.stack([table[name] for name in _COLOURS], -1) if set(_COLOURS) <= set(names) else None
    if colours is not None and (colours.dtype.kind != "f" or colours.max(initial=0) > 1):
        if not (colours.min(initial=0) >= 0 and colours.max(initial=0) <= 255):
            raise FormatError("its colours lie outside 0 ... 255.")
        colours = colours.astype(np.uint8)
    confidence = np.asarray(table["confidence"], np.float32) if "confidence" in names else None
    return PointCloud(points, colours, confidence, faces)
