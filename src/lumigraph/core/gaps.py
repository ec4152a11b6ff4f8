"""Dark gaps between micro-images: the part of a raw image that does not depend on the scene."""

import numpy as np
from scipy import ndimage


def valleys(picture: np.ndarray, sigma: float) -> np.ndarray:
    """Upward curvature of the logarithm of a picture (y, x): the dark gaps between micro-images.

    Gaps stand still whatever the scene shows behind the lenslets, and the logarithm takes vignetting and
    brightness out, so that this finds lattices on raw images and behind thin gaps.

    Parameters
    ----------
    picture
        Brightness (y, x).
    sigma
        Standard deviation of the smoothing [px].
    """
    smooth = logarithm(ndimage.gaussian_filter(np.asarray(picture, np.float32), sigma))
    curved = ndimage.correlate1d(smooth, np.array([1, -2, 1], np.float32), axis=0)
    curved += ndimage.correlate1d(smooth, np.array([1, -2, 1], np.float32), axis=1)
    upwards = np.maximum(curved, 0)
    return np.minimum(upwards, np.float32(3 * np.percentile(upwards[::2, ::2], 90) + 1e-12))


def logarithm(picture: np.ndarray) -> np.ndarray:
    """Logarithm of a picture (y, x) above its dark level, level below a fiftieth of its bright parts."""
    low, high = np.percentile(picture[:: max(1, len(picture) // 512)], (0.5, 95))
    above = np.maximum((picture - np.float32(low)) / np.float32(max(float(high - low), 1e-30)), 0)
    return np.log(above + np.float32(0.02)) - np.log(np.float32(0.02))
