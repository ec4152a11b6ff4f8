"""Sharpness of a picture by one slanted edge in it: ISO 12233's e-SFR."""

import math
from dataclasses import dataclass

import numpy as np
from scipy.signal.windows import tukey

from lumigraph.analysis.transfer import cutoff
from lumigraph.core import checks
from lumigraph.core.arrays import Array, to_numpy
from lumigraph.core.brief import brief
from lumigraph.errors import SamplingError

BIN = 0.25
"""Width of the bins across the edge [pixels], four to a pixel as in the standard."""
TAPER = 0.5
"""Part of the line spread that its window tapers; the standard of 2023 uses a cosine-tapered window, too."""
FAINTEST = 3.0
"""Least step across the edge, in standard deviations of the noise beside it."""


@dataclass(frozen=True, slots=True, eq=False)
class SlantedEdge:
    """A picture's sharpness across an edge.

    Parameters
    ----------
    frequencies
        From 0 to 1/pitch, twice what the pixels hold (n,) [1/m], or [cycles/px] without a pitch.
    mtf
        Contrast that is left at each (n,), 1 at 0; the pixels' own blur is in it.
    angle
        Of the edge from the nearer of the pixels' two axes [rad].
    levels
        Dark and bright side.
    position, spread
        Across the edge (m,) [m or px], and the edge's profile from 0 to 1 there (m,).
    """

    frequencies: np.ndarray
    mtf: np.ndarray
    angle: float
    levels: tuple[float, float]
    position: np.ndarray
    spread: np.ndarray

    __repr__ = brief

    def at(self, contrast: float) -> float:
        """Frequency at which the MTF first falls to `contrast`: MTF50 at 0.5, MTF10 at 0.1.

        Raises
        ------
        SamplingError
            It does not fall so far.
        """
        return cutoff(self.frequencies, self.mtf, contrast)


def slanted_edge(image: Array, pitch: float | None = None, *, degree: int = 1) -> SlantedEdge:
    r"""MTF across a straight, slanted edge between two even areas.

    The edge is found in each line of pixels, and a polynomial laid through it. The pixels' distances from it,
    sorted into bins of a quarter of a pixel, sample the edge's profile four times as finely as the pixels do.
    Its difference is the line spread, whose transform is freed from the bins and the difference:

    .. math:: MTF(f) = \frac{|\mathcal F\{w \, \Delta E\}(f)|}{|\mathcal F\{w \, \Delta E\}(0)| \,
              \mathrm{sinc}^2(f / 4)}

    with f in cycles per pixel. Distances are taken along the edge's normal, which is where f points.

    Parameters
    ----------
    image
        (y, x), linear in light, nothing but the edge; 5 degrees from an axis are best.
    pitch
        Of the pixels [m]; None for frequencies in cycles per pixel.
    degree
        Of the polynomial, 1 to 5: more than 1 follows an edge that distortion bends.

    Raises
    ------
    SamplingError
        An image too small or without an edge, an edge that leaves the image at its sides, or one so straight
        along the pixels that they do not sample it between them.

    References
    ----------
    ISO 12233:2023, *Resolution and spatial frequency responses*, annex on e-SFR; P. D. Burns, *Slanted-edge
    MTF for digital camera and scanner analysis*, IS&T PICS 135 (2000). The standard corrects for a difference
    over two bins; here it spans one, and the bins' own width is corrected for as well.

    Examples
    --------
    >>> y, x = np.mgrid[:60, :60] - 29.5
    >>> edge = slanted_edge(np.clip(x - 0.1 * y + 0.5, 0, 1), 5e-6)  # sharp, on pixels of 5 um
    >>> round(math.degrees(edge.angle), 1), round(float(np.interp(1e5, edge.frequencies, edge.mtf)), 2)
    (5.7, 0.64)
    """
    data = np.asarray(to_numpy(image))
    if data.ndim != 2 or min(data.shape) < 16:
        raise SamplingError(f"the edge has shape {data.shape} but needs (y, x) from 16 x 16 pixels on.")
    checks.finite_array("the edge", data)
    checks.whole("degree", degree, 1)
    scale = 1.0 if pitch is None else checks.positive("pitch", pitch)
    data = _upright(data.astype(np.float64))
    line, levels = _line(data, min(degree, 5))
    at, spread = _profile(data, line)
    change = np.diff(spread)
    frequencies, mtf = _transfer(at[:-1] + BIN / 2, change)
    low, high = float(spread[0]), float(spread[-1])
    slope = float(line.deriv()(0.0))
    return SlantedEdge(
        frequencies / scale, mtf, abs(math.atan(slope)), levels, at * scale, (spread - low) / (high - low)
    )


