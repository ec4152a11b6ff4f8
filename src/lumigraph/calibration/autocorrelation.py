"""Lattice vectors as peaks of a picture's autocorrelation."""

from typing import Any

import numpy as np
import scipy.fft
from scipy import ndimage

from lumigraph.core.arrays import WORKERS

SMALLEST_PITCH = 4.0
"""Shortest lattice vector looked for [px]: two pixels for the spot, two for the gap."""

_LONGEST = 1024  # lags looked at [px]
_PART = 0.42  # of the picture: farther lags have little overlap and much noise; 3 lenslets need 0.34
_DIP = 0.15  # how far the autocorrelation must fall between two lattice points


def autocorrelation(picture: np.ndarray) -> np.ndarray:
    """Normalised autocorrelation for lags up to half the picture each way; element [0, nx_lag] is lag 0."""
    wave = picture - picture.mean()
    for axis in (0, 1):  # takes out the highest frequency: what grey() left of a Bayer pattern
        wave = ndimage.correlate1d(wave, np.array([0.25, 0.5, 0.25], np.float32), axis=axis)
    ny, nx = picture.shape
    lags = tuple(min(int(_PART * n), _LONGEST) + 2 for n in (ny, nx))
    size = tuple(scipy.fft.next_fast_len(n + lag, real=True) for n, lag in zip((ny, nx), lags, strict=True))
    windows = [np.hanning(n + 2)[1:-1].astype(np.float32) for n in (ny, nx)]
    spectrum: Any = scipy.fft.rfft2(wave * windows[0][:, None] * windows[1], size, workers=WORKERS)
    power = np.square(spectrum.real) + np.square(spectrum.imag)
    raw: Any = scipy.fft.irfft2(power, size, workers=WORKERS)
    overlap: list[Any] = [
        scipy.fft.irfft(np.abs(np.asarray(scipy.fft.rfft(w.astype(float), n))) ** 2, n)
        for w, n in zip(windows, size, strict=True)
    ]
    columns = np.arange(-lags[1], lags[1] + 1)
    result = raw[: lags[0] + 1][:, columns] / (overlap[0][: lags[0] + 1, None] * overlap[1][columns])
    return result / result[0, lags[1]]


class Peaks:
    """Local maxima of an autocorrelation beyond its central lobe: `lags` (k, 2) and `heights` (k,)."""

    def __init__(self, correlation: np.ndarray) -> None:
        self.correlation = correlation
        zero = correlation.shape[1] // 2
        # The row above lag 0 is the mirror image of the row below it; the other edges are no peaks.
        around = np.concatenate([correlation[1:2, ::-1], correlation])
        local = (around == ndimage.maximum_filter(around, 3)) & (around > 0)
        local[0] = local[-1] = local[:, 0] = local[:, -1] = False
        rows, columns = np.nonzero(local)
        tops = _tops(around, rows, columns)
        rows = rows - 1
        lags = np.stack([rows, columns - zero], -1)
        length = np.hypot(*lags.T)
        limits = np.array(correlation.shape) - 2, zero - 1
        keep = (length >= SMALLEST_PITCH - 1) & (rows < limits[0][0]) & (np.abs(lags[:, 1]) < limits[1])
        keep &= (lags[:, 0] > 0) | (lags[:, 1] > 0)  # a half plane: the rest is its mirror image
        order = np.argsort(length[keep], kind="stable")
        self.lags, self.lengths = lags[keep][order], length[keep][order]
        self.heights = tops[keep][order]

    def dips(self, index: int) -> bool:
        """True if the autocorrelation falls and rises again between lag 0 and this peak."""
        steps = np.linspace(0, 1, max(8, int(self.lengths[index])))
        zero = self.correlation.shape[1] // 2
        y, x = self.lags[index][:, None] * steps
        path = self.correlation[np.rint(y).astype(int), np.rint(x).astype(int) + zero]
        return bool(path.min() < self.heights[index] * (1 - _DIP))

    def strong(self, limit: float) -> list[int]:
        """Indices of true peaks above a limit, shortest first; no more than 200."""
        found: list[int] = []
        for index in np.flatnonzero(self.heights >= limit):
            if self.dips(int(index)):
                found.append(int(index))
            if len(found) == 200:
                break
        return found

    def top(self) -> float:
        """Height of the strongest peak that follows a dip; 0 without any."""
        for index in np.argsort(-self.heights, kind="stable")[:500]:
            if self.dips(int(index)):
                return float(self.heights[index])
        return 0.0


def _tops(around: np.ndarray, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Heights of peaks between the samples, by parabolas: for pitches of few pixels the samples miss them."""
    here = around[rows, columns]
    result = here.copy()
    for dy, dx in ((1, 0), (0, 1)):
        before, after = around[rows - dy, columns - dx], around[rows + dy, columns + dx]
        bend = np.maximum(2 * here - before - after, 1e-12)
        result += (after - before) ** 2 / (8 * bend)
    return result


def reduced(first: np.ndarray, second: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Shortest basis of the same lattice (Lagrange and Gauss)."""
    for _ in range(20):
        if not first.any() or not second.any():
            break
        if first @ first > second @ second:
            first, second = second, first
        steps = round(float(first @ second / (first @ first)))
        if steps == 0:
            break
        second = second - steps * first
    return first, second


def refined(correlation: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """Vector from ever farther multiples of itself, each found to a fraction of a pixel."""
    limits = np.array(correlation.shape[0] - 3, float), np.array(correlation.shape[1] // 2 - 3, float)
    times = 1
    while True:
        lag = _peak_near(correlation, vector * times)
        if lag is None:
            return vector
        vector = lag / times
        far = np.abs(vector) * 2 * times
        if far[0] > limits[0] or far[1] > limits[1] or times >= 64:
            return vector
        times *= 2


def _peak_near(correlation: np.ndarray, lag: np.ndarray) -> np.ndarray | None:
    """Sub-pixel maximum within 2 px of a lag, or None where there is none."""
    sign = -1 if lag[0] < -0.5 else 1
    row, column = (int(v) for v in np.rint(sign * lag))
    column += correlation.shape[1] // 2
    mirror = 3  # rows above lag 0 are the mirror image of those below
    padded = np.concatenate([correlation[mirror:0:-1, ::-1], correlation])
    window = padded[row - 2 + mirror : row + 3 + mirror, column - 2 : column + 3]
    if window.shape != (5, 5):
        return None
    best = np.array(np.unravel_index(np.argmax(window), (5, 5)))
    y, x = best
    if not (0 < y < 4 and 0 < x < 4):
        return None
    slope = np.array([window[y + 1, x] - window[y - 1, x], window[y, x + 1] - window[y, x - 1]]) / 2
    bend = np.array([window[y + 1, x] + window[y - 1, x], window[y, x + 1] + window[y, x - 1]])
    bend = bend - 2 * window[y, x]
    peak = np.array([row - 2, column - 2 - correlation.shape[1] // 2]) + best
    return sign * (peak - slope / np.minimum(bend, -1e-12))
