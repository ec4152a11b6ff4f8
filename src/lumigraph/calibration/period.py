"""The two lattice vectors of a white image, before any spot is known: peaks of its autocorrelation.

The autocorrelation of a periodic picture is high at every lattice vector whatever one period looks like
(round, square, ringed, dim), where the spectrum may have its strongest line at any harmonic.
"""

import math
from typing import Any, NamedTuple

import numpy as np
import scipy.fft
from scipy import ndimage

from lumigraph.core.arrays import WORKERS
from lumigraph.core.lattice import Layout
from lumigraph.errors import CalibrationError

SMALLEST_PITCH = 4.0
"""Shortest lattice vector looked for [px]: two pixels for the spot, two for the gap."""

_LONGEST = 1024  # lags looked at [px]
_PART = 0.42  # of the picture: farther lags have little overlap and much noise; 3 lenslets need 0.34
_LEAST = 0.2  # of the autocorrelation's top; noise alone reaches 0.15 on pictures of 100 px
_STRONG = 0.75  # of the strongest peak; the ridges of nearly touching square micro-images reach 0.5
_DIP = 0.15  # how far the autocorrelation must fall between two lattice points


class Vectors(NamedTuple):
    """Reduced lattice vectors (y, x) [px], row vector first, and the layout they form."""

    row: np.ndarray
    column: np.ndarray
    layout: Layout


def lattice_vectors(picture: np.ndarray, layout: Layout | None, pitch: float | None) -> Vectors:
    """Lattice vectors of a flattened picture (y, x), to about 0.01 px.

    Raises
    ------
    CalibrationError
        No period, several pitches, or a pitch or layout that the picture does not support.
    """
    correlation = _autocorrelation(picture)
    peaks = _Peaks(correlation)
    first, second = _shortest(peaks, pitch, layout)
    first, second = (_refined(correlation, vector) for vector in (first, second))
    first, second = _reduced(first, second)
    found = _classify(first, second, layout)
    if pitch is None and layout is None:
        _check_single(peaks, first, second)
    return Vectors(*_oriented(first, second, found), found)


def _autocorrelation(picture: np.ndarray) -> np.ndarray:
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


