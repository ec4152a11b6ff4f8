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


@dataclass(frozen=True, slots=True)
class Planes:
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
    """

    sizes: tuple[int, int, int]
    pitch: tuple[float | None, float | None, float | None]
    depths: tuple[float, ...]
    note: str


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


def parse(description: str) -> Planes | None:
    """Planes that an OME-XML text describes; None for any other text.

    Raises
    ------
    FormatError
        OME-XML that is damaged, or that declares entities.
    """
    if "<OME" not in description[:2000]:
        return None
    if len(description) > _LONGEST:
        raise FormatError(f"its OME-XML has {len(description)} characters, at most {_LONGEST} are read.")
    try:
        root = ElementTree.fromstring(description.encode("utf-8", "replace"))
    except (ElementTree.ParseError, DefusedXmlException, ValueError, LookupError) as error:
        raise FormatError(f"its OME-XML is damaged: {error}.") from error
    pixels = next((node for node in root.iter() if _tag(node) == "Pixels"), None)
    if pixels is None:
        return None
    note = next((_note(node) for node in root.iter() if node.get("Namespace") == "lumigraph"), "")
    sizes = tuple(_size(pixels.get(f"Size{axis}", "1")) for axis in "ZCT")
    pitch = tuple(_length(pixels, f"PhysicalSize{axis}") for axis in "ZYX")
    places = {}
    for node in pixels:
        if _tag(node) == "Plane" and node.get("TheC", "0") == "0" and node.get("TheT", "0") == "0":
            places[_size(node.get("TheZ", "0"), 0)] = _length(node, "PositionZ", signed=True)
    complete = sorted(places) == list(range(sizes[0])) and None not in places.values()
    depths = tuple(float(places[k] or 0) for k in range(sizes[0])) if complete else ()
    return Planes((sizes[0], sizes[1], sizes[2]), (pitch[0], pitch[1], pitch[2]), depths, note)


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
