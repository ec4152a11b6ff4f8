"""`Tolerance`: allowed deviation of a part, table ``[tolerances]`` of a camera file."""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator

from lumigraph import units
from lumigraph.elements.scatter import MOST_MISSING
from lumigraph.errors import FormatError, GeometryError

Shape = Literal["normal", "uniform"]

NAMES = {
    "separation": "length", "lenslet_distance": "length", "object_distance": "length",
    "wavelength": "length", "main_lens.focal_length": "length", "main_lens.diameter": "length",
    "lenslets.pitch": "length", "lenslets.focal_length": "length", "lenslets.fill_factor": "number",
    "lenslets.rotation": "angle", "lenslets.offset_y": "length", "lenslets.offset_x": "length",
    "sensor.pixel_pitch": "length", "array_tilt_y": "angle", "array_tilt_x": "angle",
    "array_bow": "length", "sensor_tilt_y": "angle", "sensor_tilt_x": "angle",
    "lenslets.each.focal_length": "length", "lenslets.each.decentre": "length",
    "lenslets.each.tilt": "angle", "lenslets.each.form": "length", "lenslets.each.missing": "part",
}  # fmt: skip
"""Keys of a camera file with tolerances, and ``main_lens.aberrations.N`` [waves rms] of Noll index N.

Distances without a table are main lens to lenslets, lenslets to sensor and object to main lens; tilts and bow
are those of ``[built]``. Below
``lenslets.each`` stands what each lenslet has of its own: focal length, decentre of its vertex along either
axis, tilt of its surface about either, form (rms path through it, but for focus and tilt), and the part of
the lenslets that is missing.
"""

EACH = "lenslets.each."
"""Begins the names of what lenslets have of their own."""

FORM, MISSING, TILT = (f"{EACH}{name}" for name in ("form", "missing", "tilt"))

_UNITS = {"length": "m", "angle": "rad", "number": "", "part": ""}
_NOLL = re.compile(r"main_lens\.aberrations\.[1-9]\d{0,3}")
_PART = re.compile(r"\s*(\d{1,9}\.?\d{0,12})\s*(%)?\s*")
_TEXT = re.compile(r"\s*(?:±|\+-|\+/-)\s*(.*?)\s*(normal|uniform)?\s*")


