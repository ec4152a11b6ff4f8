"""OME-XML, the description inside an OME-TIFF: axes and physical sizes that microscopy programs read.

Schema 2016-06 of the Open Microscopy Environment (Goldberg et al., *Genome Biology* 6, R47, 2005). What
lumigraph itself needs to read back exactly stands in an annotation, as JSON.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any
from xml.sax.saxutils import escape, quoteattr

from defusedxml import ElementTree
from defusedxml.common import DefusedXmlException

from lumigraph.errors import FormatError

SCHEMA = "http://www.openmicroscopy.org/Schemas/OME/2016-06"
_TYPES = {"float32": "float", "float64": "double"}
_UNITS = {
    "m": 1.0, "cm": 1e-2, "mm": 1e-3, "µm": 1e-6, "\N{GREEK SMALL LETTER MU}m": 1e-6, "um": 1e-6,
    "nm": 1e-9, "pm": 1e-12, "Å": 1e-10,
}  # fmt: skip
_LONGEST = 16 << 20  # characters
_MOST_PLANES = 100_000


@dataclass(frozen=True, slots=True)
class OmePlanes:
    """Planes of the first image of an OME-XML text.

    Parameters
    ----------
    sizes
        Number of planes along z, channels and times.
    pitch
        Physical sizes (z, y, x) [m]; None each where the text does not say.
    depths
        PositionZ of the planes [m], in the order of z; empty where the text does not say.
    note
        The annotation of lumigraph; empty in files by other programs.
    bits
        Significant bits; None where the text does not say.
    center
        PositionY and X of the first plane [m]; None each where the text does not say.
    axes
        Letters of the axes along which there is more than one plane, the slowest first, such as "tzc".
    places
        Name of the file (empty for the one that holds the text) and page of each plane, in that order; empty
        where the text does not say.
    counts
        Number of planes along each of the axes.
    """

    sizes: tuple[int, int, int]
    pitch: tuple[float | None, float | None, float | None]
    depths: tuple[float, ...]
    note: str
    bits: int | None = None
    center: tuple[float | None, float | None] = (None, None)
    axes: str = ""
    places: tuple[tuple[str, int], ...] = ()
    counts: tuple[int, ...] = ()

    @property
    def count(self) -> int:
        """Planes in all."""
        return math.prod(self.counts)


def text(
    shape: tuple[int, ...],
    dtype: str,
    *,
    pitch: Sequence[float | None] = (None, None, None),
    depths: Sequence[float] = (),
    name: str = "",
    note: str = "",
) -> str:
    """OME-XML of a stack (z, y, x[, c]), ASCII.

    Parameters
    ----------
    shape, dtype
        Shape and type of the data.
    pitch
        Physical sizes (z, y, x) [m]; None is left out.
    depths
        Positions of the planes [m].
    name
        Name of the image.
    note
        Kept in an annotation.
    """
    (planes, rows, columns), samples = shape[:3], shape[3] if len(shape) > 3 else 1
    sizes = "".join(
        f' PhysicalSize{axis}="{value * 1e6!r}" PhysicalSize{axis}Unit="µm"'
        for axis, value in zip("ZYX", pitch, strict=True)
        if value is not None
    )
    places = "".join(
        f'<Plane TheZ="{k}" TheT="0" TheC="0" PositionZ="{dz * 1e6!r}" PositionZUnit="µm"/>'
        for k, dz in enumerate(depths)
    )
    found = (
        f'<?xml version="1.0" encoding="UTF-8"?><OME xmlns="{SCHEMA}" '
        'xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance" '
        f'xsi:schemaLocation="{SCHEMA} {SCHEMA}/ome.xsd" Creator="lumigraph">'
        f'<Image ID="Image:0" Name={quoteattr(name or "image")}><Pixels ID="Pixels:0" DimensionOrder="XYCZT" '
        f'Type="{_TYPES.get(dtype, dtype)}" SizeX="{columns}" SizeY="{rows}" SizeC="{samples}" '
        f'SizeZ="{planes}" SizeT="1"{sizes}><Channel ID="Channel:0:0" SamplesPerPixel="{samples}"/>'
        f'<TiffData IFD="0" PlaneCount="{planes}"/>{places}</Pixels><AnnotationRef ID="Annotation:0"/>'
        "</Image>"
        '<StructuredAnnotations><CommentAnnotation ID="Annotation:0" Namespace="lumigraph">'
        f"<Value>{escape(note)}</Value></CommentAnnotation></StructuredAnnotations></OME>"
    )
    return found.encode("ascii", "xmlcharrefreplace").decode("ascii")


def parse(description: str, name: str = "") -> OmePlanes | None:
    """Planes that an OME-XML text describes of the image in a file; None for any other text.

    Parameters
    ----------
    description
        The text.
    name
        Of the file: of several images it is the first that names it, or the first.

    Raises
    ------
    FormatError
        OME-XML that is damaged, that declares entities, or that refers to the text in another file.
    """
    if "<OME" not in description[:2000]:
        return None
    if len(description) > _LONGEST:
        raise FormatError(f"its OME-XML has {len(description)} characters, at most {_LONGEST} are read.")
    try:
        root = ElementTree.fromstring(description.encode("utf-8", "replace"))
    except (ElementTree.ParseError, DefusedXmlException, ValueError, LookupError) as error:
        raise FormatError(f"its OME-XML is damaged: {error}.") from error
    other = next((node for node in root if _tag(node) == "BinaryOnly"), None)
    if other is not None:
        raise FormatError(
            "it is one part of an OME data set whose planes are named in "
            f"{other.get('MetadataFile', '')[:80]!r}. Open that file, or choose a plane of this one by page=."
        )
    images = [node for node in root.iter() if _tag(node) == "Pixels"]
    if not images:
        return None
    pixels = next((node for node in images if name in _names(node)), images[0])
    note = next((_note(node) for node in root.iter() if node.get("Namespace") == "lumigraph"), "")
    sizes = tuple(_size(pixels.get(f"Size{axis}", "1")) for axis in "ZCT")
    pitch = tuple(_length(pixels, f"PhysicalSize{axis}") for axis in "ZYX")
    first = next((node for node in pixels if _tag(node) == "Plane"), None)
    center = (
        (None, None) if first is None else tuple(_length(first, f"Position{a}", signed=True) for a in "YX")
    )
    bits = pixels.get("SignificantBits")
    axes, counts = _axes(pixels, sizes)
    return OmePlanes(
        (sizes[0], sizes[1], sizes[2]), (pitch[0], pitch[1], pitch[2]), _depths(pixels, sizes[0]), note,
        None if bits is None else min(_size(bits), 64), (center[0], center[1]), axes,
        _places(pixels, dict(zip(axes, counts, strict=True)), name, root.get("UUID", "")), counts,
    )  # fmt: skip


def _depths(pixels: Any, count: int) -> tuple[float, ...]:
    """PositionZ of the planes of the first channel and time [m]; empty where one is missing."""
    places = {}
    for node in pixels:
        if _tag(node) == "Plane" and node.get("TheC", "0") == "0" and node.get("TheT", "0") == "0":
            places[_size(node.get("TheZ", "0"), 0)] = _length(node, "PositionZ", signed=True)
    complete = sorted(places) == list(range(count)) and None not in places.values()
    return tuple(float(places[k] or 0) for k in range(count)) if complete else ()


def _axes(pixels: Any, sizes: tuple[int, ...]) -> tuple[str, tuple[int, ...]]:
    """Axes along which there are several planes, the slowest first, and how many."""
    channel = next((node for node in pixels if _tag(node) == "Channel"), None)
    samples = 1 if channel is None else _size(channel.get("SamplesPerPixel", "1"))
    counts = {"z": sizes[0], "c": max(1, sizes[1] // samples), "t": sizes[2]}
    order = pixels.get("DimensionOrder", "XYCZT").lower()[:1:-1]
    found = [axis for axis in (order if sorted(order) == ["c", "t", "z"] else "tzc") if counts[axis] > 1]
    return "".join(found), tuple(counts[axis] for axis in found)


def _names(pixels: Any) -> set[str]:
    """Names of the files that hold planes of an image."""
    found = (node.get("FileName") for part in pixels if _tag(part) == "TiffData" for node in part)
    return {name for name in found if name}


def _places(pixels: Any, counts: dict[str, int], name: str, own: str) -> tuple[tuple[str, int], ...]:
    """File and page of each plane; empty where the text does not say."""
    total = math.prod(counts.values())
    if total > _MOST_PLANES:
        raise FormatError(f"its OME-XML says {total} planes, at most {_MOST_PLANES} are read. Split it.")
    found: list[tuple[str, int] | None] = [None] * total
    for node in pixels:
        if _tag(node) != "TiffData":
            continue
        start = 0
        for axis, count in counts.items():
            start = start * count + min(_size(node.get(f"First{axis.upper()}", "0"), 0), count - 1)
        page = _size(node.get("IFD", "0"), 0)
        many = _size(node.get("PlaneCount", "1" if "IFD" in node.attrib else str(total)))
        file = next((part for part in node if _tag(part) == "UUID"), None)
        other = "" if file is None or (own and file.text == own) else (file.get("FileName") or "")
        for k in range(min(many, total - start)):
            found[start + k] = ("" if other == name else other, page + k)
    return tuple(one for one in found if one is not None) if None not in found else ()


def _tag(node: Any) -> str:
    return str(node.tag).rpartition("}")[2]


def _note(node: Any) -> str:
    return next((child.text or "" for child in node if _tag(child) == "Value"), "")


def _size(value: str, lowest: int = 1) -> int:
    if not (value.isascii() and value.isdecimal() and len(value) < 10 and int(value) >= lowest):
        raise FormatError(f"its OME-XML gives a size of {value[:20]!r}. Save it again.")
    return int(value)


def _length(node: Any, name: str, *, signed: bool = False) -> float | None:
    factor = _UNITS.get(node.get(f"{name}Unit", "µm"))
    try:
        value = float(node.get(name, ""))
    except ValueError:
        return None
    good = factor is not None and math.isfinite(value) and (signed or value > 0)
    return value * factor if good and factor is not None else None
