"""Refocused pictures: shear the light field and sum over the aperture."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lumigraph.core import checks, memory
from lumigraph.core.arrays import Array, like, namespace
from lumigraph.core.lightfield import LightField
from lumigraph.errors import GeometryError
from lumigraph.rendering.geometry import lit
from lumigraph.rendering.interpolate import Interpolation, as_float, check_interpolation, taps, weighted

_PAD = 2  # samples repeated at every edge, so that the taps of a position on the edge exist


def refocus(
    views: LightField, alpha: float, *, interpolation: Interpolation = "cubic", oversample: int = 1
) -> Array:
    r"""Picture (t, s[, c]) focused on the plane whose image lies at F' = F / alpha behind the main lens.

    .. math:: E(x) = \frac{1}{N} \sum_u L(x + u (1 - \alpha'), u), \qquad \alpha' = F / F'

    which is L(α'x' + u(1 - α'), u) for x = α'x': sample n of the picture lies at x' = x_n / α' on the plane,
    so that all pictures of a stack have the same size and an object keeps its place while it goes out of
    focus. The mean runs over the views that see a place, without those that are dark everywhere (outside a
    round aperture): pictures have no dark frame. alpha = 1 keeps the
    plane of the lenslets; alpha below 1 is farther from the main lens, an object nearer to the camera.

    Parameters
    ----------
    views
        Decoded light field.
    alpha
        F / F', above 0.
    interpolation
        "cubic" or "linear", between lenslets.
    oversample
        Samples per lenslet: views seen from different places fall between each other's lenslets, so a finer
        picture holds more detail where the plane is not that of the lenslets. The first and last samples
        stay on the first and last lenslet: ((nt - 1) k + 1, (ns - 1) k + 1).

    Raises
    ------
    GeometryError
        alpha is not above 0 or moves every view out of the picture; oversample is below 1.
    LumigraphError
        It would not fit in memory.

    References
    ----------
    Ng et al., "Light field photography with a hand-held plenoptic camera", Stanford CTSR 2005-02, with the
    shear written for alpha' = F / F' as in the thesis' equation 4.7 (its 4.10 moves the focus the wrong way).
    """
    checks.positive("alpha", alpha, "1")
    return refocus_stack(views, [alpha], interpolation=interpolation, oversample=oversample)[0, ...]


def refocus_stack(
    views: LightField,
    alphas: Sequence[float] | np.ndarray,
    *,
    interpolation: Interpolation = "cubic",
    oversample: int = 1,
) -> Array:
    """Pictures (n, t, s[, c]) focused on one plane for each alpha; see `refocus`."""
    checks.instance("views", views, LightField)
    check_interpolation(interpolation)
    if not isinstance(alphas, Sequence | np.ndarray) or np.ndim(alphas) != 1:
        raise GeometryError(f"alphas is {alphas!r} but must be a list of numbers such as 1.0.")
    alphas = [checks.positive("alpha", alpha, "1") for alpha in alphas]
    if not alphas:
        raise GeometryError(
            "alphas is empty but a stack needs at least one. Give a list of numbers such as 1.0."
        )
    checks.shape("oversample", (oversample, oversample))
    _check_memory(views, len(alphas), oversample)
    data, xp = as_float(views.data), namespace(views.data)
    light = _Light(_padded(data), lit(data), views, interpolation)
    return xp.stack([_refocused(light, alpha, oversample) for alpha in alphas])


@dataclass(frozen=True, slots=True)
class _Light:
    """What all pictures of a stack share: the padded light field, and which views count."""

    data: Array
    lit: np.ndarray
    views: LightField
    interpolation: Interpolation


def shifts(views: LightField, alpha: float) -> tuple[np.ndarray, np.ndarray]:
    """How far each view is moved along t (nv,) and s (nu,) [lenslets] to focus on alpha."""
    grids = views.aperture, views.lenslets
    return (
        grids[0].y * (1 - alpha) / grids[1].pitch[0],
        grids[0].x * (1 - alpha) / grids[1].pitch[1],
    )


def _padded(data: Array) -> Array:
    """Light field (v, u, t, s[, c]) with its edges repeated along t and s."""
    xp = namespace(data)
    for axis in (2, 3):
        first = data[:, :, :1, ...] if axis == 2 else data[:, :, :, :1, ...]
        last = data[:, :, -1:, ...] if axis == 2 else data[:, :, :, -1:, ...]
        data = xp.concat([first] * _PAD + [data] + [last] * _PAD, axis=axis)
    return data


def _refocused(light: _Light, alpha: float, times: int) -> Array:
    """One picture, by phases: sample m of `times` per lenslet is a picture moved by m / times."""
    down, right = shifts(light.views, alpha)
    if times == 1:
        return _mean(light, down, right)
    xp, (nt, ns) = namespace(light.data), light.views.lenslets.shape
    steps = np.arange(times) / times
    phases = [xp.stack([_mean(light, down + y, right + x) for x in steps], axis=2) for y in steps]
    fine = xp.reshape(xp.stack(phases, axis=1), (nt * times, ns * times, *light.data.shape[4:]))
    return fine[: (nt - 1) * times + 1, : (ns - 1) * times + 1, ...]


def _mean(light: _Light, down: np.ndarray, right: np.ndarray) -> Array:
    """Mean over the views (v, u) of a padded light field, moved along t and s."""
    data, (nt, ns), tail = light.data, light.views.lenslets.shape, tuple(light.data.shape[4:])
    rows = like(np.zeros((data.shape[0], nt + 2 * _PAD, ns, *tail)), data)
    seen_t, seen_s = np.zeros((nt, len(down))), np.zeros((len(right), ns))
    for u, move in enumerate(right):
        span, pieces = _pieces(float(move), ns, light.interpolation)
        for first, weight in pieces:
            rows[:, :, span, ...] += weight * data[:, u, :, first : first + span.stop - span.start, ...]
        seen_s[u, span] = 1
    picture = like(np.zeros((nt, ns, *tail)), data)
    for v, move in enumerate(down):
        span, pieces = _pieces(float(move), nt, light.interpolation)
        for first, weight in pieces:
            picture[span, ...] += weight * rows[v, first : first + span.stop - span.start, ...]
        seen_t[span, v] = 1
    seen = seen_t @ light.lit @ seen_s
    return weighted(picture, np.where(seen > 0, 1 / np.maximum(seen, 1), 0), len(tail))


def _span(move: float, count: int) -> slice:
    """Samples of the picture that a view moved by `move` covers: up to half a lenslet beyond its last one."""
    slack = 1e-9
    low, high = math.ceil(-0.5 - move - slack), math.floor(count - 0.5 - move + slack) + 1
    return slice(min(max(low, 0), count), max(min(high, count), 0))


def _pieces(move: float, count: int, interpolation: Interpolation) -> tuple[slice, list[tuple[int, float]]]:
    """Samples that a view moved by `move` covers; of each tap, its first padded sample and its weight."""
    span = _span(move, count)
    if span.start >= span.stop:
        return slice(0, 0), []
    nearest = round(move)
    move = nearest if abs(move - nearest) < 1e-9 else move
    below = math.floor(move)
    weights = [(step, float(weight)) for step, weight in taps(np.array(move - below), interpolation)]
    return span, [(span.start + below + step + _PAD, weight) for step, weight in weights if weight != 0]


def _check_memory(views: LightField, count: int, oversample: int) -> None:
    itemsize = 8 if "64" in str(views.data.dtype) else 4
    picture = math.prod(views.data.shape[2:]) * oversample**2 * itemsize
    size = 2.5 * math.prod(views.data.shape) * itemsize + (count + 3) * picture
    memory.require(
        size,
        f"a stack of {count} pictures, {oversample} samples per lenslet",
        "Refocus {factor:.1f}x fewer at a time.",
    )
