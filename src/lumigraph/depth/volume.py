"""Cost volumes (n, y, x): how badly each of n labels explains each place, and the best label of each."""

import numpy as np
from scipy.ndimage import uniform_filter


def box(image: np.ndarray, radius: int) -> np.ndarray:
    """Mean over (2 radius + 1)² samples, edges repeated."""
    return uniform_filter(image, 2 * radius + 1, mode="nearest")


def guided(cost: np.ndarray, guide: np.ndarray, radius: int, edge: float = 1e-2) -> np.ndarray:
    """Each cost (n, y, x) smoothed, but not across the edges of a picture (y, x).

    Parameters
    ----------
    cost
        Not changed.
    guide
        Picture of about 0 ... 1.
    radius
        Of the windows [px].
    edge
        Contrast [of the guide] above which an edge is kept.

    References
    ----------
    He, Sun, Tang, "Guided image filtering", IEEE PAMI 35, 1397 (2013).
    """
    mean = box(guide, radius)
    scatter = box(guide * guide, radius) - mean * mean + edge**2
    out = np.empty_like(cost)
    for k, plane in enumerate(cost):
        level = box(plane, radius)
        slope = (box(plane * guide, radius) - level * mean) / scatter
        out[k] = box(slope, radius) * guide + box(level - slope * mean, radius)
    return out


def semi_global(cost: np.ndarray, guide: np.ndarray, step: float, jump: float) -> np.ndarray:
    """Costs (n, y, x) plus those of the cheapest paths that lead to each place from eight sides.

    Parameters
    ----------
    cost
        Not changed.
    guide
        Picture (y, x) of about 0 ... 1: jumps are cheap where it has edges.
    step, jump
        What neighbours pay whose labels differ by one, and by more, in the unit of the cost.

    References
    ----------
    Hirschmüller, "Stereo processing by semiglobal matching and mutual information", IEEE PAMI 30, 328 (2008).
    """
    rows = np.ascontiguousarray(cost.swapaxes(0, 1))
    total = np.zeros_like(rows)
    for side in (1, -1):
        for slant in (0, 1, -1):
            _sweep(rows, total, guide, side, slant, (step, jump))
    columns = np.ascontiguousarray(rows.T)
    across = np.zeros_like(columns)
    for side in (1, -1):
        _sweep(columns, across, guide.T, side, 0, (step, jump))
    total += across.T
    return np.ascontiguousarray(total.swapaxes(0, 1))


_EDGE = 0.03  # contrast between neighbours across which a jump is cheap


def _sweep(
    cost: np.ndarray, total: np.ndarray, guide: np.ndarray, side: int, slant: int, price: tuple[float, float]
) -> None:
    """Add the paths that come from one side to `total` (y, n, x)."""
    order = range(len(cost)) if side > 0 else range(len(cost) - 1, -1, -1)
    before = None
    for y in order:
        path = cost[y]
        if before is not None:
            came, seen = np.roll(before, slant, -1), np.roll(guide[y - side], slant)
            came -= came.min(0)
            jump = price[0] + price[1] * np.exp(-np.abs(guide[y] - seen) / _EDGE)
            best = np.minimum(came, jump.astype(cost.dtype))
            came += price[0]
            np.minimum(best[1:], came[:-1], out=best[1:])
            np.minimum(best[:-1], came[1:], out=best[:-1])
            if slant:
                best[:, 0 if slant > 0 else -1] = 0  # nothing comes from outside
            best += path
            path = best
        total[y] += path
        before = path


def cheapest(cost: np.ndarray) -> np.ndarray:
    """Label (y, x) of the least cost, between labels by a parabola."""
    n = len(cost)
    best = cost.argmin(0)
    middle = np.clip(best, 1, n - 2)
    below, at, above = (np.take_along_axis(cost, (middle + k)[None], 0)[0] for k in (-1, 0, 1))
    bend = below - 2 * at + above
    safe = np.where(bend > 0, bend, 1)
    move = np.where((bend > 0) & (middle == best), np.clip((below - above) / (2 * safe), -0.5, 0.5), 0)
    return best + move


_VALLEY = 0.1  # of a jump on each path: what a rival's cost must fall below that between it and the best


def rivals(total: np.ndarray, jump: float) -> np.ndarray:
    """Possible error (y, x) of a label, in steps, by other labels that explain a place as well.

    Every other valley of the costs counts by its distance, times the square of how deep it is beside the
    valley of the best label. Textures that repeat have such valleys, and so do places beside an edge of
    depth.

    Parameters
    ----------
    total
        Costs (n, y, x) by `semi_global`.
    jump
        As it was given there.
    """
    best, low = total.argmin(0), total.min(0)
    away, least = np.zeros_like(low), np.float32(8 * _VALLEY * jump)
    for side in (1, -1):
        order, top = total[::side], low
        start = best if side > 0 else len(total) - 1 - best
        for k in range(1, len(total)):
            here, beyond = order[k], order[min(k + 1, len(total) - 1)]
            top = np.where(k > start, np.maximum(top, here), low)
            fall = top - here
            valley = (fall > least) & (here < order[k - 1]) & (here <= beyond)
            fall, top_there, below = fall[valley], top[valley], low[valley]
            deep = np.square(fall / np.maximum(top_there - below, least))
            away[valley] += (k - start[valley]) * deep
    return away
