"""Lytro ESLF mosaics: one picture in which the lenslets stand on a square grid, each a block of n x n pixels.

Lytro's Power Tools export Illum pictures so, with 14 x 14 views of 541 x 376 pixels. Pixels of a block are
directions in the order of the sensor's, the picture upright: the first of them is seen from the top left.
"""

import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np

from lumigraph.core import checks
from lumigraph.core.arrays import to_numpy
from lumigraph.core.lightfield import LightField
from lumigraph.core.raw import RawImage
from lumigraph.errors import FormatError, SamplingWarning
from lumigraph.io import bmp, jpeg, png, pnm, source, tiff
from lumigraph.io.cameras import from_cameras, to_cameras

ILLUM = 14
"""Views of the Illum along each side."""

_LOADERS: dict[str, Callable[..., object]] = {
    ".png": png.load, ".jpg": jpeg.load, ".jpeg": jpeg.load, ".bmp": bmp.load, ".tif": tiff.load,
    ".tiff": tiff.load, ".pgm": pnm.load, ".ppm": pnm.load, ".pnm": pnm.load,
}  # fmt: skip
_SIDES = range(3, 31)  # what a guess may be
_LEAST = 0.02  # share of the variance from which something repeats
_BLOCKS = 4  # along each side, where sides are no multiples
_SHARE = 0.8  # of the best score that the smallest side must have: its multiples score as well


def load(
    path: Path, *, views: int | tuple[int, int] | None = None, max_pixels: int = source.MAX_PIXELS
) -> LightField:
    """The light field of a mosaic.

    Parameters
    ----------
    path
        A picture of any format.
    views
        Pixels of a block (v, u); guessed if left out, with a warning that names the guess.
    max_pixels
        Larger pictures are refused.

    Raises
    ------
    FormatError
        A picture smaller than a block, or in which no guess is possible.

    Warns
    -----
    UserWarning
        The number of views is a guess.
    SamplingWarning
        Rows or columns behind the last whole block are left out.
    """
    raw = _LOADERS[path.suffix.lower()](path, max_pixels=max_pixels)
    if not isinstance(raw, RawImage):
        raise FormatError(f"{path} holds several pages where one mosaic is needed. Save one of them alone.")
    data = np.asarray(to_numpy(raw.data))
    if views is None:
        side = guess(data)
        told = f"{path} is read as {side} x {side} views, a guess. Give views= to be sure."
        warnings.warn(told, stacklevel=4)
        views = side
    rows, columns = checks.shape("views", views)
    height, width = raw.shape[0] // rows, raw.shape[1] // columns
    size = f"{raw.shape[0]} x {raw.shape[1]}"
    if height < 1 or width < 1:
        raise FormatError(f"{path} has {size} pixels, fewer than {rows} x {columns} views.")
    if (height * rows, width * columns) != raw.shape:
        told = (
            f"{path} has {size} pixels, no multiple of {rows} x {columns} views: the last "
            f"{raw.shape[0] - height * rows} rows and {raw.shape[1] - width * columns} columns are left out."
        )
        warnings.warn(told, SamplingWarning, stacklevel=4)
    data = data[: height * rows, : width * columns]
    blocks = data.reshape(height, rows, width, columns, *data.shape[2:])
    return from_cameras(np.moveaxis(blocks, (1, 3), (0, 1)))


def save(views: LightField, path: Path, *, white: float | None = None) -> None:
    """Write a light field as a mosaic; its lengths are not kept. Floats are scaled as in a PNG."""
    cameras = to_cameras(LightField(to_numpy(views.data), views.aperture, views.lenslets, views.separation))
    rows, columns, height, width = cameras.shape[:4]
    blocks = np.moveaxis(cameras, (0, 1), (1, 3))
    png.save(RawImage(blocks.reshape(height * rows, width * columns, *cameras.shape[4:])), path, white=white)


def guess(mosaic: np.ndarray) -> int:
    """Side of the blocks of a mosaic (y, x[, c]): the Illum's where it fits, else by what repeats.

    The mean block differs from an even one by the vignetting of the lenslets; the smallest side that
    explains about as much of the picture's variance as any does wins.

    Raises
    ------
    FormatError
        Nothing repeats.
    """
    height, width = mosaic.shape[:2]
    if (height // ILLUM, width // ILLUM) == (376, 541):
        return ILLUM
    grey = (mosaic.mean(axis=2) if mosaic.ndim == 3 else mosaic).astype(np.float32)
    whole = [n for n in _SIDES if height % n == 0 and width % n == 0]
    scores = {n: _score(grey, n) for n in whole}
    if max(scores.values(), default=0.0) <= _LEAST:
        scores = {n: _score(grey, n) for n in _SIDES if _BLOCKS * n <= min(height, width)}
    best = max(scores.values(), default=0.0)
    if best <= _LEAST:
        raise FormatError(f"nothing repeats in {height} x {width} pixels. Give views= yourself.")
    return min(n for n, score in scores.items() if score >= _SHARE * best)


def _score(grey: np.ndarray, n: int) -> float:
    """Share of the variance within blocks that the mean block explains, less what chance would."""
    rows, columns = (side // n for side in grey.shape)
    blocks = grey[: rows * n, : columns * n].reshape(rows, n, columns, n)
    mean = blocks.mean(axis=(1, 3), keepdims=True)
    within = float(((blocks - mean) ** 2).mean())
    explained = float(((blocks - mean).mean(axis=(0, 2)) ** 2).mean())
    return explained / within - 1 / (blocks.shape[0] * blocks.shape[2]) if within > 0 else 0.0
