"""Smooth surfaces through uncertain values: second differences are small but for a few kinks and jumps.

Minimises, for an update x of the map d,

    Σ ½ information x² - pull x + λ Σ w |D²(d + x)|²,    w = 1 / (√(1 + (D²/kink)²) (1 + (D²/jump)²))

with the second differences D² along y, x and both: slanted planes are free, which first differences would
flatten. The weights w, from the solution before, make kinks cheap and jumps almost free. Coarse grids come
first, so that places without texture take their values from far away.
"""

from dataclasses import dataclass

import numpy as np

_LEVELS = (16, 8, 4, 2, 1)
_ROUNDS = 30  # of conjugate gradients: what is left is seen to by the next level
_ENOUGH = 1e-10


Tears = tuple[np.ndarray, np.ndarray]
"""Masks of tears between each sample (y, x) and the next, along y and along x."""


@dataclass(frozen=True, slots=True)
class Stiffness:
    """Stiffness of a smoothed map.

    Parameters
    ----------
    weight
        λ, in the unit of the information; one, or one for each place (y, x).
    kink
        Second difference above which a bend costs its amount and no longer its square [unit of the map].
    jump
        Second difference above which it is an edge and costs little [unit of the map].
    """

    weight: float | np.ndarray
    kink: float
    jump: float


def update(
    values: np.ndarray,
    information: np.ndarray,
    pull: np.ndarray,
    how: Stiffness,
    edges: np.ndarray | None = None,
    tears: Tears | None = None,
) -> np.ndarray:
    """The map (y, x) moved by what the data pull at, as far as smoothness lets them.

    Parameters
    ----------
    values
        The map (y, x) as it is.
    information
        Inverse variance of each place, up to a factor; 0 where the data say nothing.
    pull
        Information times the change that the data imply.
    how
        Of the smoothness.
    edges
        Part (y, x) of the stiffness that is kept at each place, such as less at a picture's edges.
    tears
        Where the surface has no stiffness at all; see `tears`.
    """
    edges = np.ones_like(values) if edges is None else edges
    shape, pad = values.shape, [(0, -n % _LEVELS[0]) for n in values.shape]
    values, edges = (np.pad(a, pad, "edge") for a in (values, edges))
    down, right = (np.pad(a, pad) for a in tears or (np.zeros(shape, bool),) * 2)
    information, pull = (np.pad(a, pad) for a in (information, pull))
    least = 1e-8 * float(information.max()) + 1e-30
    for size in _LEVELS:
        if min(values.shape) < 3 * size:
            continue
        mean = _pooled(values, size) / size**2
        level = Stiffness(_pooled(edges, size) * how.weight / size**4, how.kink * size**2, how.jump)
        whole, cut = _torn(down, right, size)
        known = _pooled(information, size) * whole + least * size**2
        change = _solve(mean, known, _pooled(pull, size) * whole, level, cut)
        change = _spread(change, size)
        values = values + change
        pull = pull - information * change
    return values[: shape[0], : shape[1]]


def tears(values: np.ndarray, least: float) -> Tears:
    """Masks (y, x), down and right, of edges at which neighbours of a map differ by more than `least`."""
    down, right = np.zeros(values.shape, bool), np.zeros(values.shape, bool)
    down[:-1] = np.abs(np.diff(values, axis=0)) > least
    right[:, :-1] = np.abs(np.diff(values, axis=1)) > least
    return down, right


def _torn(down: np.ndarray, right: np.ndarray, size: int) -> tuple[np.ndarray | int, Tears]:
    """Mask of blocks of size² samples that are of one piece, and the tears between them.

    The mean of a torn block belongs to neither side: it has no weight, and no block bends towards it.
    """
    if size == 1:
        return 1, (down, right)
    torn = _pooled(down | right, size) > 0
    return ~torn, (torn | np.roll(torn, -1, 0), torn | np.roll(torn, -1, 1))


