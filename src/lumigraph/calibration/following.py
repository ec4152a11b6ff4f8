"""The lattice that a picture repeats on, near a known one, by the lines of its spectrum: `followed`."""

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import scipy.fft
from scipy import ndimage

from lumigraph.core.arrays import WORKERS

_RANGE, _TURN = 0.25, math.radians(6)  # of the pitch, and angles, that are searched
_STEP = 0.35  # lenslets over the picture: steps of the search, below half a line's width
_EVIDENCE = 12.0  # of a lattice's lines over the median of all tried: 18 and more with gaps, 5 to 10 without
_LINE = 8.0  # of a single line over that median
_FINEST = 0.2  # 1/px of the lines that are looked for
_COARSE, _SECOND = 8.0, 1.9  # px of pitch from which orders up to the second are followed
_SHARPEST, _HIGHEST = 0.14, 4.0  # 1/px, and orders, of the lines that gaps have after smoothing


class FollowedLattice(NamedTuple):
    """Lattice on which a feature repeats.

    Parameters
    ----------
    basis
        Lattice vectors (y, x) of i and j in columns [px].
    evidence
        Strength of its lines over their surroundings.
    errors
        Standard errors (2, 2) of the waves of i and j along y and x [1/px], by how far the lines scatter
        about those of one lattice; NaN of two lines alone.
    """

    basis: np.ndarray
    evidence: float
    errors: np.ndarray


def followed(
    feature: "np.ndarray | Lines", basis: np.ndarray, is_hex: bool, *, share: float = 1.0
) -> FollowedLattice | None:
    """The lattice near another one that a feature (y, x) repeats on, by the lines of its spectrum.

    Parameters
    ----------
    feature
        Gaps, or light, of all micro-images; or its spectrum, where it is followed several times.
    basis
        Lattice vectors (y, x) of i and j in columns [px].
    is_hex
        True if there are three first harmonics.
    share
        Of the range of the search (25 % of the pitch, 6°) that the lattice may lie in.

    Returns
    -------
    Followed or None
        None where its lines do not stand out.
    """
    pitch = math.sqrt(abs(float(np.linalg.det(basis))))
    lines = feature if isinstance(feature, Lines) else Lines.of(feature)
    found = _nearest(lines, np.linalg.inv(basis), is_hex, min(lines.shape) / pitch, share)
    if found is None or found.evidence < _EVIDENCE:
        return None
    waves, errors = _refined(lines, found, pitch)
    return FollowedLattice(np.linalg.inv(waves), found.evidence, errors)


