"""Pictures of a light field that are sharp at every depth."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.ndimage import distance_transform_edt, gaussian_filter, median_filter

from lumigraph.core import checks
from lumigraph.core.arrays import Array, like, to_numpy
from lumigraph.core.lightfield import LightField
from lumigraph.core.progress import Progress, within
from lumigraph.errors import GeometryError
from lumigraph.rendering.detail import chosen, finer
from lumigraph.rendering.geometry import lit
from lumigraph.rendering.interpolate import Interpolation, as_float, taps, weighted
from lumigraph.rendering.refocus import refocus_stack, shifts

_PLANES_AT_ONCE = 8
_STEP = 0.5  # lenslets by which the outermost view may move from one plane to the next
_MOST_PLANES = 512
_FEWEST = 3
_MOST_VIEWS = 5  # along each axis, that are compared with each other


class AllInFocus(NamedTuple):
    """A picture that is sharp all over, and what it was put together by.

    Parameters
    ----------
    picture
        (y, x[, c]), of some samples per lenslet.
    alpha
        Refocus factor of each place (t, s).
    confidence
        How clearly the views agree on it (t, s): 0 where every plane does as well, to 1. Ones where the
        depth was given.
    """

    picture: Array
    alpha: Array
    confidence: Array


def all_in_focus(
    views: LightField,
    alphas: Sequence[float] | np.ndarray | None = None,
    *,
    depth: Array | None = None,
    window: float = 1.5,
    interpolation: Interpolation = "cubic",
    oversample: int | None = None,
    progress: Progress | None = None,
) -> AllInFocus:
    r"""Picture that is focused at every place on what is there, with its map of refocus factors.

    Without a map, each place takes the plane on which the views agree best,

    .. math:: C(x, \alpha') = \langle \overline{L^2} - \overline{L}^2 \rangle,

    the variance over up to 5 x 5 of the views, smoothed over the window ⟨·⟩; the minimum is found between
    the planes by a parabola. The picture is then blended from the two planes next to each place's factor, so
    that all views add up to it and noise is as low as in a refocused picture.

    Parameters
    ----------
    views
        Light field (v, u, t, s[, c]).
    alphas
        Refocus factors to try, evenly spaced, from the nearest to the farthest object's; where `depth` is
        not given.
    depth
        Refocus factors (t, s) of what each place shows, such as `lumigraph.depth` measures; NaN takes the
        nearest place's.
    window
        Standard deviation of the Gaussian mean [lenslets].
    interpolation
        "linear", "cubic" or "band_limited", between lenslets.
    oversample
        Samples of the picture per lenslet; chosen as by `refocus` if left out. The map keeps one.
    progress
        Called as ``progress(fraction)``.

    Raises
    ------
    GeometryError
        Neither alphas nor a map, or both; fewer than three alphas; a map of another shape or not above 0.

    References
    ----------
    Agarwala et al., "Interactive digital photomontage", ACM Trans. Graphics 23, 294 (2004). The measure:
    Tao et al., "Depth from combining defocus and correspondence using light-field cameras", ICCV 2013,
    equation 5.
    """
    checks.instance("views", views, LightField)
    if (alphas is None) == (depth is None):
        given = "both" if alphas is not None else "neither"
        raise GeometryError(f"alphas and depth are {given} given but one of them is needed. Give one.")
    if depth is None:
        assert alphas is not None
        tried = _even(alphas)
        factors, trust = _agreeing(views, tried, window, within(progress, 0.0, 0.5))
    else:
        factors = _given(depth, views)
        trust = np.ones(factors.shape)
    rest = within(progress, 0.0 if depth is not None else 0.5, 1.0)
    times = chosen(views, oversample)
    picture = _blended(
        views, _planes(views, factors, times), finer(factors, times), (interpolation, times), rest
    )
    kind = as_float(views.data)
    return AllInFocus(picture, like(factors, kind), like(trust, kind))


def _even(alphas: Sequence[float] | np.ndarray) -> np.ndarray:
    if np.ndim(alphas) != 1 or np.shape(alphas)[0] < _FEWEST:
        raise GeometryError(f"alphas is {alphas!r} but a minimum needs three of them at least, in a list.")
    values = np.array([checks.positive("alpha", alpha, "1") for alpha in alphas])
    steps = np.diff(values)
    if steps[0] <= 0 or np.ptp(steps) > 1e-6 * steps[0]:
        raise GeometryError(
            f"alphas must ascend in equal steps but theirs are {steps.min():.4g} to {steps.max():.4g}. "
            "Use numpy.linspace."
        )
    return values


def _given(depth: Array, views: LightField) -> np.ndarray:
    checks.array("depth", depth)
    factors = np.array(to_numpy(depth), float)
    if factors.shape != views.lenslets.shape:
        raise GeometryError(
            f"depth has shape {factors.shape} but the views have {views.lenslets.shape} samples (t, s)."
        )
    known = np.isfinite(factors)
    if not known.any() or (factors[known] <= 0).any():
        lowest = f"{factors[known].min():g}" if known.any() else "NaN everywhere"
        raise GeometryError(f"depth is {lowest} but refocus factors are above 0. Give alpha' = F/F'.")
    if not known.all():
        nearest = np.asarray(distance_transform_edt(~known, return_distances=False, return_indices=True))
        factors = factors[nearest[0], nearest[1]]
    return factors


def _agreeing(
    views: LightField, alphas: np.ndarray, window: float, progress: Progress
) -> tuple[np.ndarray, np.ndarray]:
    """Refocus factor of each place on which the views agree best, and how clearly."""
    window = checks.positive("window", window, "lenslets")
    pictures, chosen = _some_grey(views)
    costs = []
    for k, alpha in enumerate(alphas):
        down, right = shifts(views, float(alpha))
        total, power = np.zeros((2, *views.lenslets.shape), np.float32)
        for picture, (v, u) in zip(pictures, chosen, strict=True):
            moved = _moved(picture, float(down[v]), float(right[u]))
            total += moved
            power += moved * moved
        variance = power / len(chosen) - (total / len(chosen)) ** 2
        costs.append(gaussian_filter(np.maximum(variance, 0), window))
        progress((k + 1) / len(alphas))
    cost = np.stack(costs)
    lowest, usual = cost.min(0), np.median(cost, axis=0)
    best = cost.argmin(0)
    middle = np.clip(best, 1, len(alphas) - 2)
    below, at, above = (np.take_along_axis(cost, (middle + k)[None], 0)[0] for k in (-1, 0, 1))
    bend = below - 2 * at + above
    inside = (bend > 0) & (best == middle)
    move = np.where(inside, (below - above) / np.where(inside, 2 * bend, 1.0), 0.0)
    factors = alphas[best] + np.clip(move, -0.5, 0.5) * (alphas[1] - alphas[0])
    trust = np.where(usual > 0, (usual - lowest) / np.where(usual > 0, usual, 1), 0.0)
    return median_filter(factors, 3), trust


def _some_grey(views: LightField) -> tuple[list[np.ndarray], list[tuple[int, int]]]:
    """Grey pictures, and the indices (v, u), of up to 5 x 5 views that are not dark."""
    used = lit(views.data)
    rows, columns = (_some(np.asarray(used.any(1 - axis))) for axis in (0, 1))
    chosen = [(int(v), int(u)) for v in rows for u in columns if used[v, u]] or [(0, 0)]
    data = as_float(views.data)
    pictures = [np.asarray(to_numpy(data[v, u, ...]), np.float32) for v, u in chosen]
    return [p.mean(-1) if p.ndim == 3 else p for p in pictures], chosen


def _some(used: np.ndarray) -> np.ndarray:
    """Indices of at most so many views, the first and the last among them."""
    first, last = (int(k) for k in np.flatnonzero(used)[[0, -1]]) if used.any() else (0, 0)
    return np.unique(np.linspace(first, last, _MOST_VIEWS).astype(int))


def _moved(picture: np.ndarray, down: float, right: float) -> np.ndarray:
    """Picture (t, s) at places moved by (down, right) [samples], along one axis and then the other."""
    for axis, move in ((0, down), (1, right)):
        count, below = picture.shape[axis], math.floor(move)
        found = [
            (below + step, np.float32(weight))
            for step, weight in taps(np.array(move - below), "cubic")
            if weight != 0
        ]
        total = None
        for step, weight in found:
            index = np.clip(np.arange(count) + step, 0, count - 1)
            term = np.take(picture, index, axis) * weight
            total = term if total is None else np.add(total, term, out=total)
        assert total is not None
        picture = total
    return picture


def _planes(views: LightField, factors: np.ndarray, times: int) -> np.ndarray:
    """Refocus factors so close that no view moves by more than half a lenslet from one to the next.

    A quarter in pictures of several samples per lenslet, where half of one would blur several samples.
    """
    low, high = float(factors.min()), float(factors.max())
    used = lit(views.data)
    moves = 0.0
    for positions, seen, pitch in zip(
        (views.aperture.y, views.aperture.x), (used.any(1), used.any(0)), views.lenslets.pitch, strict=True
    ):
        moves = max(moves, float(np.abs(positions[seen]).max(initial=0.0)) / pitch)
    count = math.ceil((high - low) * moves / (_STEP / min(times, 2))) + 1
    if count > _MOST_PLANES:
        raise GeometryError(
            f"the refocus factors from {low:.4g} to {high:.4g} need {count} planes, above {_MOST_PLANES}. "
            "Check the map, or leave out what is far from the lenslets' plane (NaN)."
        )
    return np.linspace(low, high, max(count, 2)) if high > low else np.array([low])


def _blended(
    views: LightField,
    planes: np.ndarray,
    factors: np.ndarray,
    how: tuple[Interpolation, int],
    progress: Progress,
) -> Array:
    """Picture of the two planes next to each place's factor (y, x); `how`: interpolation and oversample."""
    place = (factors - planes[0]) / (planes[1] - planes[0]) if len(planes) > 1 else np.zeros(factors.shape)
    total, tail = None, len(views.data.shape) - 4
    for first in range(0, len(planes), _PLANES_AT_ONCE):
        part = planes[first : first + _PLANES_AT_ONCE]
        stack = refocus_stack(views, part, interpolation=how[0], oversample=how[1])
        for k in range(len(part)):
            term = weighted(stack[k, ...], np.clip(1 - np.abs(place - first - k), 0, 1), tail)
            total = term if total is None else total + term
        progress(min(first + _PLANES_AT_ONCE, len(planes)) / len(planes))
    return total
