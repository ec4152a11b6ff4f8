"""Pictures from a point of view that moves over the aperture."""

import math
from typing import Literal

import numpy as np

from lumigraph.core import checks
from lumigraph.core.arrays import A, Array, like, namespace
from lumigraph.core.lightfield import LightField
from lumigraph.errors import GeometryError
from lumigraph.rendering.geometry import lit
from lumigraph.rendering.interpolate import as_float, sample, weighted
from lumigraph.rendering.refocus import shifts

Path = Literal["circle", "line", "eight"]
PATHS = ("circle", "line", "eight")

_MOST_FRAMES = 10_000


def view_path(
    views: LightField[A], frames: int = 24, *, path: Path = "circle", radius: float = 0.7, alpha: float = 1.0
) -> A:
    """Pictures (n, t, s[, c]) from a point of view that runs once round a closed path on the aperture.

    The plane of refocus factor `alpha` stands still while everything nearer or farther moves: parallax
    shows the depth. Between the views the picture is mixed of the four next to the point; objects more than
    a lenslet per view away from that plane are seen double there.

    Parameters
    ----------
    views
        Light field.
    frames
        Pictures; the last leads back to the first.
    path
        "circle"; "line": from left to right and back; "eight": a lying figure of eight.
    radius
        Of the path, over that of the aperture, above 0 and up to 1.
    alpha
        F / F' of the plane that does not move.

    Raises
    ------
    GeometryError
        Another path, or numbers out of range.
    """
    checks.instance("views", views, LightField)
    checks.choice("path", path, PATHS)
    checks.positive("alpha", alpha, "1")
    if checks.whole("frames", frames) > _MOST_FRAMES:
        raise GeometryError(f"frames is {frames} but must be at most {_MOST_FRAMES}.")
    if not 0 < checks.finite("radius", radius, "1") <= 1:
        raise GeometryError(f"radius is {radius:g} but must be above 0 and at most 1.")
    angles = 2 * math.pi * np.arange(frames) / frames
    y, x = {
        "circle": (np.sin(angles), np.cos(angles)),
        "line": (np.zeros(frames), np.cos(angles)),
        "eight": (np.sin(2 * angles) / 2, np.cos(angles)),
    }[path]
    used = lit(views.data)
    v, u = (_indices(np.asarray(used.any(1 - axis)), part * radius) for axis, part in ((0, y), (1, x)))
    pictures = [_seen_from(views, float(a), float(b), alpha, used) for a, b in zip(v, u, strict=True)]
    return namespace(views.data).stack(pictures)


def _indices(used: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Fractional indices of places (-1 to 1) across the views that are not dark."""
    first, last = (int(k) for k in np.flatnonzero(used)[[0, -1]]) if used.any() else (0, len(used) - 1)
    return (first + last) / 2 + places * (last - first) / 2


def _seen_from(views: LightField, v: float, u: float, alpha: float, used: np.ndarray) -> Array:
    """Picture from the fractional view (v, u): the four next to it, each moved so that one plane stays."""
    data, (down, right) = as_float(views.data), shifts(views, alpha)
    t, s = np.arange(views.lenslets.shape[0])[:, None], np.arange(views.lenslets.shape[1])[None, :]
    total, weight, tail = None, 0.0, len(views.data.shape) - 4
    for a in {math.floor(v), math.ceil(v)}:
        for b in {math.floor(u), math.ceil(u)}:
            share = (1 - abs(v - a)) * (1 - abs(u - b)) * bool(used[a, b])
            if share > 0:
                picture = sample(data[a, b, ...], t + down[a], s + right[b], "cubic")
                term = weighted(picture, np.full((1, 1), share), tail)
                total, weight = (term if total is None else total + term), weight + share
    if total is None:
        return like(np.zeros(views.data.shape[2:]), data)
    return total / weight
