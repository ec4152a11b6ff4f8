"""The error of a map to expect: what noise does, and what is at stake beside an edge of depth."""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import maximum_filter, minimum_filter

_NOISE, _DISPUTED, _FARTHER = 0.18, 0.097, 0.041
_NEARER, _FADED = 0.28, {5: 0.59, 9: 0.19}  # of the difference in windows so wide
_AROUND = 15
_FAINT = 0.005  # contrast between neighbours by which an edge of depth shows


@dataclass(frozen=True, slots=True)
class Evidence:
    """What a map rests on.

    Parameters
    ----------
    deviation
        Standard deviation (y, x) by the residuals that are left and the contrast.
    disputed
        Part (y, x) of what sees a place that shows something else there.
    contrast
        Between neighbours of the picture (y, x), of 0 to 1.
    """

    deviation: np.ndarray
    disputed: np.ndarray
    contrast: np.ndarray


def contrast(picture: np.ndarray) -> np.ndarray:
    """Length of the gradient (y, x) of a picture (y, x)."""
    return np.hypot(*np.gradient(picture))


def expected(values: np.ndarray, evidence: Evidence) -> np.ndarray:
    """Mean distance from the truth (y, x) to expect, in the unit of the values and their deviation.

    `values` (y, x) are greater where nearer. A map is most often wrong beside something farther, which it
    takes for a part of what stands before it; the more so if no edge of the picture says where that ends.
    The factors were found by the Poisson likelihood of the errors on the rendered scenes *antinous* and
    *cotton*.
    """
    farther = {width: values - minimum_filter(values, width) for width in (3, *_FADED, _AROUND)}
    nearer = {width: maximum_filter(values, width) - values for width in (3, _AROUND)}
    faint = np.exp(-evidence.contrast / _FAINT)
    error = _NOISE * evidence.deviation + _FARTHER * nearer[3] + _NEARER * farther[3]
    error += faint * sum(part * farther[width] for width, part in _FADED.items())
    return error + _DISPUTED * evidence.disputed * (farther[_AROUND] + nearer[_AROUND])
