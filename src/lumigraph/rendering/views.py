"""Pictures out of a light field, and its two-dimensional layouts."""

import math
from typing import Any, Literal

import numpy as np

from lumigraph.core import checks
from lumigraph.core.arrays import A, Array, like, namespace, to_numpy
from lumigraph.core.grid import Grid
from lumigraph.core.lightfield import LightField
from lumigraph.errors import GeometryError
from lumigraph.rendering.interpolate import as_float, neighbours


def sub_aperture(views: LightField[A], v: int, u: int) -> A:
    """Sub-aperture image (t, s[, c]) seen from view (v, u) of the aperture; negative indices from the end.

    Raises
    ------
    GeometryError
        There is no such view.
    """
    checks.instance("views", views, LightField)
    nv, nu = views.aperture.shape
    for name, index in (("v", v), ("u", u)):
        checks.whole(name, index, -max(nv, nu))
    if not (-nv <= v < nv and -nu <= u < nu):
        raise GeometryError(f"there is no view ({v}, {u}): the aperture has {nv} x {nu}, counted from 0.")
    return views.data[v, u, ...]


def arranged(views: LightField[A], which: Literal["all", "star", "cross", "row"] = "all") -> LightField[A]:
    """Some of the views: the middle row; that and the middle column, a cross; these and diagonals, a star.

    The rest is black and not `valid`, as in a folder that lacks it; of a row the other rows are left out.

    Raises
    ------
    GeometryError
        Another arrangement.
    """
    checks.choice("which", which, ("all", "star", "cross", "row"))
    if which == "all":
        return views
    (nv, nu), own = views.aperture.shape, views.aperture
    if which == "row":
        row, grid = (
            slice(nv // 2, nv // 2 + 1),
            Grid((1, nu), own.pitch, (float(own.y[nv // 2]), own.center[1])),
        )
        valid = None if views.valid is None else views.valid[row]
        return LightField(views.data[row], grid, views.lenslets, views.separation, valid)
    down, right = np.abs(np.arange(nv) - nv // 2)[:, None], np.abs(np.arange(nu) - nu // 2)
    there = (down == 0) | (right == 0) | ((which == "star") & (down == right))
    xp = namespace(views.data)
    data: Any = views.data
    seen = xp.asarray(there.reshape(there.shape + (1,) * (data.ndim - 2)), device=data.device)
    data = xp.where(seen, data, xp.asarray(0, dtype=data.dtype, device=data.device))
    valid = np.broadcast_to(there[:, :, None, None], data.shape[:4])
    valid = valid if views.valid is None else valid & to_numpy(views.valid)
    valid = xp.asarray(valid.copy(), device=data.device)
    return LightField(data, own, views.lenslets, views.separation, valid)


def point_of_view(views: LightField[A], y: float, x: float) -> A:
    """Picture (t, s[, c]) seen from a place on the main lens (y, x) [m], between the views linearly.

    Raises
    ------
    GeometryError
        The place lies outside the aperture; the message gives its limits.
    """
    checks.instance("views", views, LightField)
    grid, places = views.aperture, []
    for name, value, positions in zip("yx", (y, x), (grid.y, grid.x), strict=True):
        value = checks.finite(name, value)
        if not positions[0] - 1e-9 * abs(positions[0]) <= value <= positions[-1] + 1e-9 * abs(positions[-1]):
            raise GeometryError(
                f"{name} is {value:.4g} m but the views lie between {positions[0]:.4g} and "
                f"{positions[-1]:.4g} m. "
                "Choose a place inside the aperture."
            )
    for axis, value in enumerate((y, x)):
        first = (grid.y, grid.x)[axis][0]
        places.append(neighbours(np.array((value - first) / grid.pitch[axis]), grid.shape[axis], "linear"))
    data: Any = as_float(views.data)
    total: Any = None
    for v, wv in places[0]:
        for u, wu in places[1]:
            term = data[int(v), int(u), ...] * float(wv * wu)
            total = term if total is None else total + term
    return total


def reduce_aperture(
    views: LightField[A],
    fraction: float = 1.0,
    *,
    shape: Literal["square", "round", "ring"] | Array = "square",
) -> LightField[A]:
    """Light field of a smaller aperture: the outer views are left out, the middle one stays the middle.

    Parameters
    ----------
    views
        Of the full aperture.
    fraction
        Width kept, above 0 and up to 1; at least one view stays.
    shape
        "round" also sets the views in the corners to 0, outside the circle (an ellipse, where the numbers
        of views differ) that touches the kept views' outer edges; "ring" those inside half that circle too,
        as behind a mirror lens, whose blur is ring-shaped. Or any mask (v, u) of the views that are kept,
        true or false. Views set to 0 do not count in `refocus`.

    Raises
    ------
    GeometryError
        A fraction outside 0 to 1, another shape, a mask of another size or one that keeps nothing.
    """
    checks.instance("views", views, LightField)
    if not 0 < checks.finite("fraction", fraction, "1") <= 1:
        raise GeometryError(f"fraction is {fraction:g} but must be above 0 and at most 1.")
    full = views.aperture.shape
    kept = tuple(max(1, round(n * fraction)) for n in full)
    first = [n // 2 - k // 2 for n, k in zip(full, kept, strict=True)]
    rows, columns = (slice(start, start + count) for start, count in zip(first, kept, strict=True))
    opening = _opening(shape, full)[rows, columns] if not isinstance(shape, str) else _named(shape, kept)
    if not opening.any():
        raise GeometryError(
            f"an aperture of {kept[0]} x {kept[1]} views in this shape keeps none of them. Use a larger one."
        )
    data, valid = views.data[rows, columns, ...], views.valid
    if not opening.all():
        data = as_float(data)
        data = data * like(opening.astype(float).reshape(opening.shape + (1,) * (len(data.shape) - 2)), data)
    valid = None if valid is None else valid[rows, columns, ...]
    aperture = views.aperture.resized((kept[0], kept[1]))
    return LightField(data, aperture, views.lenslets, views.separation, valid)


def _named(shape: str, kept: tuple[int, ...]) -> np.ndarray:
    """Views (v, u) inside a shape known by name."""
    if shape not in ("square", "round", "ring"):
        raise GeometryError(f"shape is {shape!r} but must be 'square', 'round', 'ring' or a mask of views.")
    v, u = ((np.arange(k) - (k - 1) / 2) / (k / 2) for k in kept)
    radius = v[:, None] ** 2 + u**2
    return {"square": radius >= 0, "round": radius <= 1, "ring": (radius <= 1) & (radius > 0.25)}[shape]


def _opening(mask: Array, full: tuple[int, int]) -> np.ndarray:
    """A mask of views (v, u), of any library."""
    if not hasattr(mask, "shape") or tuple(mask.shape) != tuple(full):
        raise GeometryError(
            f"shape is of type {type(mask).__name__} and size {getattr(mask, 'shape', None)} but must be a "
            f"name, or a mask of {full[0]} x {full[1]} views."
        )
    return np.asarray(to_numpy(mask)) != 0


def views_mosaic(views: LightField[A]) -> A:
    """All views side by side (v t, u s[, c]), as an array of cameras would take them."""
    return _mosaic(views.data, (0, 2, 1, 3))


def lenslet_mosaic(views: LightField[A]) -> A:
    """All micro-images side by side (t v, s u[, c]), each with v and u ascending."""
    return _mosaic(views.data, (2, 0, 3, 1))


def views_from_mosaic(mosaic: A, aperture: Grid, lenslets: Grid, separation: float) -> LightField[A]:
    """Light field of all views side by side (v t, u s[, c]): the inverse of `views_mosaic`.

    Raises
    ------
    GeometryError
        The mosaic's size is not that of the grids.
    """
    checks.array("the mosaic", mosaic)
    (nv, nu), (nt, ns), tail = aperture.shape, lenslets.shape, tuple(mosaic.shape[2:])
    if tuple(mosaic.shape[:2]) != (nv * nt, nu * ns):
        raise GeometryError(
            f"the mosaic has {mosaic.shape[0]} x {mosaic.shape[1]} pixels but {nv} x {nu} views "
            f"of {nt} x {ns} "
            f"make {nv * nt} x {nu * ns}. Give the grids that it was made from."
        )
    xp = namespace(mosaic)
    data = xp.permute_dims(
        xp.reshape(mosaic, (nv, nt, nu, ns, *tail)), (0, 2, 1, 3, *range(4, 4 + len(tail)))
    )
    return LightField(data, aperture, lenslets, separation)


def _mosaic(data: Array, order: tuple[int, int, int, int]) -> Array:
    xp, shape = namespace(data), tuple(data.shape)
    turned = xp.permute_dims(data, (*order, *range(4, len(shape))))
    sizes = [shape[k] for k in order]
    return xp.reshape(turned, (math.prod(sizes[:2]), math.prod(sizes[2:]), *shape[4:]))
