"""Plane sweep: agreement of the views if a place lies at each of many disparities.

Only the cross of views through the middle one is used: each is moved along one axis only. What stands before
a place hides it from the views of one side; so the better of the left and the right half counts, and the
better of the upper and the lower.

Near views move little between labels, and may mislead, as on glass and polished steel. So the outermost
views are also swept alone; `lines` refines both maps, and each place takes the one that the views agree with.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import gaussian_filter, map_coordinates, median_filter

from lumigraph.core import memory
from lumigraph.core.progress import Progress, silent, within
from lumigraph.depth.pictures import Pictures
from lumigraph.depth.shading import WINDOW, Shading, ShadingFit
from lumigraph.depth.volume import box, cheapest, guided, rivals, semi_global
from lumigraph.errors import GeometryError

_STEP = 0.4  # between labels: how far a point moves in the outermost view [px]
_MOST_LABELS = 2000
_MOST_DIFFERENCE = 0.017  # of a picture from 0 to 1: more says only that the label is wrong
_FAR = 0.15  # part of a picture's width that a point may cross from the middle view to the outermost
_COARSE = 4
_BAND = 1 << 16  # values at a time, which stay in the processor's cache
_SLOW = 2.0  # px of the small pictures: what varies over more may be shading
_DISTANT = 0.5  # power of a view's distance by which it counts; of 0, 0.5, 1, 2 on *antinous* and *cotton*
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


def swept(
    pictures: Pictures, moves: np.ndarray, shading: Shading, progress: Progress
) -> tuple[list[np.ndarray], np.ndarray]:
    """Movements (y, x) of places in the outermost view [px], to a fraction of a label, and their `rivals`.

    One map by all views of the cross, and where it has others than the outermost, one by these alone.

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
    ends = outermost(pictures)
    share = 1.0 if ends is None else 0.7
    total = _matched(pictures, moves, most, shading, within(progress, 0, share))
    found, others = [_cheapest(total, moves)], rivals(total, most) * step
    del total
    if ends is not None:
        second = _matched(ends, moves, most, shading, within(progress, share, 1))
        found.append(_cheapest(second, moves))
    return found, others


def _matched(
    pictures: Pictures, moves: np.ndarray, most: float, shading: Shading, progress: Progress
) -> np.ndarray:
    """Costs (n, y, x) of the movements, smoothed along the picture's edges and by semi-global matching."""
    guide = pictures.center.mean(0)
    cost = guided(costs(pictures, moves, most, progress, shading), guide, 3)
    return semi_global(cost, guide, 0.2 * most, most)


def _cheapest(total: np.ndarray, moves: np.ndarray) -> np.ndarray:
    """Movements (y, x) of the least cost, less those of single places."""
    found = median_filter(moves[0] + cheapest(total) * (moves[1] - moves[0]), 5)
    return np.clip(found, moves[0], moves[-1]).astype(np.float32)


def outermost(pictures: Pictures) -> Pictures | None:
    """The same with only the outermost lit views of the cross's arms; None where there are no others."""
    v, u = pictures.middle
    lit, cross = np.zeros_like(pictures.lit), np.zeros_like(pictures.lit)
    cross[v], cross[:, u] = pictures.lit[v], pictures.lit[:, u]
    for row, column in (np.nonzero(cross[:, u])[0][[0, -1]], u), (v, np.nonzero(cross[v])[0][[0, -1]]):
        lit[row, column] = True
    lit[v, u] = True
    return replace(pictures, lit=lit) if cross.sum() > lit.sum() else None


