"""Lines in the spectrum of a picture: a lattice leaves one at each of its harmonics."""

import math
from functools import cache
from typing import Any, Protocol

import numpy as np
import scipy.fft
from scipy import ndimage

from lumigraph.calibration.autocorrelation import SMALLEST_PITCH, reduced
from lumigraph.core.arrays import WORKERS

_BACKGROUND = 15  # bins over which a line's surroundings are averaged
_COST = 3.0  # natural logarithm of a line over its surroundings that noise does not reach on average
_CAP = 8.0  # and above which a line is no better
_MOST = 16  # lines paired
_SEARCH = 0.05  # of the pitch, and radians, that a lattice is looked for around a candidate
_SHARPEST, _HIGHEST = 0.14, 5.0  # 1/px, and orders, that gaps have after smoothing
_BESIDE, _SPREAD = 3.0, 0.02  # bins, and of the frequency, over which a line of a 1-D array is spread
_WEAK, _NOISE, _CERTAIN = 0.02, 6.0, 30.0  # of the strongest line; of the median that noise reaches, and not
_FLOOR = 0.03  # of the mean power: beats of the lattice with the pixels make no lines


class _Basis(Protocol):
    @property
    def row(self) -> np.ndarray: ...

    @property
    def column(self) -> np.ndarray: ...

    @property
    def layout(self) -> str: ...


class PowerSpectrum:
    """Natural logarithm of the power spectrum of a picture (y, x) over its surroundings."""

    def __init__(self, picture: np.ndarray) -> None:
        self.shape = picture.shape
        windows = [np.hanning(n + 2)[1:-1].astype(np.float32) for n in picture.shape]
        wave = (picture - picture.mean()) * windows[0][:, None] * windows[1]
        spectrum: Any = scipy.fft.fft2(wave, workers=WORKERS)
        power = np.square(spectrum.real) + np.square(spectrum.imag)
        power = np.log(power + _FLOOR * power.mean() + 1e-30)
        self.lines = power - ndimage.uniform_filter(power, _BACKGROUND, mode="wrap")
        self.largest = ndimage.maximum_filter(self.lines, 3, mode="wrap")

    def pairs(self, ratio: float = 1.3) -> list[tuple[np.ndarray, np.ndarray]]:
        """Reduced bases (y, x) [px], of lengths up to a ratio, whose first harmonics are strong lines."""
        waves = self._strongest()
        result = []
        for a in range(len(waves)):
            for b in range(a + 1, len(waves)):
                matrix = np.stack(reduced(waves[a].copy(), waves[b].copy()))
                first, second = np.hypot(*matrix.T)
                area = abs(np.linalg.det(matrix))
                if min(first, second) > 0 and area > 0.5 * first * second and second < ratio * first:
                    y, x = np.linalg.inv(matrix)
                    vectors = reduced(np.array([y[0], x[0]]), np.array([y[1], x[1]]))
                    if math.hypot(*vectors[0]) >= SMALLEST_PITCH:
                        result.append(vectors)
        return result

    def _strongest(self) -> list[np.ndarray]:
        """Waves (y, x) [1/px] of the strongest lines of a half plane, between the bins."""
        ny, nx = self.shape
        y, x = np.fft.fftfreq(ny)[:, None], np.fft.fftfreq(nx)[None, :]
        size = np.hypot(y, x)
        peaks = (self.lines == self.largest) & (size < 0.3) & (size > 2.5 / min(ny, nx))
        peaks &= (y > 0) | ((y == 0) & (x > 0))
        rows, columns = np.nonzero(peaks)
        order = np.argsort(-self.lines[rows, columns])[:_MOST]
        return [self._between(int(rows[k]), int(columns[k])) for k in order]

    def _between(self, row: int, column: int) -> np.ndarray:
        result = []
        for axis, n in enumerate(self.shape):
            step = (1, 0) if axis == 0 else (0, 1)
            before, here, after = (
                self.lines[(row + k * step[0]) % self.shape[0], (column + k * step[1]) % self.shape[1]]
                for k in (-1, 0, 1)
            )
            bend = max(2 * here - before - after, 1e-6)
            k = (row, column)[axis] + float(np.clip((after - before) / (2 * bend), -0.5, 0.5))
            result.append((k - n if k > n / 2 else k) / n)
        return np.array(result)

    def score(self, vectors: _Basis, limit: float) -> float:
        """Sum over the harmonics below a frequency [1/px] of what lines are above the cost of a harmonic."""
        matrix = np.stack([vectors.column, vectors.row], -1)
        inverse = np.linalg.inv(matrix)
        reach = int(limit * math.sqrt(abs(np.linalg.det(matrix))) * 1.6) + 2
        waves = _half_plane(reach) @ inverse
        size = np.hypot(*waves.T)
        waves, size = waves[size <= limit], size[size <= limit]
        rows, columns = (np.rint(waves[:, k] * n).astype(int) % n for k, n in enumerate(self.shape))
        lines = np.minimum(self.largest[rows, columns], _CAP)
        count = 3 if vectors.layout == "hex" else 2
        first = np.sort(lines[np.argsort(size)[:count]])
        if len(first) < 2 or first[-2] < _COST / 2:  # without two first harmonics there is no lattice
            return 0.0
        return float((lines - _COST).sum())


