"""Gaussian low-pass of rendered pictures, against the seams of their patches."""

import math

import numpy as np
from scipy.ndimage import gaussian_filter

from lumigraph.core import checks
from lumigraph.core.arrays import Array, to_numpy

_REACH = 6.0  # standard deviations, beyond which the kernel is below single precision


def low_pass(picture: Array, pitch: float, deviation: float) -> np.ndarray:
    r"""Picture (y, x[, c]), or profile (x,), whose spectrum is multiplied by a Gaussian.

    .. math:: \exp\left(-\frac{f^2}{2 \sigma^2}\right)

    Seams between patches have frequencies beyond what lenslets let through, which
    `design.plenoptic2.rendered_cutoff` gives; contrast below it is lowered too, by the same factor.

    Parameters
    ----------
    picture
        Values; edges are mirrored.
    pitch
        Distance of its samples [m].
    deviation
        σ, of the filter in frequency [1/m]. The thesis has 1.162e4 /m.

    References
    ----------
    Thesis, section 5.6, figures 5.21 to 5.27.

    Examples
    --------
    >>> x = np.arange(400) * 5e-6
    >>> wave = low_pass(np.cos(2 * np.pi * 8000 * x), 5e-6, 1.162e4)
    >>> round(float(np.abs(wave[100:300]).max()), 3)
    0.789
    """
    data = np.asarray(to_numpy(picture))
    sigma = 1 / (
        2 * math.pi * checks.positive("deviation", deviation, "1/m") * checks.positive("pitch", pitch)
    )
    widths = (sigma,) * min(data.ndim, 2) + (0.0,) * max(0, data.ndim - 2)
    return gaussian_filter(data, widths, truncate=_REACH)
