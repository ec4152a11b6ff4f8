"""Plane sweep: agreement of the views if a place lies at each of many disparities.

Only the arms of a star of views about the middle one are used. What stands before a place hides it from the
views on one side, and a leaf before it from those on both; so the better half of the arms counts. Of a cross,
or of a row, the better half of each line does: arms along an edge say nothing, and would be the better ones.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import gaussian_filter, map_coordinates, median_filter, minimum_filter

from lumigraph.core import memory
from lumigraph.core.progress import Progress, silent
from lumigraph.depth.pictures import Pictures
from lumigraph.depth.shading import WINDOW, Shading, ShadingFit
from lumigraph.depth.visible import BEFORE
from lumigraph.depth.volume import box, cheapest, guided, rivals, semi_global
from lumigraph.errors import GeometryError

_STEP = 0.4  # between labels: how far a point moves in the outermost view [px]
_MOST_LABELS = 2000
_MOST_DIFFERENCE = 0.017  # of a picture from 0 to 1: more says only that the label is wrong
_FAR = 0.15  # part of a picture's width that a point may cross from the middle view to the outermost
_COARSE = 4
_RADIUS = 2  # px to each side whose costs are joined; 1 leaves islands on smooth ground
_MEDIANS = 3, 7  # places across
_BEHIND = 8  # px to each side where something farther is seen
_LIKELY = (
    0.8  # of the way to it, where both explain a place; fits *rosemary* and *kitchen*, much for *antinous*
)
_CROSS = 4  # arms, at most, that each stand for a line of their own
_ALONG = 1e-6  # px off a diagonal between samples
_BAND = 1 << 16  # values at a time, which stay in the processor's cache
_SLOW = 2.0  # px of the small pictures: what varies over more may be shading
_DISTANT = 0.5  # power of a view's distance by which it counts; of 0, 0.5, 1, 2 on *antinous* and *cotton*
_CLEAR = (
    0.01  # of a picture from 0 to 1: texture with more counts no more, lest plain walls count for nothing
)
_ENDS = 0.002, 0.998  # parts of the texture between which a sweep searches
_MODEST = 0.05  # preference for small movements where the views do not say


def labels(low: float, high: float) -> np.ndarray:
    """Movements in the outermost view (n,) [px] that are compared, two beyond each end."""
    count = math.ceil((high - low) / _STEP) + 1
    if count + 4 > _MOST_LABELS:
        raise GeometryError(
            f"disparities span {high - low:.4g} px in the outermost view, which takes {count} labels where "
            f"{_MOST_LABELS} are the most. Give a smaller range as disparities=(low, high)."
        )
    middle, half = (low + high) / 2, (count - 1) / 2 + 2
    return (middle + _STEP * np.linspace(-half, half, count + 4)).astype(np.float32)


@dataclass(frozen=True, slots=True)
class Swept:
    """First map of movements in the outermost view [px], and which others may be right.

    Parameters
    ----------
    moves
        (y, x), to a fraction of a label.
    rivals
        How far (y, x) other movements lie that explain a place as well; see `volume.rivals`.
    behind
        Error (y, x) to expect because a place may belong to what is seen behind; see `behind`.
    """

    moves: np.ndarray
    rivals: np.ndarray
    behind: np.ndarray


def swept(pictures: Pictures, moves: np.ndarray, shading: Shading, progress: Progress) -> Swept:
    """The map of the least costs, smoothed along the picture's edges and by semi-global matching.

    Raises
    ------
    LumigraphError
        The cost of all labels would not fit in memory.
    """
    shape = pictures.center.shape[1:]
    memory.require(
        4.5 * 4 * len(moves) * shape[0] * shape[1],
        f"the cost of {len(moves)} disparities for {shape[0]} x {shape[1]} places",
        "Give a range of disparities {factor:.1f}x narrower.",
    )
    most, step = max(_MOST_DIFFERENCE, 3 * pictures.noise), moves[1] - moves[0]
    guide = pictures.center.mean(0)
    cost = guided(costs(pictures, moves, most, progress, shading), guide, _RADIUS)
    total = semi_global(cost, guide, 0.2 * most, most)
    found = _settled(cost, moves, moves[0] + cheapest(total) * step, pictures.noise)
    return Swept(found, rivals(total, most) * step, behind(cost, moves, found, pictures.noise))


def behind(cost: np.ndarray, moves: np.ndarray, found: np.ndarray, noise: float) -> np.ndarray:
    """Error (y, x) to expect of places that may belong to what is seen behind them [px].

    A plain gap between leaves shows nothing of its own depth, and smoothing gives it that of the leaves.
    Where the farthest movement around explains a place nearly as well as its own, it may be right.

    Parameters
    ----------
    cost
        Of each movement (n,) at each place (n, y, x), before those beside it count.
    moves
        Movements (n,).
    found
        Map (y, x).
    noise
        Of the pictures: so little of a difference between costs is chance.
    """
    far = minimum_filter(found, 2 * _BEHIND + 1)
    dearer = _cost_at(cost, moves, far) - _cost_at(cost, moves, found)
    away = np.where(found - far > BEFORE, found - far, 0)
    return _LIKELY * away * np.exp(-np.maximum(dearer, 0) / np.float32(noise))


def _settled(cost: np.ndarray, moves: np.ndarray, found: np.ndarray, noise: float) -> np.ndarray:
    """A map (y, x) less the islands of a few places that fit no better than what is around them."""
    narrow, wide = (np.clip(median_filter(found, width), moves[0], moves[-1]) for width in _MEDIANS)
    better = _cost_at(cost, moves, wide) - _cost_at(cost, moves, narrow) > noise
    return np.where(better, narrow, wide).astype(np.float32)


def _cost_at(cost: np.ndarray, moves: np.ndarray, found: np.ndarray) -> np.ndarray:
    """Cost (y, x) of the label next to a movement (y, x)."""
    nearest = np.rint((found - moves[0]) / (moves[1] - moves[0])).astype(np.intp)
    return np.take_along_axis(cost, np.clip(nearest, 0, len(moves) - 1)[None], 0)[0]


def costs(
    pictures: Pictures, moves: np.ndarray, most: float, progress: Progress, shading: Shading | None = None
) -> np.ndarray:
    """Disagreement (n, y, x) of the star of views for each movement, at most 2 `most`."""
    pad = math.ceil(float(np.abs(moves).max())) + 2
    arms = _arms(pictures, shading or Shading.none(pictures.center.shape[1:]), pad)
    colours, count, width = pictures.center.shape
    out = np.empty((len(moves), count, width), np.float32)
    band = max(1, _BAND // (colours * width))
    for start in range(0, count, band):
        rows = slice(start, min(start + band, count))
        for k, move in enumerate(moves):
            out[k, rows] = _better([_disagreement(arm, float(move), most, rows) for arm in arms])
            progress((start + (rows.stop - start) * (k + 1) / len(moves)) / count)
    return out


@dataclass(frozen=True, slots=True)
class _View:
    """A view of an arm, and the middle view as bright as it is seen from there (c, y, x).

    `places` is where it stands along y and x; `data` goes on by `pad` px at its edges, and so does `seen`
    (y, x), which places are not cut off.
    """

    data: np.ndarray
    middle: np.ndarray
    places: tuple[float, float]
    pad: int
    seen: np.ndarray | None

    def difference(self, move: float, rows: slice, most: float) -> np.ndarray:
        """Difference (y, x) from rows of the middle view, to `most`, if all places move by `move`; linear."""
        corners = self._corners(move)
        (first, _), others = corners[0], corners[1:]
        start = self._read(self.data, first, rows)
        image = start - self.middle[:, rows]
        for corner, part in others:
            image += np.float32(part) * (self._read(self.data, corner, rows) - start)
        off = np.abs(image, out=image).mean(0) if len(image) > 1 else np.abs(image[0])
        np.minimum(off, np.float32(most), out=off)
        self._leave_outside(off, move, rows, most)
        return off

    def sees(self, move: float, rows: slice) -> np.ndarray | None:
        """Mask (y, x) of places of some rows that are not cut off if all move by `move`; None for all."""
        if self.seen is None:
            return None
        corners = (self._read(self.seen[None], corner, rows)[0] for corner, _ in self._corners(move))
        return np.logical_and.reduce(list(corners))

    def _corners(self, move: float) -> list[tuple[tuple[int, int], float]]:
        """Samples (y, x) that a movement falls between, and their parts: along a diagonal two."""
        (y, x), (down, right) = self.places, (math.floor(move * place) for place in self.places)
        ty, tx = move * y - down, move * x - right
        across = [(0, 0, (1 - ty) * (1 - tx)), (0, 1, (1 - ty) * tx), (1, 0, ty * (1 - tx)), (1, 1, ty * tx)]
        if abs(ty - tx) < _ALONG:
            across = [(0, 0, 1 - ty), (1, 1, ty)]
        elif abs(ty + tx - 1) < _ALONG:
            across = [(1, 0, ty), (0, 1, tx)]
        return [((down + i, right + j), part) for i, j, part in across if part > 0]

    def _read(self, data: np.ndarray, start: tuple[int, int], rows: slice) -> np.ndarray:
        y, x = rows.start + start[0] + self.pad, start[1] + self.pad
        return data[:, y : y + rows.stop - rows.start, x : x + self.middle.shape[2]]

    def _leave_outside(self, image: np.ndarray, move: float, rows: slice, most: float) -> None:
        """Write `most` where rows (y, x) are read beyond the view's edge if all places move by `move`."""
        down, right = (move * place for place in self.places)
        height, width = self.middle.shape[1:]
        image[: max(math.ceil(-down) - rows.start, 0)] = most
        image[max(height - max(math.ceil(down), 0) - rows.start, 0) :] = most
        image[:, : max(math.ceil(-right), 0)] = most
        image[:, max(width - max(math.ceil(right), 0), 0) :] = most


