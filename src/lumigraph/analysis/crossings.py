r"""Crossings of edges, such as corners of a chessboard, without the pull of samples.

A quadratic that is laid through the samples about a saddle leans towards where they stand, by up to 0.03 of
a sample where edges are as sharp as pixels. So two straight edges that cross are fitted to the samples,

.. math:: I = c + a\, E(d_1)\, E(d_2)

with d the distance from an edge and E from -1 to 1, a step as pixels 1 wide and a normal blur make it. Edges
along rows that are sharper than a sample, behind round lenslets or pixels with gaps, remain 0.04 off; edges
turned by 10° do not.
"""

import numpy as np
from scipy.special import erf

from lumigraph.analysis.saddles import STILL, disc, quadratic

_STEPS = 12
_SHARP = 0.3  # samples: blur to begin with
_KNOWN = 0.05  # of the contrast, by which the blur's logarithm is held there
_LONGEST = np.array([0.3, 0.3, 0.2, 0.2, 0.5, np.inf, np.inf])  # step of each unknown of `_samples`
_FARTHEST = 0.3
"""Largest distance from a saddle to its edges' crossing [samples]: the pull of samples, and noise."""


def crossed(picture: np.ndarray, saddles: np.ndarray, radius: int) -> np.ndarray:
    """Crossings of the edges of saddles (n, 2), by samples within `radius`, without the samples' pull.

    Saddles whose edges are not found near them stay: such as those so blurred that samples do not pull.

    Parameters
    ----------
    picture
        (y, x), not filtered.
    saddles
        (n, 2) as `settle` finds them.
    radius
        Of the round window in which edges are fitted [px].
    """
    base = np.rint(saddles).astype(int)
    ways = base[:, :, None] + disc(radius).astype(int)
    inside = ((ways >= 0) & (ways < np.array(picture.shape)[:, None])).all((1, 2))
    found = saddles.copy()
    if inside.any():
        rows, columns = np.moveaxis(ways[inside], 1, 0)
        start = (saddles - base)[inside]
        numbers, settled = _fitted(picture[rows, columns], start, radius)
        near = settled & (np.hypot(*(numbers[:, :2] - start).T) < _FARTHEST)
        found[inside] += np.where(near[:, None], numbers[:, :2] - start, 0)
    return found


def _fitted(values: np.ndarray, start: np.ndarray, radius: int) -> tuple[np.ndarray, np.ndarray]:
    """Unknowns (n, 7) of the edges in windows (n, k), by Gauss-Newton, and which settled.

    They are the crossing (y, x), the angles of both edges, the logarithm of the blur, c and a.
    """
    ways = disc(radius)
    middle, half = (values.max(1) + values.min(1)) / 2, np.ptp(values, axis=1) / 2 + 1e-30
    blur = np.full(len(values), np.log(_SHARP))
    numbers = np.column_stack(
        [start, *_edges(values @ quadratic(ways[0], ways[1], radius / 2)), blur, 0 * blur, blur]
    )
    values = (values - middle[:, None]) / half[:, None]
    numbers[:, 6] = 1
    numbers[(values * _samples(numbers, ways)).sum(1) < 0, 6] = -1
    away = (ways - start[:, :, None]) / radius
    weight = np.exp(-0.56 * (away**2).sum(1))
    step = numbers
    for _ in range(_STEPS):
        seen = _samples(numbers, ways)
        slopes = np.stack([_samples(numbers + 1e-6 * one, ways) - seen for one in np.eye(7)], -1) / 1e-6
        slopes, rest = slopes * weight[..., None], (values - seen) * weight
        normal, pull = slopes.swapaxes(1, 2) @ slopes, np.einsum("nka,nk->na", slopes, rest)
        normal[:, 4, 4] += _KNOWN**2
        pull[:, 4] += _KNOWN**2 * (np.log(_SHARP) - numbers[:, 4])
        step = np.linalg.solve(normal + 1e-6 * np.eye(7), pull[..., None])[..., 0]
        numbers = numbers + np.clip(step, -_LONGEST, _LONGEST)
    return numbers, np.hypot(*step[:, :2].T) < STILL


def _edges(terms: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Angles (n,) across both edges of saddles, of quadratics' terms (n, 6): along them they do not bend."""
    _, _, _, yy, yx, xx = terms.T
    turn, bend = np.arctan2(yx, (yy - xx) / 2), np.maximum(np.hypot((yy - xx) / 2, yx), 1e-30)
    apart = np.arccos(np.clip(-(yy + xx) / 2 / bend, -0.95, 0.95))
    return (turn + apart + np.pi) / 2, (turn - apart + np.pi) / 2


def _samples(numbers: np.ndarray, ways: np.ndarray) -> np.ndarray:
    """(n, k) Samples at ways (2, k) of two edges by their numbers (n, 7); see `_fitted`."""
    y, x, *turns, blur, level, contrast = (one[:, None] for one in numbers.T)
    down, right = ways[0] - y, ways[1] - x
    for turn in turns:
        sides = np.abs([np.cos(turn), np.sin(turn)])
        wide, narrow = sides.max(0), sides.min(0)
        soft = np.sqrt(np.exp(2 * blur) + narrow**2 / 12)
        way = down * np.cos(turn) + right * np.sin(turn)
        contrast = contrast * (_risen(way + wide / 2, soft) - _risen(way - wide / 2, soft)) / wide
    return level + contrast


def _risen(way: np.ndarray, soft: np.ndarray) -> np.ndarray:
    """Integral of a step from -1 to 1 that a normal blur softens."""
    return way * erf(way / (np.sqrt(2) * soft)) + soft * np.sqrt(2 / np.pi) * np.exp(-0.5 * (way / soft) ** 2)