@dataclass(frozen=True, slots=True)
class Tolerance:
    """Tolerance of a camera's value.

    Parameters
    ----------
    name
        One of `NAMES`.
    half
        Half of the range, in SI, or as a part of the value.
    relative
        True if it is a part of the value.
    shape
        "normal": ± is two standard deviations, which 95 % of all cameras keep; "uniform": all keep it, and
        none is likelier than another. What lenslets have of their own is normal.

    Raises
    ------
    FormatError
        An unknown name, or a shape that it cannot have.
    GeometryError
        A range that is not above zero.

    Examples
    --------
    >>> Tolerance.parse("separation", "±0.05 mm")
    Tolerance(name='separation', half=5e-05, relative=False, shape='normal')
    >>> Tolerance.parse("lenslets.focal_length", "+-1 % uniform").deviation_of(5.2e-3)
    3.002221399786054e-05
    """

    name: str
    half: float
    relative: bool = False
    shape: Shape = "normal"

    def __post_init__(self) -> None:
        check_name(self.name)
        if not (math.isfinite(self.half) and self.half > 0):
            raise GeometryError(f"the tolerance of {self.name} is ±{self.half:g} but must be above zero.")
        if self.shape not in ("normal", "uniform"):
            raise FormatError(
                f"the tolerance of {self.name} is {self.shape!r} but must be normal or uniform."
            )
        if self.name == MISSING and self.half > MOST_MISSING:
            raise GeometryError(f"{MISSING} is {self.half:g} but must be at most {MOST_MISSING:g}.")
        if self.is_of_each and self.shape != "normal":
            raise FormatError(f"{self.name} is uniform but lenslets differ normally. Leave 'uniform' out.")

    @classmethod
    def parse(cls, name: str, text: str) -> "Tolerance":
        """Tolerance from text such as "±0.05 mm", "±1 %" or "±0.1 um uniform"; "+-" is accepted for "±".

        A part that is missing has no sign: "0.2 %".

        Raises
        ------
        FormatError
            Another text, or an unknown name.
        GeometryError
            A range that is not above zero.
        """
        check_name(name)
        if name == MISSING:
            return cls(name, _part(text))
        found = _TEXT.fullmatch(text) if isinstance(text, str) and len(text) < 100 else None
        dimension = NAMES.get(name, "number")
        if found is None:
            raise FormatError(
                f"the tolerance of {name} is {str(text)[:60]!r} but must be like '±0.05 mm', "
                "'±1 %' or '±0.1 um uniform'."
            )
        half = found[1]
        shape: Shape = "uniform" if found[2] == "uniform" else "normal"
        if half.endswith("%"):
            return cls(name, _number(name, half[:-1]) / 100, True, shape)
        if dimension == "number":
            return cls(name, _number(name, half), False, shape)
        try:
            return cls(name, units.parse(half, dimension), False, shape)
        except FormatError as error:
            raise FormatError(f"the tolerance of {name}: {error}") from None

    @property
    def unit(self) -> str:
        """SI unit of the value."""
        return _UNITS[NAMES.get(self.name, "number")]

    @property
    def is_of_each(self) -> bool:
        """True if each lenslet has its own deviation."""
        return self.name.startswith(EACH)

    def deviation_of(self, value: float) -> float:
        """Standard deviation of the value, in SI; √(q (1 - q)) of whether a lenslet is there, q missing.

        Raises
        ------
        GeometryError
            It is a part of a value that is zero.
        """
        if self.relative and value == 0:
            raise GeometryError(
                f"{self.name} is 0, and ±{100 * self.half:g} % of it is nothing. "
                "Give the tolerance with a unit."
            )
        half = self.half * abs(value) if self.relative else self.half
        if self.name == MISSING:
            return math.sqrt(half * (1 - half))
        return half / (math.sqrt(3) if self.shape == "uniform" else 2)

    def __str__(self) -> str:
        if self.name == MISSING:
            return f"{100 * self.half:.6g} %"
        scale, unit = {"m": (1e6, "µm"), "rad": (1e3, "mrad")}.get(self.unit, (1.0, ""))
        size = f"{100 * self.half:.6g} %" if self.relative else f"{scale * self.half:.6g} {unit}".rstrip()
        return f"±{size}" + (" uniform" if self.shape == "uniform" else "")


def check_name(name: str) -> None:
    """Refuse a name without tolerance.

    Raises
    ------
    FormatError
        Neither of `NAMES` nor an aberration.
    """
    if name not in NAMES and not _NOLL.fullmatch(name):
        near = get_close_matches(name, NAMES, 1, 0.5)
        hint = f"Did you mean {near[0]!r}?" if near else f"Known: {', '.join(NAMES)}."
        raise FormatError(f"{name} has no tolerance. {hint}")


def _number(name: str, text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise FormatError(
            f"the tolerance of {name} has {text!r} where a number without a unit, or a part in %, must stand."
        ) from None


def _part(text: Any) -> float:
    """Fraction of lenslets that are missing."""
    if not isinstance(text, str) or not (found := _PART.fullmatch(text)):
        raise FormatError(f"the tolerance of {MISSING} is {str(text)[:60]!r} but must be like '0.2 %'.")
    return float(found[1]) / (100 if found[2] else 1)


def flat(table: Any, above: str = "") -> dict[str, str]:
    """A table with dotted keys in the place of tables, each value a tolerance.

    >>> flat({"separation": "±0.1 mm", "lenslets": {"pitch": "±1 um"}})
    {'separation': '±0.1 mm', 'lenslets.pitch': '±1 um'}
    """
    if not isinstance(table, Mapping):
        raise FormatError(f"{table!r} is not a table. Write a line such as separation = '±0.05 mm'.")
    found: dict[str, str] = {}
    for key, value in table.items():
        name = f"{above}{key}"
        if isinstance(value, Mapping):
            found |= flat(value, f"{name}.")
        else:
            Tolerance.parse(name, value)
            found[name] = value
    return found


Tolerances = Annotated[dict[str, str], BeforeValidator(flat)]
"""Tolerances by dotted keys."""