def costs(
    pictures: Pictures, moves: np.ndarray, most: float, progress: Progress, shading: Shading | None = None
) -> np.ndarray:
    """Disagreement (n, y, x) of the cross of views for each movement, at most 2 `most`."""
    pad = math.ceil(float(np.abs(moves).max())) + 1
    halves = _halves(pictures, shading or Shading.none(pictures.center.shape[1:]), pad)
    colours, count, width = pictures.center.shape
    out = np.zeros((len(moves), count, width), np.float32)
    band = max(1, _BAND // (colours * width))
    room = np.empty((colours, band, width), np.float32), np.empty((band, width), np.float32)
    for start in range(0, count, band):
        rows = slice(start, min(start + band, count))
        here = room[0][:, : rows.stop - start], room[1][: rows.stop - start]
        for k, move in enumerate(moves):
            for sides in halves:
                means = [_disagreement(side, float(move), most, (rows, *here)) for side in sides]
                out[k, rows] += np.minimum(*means) if len(means) == 2 else means[0]
            progress((start + (rows.stop - start) * (k + 1) / len(moves)) / count)
    return out


@dataclass(frozen=True, slots=True)
class _View:
    """A view of the cross, and the middle view as bright as it is seen from there (c, y, x).

    `place` is where it stands along `axis` of its array; `data` goes on by `pad` px at its edges, and so do
    its steps `slope` from each sample to the next, and `seen` (y, x), which places are not cut off.
    """

    data: np.ndarray
    slope: np.ndarray
    middle: np.ndarray
    place: float
    axis: int
    pad: int
    seen: np.ndarray | None

    def difference(self, move: float, rows: slice, out: np.ndarray) -> np.ndarray:
        """Difference from rows of the middle view (c, y, x) if all places move by `move`, linearly."""
        below = math.floor(move * self.place)
        part = np.float32(move * self.place - below)
        np.multiply(self._read(self.slope, below, rows), part, out=out)
        out += self._read(self.data, below, rows)
        out -= self.middle[:, rows]
        return np.abs(out, out=out)

    def sees(self, move: float, rows: slice) -> np.ndarray | None:
        """Mask (y, x) of places of some rows that are not cut off if all move by `move`; None for all."""
        if self.seen is None:
            return None
        below = math.floor(move * self.place)
        first, second = (self._read(self.seen[None], below + k, rows) for k in (0, 1))
        return (first & second)[0]

    def _read(self, data: np.ndarray, start: int, rows: slice) -> np.ndarray:
        start += self.pad
        if self.axis == 1:
            return data[:, start + rows.start : start + rows.stop]
        return data[:, rows, start : start + self.middle.shape[2]]

    def outside(self, image: np.ndarray, move: float, rows: slice) -> np.ndarray:
        """The part of rows (y, x) that is read beyond the view's edge if all places move by `move`."""
        far = move * self.place
        if self.axis == 2:
            return (
                image[:, : math.ceil(-far)]
                if far < 0
                else image[:, max(image.shape[1] - math.ceil(far), 0) :]
            )
        last = self.middle.shape[1] - math.ceil(far)
        return (
            image[: max(math.ceil(-far) - rows.start, 0)] if far < 0 else image[max(last - rows.start, 0) :]
        )


def _halves(pictures: Pictures, shading: Shading, pad: int) -> list[list[list[_View]]]:
    """Views on both sides of the middle, for each axis."""
    v, u = pictures.middle
    arms = [
        [
            _view(pictures, (int(k), u), (pictures.down[k], 1), shading, pad)
            for k in np.flatnonzero(pictures.lit[:, u])
        ],
        [
            _view(pictures, (v, int(k)), (pictures.right[k], 2), shading, pad)
            for k in np.flatnonzero(pictures.lit[v])
        ],
    ]
    halves = [[[one for one in arm if side * one.place > 0] for side in (-1, 1)] for arm in arms]
    kept = [[side for side in arm if side] for arm in halves]
    if not any(kept):
        raise GeometryError("only the middle view is lit: there is no parallax. Decode without a stop.")
    return [arm for arm in kept if arm]


def _view(
    pictures: Pictures, which: tuple[int, int], stands: tuple[float, int], shading: Shading, pad: int
) -> _View:
    place, axis = float(stands[0]), stands[1]
    wider = [(pad, pad) if k == axis else (0, 0) for k in range(3)]
    data = np.pad(pictures.data[which], wider, "edge")
    seen = None if pictures.seen is None else np.pad(pictures.seen[which], wider[1:], "edge")
    gloss = shading.at(place, 0.0) if axis == 1 else shading.at(0.0, place)
    slope = np.diff(data, axis=axis, append=data.take([-1], axis))
    return _View(data, slope, pictures.center + gloss, place, axis, pad, seen)


def _disagreement(
    side: list[_View], move: float, most: float, room: tuple[slice, np.ndarray, np.ndarray]
) -> np.ndarray:
    """Mean over the views of one side of how much they differ from rows of the middle one (y, x).

    Far views count more: in near ones a wrong place moves less, and differs less. Where all of them are cut
    off, as much as counts.
    """
    rows, space, difference = room
    total = np.zeros(difference.shape, np.float32)
    weights: np.ndarray | np.float32 = np.float32(0)
    for view in side:
        colours = view.difference(move, rows, space)
        np.copyto(difference, colours[0])
        for colour in colours[1:]:
            difference += colour
        difference /= len(colours)
        np.minimum(difference, np.float32(most), out=difference)
        view.outside(difference, move, rows)[...] = most
        sees, distant = view.sees(move, rows), np.float32(abs(view.place) ** _DISTANT)
        weight = distant if sees is None else distant * sees
        difference *= weight
        total += difference
        weights = weights + weight
    total /= np.where(np.equal(weights, 0), 1, weights)
    return np.where(np.equal(weights, 0), np.float32(most), total)


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
    low, high = _quantiles(found * size, texture**2, (0.01, 0.99))
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
