"""Error of an image against a reference."""

import math

import numpy as np

from lumigraph.core.arrays import Array, to_numpy
from lumigraph.errors import LumigraphError


def snr(image: Array, reference: Array) -> float:
    r"""Signal to error ratio of an image [dB].

    .. math:: 10 \log_{10} \frac{\sum I_{ref}^2}{\sum (I - I_{ref})^2}

    Parameters
    ----------
    image, reference
        Real, of one shape and one scale.

    Returns
    -------
    float
        Infinite where both are equal.

    Raises
    ------
    LumigraphError
        Different shapes, complex numbers, or a reference without light.

    Examples
    --------
    >>> snr(np.array([1.1, 1.0]), np.array([1.0, 1.0]))
    23.01...
    """
    found, right = _pair(image, reference)
    error = float(np.square(found - right).sum())
    return math.inf if error == 0 else 10 * math.log10(float(np.square(right).sum()) / error)


def rms_error(image: Array, reference: Array, *, scaled: bool = True) -> float:
    r"""Root mean square error of an image, relative to the reference's root mean square.

    .. math:: \sqrt{\sum (a I - I_{ref})^2 / \sum I_{ref}^2}

    Parameters
    ----------
    image, reference
        Real, of one shape.
    scaled
        Whether the image is first scaled by the a that makes the error smallest; else a = 1.

    Raises
    ------
    LumigraphError
        Different shapes, complex numbers, or a reference without light.

    Examples
    --------
    >>> round(rms_error(np.array([2.0, 4.0]), np.array([1.0, 2.0])), 12)
    0.0
    """
    found, right = _pair(image, reference)
    power = float(np.square(found).sum())
    a = float((found * right).sum()) / power if scaled and power else 1.0
    return math.sqrt(float(np.square(a * found - right).sum()) / float(np.square(right).sum()))


def _pair(image: Array, reference: Array) -> tuple[np.ndarray, np.ndarray]:
    found, right = (np.asarray(to_numpy(array)) for array in (image, reference))
    if found.shape != right.shape:
        raise LumigraphError(
            f"the image has shape {found.shape} but the reference {right.shape}. Bring them onto one grid."
        )
    if found.dtype.kind == "c" or right.dtype.kind == "c":
        raise LumigraphError("the image or the reference is complex. Compare intensities, abs(field)**2.")
    if not right.any():
        raise LumigraphError("the reference is zero everywhere. There is nothing to compare with.")
    return found.astype(np.float64), right.astype(np.float64)