def _upright(data: np.ndarray) -> np.ndarray:
    """The image turned and mirrored such that its edge runs along y and rises towards larger x."""
    rise = np.abs(np.diff(data.mean(0))).max(), np.abs(np.diff(data.mean(1))).max()
    data = data if rise[0] >= rise[1] else data.T
    side = max(2, data.shape[1] // 8)
    return data if data[:, -side:].mean() >= data[:, :side].mean() else data[:, ::-1]


def _line(data: np.ndarray, degree: int) -> tuple[np.polynomial.Polynomial, tuple[float, float]]:
    """Polynomial of the edge's crossing of each row, by the row from the middle; dark and bright level."""
    rows, columns = data.shape
    side = max(2, columns // 8)
    left, right = data[:, :side], data[:, -side:]
    low, high, noise = left.mean(), right.mean(), math.hypot(left.std(), right.std())
    if not high - low > FAINTEST * noise:
        raise SamplingError(
            f"there is no edge: the sides read {low:.4g} and {high:.4g} with a spread of {noise:.2g}. "
            "Cut out one edge between two even areas."
        )
    y, x = np.arange(rows) - (rows - 1) / 2, np.arange(columns - 1) + 0.5
    line = np.polynomial.Polynomial([columns / 2])
    for width in (columns / 2, columns / 4, columns / 4):  # centroids, at first of whole rows
        window = np.clip(np.cos(np.pi / 2 * np.clip((x - line(y)[:, None]) / width, -1, 1)), 0, None) ** 2
        weight = np.diff(data, axis=1) * window
        total = weight.sum(1)
        good = total > 0.25 * (high - low)
        if good.sum() < max(8, rows // 2):
            raise SamplingError(f"only {good.sum()} of {rows} rows show the edge. Cut out one straight edge.")
        line = np.polynomial.Polynomial.fit(y[good], (weight @ x)[good] / total[good], degree).convert()
    crossing = line(y)
    if min(crossing.min(), columns - 1 - crossing.max()) < side:
        raise SamplingError(
            f"the edge goes from column {crossing.min():.1f} to {crossing.max():.1f} of {columns}: too close "
            "to the sides. Cut out a wider or a lower piece."
        )
    if np.ptp(crossing) < 1:
        raise SamplingError(
            f"the edge moves by {np.ptp(crossing):.2g} pixels over {rows} rows: its profile is not sampled "
            "between the pixels. Turn it by some 5 degrees, or take a longer piece."
        )
    return line, (float(low), float(high))


def _profile(data: np.ndarray, line: np.polynomial.Polynomial) -> tuple[np.ndarray, np.ndarray]:
    """Bins' centres across the edge [pixels] and their mean values, over a whole number of pixels' shift."""
    rows, columns = data.shape
    y = np.arange(rows) - (rows - 1) / 2
    slope = line.deriv()(y)
    shift = float(np.ptp(line(y)))
    kept = slice(0, max(8, round(rows * math.floor(shift) / shift)))
    distance = (np.arange(columns) - line(y)[:, None]) / np.hypot(1.0, slope)[:, None]
    distance, values = distance[kept], data[kept]
    reach = min(-distance[:, 0].max(), distance[:, -1].min())
    count = math.floor(reach / BIN)
    number = np.floor(distance / BIN).astype(int) + count
    inside = (number >= 0) & (number < 2 * count)
    filled = np.bincount(number[inside], minlength=2 * count)
    sums, places = (np.bincount(number[inside], of[inside], minlength=2 * count) for of in (values, distance))
    if (filled == 0).any():
        raise SamplingError(
            f"{(filled == 0).sum()} of {2 * count} bins across the edge hold no pixel. Take a longer piece, "
            "or turn the edge to some 5 degrees from the pixels' axes."
        )
    centers, means, places = (np.arange(2 * count) - count + 0.5) * BIN, sums / filled, places / filled
    # Some slopes, such as 4/11, put the pixels of every bin on one side of its centre.
    return centers, means + (centers - places) * np.gradient(means, places)


def _transfer(at: np.ndarray, change: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies [cycles/px] up to 1, and the MTF of a line spread in bins."""
    n = len(change)
    peak = int(np.argmin(np.abs(at)))
    reach = min(peak, n - 1 - peak)
    windowed = change[peak - reach : peak + reach + 1] * tukey(2 * reach + 1, TAPER)
    spectrum = np.abs(np.fft.rfft(windowed, 4 * n))
    frequencies = np.fft.rfftfreq(4 * n, BIN)
    kept = frequencies <= 1
    return frequencies[kept], spectrum[kept] / spectrum[0] / np.sinc(frequencies[kept] * BIN) ** 2
