"""Expected error of a map: by noise, and by what is at stake beside an edge of depth."""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import grey_closing, grey_opening, maximum_filter, minimum_filter

from lumigraph.depth.volume import box

LINES = {
    "noise": 0.26,
    "around": 0.8,
    "nearer": 0.07,
    "farther": 0.29,
    "faint": 0.54,
    "wide": 0.21,
    "disputed": 0.105,
}
"""Factors of the `terms` for views, chosen on *antinous* and *cotton*; see benchmarks/expected.py.

Of "around", the mean of the size of what has a normal distribution of deviation 1.
"""

MICRO_IMAGES = {
    "noise": 0.045,
    "around": 0.8,
    "nearer": 0.01,
    "farther": 0.01,
    "faint": 0.0,
    "wide": 0.34,
    "disputed": 0.2,
}
"""The same for cameras 2.0, chosen on drawn scenes with 1 % of noise; see benchmarks/pixel_depth.py."""

_FADED = {"faint": 5, "wide": 9}  # windows beside whose edges no edge of the picture shows
_AROUND = 15
_RIVALS = 0.5  # of how far other values lie: so large are errors where they explain *antinous* as well
_CHANCE = 0.5  # px: what lies nearer is noise of the costs, as on slants
_GAPS = 3  # samples across that an area of rivals closes over
_AREA = 7  # samples across that it has: beside an edge of depth there are fewer
_EVEN = 1e-6  # contrast of what is saturated or black
_FAINT = 0.005  # contrast between neighbours by which an edge of depth shows
_WINDOWS = (3, 8, 20, 50)  # samples to each side that tell a value; the wider ones, where others say little
_NOTHING, _UNKNOWN = 1e-9, 1e3  # of the most information; px, the deviation where nothing is known


@dataclass(frozen=True, slots=True)
class Evidence:
    """Evidence for a map: noise, contrast, and rival values of each place.

    Parameters
    ----------
    deviation
        Standard deviation (y, x) of a place by itself, as `deviation` makes it.
    around
        Scatter (y, x) of known values where a place follows from those around it only.
    disputed
        Part (y, x) of what sees a place that shows something else there.
    contrast
        Between neighbours of the picture (y, x), of 0 to 1.
    rivals
        How far (y, x) other values lie that explain a place as well; see `lumigraph.depth.volume.rivals`.
    chance
        How likely (y, x) the match is one by chance; see `lumigraph.depth.chance.by_chance`.
    farthest
        Between the least and the greatest value that there may be, which matches by chance may have.
    period
        Error (y, x) that nothing would show, as in textures that repeat.
    """

    deviation: np.ndarray
    around: np.ndarray
    disputed: np.ndarray
    contrast: np.ndarray
    rivals: np.ndarray
    chance: np.ndarray | float = 0.0
    farthest: float = 0.0
    period: np.ndarray | float = 0.0


def deviation(
    values: np.ndarray, information: np.ndarray, variance: np.ndarray, factors: dict[str, float]
) -> tuple[np.ndarray, np.ndarray]:
    r"""Standard deviation (y, x) of a place by itself, by the mean of those around it; how far these scatter.

    .. math:: \sigma^2 = \frac{\langle I^2 \sigma_p^2 \rangle}{\langle I \rangle^2}

    where places pull with an information I = Σ g², and a variance I² σ_p² = Σ g² r² of that pull by the
    residuals r: no noise is assumed to be the same anywhere, and what says nothing, such as saturated
    places, counts for none. Where a window says little, a wider one says what is around; then a place may
    be off the plane through the known values as far as these are (0 in the smallest window). 1000 px where
    nothing is known.

    Parameters
    ----------
    values
        The map (y, x).
    information, variance
        Of the pull at each place (y, x).
    factors
        Of "noise" and "around", by which a window is chosen.

    References
    ----------
    White, "A heteroskedasticity-consistent covariance matrix estimator", Econometrica 48, 817 (1980).
    """
    least = _NOTHING * float(information.max(initial=0))
    part = (factors["noise"] / factors["around"]) ** 2
    own, around = np.full(values.shape, _UNKNOWN**2), np.zeros(values.shape)
    for radius in _WINDOWS:
        known = box(information, radius)
        some = known > least
        square = np.maximum(box(variance, radius), 0) / np.where(some, known, 1) ** 2
        square = np.where(some, square, _UNKNOWN**2)
        beside = _scatter(values, information, radius) if radius > _WINDOWS[0] else np.zeros(values.shape)
        better = part * square + beside < part * own + around
        own, around = np.where(better, square, own), np.where(better, beside, around)
    return np.sqrt(own), np.sqrt(around)


