"""Arrays by other programs, which do not say what their axes are: `arrangement` and `noun_of`.

MATLAB stores arrays in reverse order, so the same file of views (v, u, y, x, c) may declare (c, x, y, u, v).
What only one order can mean is read so; what several can mean is asked for.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from lumigraph.core.lightfield import LightField
from lumigraph.core.raw import RawImage
from lumigraph.core.stack import Stack
from lumigraph.errors import FormatError
from lumigraph.io.cameras import from_cameras

Noun = RawImage | LightField | Stack

_COLOURS = (3, 4)
_KNOWN = frozenset({"yx", "yxc", "nyx", "nyxc", "vuyx", "vuyxc"})
"""Axes of a picture, of a stack of n, and of views by rows and columns."""

_OTHERS = ("cxyuv", "yxvuc", "vucyx", "xyuv", "yxvu", "yxn", "yxcn")
"""Orders of others, which are asked for."""

_NARROW = 8
"""Times as many pictures or rows as columns that show that the last axis counts pictures."""


def arrangement(
    what: str,
    shape: tuple[int, ...],
    *,
    axes: str | None = None,
    reverse: bool | None = None,
    weighted: bool = False,
) -> str:
    """Letters of the axes of an array in the order in which they are stored, such as "vuyxc" or "cxyuv".

    Parameters
    ----------
    what
        File and array, for messages.
    shape
        As stored.
    axes
        As the caller gives them.
    reverse
        Whether the array is stored in reverse order; None where nobody knows.
    weighted
        Whether two colours may be grey and a weight.

    Raises
    ------
    FormatError
        Axes that do not fit, or several orders that the array can have, or none.
    """
    if axes is not None:
        return _given(what, shape, axes)
    forward, backward = _letters(shape, weighted=weighted), _letters(shape[::-1], weighted=weighted)[::-1]
    natural, other = (backward, forward) if reverse else (forward, backward)
    if reverse is None and len(shape) == 3 and shape[0] in _COLOURS and shape[2] not in _COLOURS:
        raise _question(what, shape, "nyx", "cxy")
    if reverse is None and len(shape) == 5 and not _fits(forward, shape) and _fits(backward, shape):
        return backward
    if not _fits(natural, shape):
        step = -1 if reverse else 1
        found = [one[::step] for one in _OTHERS if len(one) == len(shape) and _fits(one[::step], shape)]
        raise _question(what, shape, *dict.fromkeys([natural, *(found or [other])]))
    return natural


def _given(what: str, shape: tuple[int, ...], axes: str) -> str:
    if not isinstance(axes, str) or "".join(sorted(axes)) not in {"".join(sorted(one)) for one in _KNOWN}:
        raise FormatError(f"axes is {axes!r} but must be the letters of one of {', '.join(sorted(_KNOWN))}.")
    if len(axes) != len(shape):
        raise FormatError(f"{what} has shape {_times(shape)}, {len(shape)} axes, but axes is {axes!r}.")
    return axes


def _letters(shape: tuple[int, ...], *, weighted: bool) -> str:
    colours = shape[-1] in _COLOURS or (weighted and shape[-1] == 2)
    if len(shape) == 4:
        return "nyxc" if colours else "vuyx"
    return {2: "yx", 3: "yxc" if colours else "nyx", 5: "vuyxc"}[len(shape)]


def _fits(axes: str, shape: tuple[int, ...]) -> bool:
    """True if pictures are at least as wide as there are views in a row, in at most four colours.

    Pictures of a stack may be fewer or more, but hardly slits.
    """
    size = dict(zip(axes, shape, strict=True))
    if "n" in axes and size["x"] * _NARROW < min(size["n"], size["y"]):
        return False
    few = max(size.get("v", 1), size.get("u", 1)) <= min(size["y"], size["x"])
    return few and size.get("c", 1) <= max(_COLOURS)


def _question(what: str, shape: tuple[int, ...], *choices: str) -> FormatError:
    told = " or ".join(f"axes={one!r} ({_meaning(one, shape)})" for one in choices)
    return FormatError(
        f"{what} is {_times(shape)}, and which axis is which is not known: MATLAB stores them in reverse. "
        f"Give {told}."
    )


def _meaning(axes: str, shape: tuple[int, ...]) -> str:
    size = dict(zip(axes, shape, strict=True))
    many = f"{size['v']} x {size['u']} views of " if "v" in size else f"{size.get('n', 1)} of "
    colours = f" in {size['c']} colours" if "c" in size else ""
    return f"{many}{size['y']} x {size['x']} px{colours}"


def noun_of(axes: str) -> str:
    """Name of the noun that has these axes, in any order."""
    return "LightField" if "v" in axes else "Stack" if "n" in axes else "RawImage"


def upright(data: np.ndarray, axes: str) -> np.ndarray:
    """The array with its axes in lumigraph's order, (v, u, y, x, c), (n, y, x, c) or (y, x, c)."""
    order = [axes.index(letter) for letter in "vunyxc" if letter in axes]
    return np.ascontiguousarray(data.transpose(order))


def as_noun(data: np.ndarray, axes: str, known: Mapping[str, float], *, weighted: bool = False) -> Noun:
    """A picture, a stack, or the light field of cameras that an array holds.

    Parameters
    ----------
    data
        As stored.
    axes
        As `arrangement` gives them.
    known
        Numbers beside it: "dV" and "dH" are the spacing of the cameras, down and to the right.
    weighted
        Whether a last colour beside one or three of them is the weight of a sample, as in LFToolbox'
        variable ``LF``: samples without weight are not `valid`.
    """
    data = upright(data, axes)
    depth = data.dtype.itemsize * 8 if data.dtype.kind in "iu" else None
    if noun_of(axes) == "RawImage":
        return RawImage(data, bit_depth=depth, metadata=dict(known))
    if noun_of(axes) == "Stack":
        return Stack(data, bit_depth=depth, metadata=dict(known))
    spacing = (known.get("dV", 1.0), known.get("dH", 1.0))
    if not weighted or data.shape[4:] not in ((2,), (4,)):
        return from_cameras(data, spacing)
    colours = data[..., 0] if data.shape[4] == 2 else data[..., :3]
    valid = from_cameras(data[..., -1] > 0, spacing).data
    views = from_cameras(colours, spacing)
    return LightField(views.data, views.aperture, views.lenslets, views.separation, valid)


def unpacked(content: Any, shape: tuple[int, ...], dtype: np.dtype) -> np.ndarray:
    """Numbers in the machine's own byte order."""
    return np.frombuffer(content, dtype).reshape(shape).astype(dtype.newbyteorder("="), copy=False)


def _times(shape: tuple[int, ...]) -> str:
    return " x ".join(map(str, shape))
