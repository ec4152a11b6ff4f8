"""Raw images: the numbers that a sensor read out."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, Self

import numpy as np

from lumigraph.core import checks, picture
from lumigraph.core.arrays import A
from lumigraph.core.labelled import Labels
from lumigraph.core.noun import Noun
from lumigraph.core.short_repr import brief
from lumigraph.errors import FormatError, GeometryError

BAYER_PATTERNS = ("RGGB", "GRBG", "GBRG", "BGGR")

_MOST_BITS = 64


@dataclass(frozen=True, slots=True, eq=False)
class RawImage(Noun[A]):
    """A sensor's picture, in which position and direction are still interleaved.

    A simulated raw image is turned by 180° as every camera's is, so that pictures stand upright.

    Parameters
    ----------
    data
        Pixel values (y, x) or (y, x, c).
    pixel_pitch
        Distance between pixels [m]; None where the file does not say.
    bit_depth
        Significant bits of integer data; None for floats.
    bayer
        Colours of the first 2 × 2 pixels: "RGGB", "GRBG", "GBRG" or "BGGR"; None for grey or full colour.
    metadata
        Whatever else is known, by name.

    Raises
    ------
    GeometryError
        The data's shape is not (y, x) or (y, x, c), or is empty.
    FormatError
        Data that is not an array of numbers; a bit depth, Bayer pattern or metadata that no raw image can
        have.
    """

    axes: ClassVar[str] = "yx"

    data: A
    pixel_pitch: float | None = None
    bit_depth: int | None = None
    bayer: str | None = None
    metadata: Mapping[str, Any] = field(default_factory=dict)

    __repr__ = brief

    def __post_init__(self) -> None:
        checks.array("a raw image", self.data, FormatError)
        shape = tuple(self.data.shape)
        if len(shape) not in (2, 3) or min(shape) < 1:
            raise GeometryError(f"a raw image has shape (y, x) or (y, x, c), not {shape}.")
        if self.pixel_pitch is not None:
            object.__setattr__(self, "pixel_pitch", checks.positive("pixel_pitch", self.pixel_pitch))
        bits = self.bit_depth
        if bits is not None and checks.whole("bit_depth", bits, error=FormatError) > _MOST_BITS:
            raise FormatError(f"bit_depth is {bits} but must be at most {_MOST_BITS}.")
        if self.bayer is not None:
            checks.choice("bayer", self.bayer, BAYER_PATTERNS, FormatError)
        if not isinstance(self.metadata, Mapping):
            raise FormatError(f"metadata is {self.metadata!r} but must be a mapping of names to values.")

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns (ny, nx)."""
        return int(self.data.shape[0]), int(self.data.shape[1])

    def _repr_html_(self) -> str:
        rows = [("size", f"{picture.sized(self.data.shape)} px"), ("numbers", picture.numbers(self.data))]
        rows += [("bits", str(self.bit_depth))] if self.bit_depth else []
        rows += [("Bayer pattern", self.bayer)] if self.bayer else []
        rows.append(("pixel pitch", picture.length(self.pixel_pitch)))
        return picture.card("Raw image", rows, picture.thumbnail(self.data))

    def _labels(self) -> Labels:
        about = {"bit_depth": self.bit_depth, "bayer": self.bayer, "metadata": dict(self.metadata)}
        pitch, unit = (self.pixel_pitch, "m") if self.pixel_pitch else (1.0, "px")
        along = {name: np.arange(n) * pitch for name, n in zip("yx", self.shape, strict=True)}
        pitches = dict.fromkeys("yx", pitch) if self.pixel_pitch else {}
        units = dict.fromkeys("yx", unit)
        return Labels("yx", "pixel value", along=along, units=units, pitches=pitches, attributes=about)

    @classmethod
    def _of_labels(cls, labels: Labels) -> Self:
        about = labels.attributes
        pitch = labels.grid().pitch[1] if labels.units.get("x") == "m" else None
        return cls(labels.data, pitch, about.get("bit_depth"), about.get("bayer"), about.get("metadata", {}))