@dataclass(frozen=True, slots=True)
class Lines:
    """Amplitudes of a windowed picture's spectrum, between its own bins too; x is not below 0."""

    amplitude: np.ndarray
    size: np.ndarray
    shape: tuple[int, ...]

    @classmethod
    def of(cls, picture: np.ndarray) -> "Lines":
        """Lines of a picture (y, x)."""
        window = [np.hanning(n + 2)[1:-1].astype(np.float32) for n in picture.shape]
        wave = (picture - picture.mean()) * window[0][:, None] * window[1]
        size = [scipy.fft.next_fast_len(3 * n // 2, real=True) for n in picture.shape]
        spectrum: Any = scipy.fft.rfft2(wave, size, workers=WORKERS)
        return cls(np.abs(spectrum).astype(np.float32), np.array(size), picture.shape)

    def heights(self, waves: np.ndarray) -> np.ndarray:
        """Amplitudes (...) at waves (..., 2) as (y, x) [1/px]."""
        waves = np.where(waves[..., 1:] < 0, -waves, waves) * self.size
        return ndimage.map_coordinates(self.amplitude, np.moveaxis(waves, -1, 0), order=1, mode="grid-wrap")

    def peaks(self, waves: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Maxima (k, 2) within two samples of waves (k, 2) [1/px], by parabolas, and their heights (k,)."""
        near = np.arange(-2, 3)
        middle = np.rint(waves * self.size).astype(int)
        rows, columns = np.broadcast_arrays(
            middle[:, 0, None, None] + near[:, None], middle[:, 1, None, None] + near
        )
        turned = np.where(columns < 0, -1, 1)
        heights = self.amplitude[turned * rows % self.size[0], turned * columns % self.size[1]]
        place = heights[:, 1:4, 1:4].reshape(len(waves), -1).argmax(1)
        y, x, k = place // 3 + 1, place % 3 + 1, np.arange(len(waves))
        logarithms = np.log(np.maximum(heights, 1e-30))
        dy = _top(*(logarithms[k, y + step, x] for step in (-1, 0, 1)))
        dx = _top(*(logarithms[k, y, x + step] for step in (-1, 0, 1)))
        return (middle - 2 + np.stack([y + dy, x + dx], -1)) / self.size, heights[k, y, x]


def _top(before: np.ndarray, here: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Offset of a parabola's maximum from the middle one of three samples [samples]."""
    return np.clip((after - before) / (2 * np.maximum(2 * here - before - after, 1e-6)), -0.6, 0.6)


class _FoundWaves(NamedTuple):
    """Waves of i and j (2, 2), their height over the surroundings, and those surroundings."""

    waves: np.ndarray
    evidence: float
    surroundings: float


def _nearest(
    lines: Lines, waves: np.ndarray, is_hex: bool, lenslets: float, share: float
) -> _FoundWaves | None:
    """The lattice around the expected one, stretched and turned, whose first lines are strongest together.

    A scene's own lattice may have a few of them, and be far stronger there; gaps have all. What is best at
    the border of the search lies beyond it.
    """
    stretch, turn = (
        np.arange(-int(reach * lenslets / _STEP), int(reach * lenslets / _STEP) + 1) * _STEP / lenslets
        for reach in (_RANGE, _TURN)
    )
    first = _first(waves, is_hex)
    size, angle = 1 / (1 + stretch[:, None]), turn[None, :]
    y, x = (first[:, k, None, None] * np.cos(angle) for k in (0, 1))
    ty, tx = (first[:, k, None, None] * np.sin(angle) for k in (0, 1))
    tried = np.stack([(y + tx) * size, (x - ty) * size], -1)
    score = np.exp(np.log(np.maximum(lines.heights(tried), 1e-30)).mean(0))
    around = float(np.median(score))
    score[~_is_peak(score)] = 0
    score[np.abs(stretch) > share * _RANGE] = 0
    score[:, np.abs(turn) > share * _TURN] = 0
    best = np.unravel_index(int(np.argmax(score)), score.shape)
    if around <= 0:
        return None
    return _FoundWaves(tried[:2, best[0], best[1]], float(score[best]) / around, around)


def _first(waves: np.ndarray, is_hex: bool) -> np.ndarray:
    """Waves (k, 2) of the two shortest kinds of harmonics; the first alone where the second is too fine."""
    i, j = waves
    if is_hex:
        j = min(j, -j, key=lambda wave: float(np.hypot(*(i + wave))))  # 120 deg apart
        shortest, next_ones = [i, j, i + j], [i - j, 2 * i + j, i + 2 * j]
    else:
        shortest, next_ones = [i, j], [i + j, i - j]
    fine = max(float(np.hypot(*wave)) for wave in next_ones) > _FINEST
    return np.stack(shortest if fine else shortest + next_ones)


def _is_peak(score: np.ndarray) -> np.ndarray:
    """True where a score is the highest of its surroundings, but not at the border."""
    found = score == ndimage.maximum_filter(score, 3)
    found[[0, -1]] = found[:, [0, -1]] = False
    return found


def _refined(lines: Lines, found: _FoundWaves, pitch: float) -> tuple[np.ndarray, np.ndarray]:
    """Waves of i and j (2, 2) by least squares over ever more harmonics, each at its own maximum.

    Their standard errors (2, 2), too.
    """
    least = _SECOND if pitch > _COARSE else 1.0
    highest, waves = float(np.clip(_SHARPEST * pitch, least, _HIGHEST)), found.waves
    errors = np.full((2, 2), np.nan)
    reach = np.arange(-5, 6)
    orders = np.stack(np.meshgrid(reach, reach, indexing="ij"), -1).reshape(-1, 2)
    orders = orders[61:]  # half a plane: the rest mirrors it
    for limit in np.arange(1.1, highest + 0.2, 0.9):
        expected = orders @ waves
        used = np.hypot(*expected.T) <= limit * 1.1 * math.sqrt(abs(np.linalg.det(waves)))
        places, heights = lines.peaks(expected[used])
        weights = np.where(heights > _LINE * found.surroundings, heights, 0)[:, None]
        if (weights > 0).sum() < 2:
            break
        better = np.linalg.lstsq(orders[used] * weights, places * weights, rcond=None)[0]
        if np.linalg.matrix_rank(orders[used] * (weights > 0)) < 2:
            break
        waves, errors = better, _errors(places, orders[used], better, weights)
    return waves, errors


def _errors(places: np.ndarray, orders: np.ndarray, waves: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Standard errors (2, 2) of waves that weighted places (k, 2) of harmonics were fitted by."""
    left = int((weights > 0).sum()) - 2
    if left < 1:
        return np.full((2, 2), np.nan)
    variance = np.square((places - orders @ waves) * weights).sum(0) / left
    return np.sqrt(np.outer(np.diag(np.linalg.inv((orders * weights).T @ (orders * weights))), variance))
