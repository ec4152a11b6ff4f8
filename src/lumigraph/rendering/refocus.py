"""Refocused pictures: shear the light field and sum over the aperture."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.linalg import get_blas_funcs
from scipy.ndimage import distance_transform_edt

from lumigraph.core import checks, memory
from lumigraph.core.arrays import A, Array, is_complex, is_numpy, like, namespace, to_numpy
from lumigraph.core.lightfield import LightField
from lumigraph.core.progress import Progress, part
from lumigraph.errors import GeometryError
from lumigraph.rendering.detail import chosen
from lumigraph.rendering.geometry import lit
from lumigraph.rendering.interpolate import Interpolation, as_float, check_interpolation, take, taps, weighted
from lumigraph.rendering.tilted import Tilt, check_tilt, tilted_sums
from lumigraph.rendering.views import reduce_aperture

_BLOCK = 10_000  # values summed at a time: they stay in the cache, and BLAS keeps to one thread
_LEAST_VALID = 0.3  # of the light that would be seen without the mask of valid samples
_LEAST_SEEN = 0.05  # of one view; places that less light reaches stay dark


def refocus(
    views: LightField[A],
    alpha: float,
    *,
    aperture: float = 1.0,
    interpolation: Interpolation = "cubic",
    oversample: int | None = None,
    tilt: Tilt = (0.0, 0.0),
) -> A:
    r"""Picture (t, s[, c]) focused on the plane whose image lies at F' = F / alpha behind the main lens.

    .. math:: E(x) = \frac{1}{N} \sum_u L(x + u (1 - \alpha'), u), \qquad \alpha' = F / F'

    which is L(α'x' + u(1 - α'), u) for x = α'x': sample n of the picture lies at x' = x_n / α' on the plane,
    so that all pictures of a stack have the same size and an object keeps its place while it goes out of
    focus. The mean runs over the views that see a place, without those that are dark everywhere (outside a
    round aperture) and without invalid samples: pictures have no dark frame. alpha = 1 keeps the
    plane of the lenslets; alpha below 1 is farther from the main lens, an object nearer to the camera.

    Parameters
    ----------
    views
        Decoded light field.
    alpha
        F / F', above 0.
    aperture
        Width of the aperture that is used, relative to all of it: smaller is sharper in depth, and noisier;
        see `reduce_aperture` for other shapes.
    interpolation
        "cubic", "linear" or "band_limited", between lenslets.
    oversample
        Samples per lenslet: views seen from different places fall between each other's lenslets, so a finer
        picture holds more detail where the plane is not that of the lenslets. The first and last samples
        stay on the first and last lenslet: ((nt - 1) k + 1, (ns - 1) k + 1). If left out, a power of two, at
        most 8, that gives the picture 200 pixels along its longer side (`lumigraph.rendering.detail`); 1
        gives one sample per lenslet.
    tilt
        Focus on a plane that leans (focal tilt): alpha in the last row less the first row's, and in the last
        column less the first column's; `alpha` itself holds in the middle of the picture.

    Raises
    ------
    GeometryError
        alpha is not above 0 or moves every view out of the picture; oversample is below 1; so much tilt that
        alpha is not above 0 everywhere or that views fold over.
    LumigraphError
        It would not fit in memory.

    References
    ----------
    Ng et al., "Light field photography with a hand-held plenoptic camera", Stanford CTSR 2005-02, with the
    shear written for alpha' = F / F' as in the thesis' equation 4.7 (its 4.10 moves the focus the wrong way).
    """
    checks.positive("alpha", alpha, "1")
    found = refocus_stack(
        views, [alpha], aperture=aperture, interpolation=interpolation, oversample=oversample, tilt=tilt
    )
    return found[0, ...]


def refocus_stack(
    views: LightField[A],
    alphas: Sequence[float] | np.ndarray,
    *,
    aperture: float = 1.0,
    interpolation: Interpolation = "cubic",
    oversample: int | None = None,
    tilt: Tilt = (0.0, 0.0),
    progress: Progress | None = None,
) -> A:
    """Pictures (n, t, s[, c]) focused on one plane for each alpha; see `refocus`.

    Views are summed along u first, then along v, and all planes of the stack take from a piece of the light
    field while it is in the processor's cache: 4 + 4/nu multiplications for each plane and sample.

    Parameters
    ----------
    views, aperture, interpolation, oversample, tilt
        As for `refocus`.
    alphas
        F / F' of each picture, above 0.
    progress
        Called as ``progress(fraction)``.
    """
    checks.instance("views", views, LightField)
    check_interpolation(interpolation)
    if aperture != 1:
        views = reduce_aperture(views, aperture)
    if not isinstance(alphas, Sequence | np.ndarray) or np.ndim(alphas) != 1:
        raise GeometryError(f"alphas is {alphas!r} but must be a list of numbers such as 1.0.")
    alphas = [checks.positive("alpha", alpha, "1") for alpha in alphas]
    if not alphas:
        raise GeometryError(
            "alphas is empty but a stack needs at least one. Give a list of numbers such as 1.0."
        )
    oversample = chosen(views, oversample)
    _check_memory(views, len(alphas), oversample)
    open_views = lit(views.data)
    if any(tilt := check_tilt(tilt, alphas)):
        how, count = (oversample, interpolation), len(alphas)
        return namespace(views.data).stack([
            _tilted(views, open_views, alpha, tilt, how, part(progress, k, count))
            for k, alpha in enumerate(alphas)
        ])  # fmt: skip
    planes = [_Plane.of(views, alpha, oversample, interpolation) for alpha in alphas]
    if views.valid is None:
        total, seen = _sheared(views.data, open_views, planes, progress), None
    else:
        valid = like(np.asarray(to_numpy(views.valid), float), as_float(views.data[:1, :1, ...]))
        tail = (1,) * (len(views.data.shape) - 4)
        weights = namespace(valid).reshape(valid, (*views.data.shape[:4], *tail))
        total = _sheared(as_float(views.data) * weights, open_views, planes, progress)
        seen = to_numpy(_sheared(valid, open_views, planes, None))
    xp, tail, pictures = namespace(views.data), len(views.data.shape) - 4, []
    for k, plane in enumerate(planes):
        share = plane.seen(open_views)
        if seen is None:
            pictures.append(weighted(total[k, ...], _inverse(share), tail))
        else:
            picture = weighted(total[k, ...], _inverse(seen[k]), tail)
            pictures.append(_closed(picture, seen[k] > _LEAST_VALID * share))
    return xp.stack(pictures)


def _tilted(
    views: LightField,
    open_views: np.ndarray,
    alpha: float,
    tilt: Tilt,
    how: tuple[int, Interpolation],
    progress: Progress,
) -> Array:
    """Picture (t, s[, c]) focused on a plane that leans."""
    total, seen, share = tilted_sums(views, open_views, alpha, tilt, how, progress)
    picture = weighted(total, _inverse(seen), len(views.data.shape) - 4)
    return picture if views.valid is None else _closed(picture, seen > _LEAST_VALID * share)


def shifts(views: LightField, alpha: float) -> tuple[np.ndarray, np.ndarray]:
    """Shifts of each view along t (nv,) and s (nu,) [lenslets] to focus on alpha."""
    grids = views.aperture, views.lenslets
    return (
        grids[0].y * (1 - alpha) / grids[1].pitch[0],
        grids[0].x * (1 - alpha) / grids[1].pitch[1],
    )


def _closed(picture: Array, known: np.ndarray) -> Array:
    """Picture (t, s[, c]) whose unknown places, which hardly a valid sample shows, take the nearest known."""
    if known.all() or not known.any():
        return picture
    nearest = np.asarray(distance_transform_edt(~known, return_distances=False, return_indices=True))
    flat = namespace(picture).reshape(picture, (known.size, *picture.shape[2:]))
    index = np.ravel_multi_index((nearest[0], nearest[1]), known.shape)
    return namespace(picture).reshape(take(flat, index.ravel(), 0), tuple(picture.shape))


def _inverse(seen: np.ndarray) -> np.ndarray:
    """One over the views that see each place; 0 where hardly one does."""
    return np.where(seen > _LEAST_SEEN, 1 / np.maximum(seen, _LEAST_SEEN), 0)


_Taps = list[tuple[int, float]]
"""Offset of a neighbour in samples, and its weight."""


@dataclass(frozen=True, slots=True)
class _Axis:
    """One axis of one picture: the taps of every view for each of the samples between two lenslets."""

    taps: list[list[_Taps]]  # by phase, by view
    count: int  # lenslets

    @classmethod
    def of(cls, moves: np.ndarray, count: int, oversample: int, interpolation: Interpolation) -> "_Axis":
        phases = np.arange(oversample) / oversample
        return cls([[_taps(m + phase, count, interpolation) for m in moves] for phase in phases], count)

    @property
    def reach(self) -> int:
        return max((abs(step) for phase in self.taps for view in phase for step, _ in view), default=0)

    def seen(self) -> np.ndarray:
        """Weight of every view at every sample (views, samples)."""
        times = len(self.taps)
        result = np.zeros((len(self.taps[0]), self.count * times))
        places = np.arange(self.count)
        for phase, views in enumerate(self.taps):
            for view, found in enumerate(views):
                for step, weight in found:
                    inside = (places + step >= 0) & (places + step < self.count)
                    result[view, phase::times] += weight * inside
        return result[:, : (self.count - 1) * times + 1]


@dataclass(frozen=True, slots=True)
class _Plane:
    """Shifts of views for one picture: along t and along s."""

    t: _Axis
    s: _Axis

    @classmethod
    def of(cls, views: LightField, alpha: float, oversample: int, interpolation: Interpolation) -> "_Plane":
        down, right = shifts(views, alpha)
        nt, ns = views.lenslets.shape
        return cls(
            _Axis.of(down, nt, oversample, interpolation), _Axis.of(right, ns, oversample, interpolation)
        )

    def seen(self, open_views: np.ndarray) -> np.ndarray:
        """Number of views that see each place of the picture (t, s)."""
        return self.t.seen().T @ open_views @ self.s.seen()


def _taps(move: float, count: int, interpolation: Interpolation) -> _Taps:
    """Taps of a view moved by `move`; those that nowhere fall into the picture are left out."""
    nearest = round(move)
    move = nearest if abs(move - nearest) < 1e-9 else move
    below = math.floor(move)
    found = [(below + step, float(weight)) for step, weight in taps(np.array(move - below), interpolation)]
    return [(step, weight) for step, weight in found if weight != 0 and abs(step) < count]


def _sheared(data: Array, open_views: np.ndarray, planes: list[_Plane], progress: Progress | None) -> Array:
    """Sums (n, t, s[, c]) of the moved views (v, u, t, s[, c]) for each plane, not yet divided."""
    xp = namespace(data)
    (nv, _, nt, ns), tail = data.shape[:4], tuple(data.shape[4:])
    colours = math.prod(tail)
    # Zeros between the rows: a row moved by up to `gap` samples never runs into the next one.
    gap = max(plane.s.reach for plane in planes)
    width = (ns + gap) * colours
    times = len(planes[0].s.taps)
    sample = _summable(data[:1, :1, :1, :1, ...])
    pictures = [[[_zeros((nt * width,), sample) for _ in range(times)] for _ in range(times)] for _ in planes]
    add = _adder(sample)
    rows = max(1, _BLOCK // width) if is_numpy(data) else nt
    for v in range(nv):
        used = [int(u) for u in np.flatnonzero(open_views[v])]
        for top in range(0, nt if used else 0, rows):
            block = _flat_rows(data[v, :, top : top + rows, ...], used, gap)
            for plane, picture in zip(planes, pictures, strict=True):
                for px, by_view in enumerate(plane.s.taps):
                    line = _moved(block, [by_view[u] for u in used], colours, add)
                    for py, by_row in enumerate(plane.t.taps):
                        for step, weight in by_row[v]:
                            add(picture[py][px], line, (top - step) * width, weight)
        if progress is not None:
            progress((v + 1) / nv)
    return xp.stack([_interleaved(picture, (nt, ns, gap), tail) for picture in pictures])


def _summable(data: Array) -> Array:
    """Data as BLAS sums it, in place: real or complex, single or double precision, this machine's bytes."""
    data = as_float(data)
    dtype = _zeros((1,), data).dtype
    return data if data.dtype == dtype else namespace(data).astype(data, dtype)


def _zeros(shape: tuple[int, ...], sample: Array) -> Array:
    return like(np.zeros(shape, complex if is_complex(sample) else float), sample)


def _flat_rows(part: Array, used: list[int], gap: int) -> list[Array]:
    """Rows (u, t, s[, c]) of views as one line of values for each u, with `gap` zeros after each row."""
    xp = namespace(part)
    shape = (part.shape[1], gap, *part.shape[3:])
    lines = []
    for u in used:
        rows = _summable(part[u, ...])
        padded = xp.concat([rows, _zeros(shape, rows)], axis=1)
        lines.append(xp.reshape(padded, (-1,)))
    return lines


def _moved(block: list[Array], views: list[_Taps], colours: int, add: "_Add") -> Array:
    """Sum of the lines of all views, each moved by its taps."""
    total = namespace(block[0]).zeros_like(block[0])
    for line, found in zip(block, views, strict=True):
        for step, weight in found:
            add(total, line, -step * colours, weight)
    return total


_Add = Callable[[Array, Array, int, float], None]


def _adder(sample: Array) -> _Add:
    """Function of (total, line, first, weight): total[first + k] += weight * line[k] where that exists.

    A stack calls it 600,000 times: on NumPy arrays it is one BLAS call, which takes a microsecond.
    """
    # Of the data's own type: f2py would add to a copy of a total of another one.
    axpy: Any = get_blas_funcs("axpy", dtype=sample.dtype) if is_numpy(sample) else None

    def add_numpy(total: Array, line: Array, first: int, weight: float) -> None:
        if first >= 0:
            count = min(len(line), len(total) - first)
            if count > 0:
                axpy(line, total, count, weight, 0, 1, first)
        elif first > -len(line):
            axpy(line, total, min(len(line) + first, len(total)), weight, -first)

    def add(total: Array, line: Array, first: int, weight: float) -> None:
        skipped = max(0, -first)
        count = min(line.shape[0] - skipped, total.shape[0] - first - skipped)
        if count > 0:
            total[first + skipped : first + skipped + count] += weight * line[skipped : skipped + count]

    return add_numpy if is_numpy(sample) else add


def _interleaved(picture: list[list[Array]], shape: tuple[int, int, int], tail: tuple[int, ...]) -> Array:
    """One picture (t, s[, c]) of the lines for each phase (py, px), without the zeros between rows."""
    (nt, ns, gap), xp, times = shape, namespace(picture[0][0]), len(picture)
    parts = [[xp.reshape(p, (nt, ns + gap, *tail))[:, :ns, ...] for p in row] for row in picture]
    if times == 1:
        return parts[0][0]
    fine = xp.stack([xp.stack(row, axis=2) for row in parts], axis=1)
    fine = xp.reshape(fine, (nt * times, ns * times, *tail))
    return fine[: (nt - 1) * times + 1, : (ns - 1) * times + 1, ...]


def _check_memory(views: LightField, count: int, oversample: int) -> None:
    itemsize = to_numpy(_summable(views.data[:1, :1, :1, :1, ...])).itemsize
    picture = math.prod(views.data.shape[2:]) * oversample**2 * itemsize
    size = 1.2 * math.prod(views.data.shape[1:]) * itemsize + (3 * count + 3) * picture
    memory.require(
        size,
        f"a stack of {count} pictures, {oversample} samples per lenslet",
        "Refocus {factor:.1f}x fewer at a time.",
    )