def _scatter(values: np.ndarray, weight: np.ndarray, radius: int) -> np.ndarray:
    """Mean square (y, x) by which values in a window are off a plane of weighted least squares."""
    y, x = (a - a.mean() for a in np.ogrid[: values.shape[0], : values.shape[1]])
    weight = weight.astype(float)
    total = box(weight, radius) + 1e-30

    def mean(part: np.ndarray) -> np.ndarray:
        return box(weight * part, radius) / total

    down, right, level = mean(y), mean(x), mean(values)
    yy, xx = mean(y * y) - down**2, mean(x * x) - right**2
    yx = mean(y * x) - down * right
    by_y, by_x = mean(values * y) - level * down, mean(values * x) - level * right
    square = mean(values * values) - level**2
    least = 1e-3 * radius**2
    yy, xx = yy + least, xx + least
    explained = (xx * by_y**2 - 2 * yx * by_y * by_x + yy * by_x**2) / (yy * xx - yx**2)
    return np.maximum(square - explained, 0)


def contrast(picture: np.ndarray) -> np.ndarray:
    """Length of the gradient (y, x) of a picture (y, x)."""
    return np.hypot(*np.gradient(picture))


def expected(
    values: np.ndarray, evidence: Evidence, factors: dict[str, float], *, slants: bool = True
) -> np.ndarray:
    """Mean distance from the truth (y, x) to expect, in the unit of the values and their deviation.

    `values` (y, x) are greater where nearer. `slants`: see `terms`. Where other values explain an area as
    well, as in a texture that repeats, it is at least a part of how far they lie; where nothing else would
    look different, at least that; and by chance a match may be anywhere.
    """
    parts = terms(values, evidence, slants=slants)
    usual = sum((factors[name] * part for name, part in parts.items()), np.zeros_like(values))
    rivals = np.where(evidence.rivals > _CHANCE, evidence.rivals, 0)
    rivals = _RIVALS * grey_opening(grey_closing(rivals, _GAPS), _AREA)
    blind = np.asarray(evidence.chance) * (evidence.farthest / 2)
    return np.maximum(np.maximum(usual, rivals), np.maximum(evidence.period, blind))


def uniform(evidence: Evidence) -> np.ndarray:
    """Mask (y, x) of places as bright as all around them, as where the picture is saturated or black."""
    return maximum_filter(evidence.contrast, 3) < _EVEN


def terms(values: np.ndarray, evidence: Evidence, *, slants: bool = True) -> dict[str, np.ndarray]:
    """Terms of an expected error (y, x), by name, each in the unit of the values.

    A map is most often wrong beside something farther, which it takes for a part of what stands before it;
    the more so if no edge of the picture says where that ends. What is as much nearer on the other side is no
    edge but a slant. With `slants` it is still at stake where views dispute a place.
    """
    beyond = {width: _beyond_slant(values, width) for width in (3, *_FADED.values())}
    farther = {width: np.maximum(one, 0) for width, one in beyond.items()}
    around = _range(values, _AROUND) if slants else np.abs(_beyond_slant(values, _AROUND))
    faint = np.exp(-evidence.contrast / _FAINT)
    return {
        "noise": evidence.deviation,
        "around": evidence.around,
        "nearer": np.maximum(-beyond[3], 0),
        "farther": farther[3],
        **{name: faint * farther[width] for name, width in _FADED.items()},
        "disputed": evidence.disputed * around,
    }


def _range(values: np.ndarray, width: int) -> np.ndarray:
    """Range (y, x) from the farthest to the nearest value in a window."""
    return maximum_filter(values, width) - minimum_filter(values, width)


def _beyond_slant(values: np.ndarray, width: int) -> np.ndarray:
    """Distance (y, x) to the farthest value in a window, less that to the nearest."""
    return (values - minimum_filter(values, width)) - (maximum_filter(values, width) - values)
