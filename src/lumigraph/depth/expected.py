"""The error of a map to expect: what noise does, and what is at stake beside an edge of depth."""

import numpy as np
from scipy.ndimage import maximum_filter, minimum_filter

_NOISE, _STAKES = 0.385, ((3, 0.17), (5, 0.073), (9, 0.03))
"""Expected error per standard deviation, and per difference between neighbours (width of the window, part).

By least squares without negative numbers, from the errors on the rendered scenes *antinous* and *cotton*.
"""


def expected(values: np.ndarray, deviation: np.ndarray) -> np.ndarray:
    """Mean distance from the truth (y, x) to expect, in the unit of the values and their deviation (y, x)."""
    error = _NOISE * deviation
    for width, part in _STAKES:
        error = error + part * (maximum_filter(values, width) - minimum_filter(values, width))
    return error
