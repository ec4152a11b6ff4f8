"""Vignetting: how much light reaches each micro-image."""

import numpy as np
from scipy.ndimage import gaussian_filter

from lumigraph.errors import CalibrationError

_WIDTH = 1.5  # lenslets: what is finer is the micro-images' own shape
_TOP = 99  # percentile that counts as full light: dust and hot pixels are above


def vignetting(white: np.ndarray, pitch: float) -> np.ndarray:
    """Light on each micro-image (y, x), up to 1: a white image smoothed over lenslets.

    The micro-images' own shape is left to the camera's model, as `lumigraph.deconvolve` needs it.

    Parameters
    ----------
    white
        White image above its dark (y, x).
    pitch
        Pitch of the micro-images [px].

    Raises
    ------
    CalibrationError
        No light.

    Examples
    --------
    >>> bool(np.ptp(vignetting(np.full((40, 40), 7.0), 5.0)) < 1e-12)
    True
    """
    smooth = gaussian_filter(np.maximum(white, 0), _WIDTH * pitch, mode="nearest")
    top = float(np.percentile(smooth, _TOP))
    if top <= 0:
        raise CalibrationError(
            "the white image has no light above the dark. Take a picture of an evenly lit surface."
        )
    return np.clip(smooth / top, 0.0, 1.0)
