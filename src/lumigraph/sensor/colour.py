"""Colour filters on pixels."""

import numpy as np

from lumigraph.core import checks
from lumigraph.core.arrays import Array, like, namespace
from lumigraph.core.raw import BAYER_PATTERNS
from lumigraph.errors import FormatError, GeometryError


def mosaic(image: Array, pattern: str = "RGGB") -> Array:
    """What pixels behind a Bayer filter see of a colour image.

    Parameters
    ----------
    image
        (y, x, 3): red, green, blue.
    pattern
        Colours of the first 2 × 2 pixels, row by row: "RGGB", "GRBG", "GBRG" or "BGGR".

    Returns
    -------
    Array
        (y, x), for ``RawImage(..., bayer=pattern)``.

    Raises
    ------
    GeometryError
        An image that is not (y, x, 3).
    FormatError
        An unknown pattern.

    Examples
    --------
    >>> mosaic(np.broadcast_to([10, 20, 30], (2, 4, 3)), "GRBG").tolist()
    [[20, 10, 20, 10], [30, 20, 30, 20]]
    """
    checks.array("a colour image", image)
    if image.ndim != 3 or image.shape[2] != 3:
        raise GeometryError(f"a colour image has shape (y, x, 3), not {tuple(image.shape)}.")
    checks.choice("pattern", pattern, BAYER_PATTERNS, FormatError)
    xp, (rows, columns) = namespace(image), np.indices(tuple(image.shape[:2])) % 2
    result = image[:, :, 1]
    for place, colour in enumerate(pattern):
        if colour != "G":
            here = like(2 * rows + columns == place, image) > 0
            result = xp.where(here, image[:, :, "RGB".index(colour)], result)
    return result