def flattened(picture: np.ndarray) -> np.ndarray:
    """Picture above its dark level, divided by a smooth quadratic surface: about 1 on average everywhere."""
    ny, nx = picture.shape
    step = max(1, min(ny, nx) // 512)
    sparse = picture[::step, ::step]
    dark = np.float32(np.percentile(sparse, 2))
    y, x = np.linspace(-1, 1, ny, dtype=np.float32), np.linspace(-1, 1, nx, dtype=np.float32)
    surface = Surface(2).fit(y[::step, None], x[None, ::step], sparse - dark)
    return (picture - dark) / surface(y[:, None], x[None, :])


class Surface:
    """Polynomial surface of brightness, kept above a tenth of its top."""

    def __init__(self, degree: int) -> None:
        self.powers = [(a, b) for a in range(degree + 1) for b in range(degree + 1 - a)]
        self.weights: list[np.float32] = []
        self.floor = np.float32(0)

    def fit(self, y: np.ndarray, x: np.ndarray, values: np.ndarray) -> "Surface":
        """Least squares through values at y and x, which broadcast."""
        terms = [np.broadcast_to(y**a * x**b, values.shape).ravel() for a, b in self.powers]
        self.weights = list(np.linalg.lstsq(np.stack(terms, -1), values.ravel(), rcond=None)[0])
        self.weights = [np.float32(w) for w in self.weights]
        self.floor = np.float32(-np.inf)
        self.floor = np.float32(max(0.1 * float(self(y, x).max()), 1e-30))
        return self

    def __call__(self, y: np.ndarray, x: np.ndarray) -> np.ndarray:
        """The surface at y and x, which broadcast."""
        total = np.zeros(np.broadcast_shapes(y.shape, x.shape), np.float32)
        for weight, (a, b) in zip(self.weights, self.powers, strict=True):
            total += weight * y**a * x**b
        return np.maximum(total, self.floor)


class _Peaks:
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
        """Whether the autocorrelation falls and rises again between lag 0 and this peak."""
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


def _shortest(peaks: _Peaks, pitch: float | None, layout: Layout | None) -> tuple[np.ndarray, np.ndarray]:
    """The two shortest strong lattice vectors that are not parallel."""
    top = peaks.top()
    if top < _LEAST:
        raise CalibrationError(
            f"the white image shows no lattice: its autocorrelation returns to {top:.2f} of its top at most, "
            "where a lattice gives over {_LEAST:g}. Use an evenly lit, focused white image with dark gaps "
            "between at least 3 x 3 micro-images."
        )
    strong = peaks.strong(_STRONG * top)
    if pitch is not None:
        strong = _near_pitch(peaks, strong, pitch, top)
    first = peaks.lags[strong[0]]
    for index in strong[1:]:
        second = peaks.lags[index]
        sine = abs(first[0] * second[1] - first[1] * second[0]) / math.hypot(*first) / math.hypot(*second)
        if sine > 0.5 and _fits(first, second, layout):
            return first.astype(float), second.astype(float)
    size = math.hypot(*first)
    raise CalibrationError(
        f"the white image repeats every {size:.1f} px in one direction only"
        + (f" of a {layout} lattice" if layout else "")
        + ". At least 3 x 3 lenslets are needed; pass the layout= that it has, or none."
    )


def _fits(first: np.ndarray, second: np.ndarray, layout: Layout | None) -> bool:
    """Whether two vectors may be neighbours of a layout; a hexagon's are 60° apart, a square's 90°."""
    if layout is None:
        return True
    cosine = abs(float(first @ second)) / math.hypot(*first) / math.hypot(*second)
    return (cosine > 0.25) == (layout == "hex") and math.hypot(*second) < 1.3 * math.hypot(*first)


def _near_pitch(peaks: _Peaks, strong: list[int], pitch: float, top: float) -> list[int]:
    """Peaks within 10 % of the pitch that was asked for, weak ones too."""
    near = [i for i in peaks.strong(0.3 * top) if abs(peaks.lengths[i] - pitch) <= 0.1 * pitch + 1]
    shorter = [i for i in strong if peaks.lengths[i] < 0.85 * pitch]
    hides = near and shorter and peaks.heights[shorter[0]] > 0.9 * peaks.heights[near].max()
    if near and not hides:
        return near
    shown = peaks.lengths[strong[0]]
    raise CalibrationError(
        f"the white image has no lattice of pitch {pitch:g} px: it repeats every {shown:.1f} px. "
        f"Leave pitch out, or pass pitch={shown:.1f}."
    )


def _reduced(first: np.ndarray, second: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Shortest basis of the same lattice (Lagrange and Gauss)."""
    for _ in range(20):
        if first @ first > second @ second:
            first, second = second, first
        steps = round(float(first @ second / (first @ first)))
        if steps == 0:
            break
        second = second - steps * first
    return first, second


def _refined(correlation: np.ndarray, vector: np.ndarray) -> np.ndarray:
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


def _classify(first: np.ndarray, second: np.ndarray, layout: Layout | None) -> Layout:
    """Layout of a reduced basis: neighbours 60° apart are hexagonal, 90° square."""
    ratio = math.hypot(*second) / math.hypot(*first)
    angle = math.degrees(math.acos(abs(float(first @ second)) / math.hypot(*first) / math.hypot(*second)))
    found: Layout = "hex" if angle < 75 else "square"
    if layout is not None and layout != found:
        raise CalibrationError(
            f"the white image shows neighbours {angle:.1f} deg apart, a {found} lattice, "
            f"but layout={layout!r} was asked for. Leave layout out, or pass pitch= as well."
        )
    if ratio > 1.25:
        raise CalibrationError(
            f"the white image shows 2 pitches ({math.hypot(*first):.1f}, {math.hypot(*second):.1f} px) "
            f"{angle:.0f} deg apart, where a square or hexagonal lattice has one. "
            "Check that the micro-images have dark gaps on all sides, or pass pitch= yourself."
        )
    return found


def _check_single(peaks: _Peaks, first: np.ndarray, second: np.ndarray) -> None:
    """Refuse a picture whose strong repeats are not all points of one lattice."""
    matrix = np.linalg.inv(np.stack([first, second], -1))
    strong = peaks.strong(_STRONG * peaks.top())
    near = [i for i in strong if peaks.lengths[i] < 4 * math.hypot(*second)]
    cells = peaks.lags[near] @ matrix.T
    off = np.hypot(*((cells - np.rint(cells)) @ np.stack([first, second], -1).T).T)
    slack = 1.5 + 0.05 * math.hypot(*first)
    strays = sorted({round(float(peaks.lengths[i]), 1) for i, d in zip(near, off, strict=True) if d > slack})
    if len(strays) > 0.25 * len(near):
        pitches = [round(math.hypot(*first), 1), *strays[:2]]
        raise CalibrationError(
            f"the white image shows {len(pitches)} pitches ({', '.join(f'{p:g}' for p in pitches)} px) "
            "where a lattice has one. Check that it was taken at the same zoom and focus as the raw image, "
            "or pass pitch= yourself."
        )


def _oriented(first: np.ndarray, second: np.ndarray, layout: Layout) -> tuple[np.ndarray, np.ndarray]:
    """Row vector nearest to +x, and the vector to the next row 90° or 60° further towards +y."""
    around = [first, second, -first, -second]
    if layout == "hex":
        third = first - second if first @ second > 0 else first + second
        around += [third, -third]
    angles = [math.atan2(y, x) for y, x in around]
    row = min(range(len(around)), key=lambda k: (round(abs(angles[k]), 6), -angles[k]))
    step = math.pi / 3 if layout == "hex" else math.pi / 2
    turns = [abs(math.remainder(angle - angles[row] - step, 2 * math.pi)) for angle in angles]
    return around[row], around[int(np.argmin(turns))]
