"""Planes that a TIFF file declares elsewhere than by its pages: ImageJ, tifffile's shapes, MetaMorph.

ImageJ writes stacks above 4 GB with one directory (IFD), the planes one behind the other; so does tifffile
where it is told to, and MetaMorph always.
"""

import json
import math
import re
from dataclasses import dataclass
from typing import Any

import tifffile

from lumigraph.errors import FormatError

_METAMORPH = 33629  # tag UIC2, one entry for each plane
_MOST = 100_000_000
_ENTRY = re.compile(r"^([a-z]+)=([^\r\n]{1,60})\r?$", re.M)
_UNITS = {
    "micron": 1e-6, "microns": 1e-6, "um": 1e-6, "\\u00b5m": 1e-6, "\u00b5m": 1e-6, "nm": 1e-9, "mm": 1e-3,
    "cm": 1e-2, "m": 1.0, "inch": 0.0254,
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Declared:
    """Planes that a file declares.

    Parameters
    ----------
    writer
        Program, for messages.
    axes
        Letters of the axes along which there is more than one plane, the slowest first, such as "tzc".
    sizes
        Number of planes along each.
    pitch
        Sizes of a voxel (z, y, x) [m]; None where the file does not say.
    """

    writer: str
    axes: str
    sizes: tuple[int, ...]
    pitch: tuple[float | None, float | None, float | None] = (None, None, None)

    @property
    def count(self) -> int:
        """Planes in all."""
        return math.prod(self.sizes)


def declared(path: Any, page: tifffile.TiffPage) -> Declared | None:
    """What the first page says of all planes; None where it says nothing.

    Raises
    ------
    FormatError
        Numbers of planes that contradict each other.
    """
    text = page.description
    if text.startswith("ImageJ="):
        return _imagej(path, page, dict(_ENTRY.findall(text[:100_000])))
    if text.startswith("{") and '"shape"' in text and '"lumigraph"' not in text:
        return _shaped(page, text)
    if (tag := page.tags.get(_METAMORPH)) is not None and tag.count > 1:
        return Declared("MetaMorph", "n", (min(int(tag.count), _MOST),))
    return None


def _imagej(path: Any, page: tifffile.TiffPage, entries: dict[str, str]) -> Declared | None:
    named = [("t", "frames"), ("z", "slices"), ("c", "channels")]
    sizes = {axis: _whole(path, name, entries.get(name, "1")) for axis, name in named}
    count = _whole(path, "images", entries.get("images", "1"))
    found = {axis: size for axis, size in sizes.items() if size > 1}
    if found and math.prod(found.values()) != count:
        told = " x ".join(f"{size} {dict(named)[axis]}" for axis, size in found.items())
        raise FormatError(f"{path}: ImageJ's header says images={count} but {told}. Save it again.")
    found = found or {"n": count}
    return Declared("ImageJ", "".join(found), tuple(found.values()), _voxel(page, entries))


def _voxel(
    page: tifffile.TiffPage, entries: dict[str, str]
) -> tuple[float | None, float | None, float | None]:
    unit = _UNITS.get(entries.get("unit", "").strip())
    if unit is None:
        return (None, None, None)
    step = _positive(entries.get("spacing", ""))
    sizes = [_positive(1 / found if (found := _resolution(page, tag)) else "") for tag in (283, 282)]
    y, x = (None if size is None else size * unit for size in sizes)
    return (None if step is None else step * unit, y, x)


def _resolution(page: tifffile.TiffPage, code: int) -> float:
    """Pixels per unit."""
    value = page.tags[code].value if code in page.tags else (0, 1)
    return value[0] / value[1] if isinstance(value, tuple) and len(value) == 2 and value[1] else 0.0


def _positive(text: Any) -> float | None:
    try:
        value = abs(float(text))
    except ValueError:
        return None
    return value if 0 < value < math.inf else None


def _shaped(page: tifffile.TiffPage, text: str) -> Declared | None:
    try:
        shape = json.loads(text)["shape"]
    except (ValueError, KeyError, TypeError, RecursionError):
        return None
    good = isinstance(shape, list) and all(isinstance(n, int) and 0 < n < _MOST for n in shape)
    own = [n for n in page.shape if n > 1]
    whole = [n for n in shape if n > 1] if good else []
    if not good or len(whole) <= len(own) or whole[len(whole) - len(own) :] != own:
        return None
    sizes = tuple(whole[: len(whole) - len(own)])
    return Declared("tifffile", "n" * len(sizes), sizes)


def _whole(path: Any, name: str, text: str) -> int:
    if not (text.isascii() and text.isdecimal() and len(text) < 9 and int(text) > 0):
        raise FormatError(f"{path}: ImageJ's header says {name}={text[:20]!r}. Save it again.")
    return int(text)
