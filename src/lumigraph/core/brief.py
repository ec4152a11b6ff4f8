"""Short representations of objects: arrays by type and shape, long lists by their ends."""

import re
import textwrap
from collections.abc import Mapping
from dataclasses import fields
from typing import Any

from lumigraph.core import picture

WIDTH, LINES = 100, 8
"""Size of the text."""

MANY = 6
"""Members of a list or a mapping that are all shown."""

_LONG = 200


def brief(self: Any) -> str:
    """A dataclass with its fields, for its ``__repr__``: some lines, however large its arrays are.

    Examples
    --------
    >>> import numpy as np
    >>> from lumigraph.core.raw import RawImage
    >>> RawImage(np.zeros((480, 640), np.float32), 5e-6)
    RawImage(data=float32 (480, 640), pixel_pitch=5e-06, bit_depth=None, bayer=None, metadata={})
    """
    shown = ", ".join(
        f"{field.name}={_short(getattr(self, field.name))}" for field in fields(self) if field.repr
    )
    lines = textwrap.wrap(f"{type(self).__name__}({shown})", WIDTH, subsequent_indent="    ")
    return "\n".join(lines if len(lines) <= LINES else [*lines[: LINES - 1], "    ...)"])


def called(thing: Any) -> str:
    """Plain name of a type, or of the type of an object.

    Examples
    --------
    >>> from lumigraph.core.grid import Grid
    >>> called(Grid((1, 1), 1.0)), called(type("LightField", (), {})())
    ('grid', 'light field')
    """
    name = (thing if isinstance(thing, type) else type(thing)).__name__
    return re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name).lower()


def table(self: Any) -> str:
    """A dataclass with its fields as a card of HTML, for its ``_repr_html_``."""
    rows = [(f.name.replace("_", " "), _short(getattr(self, f.name))) for f in fields(self) if f.repr]
    return picture.card(type(self).__name__, rows)


def _short(value: Any) -> str:
    if hasattr(value, "dtype") and getattr(value, "shape", ()):
        return f"{str(value.dtype).rsplit('.', 1)[-1]} {tuple(value.shape)}"
    if isinstance(value, Mapping):
        pairs = [f"{key!r}: {_short(value[key])}" for key in value]
        return "{" + ", ".join(_ends(pairs)) + "}"
    if isinstance(value, tuple | list):
        return "(" + ", ".join(_ends([_short(each) for each in value])) + ")"
    told = repr(value)
    return told if len(told) <= _LONG else f"{told[: _LONG - 3]}..."


def _ends(parts: list[str]) -> list[str]:
    if len(parts) <= MANY:
        return parts
    return [*parts[: MANY // 2], f"... {len(parts)} in all ...", parts[-1]]