def _better(arms: list[np.ndarray | None]) -> np.ndarray:
    """Twice the mean (y, x) of the arms that differ least: half of a star's, one of each line's otherwise.

    Arms are in the order of `WAYS`, and None where there is none.
    """
    there = [arm for arm in arms if arm is not None]
    if len(there) > _CROSS:
        kept = np.partition(np.stack(there), len(there) // 2 - 1, axis=0)[: len(there) // 2]
        return kept.sum(0) * np.float32(2 / len(kept))
    lines = [[arm for arm in pair if arm is not None] for pair in zip(arms, arms[::-1], strict=True)]
    best = [np.minimum.reduce(line) for line in lines[: len(arms) // 2] if line]
    return np.sum(best, axis=0) * np.float32(2 / len(best))


def _arms(pictures: Pictures, shading: Shading, pad: int) -> list[list[_View]]:
    """Views in the eight ways from the middle one, opposite ones as far from the list's ends."""
    arms = [
        [_view(pictures, at, shading, pad) for at in along(pictures, way)]
        for way in np.ndindex(3, 3)
        if way != (1, 1)
    ]
    if not any(arms):
        raise GeometryError("only the middle view is lit: there is no parallax. Decode without a stop.")
    return arms


def along(pictures: Pictures, way: tuple[int, int]) -> list[tuple[int, int]]:
    """Lit views (v, u) from the middle one on, in a way of 0, 1 or 2 along v and u: back, none, on."""
    (v, u), (down, right) = pictures.middle, (step - 1 for step in way)
    out = []
    while 0 <= v + down < pictures.lit.shape[0] and 0 <= u + right < pictures.lit.shape[1]:
        v, u = v + down, u + right
        if pictures.lit[v, u]:
            out.append((v, u))
    return out


def _view(pictures: Pictures, which: tuple[int, int], shading: Shading, pad: int) -> _View:
    places = float(pictures.down[which[0]]), float(pictures.right[which[1]])
    wider = [(0, 0), (pad, pad), (pad, pad)]
    data = np.pad(pictures.data[which], wider, "edge")
    seen = None if pictures.seen is None else np.pad(pictures.seen[which], wider[1:], "edge")
    return _View(data, pictures.center + shading.at(*places), places, pad, seen)


def _disagreement(arm: list[_View], move: float, most: float, rows: slice) -> np.ndarray | None:
    """Mean over the views of an arm of how much they differ from rows of the middle one (y, x).

    Far views count more: in near ones a wrong place moves less, and differs less. Where all of them are cut
    off, as much as counts; None of an arm without views.
    """
    if not arm:
        return None
    total = np.float32(0)
    weights: np.ndarray | np.float32 = np.float32(0)
    for view in arm:
        sees, distant = view.sees(move, rows), np.float32(max(map(abs, view.places)) ** _DISTANT)
        weight = distant if sees is None else distant * sees
        total = total + weight * view.difference(move, rows, most)
        weights = weights + weight
    if np.ndim(weights) == 0:
        return np.asarray(total / weights)
    return np.where(weights == 0, np.float32(most), total / np.where(weights == 0, 1, weights))


def farthest(pictures: Pictures) -> float:
    """Most movement in the outermost view [px] that a lens camera could show."""
    return max(2.0, _FAR * max(pictures.center.shape[1:]))


def span(pictures: Pictures) -> tuple[tuple[float, float], Shading]:
    """Least and most movement in the outermost view [px] that the picture shows, with some to spare; shading.

    Sweeps of pictures `_COARSE` times smaller over all that a lens camera could show: of their texture first,
    which shading does not touch, then, with the shading so found, of all that they show.
    """
    size = _COARSE if min(pictures.center.shape[1:]) >= 16 * _COARSE else 1
    small, most = _shrunk(pictures, size), farthest(pictures)
    moves = np.arange(-most, most + 0.5, 0.5).astype(np.float32) / np.float32(size)
    limit = 3 * max(_MOST_DIFFERENCE, 3 * pictures.noise / size)
    radius = max(1, WINDOW // size)
    guide = small.center.mean(0)
    shading, texture = Shading.none(guide.shape), guide
    for grounds in (_textures(small), small):
        cost = guided(costs(grounds, moves, limit, silent, shading if grounds is small else None), guide, 2)
        if grounds is small:
            texture = np.maximum(np.median(cost, axis=0) - cost.min(0) - 2 * pictures.noise / size, 0)
        cost += (_MODEST * limit * np.abs(moves) / moves[-1])[:, None, None]
        best = cheapest(semi_global(cost, guide, 0.1 * limit, limit))
        found = moves[0] + best * (moves[1] - moves[0])
        shading = _shading(small, found.astype(np.float32), radius, limit)
    low, high = _quantiles(found * size, np.minimum(texture, _CLEAR) ** 2, _ENDS)
    spare = 0.1 * (high - low) + 2 * _STEP
    return (low - spare, high + spare), _enlarged(shading, pictures.center.shape[1:])


def _textures(pictures: Pictures) -> Pictures:
    """The pictures less what varies slowly over them."""
    slow = gaussian_filter(pictures.data, (0, 0, 0, _SLOW, _SLOW))
    return replace(pictures, data=pictures.data - slow)


def _shading(pictures: Pictures, moves: np.ndarray, radius: int, most: float) -> Shading:
    """Shading of the cross of views against the middle one, with places moved by `moves`."""
    fit = ShadingFit(moves.shape, pictures.noise)
    grey, (v, u) = pictures.data.mean(2), pictures.middle
    slope = np.gradient(grey[v, u])
    places = np.meshgrid(*(np.arange(n, dtype=np.float32) for n in moves.shape), indexing="ij")
    for k, m in np.argwhere(pictures.lit):
        if (k, m) == (v, u):
            continue
        down, right = float(pictures.down[k]), float(pictures.right[m])
        at = [places[0] + moves * np.float32(down), places[1] + moves * np.float32(right)]
        residual = map_coordinates(grey[k, m], at, order=1, mode="nearest") - grey[v, u]
        inside = pictures.sees((int(k), int(m)), at)
        gradient = np.float32(down) * slope[0] + np.float32(right) * slope[1]
        fit.add(residual, inside / (1 + (residual / most) ** 2) ** 2, gradient, down, right)
    return fit.solved(radius)


def _enlarged(shading: Shading, shape: tuple[int, ...]) -> Shading:
    return Shading(*(_resized(part, shape) for part in (shading.down, shading.right)))


def _resized(part: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    size = shape[0] // part.shape[0]
    at = [
        np.clip((np.arange(n, dtype=np.float32) + 0.5) / size - 0.5, 0, m - 1)
        for n, m in zip(shape, part.shape, strict=True)
    ]
    return map_coordinates(part, np.meshgrid(*at, indexing="ij"), order=1, mode="nearest")


def _shrunk(pictures: Pictures, size: int) -> Pictures:
    ny, nx = (n // size for n in pictures.center.shape[1:])
    data = pictures.data[..., : ny * size, : nx * size]
    data = data.reshape(*data.shape[:3], ny, size, nx, size).mean((4, 6))
    seen = pictures.seen
    if seen is not None:
        seen = seen[..., : ny * size, : nx * size].reshape(*seen.shape[:2], ny, size, nx, size).all((3, 5))
    return replace(pictures, data=data, seen=seen)


def _quantiles(values: np.ndarray, weights: np.ndarray, parts: tuple[float, float]) -> tuple[float, float]:
    weights = box(weights, 1).ravel() + 1e-12
    order = np.argsort(values, axis=None)
    sums = np.cumsum(weights[order], dtype=float)
    places = np.searchsorted(sums, np.array(parts) * sums[-1])
    low, high = values.ravel()[order][np.clip(places, 0, len(order) - 1)]
    return float(low), float(high)
