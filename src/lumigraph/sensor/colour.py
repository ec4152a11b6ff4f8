"""Colour filters on pixels: mosaic of a picture, and its demosaicing."""

import importlib
import warnings
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from lumigraph.core import checks, memory
from lumigraph.core.arrays import Array, like, namespace, to_numpy
from lumigraph.core.raw import BAYER_PATTERNS, RawImage
from lumigraph.errors import FormatError, GeometryError

METHODS = {"bilinear": "bilinear", "malvar": "Malvar2004", "menon": "Menon2007"}
"""Names of ways to demosaic, and what the library colour-demosaicing calls them.

- "bilinear": mean of the nearest pixels of a colour; colour fringes at edges
- "malvar": linear, 5 x 5 pixels, corrected by the gradient of the colour that was measured; H. S. Malvar,
  L. He and R. Cutler, *High-quality linear interpolation for demosaicing*, ICASSP 2004
- "menon": along the direction of less change, then refined; D. Menon, S. Andriani and G. Calvagno,
  IEEE Trans. Image Process. 16, 132 (2007)
"""

_ROWS, _REACH = 512, 16  # rows demosaiced at once, and pixels around them that reach into them; both even


def mosaic(image: Array, pattern: str = "RGGB") -> Array:
    """Raw image (y, x) of a colour image behind a Bayer filter.

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


def demosaic(
    raw: RawImage, *, method: str = "malvar", white_balance: bool = True, colour_matrix: bool = True
) -> RawImage:
    r"""The colour picture behind a Bayer filter, linear in light; a grey or colour raw image as it is.

    With the levels, gains and matrix that the camera recorded (in `RawImage.metadata`),

    .. math:: w = \min\left(1, g_c \frac{n - b_c}{w_c - b_c}\right), \qquad
              (r, g, b)^T = M \, \mathrm{demosaic}(w)

    Gains are scaled so that the least is 1; pixels that are full then become white in all colours.

    Parameters
    ----------
    raw
        (y, x) with a `bayer` pattern. Its metadata may hold ``black_level`` and ``white_level`` (a number, or
        four for r, gr, gb, b; else 0 and the largest number of `bit_depth`, 1 for floats), ``white_balance``
        (three or four gains) and ``colour_matrix`` (3 x 3, camera to linear sRGB).
    method
        One of `METHODS`.
    white_balance, colour_matrix
        Whether to apply those recorded.

    Returns
    -------
    RawImage
        (y, x, 3) float32 (float64 if the raw image is), 0 to 1, below and above where noise and the matrix
        lead there. ``metadata["demosaiced"]`` names the method; a recorded ``gamma`` is not applied.

    Raises
    ------
    FormatError
        An unknown method, or levels, gains or a matrix that cannot be.

    Examples
    --------
    >>> grey = RawImage(np.ones((4, 6), np.uint8))
    >>> demosaic(grey) is grey
    True
    """
    checks.instance("raw", raw, RawImage, FormatError)
    checks.choice("method", method, METHODS, FormatError)
    if raw.bayer is None:
        return raw
    if raw.data.ndim != 2 or min(raw.shape) < 2:
        raise FormatError(
            f"a Bayer mosaic is (y, x) from 2 x 2 on but the raw image has shape {tuple(raw.data.shape)}."
        )
    data, pattern = to_numpy(raw.data), raw.bayer
    checks.finite_array("the raw image", data, FormatError)
    kind = np.float64 if data.dtype == np.float64 else np.float32
    what = f"a colour picture of {data.shape[0]} x {data.shape[1]} pixels"
    memory.require(3 * data.size * np.dtype(kind).itemsize, what, "Crop it.", FormatError)
    black, white = levels(raw)
    scale = 1 / (white - black)
    gains = _gains(raw.metadata.get("white_balance"), pattern) if white_balance else np.ones((2, 2))
    matrix = _matrix(raw.metadata.get("colour_matrix")) if colour_matrix else np.eye(3)
    decode, picture = _library(method), np.empty((*data.shape, 3), kind)
    across = _mirrored(-_REACH, data.shape[1] + _REACH, data.shape[1])
    for top in range(0, data.shape[0], _ROWS):
        stop = min(data.shape[0], top + _ROWS)
        down = _mirrored(top - _REACH, stop + _REACH, data.shape[0])
        rows = data[down[:, None], across].astype(np.float64)
        rows = (rows - _tiled(black, rows.shape)) * _tiled(gains * scale, rows.shape)
        rows = np.minimum(rows, 1.0) if white_balance else rows
        picture[top:stop] = decode(rows, pattern)[_REACH:-_REACH, _REACH:-_REACH] @ matrix.T
    known = {**raw.metadata, "demosaiced": method}
    return replace(raw, data=picture, bit_depth=None, bayer=None, metadata=known)


def _library(method: str) -> Callable[[np.ndarray, str], np.ndarray]:
    """The function of colour-demosaicing, which takes seconds to import."""
    with warnings.catch_warnings(), np.printoptions():  # it sets NumPy to print as it did years ago
        warnings.simplefilter("ignore")  # it uses names that SciPy is about to drop
        library = importlib.import_module("colour_demosaicing")
    return getattr(library, f"demosaicing_CFA_Bayer_{METHODS[method]}")


def _mirrored(start: int, stop: int, n: int) -> np.ndarray:
    """Indices start ... stop - 1, mirrored about the first and the last pixel, which keeps the colours."""
    index = np.mod(np.arange(start, stop), 2 * n - 2)
    return np.minimum(index, 2 * n - 2 - index)


def levels(raw: RawImage) -> tuple[np.ndarray, np.ndarray]:
    """Black and white level (2, 2) each of the first 2 x 2 pixels of a raw image, as it records them.

    Parameters
    ----------
    raw
        Its metadata may hold ``black_level`` and ``white_level``; else 0, and the largest number of the
        bits, 1 for floats.

    Raises
    ------
    FormatError
        A white level that is not above the black one, or levels that are no numbers.
    """
    full, pattern = float(2**raw.bit_depth - 1) if raw.bit_depth is not None else 1.0, raw.bayer or "RGGB"
    black = _sites("black_level", raw.metadata.get("black_level", 0.0), pattern)
    white = _sites("white_level", raw.metadata.get("white_level", full), pattern)
    if (white <= black).any():
        raise FormatError(f"white_level {white.tolist()} must be above black_level {black.tolist()}.")
    return black, white


def _gains(recorded: Any, pattern: str) -> np.ndarray:
    if recorded is None:
        return np.ones((2, 2))
    gains = _sites("white_balance", recorded, pattern)
    if gains.min() <= 0:
        raise FormatError(f"white_balance is {recorded} but must be gains above 0.")
    return gains / gains.min()


def _sites(name: str, recorded: Any, pattern: str) -> np.ndarray:
    """One number, (r, g, b) or (r, gr, gb, b) as (2, 2) for the first pixels; gr stands beside red."""
    try:
        values = np.asarray(recorded, np.float64).ravel()
    except (TypeError, ValueError):
        values = np.array([np.nan])
    if values.size not in (1, 3, 4) or not np.isfinite(values).all():
        raise FormatError(
            f"{name} is {str(recorded)[:60]} but must be one number, (r, g, b) or (r, gr, gb, b)."
        )
    if values.size == 1:
        return np.full((2, 2), values[0])
    four = values if values.size == 4 else values[[0, 1, 1, 2]]
    red_row = pattern.index("R") // 2
    places = [
        {"R": 0, "B": 3, "G": 1 if k // 2 == red_row else 2}[colour] for k, colour in enumerate(pattern)
    ]
    return four[places].reshape(2, 2)


def _matrix(recorded: Any) -> np.ndarray:
    if recorded is None:
        return np.eye(3)
    try:
        matrix = np.asarray(recorded, np.float64)
    except (TypeError, ValueError):
        matrix = np.zeros(0)
    if matrix.shape != (3, 3) or not np.isfinite(matrix).all():
        raise FormatError(f"colour_matrix is {str(recorded)[:60]} but must be 3 x 3 finite numbers.")
    return matrix


def _tiled(sites: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """The (2, 2) numbers repeated over rows that begin on an even one."""
    rows, columns = np.arange(shape[0]) % 2, np.arange(shape[1]) % 2
    return sites[rows[:, None], columns]