@cache
def _half_plane(reach: int) -> np.ndarray:
    """Orders (k, 2) of harmonics; the other half plane mirrors them."""
    i, j = np.meshgrid(np.arange(-reach, reach + 1), np.arange(0, reach + 1), indexing="ij")
    half = (j > 0) | (i > 0)
    return np.stack([i[half], j[half]], -1)


class Gaps:
    """Amplitudes in the spectrum of a picture's dark gaps, between the bins."""

    def __init__(self, gaps: np.ndarray) -> None:
        self.shape = gaps.shape
        windows = [np.hanning(n + 2)[1:-1].astype(np.float32) for n in gaps.shape]
        wave = (gaps - gaps.mean()) * windows[0][:, None] * windows[1]
        size = [2 * n for n in gaps.shape]
        spectrum: Any = scipy.fft.rfft2(wave, size, workers=WORKERS)
        self.amplitude = np.abs(spectrum).astype(np.float32)
        self._samples = np.array(size, float)

    def heights(self, waves: np.ndarray) -> np.ndarray:
        """Amplitudes (...) at waves (..., 2) as (y, x) [1/px], whose x is not below 0."""
        at = np.moveaxis(waves * self._samples, -1, 0)
        return ndimage.map_coordinates(self.amplitude, at, order=1, mode="grid-wrap")


def single_direction(light: Gaps) -> float | None:
    """Pitch [px] of a picture that repeats in one direction only, as behind cylindrical lenses; else None.

    Its lines stand on a straight line through the middle of the spectrum: what stands beside it is noise, or
    less than a fiftieth of the strongest one.
    """
    y, x = (np.fft.fftfreq(2 * n) for n in light.shape)
    y, x = y[:, None], np.abs(x[: light.amplitude.shape[1]])[None]
    least, size = _BESIDE / min(light.shape), np.hypot(y, x)
    amplitude = np.where((size > least) & (size < 0.5 / 2**0.5), light.amplitude, 0)
    row, column = np.unravel_index(int(np.argmax(amplitude)), amplitude.shape)
    wave = np.array([float(y[row, 0]), float(x[0, column])])
    long = math.hypot(*wave)
    beside = np.abs(y * wave[1] - x * wave[0]) / long > np.maximum(least, _SPREAD * size)
    rest = amplitude[beside & (amplitude > 0)]
    if not rest.size or amplitude[row, column] < _CERTAIN * np.median(rest):
        return None
    alone = float(rest.max()) < max(_WEAK * float(amplitude[row, column]), _NOISE * float(np.median(rest)))
    return 1 / long if alone else None


def polished(gaps: Gaps, basis: _Basis) -> tuple[np.ndarray, np.ndarray]:
    """Row and column vector of the regular lattice near a basis that the gaps follow best.

    Pitch and rotation are tried by steps of half a bin at the highest order, then of an eighth: a scene that
    repeats has lines of its own around, between which a search downhill gets lost. Harmonics up to the
    sharpness of the gaps count: the scene changes over the picture and has no sharp high ones.
    """
    turn = math.pi / (3 if basis.layout == "hex" else 2)
    pitch = math.sqrt(
        abs(float(basis.row[0] * basis.column[1] - basis.row[1] * basis.column[0])) / math.sin(turn)
    )
    angle = math.atan2(*basis.row)
    orders = float(np.clip(_SHARPEST * pitch, 1.3, _HIGHEST))
    waves = _waves(orders, turn)
    step = 0.5 * pitch / orders / math.sqrt(np.prod(gaps.shape))
    for width, fine in ((_SEARCH, step), (step, step / 4), (step / 4, step / 16)):
        count = max(2, min(16, math.ceil(width / fine)))
        tries = np.arange(-count, count + 1) * fine
        turned = _turned(waves, pitch, angle + tries) / (1 + tries)[:, None, None, None]
        a, b = np.unravel_index(int(np.argmax(gaps.heights(turned).sum(-1))), (len(tries), len(tries)))
        pitch, angle = pitch * (1 + tries[a]), angle + tries[b]
    return _regular(pitch, angle, turn)


def _waves(orders: float, turn: float) -> np.ndarray:
    """First harmonics (k, 2) of the lattice of pitch 1, not turned, of one half plane."""
    reach = np.arange(-math.ceil(orders), math.ceil(orders) + 1)
    i, j = np.meshgrid(reach, reach, indexing="ij")
    unit = np.stack(_regular(1.0, 0.0, turn)[::-1], -1)
    waves = np.stack([i.ravel(), j.ravel()], -1) @ np.linalg.inv(unit)
    half = (waves[:, 0] > 1e-9) | ((np.abs(waves[:, 0]) < 1e-9) & (waves[:, 1] > 0))
    return waves[half & (np.hypot(*waves.T) <= orders)]


def _regular(pitch: float, angle: float, turn: float) -> tuple[np.ndarray, np.ndarray]:
    row, column = (pitch * np.array([math.sin(a), math.cos(a)]) for a in (angle, angle + turn))
    return row, column


def _turned(waves: np.ndarray, pitch: float, angles: np.ndarray) -> np.ndarray:
    """Waves (n, k, 2) of the lattice of pitch 1 (k, 2), for another pitch and n rotations."""
    cos, sin = np.cos(angles)[:, None], np.sin(angles)[:, None]
    y, x = waves.T
    return np.stack([y * cos + x * sin, x * cos - y * sin], -1) / pitch