def _across(cut: Tears) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Masks (y, x) of the second differences of `_bends` that cross no tear."""
    down, right, both = (np.ones(cut[0].shape, bool) for _ in range(3))
    down[1:-1] = ~(cut[0][:-2] | cut[0][1:-1])
    right[:, 1:-1] = ~(cut[1][:, :-2] | cut[1][:, 1:-1])
    both[:-1, :-1] = ~(cut[0][:-1, :-1] | cut[0][:-1, 1:] | cut[1][:-1, :-1] | cut[1][1:, :-1])
    return down, right, both


def _solve(
    values: np.ndarray, information: np.ndarray, pull: np.ndarray, how: Stiffness, cut: Tears
) -> np.ndarray:
    """The change by conjugate gradients, with weights made afresh twice."""
    change = np.zeros_like(values)
    across = _across(cut)
    for _ in range(3):
        weights = [
            _weight(part, how) * free for part, free in zip(_bends(values + change), across, strict=True)
        ]
        diagonal = information + 6 * weights[0] + 6 * weights[1] + 8 * weights[2]
        start = pull - _stiff(values, weights)
        change = _conjugate_gradients(change, start, information, weights, diagonal)
    return change


def _conjugate_gradients(
    x: np.ndarray, right: np.ndarray, information: np.ndarray, weights: list[np.ndarray], diagonal: np.ndarray
) -> np.ndarray:
    left = right - information * x - _stiff(x, weights)
    scaled = left / diagonal
    way, size = scaled, float(np.vdot(left, scaled))
    enough = _ENOUGH * size
    for _ in range(_ROUNDS):
        if size <= enough:
            break
        image = information * way + _stiff(way, weights)
        length = np.asarray(size / float(np.vdot(way, image)), x.dtype)
        x, left = x + length * way, left - length * image
        scaled = left / diagonal
        size, old = float(np.vdot(left, scaled)), size
        way = scaled + np.asarray(size / old, x.dtype) * way
    return x


def _weight(bend: np.ndarray, how: Stiffness) -> np.ndarray:
    return how.weight / (np.sqrt(1 + (bend / how.kink) ** 2) * (1 + (bend / how.jump) ** 2))


def _bends(a: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Second differences along y, x and both; 0 where the border is in the way."""
    down, right, both = np.zeros_like(a), np.zeros_like(a), np.zeros_like(a)
    down[1:-1] = a[:-2] - 2 * a[1:-1] + a[2:]
    right[:, 1:-1] = a[:, :-2] - 2 * a[:, 1:-1] + a[:, 2:]
    both[:-1, :-1] = a[1:, 1:] - a[1:, :-1] - a[:-1, 1:] + a[:-1, :-1]
    return down, right, both


def _stiff(a: np.ndarray, weights: list[np.ndarray]) -> np.ndarray:
    """Adjoint of the second differences, of the weighted second differences."""
    down, right, both = (w * part for w, part in zip(weights, _bends(a), strict=True))
    out = -2 * down - 2 * right
    out[:-1] += down[1:]
    out[1:] += down[:-1]
    out[:, :-1] += right[:, 1:]
    out[:, 1:] += right[:, :-1]
    both = 2 * both[:-1, :-1]
    out[1:, 1:] += both
    out[1:, :-1] -= both
    out[:-1, 1:] -= both
    out[:-1, :-1] += both
    return out


def _pooled(a: np.ndarray, size: int) -> np.ndarray:
    """Sums over size² samples."""
    return a.reshape(a.shape[0] // size, size, a.shape[1] // size, size).sum((1, 3))


def _spread(a: np.ndarray, size: int) -> np.ndarray:
    """Values of blocks at each of their size² samples, linearly between the blocks' middles."""
    for axis in (0, 1):
        if size > 1:
            place = (np.arange(a.shape[axis] * size) + 0.5) / size - 0.5
            below = np.clip(np.floor(place).astype(int), 0, a.shape[axis] - 2)
            part = np.clip(place - below, 0, 1).astype(a.dtype)
            part = part[:, None] if axis == 0 else part
            a = np.take(a, below, axis) * (1 - part) + np.take(a, below + 1, axis) * part
    return a
