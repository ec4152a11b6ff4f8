"""Sums of views moved so that a plane that leans is sharp, as with a tilted lens of a view camera."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lumigraph.core import checks
from lumigraph.core.arrays import Array, like, namespace, to_numpy
from lumigraph.core.lightfield import LightField
from lumigraph.core.progress import Progress
from lumigraph.errors import GeometryError
from lumigraph.rendering.interpolate import Interpolation, as_float, take, taps, weighted

Tilt = tuple[float, float]
"""Refocus factor of the last row less the first row's, and of the last column less the first column's."""


def check_tilt(tilt: Sequence[float], alphas: Sequence[float]) -> Tilt:
    """`tilt` as two numbers, refused where a corner of a picture has a refocus factor of 0 or less."""
    if isinstance(tilt, str) or not isinstance(tilt, Sequence | np.ndarray) or len(tilt) != 2:
        raise GeometryError(f"tilt is {tilt!r} but must be two numbers (down, across) such as (0.05, 0).")
    down, across = (checks.finite("tilt", float(one), "1") for one in tilt)
    least = min(alphas) - (abs(down) + abs(across)) / 2
    if least <= 0:
        raise GeometryError(
            f"tilt is ({down:g}, {across:g}): with alpha {min(alphas):g} one corner has {least:g} "
            "but must have above 0. Give less tilt."
        )
    return down, across


@dataclass(frozen=True, slots=True)
class _Leaning:
    """Refocus factor 1 - defocus - rise y - slope x at lenslets (y, x) of a picture."""

    defocus: float
    rise: float
    slope: float

    @classmethod
    def of(cls, views: LightField, alpha: float, tilt: Tilt) -> "_Leaning":
        per = [one / (n - 1) if n > 1 else 0.0 for one, n in zip(tilt, views.lenslets.shape, strict=True)]
        corner = alpha - sum(one * (n - 1) / 2 for one, n in zip(per, views.lenslets.shape, strict=True))
        return cls(1 - corner, -per[0], -per[1])

    def at(self, y: np.ndarray, x: np.ndarray) -> np.ndarray:
        """1 - alpha."""
        return self.defocus + self.rise * y + self.slope * x

    def row_of(self, t: np.ndarray, x: np.ndarray, move: float) -> np.ndarray:
        """Row y of the picture that takes from row t of a view: t = y + move (1 - alpha(y, x))."""
        return (t - move * (self.defocus + self.slope * x)) / (1 + move * self.rise)


def tilted_sums(
    views: LightField,
    open_views: np.ndarray,
    alpha: float,
    tilt: Tilt,
    sampling: tuple[int, Interpolation],
    progress: Progress | None = None,
) -> tuple[Array, np.ndarray, np.ndarray]:
    r"""Sum of the moved views (t, s[, c]), valid views that each place sees, and views (t, s).

    .. math:: E(x) = \sum_u L(x + u (1 - \alpha'(x)), u), \qquad \alpha'(x) = \alpha'_0 + g \cdot x

    A plane in front of a lens has an image that is a plane, F' = F0' + k x', and with x = α'x' its refocus
    factor F / F' is linear in x: no approximation. Rows of views are sheared first, each sample by the
    factor of the row of the picture that it goes to, columns then (two passes of Catmull and Smith).

    References
    ----------
    Catmull and Smith, "3-D transformations of images in scanline order", Computer Graphics 14, 279 (1980).
    """
    times, interpolation = sampling
    (nt, ns), leaning = views.lenslets.shape, _Leaning.of(views, alpha, tilt)
    down, right = (grid / pitch for grid, pitch in zip(
        (views.aperture.y, views.aperture.x), views.lenslets.pitch, strict=True))  # fmt: skip
    steepest = max(abs(leaning.rise) * np.abs(down).max(), abs(leaning.slope) * np.abs(right).max())
    if steepest >= 1:
        raise GeometryError(
            f"tilt is ({tilt[0]:g}, {tilt[1]:g}): the outermost views would fold over. "
            f"Give at most ({tilt[0] / steepest:.3g}, {tilt[1] / steepest:.3g}), or a smaller aperture."
        )
    y, x = np.arange((nt - 1) * times + 1)[:, None] / times, np.arange((ns - 1) * times + 1)[None, :] / times
    t, defocus, total = np.arange(nt)[:, None], leaning.at(y, x), None
    for v in range(len(down)):
        used, row = np.flatnonzero(open_views[v]), None
        moved = leaning.at(leaning.row_of(t, x, float(down[v])), x)
        for u in used:
            term = _taken(_with_weights(views, v, int(u)), t, x + moved * right[u], 1, interpolation)
            row = term if row is None else row + term
        if row is not None:
            columns = np.broadcast_to(np.arange(x.size)[None, :], defocus.shape)
            term = _taken(row, columns, y + defocus * down[v], 0, interpolation)
            total = term if total is None else total + term
        if progress is not None:
            progress((v + 1) / len(down))
    assert total is not None  # a light field has a view that is lit
    tail = tuple(views.data.shape[4:])
    picture = namespace(total).reshape(total[..., :-2], (y.size, x.size, *tail))
    return picture, to_numpy(total[..., -2]), to_numpy(total[..., -1])


def _with_weights(views: LightField, v: int, u: int) -> Array:
    """One view (t, s, c + 2): its values where valid, whether valid, and ones."""
    view = as_float(views.data[v, u, ...])
    xp, (nt, ns) = namespace(view), views.lenslets.shape
    view, ones = xp.reshape(view, (nt, ns, math.prod(view.shape[2:]))), like(np.ones((nt, ns, 1)), view)
    valid = ones
    if views.valid is not None:
        valid = like(np.asarray(to_numpy(views.valid[v, u, ...]), float)[..., None], view)
    return xp.concat([view * valid, valid, ones], axis=2)


def _taken(
    values: Array, other: np.ndarray, place: np.ndarray, axis: int, interpolation: Interpolation
) -> Array:
    """Values (t, s, c) at places along one axis and samples `other` along the other; 0 beyond the edge."""
    xp, (rows, columns, count) = namespace(values), values.shape
    flat, side, total = xp.reshape(values, (rows * columns, count)), (rows, columns)[axis], None
    nearest = np.rint(place)
    place = np.where(np.abs(place - nearest) < 1e-9, nearest, place)
    below = np.floor(place).astype(np.int64)
    for step, weight in taps(place - below, interpolation):
        at = below + step
        kept, at = np.where((at >= 0) & (at < side), weight, 0), np.clip(at, 0, side - 1)
        index = other * columns + at if axis == 1 else at * columns + other
        term = weighted(take(flat, index.ravel(), 0), kept.ravel(), 1)
        total = term if total is None else total + term
    return xp.reshape(total, (*place.shape, count))
