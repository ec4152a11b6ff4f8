"""Lytro ESLF mosaics: one PNG in which the lenslets stand on a square grid, each a block of n x n pixels.

Lytro's Power Tools export Illum pictures so, with 14 x 14 views of 541 x 376 pixels. Pixels of a block are
directions in the order of the sensor's, the picture upright: the first of them is seen from the top left.
"""

import warnings
from pathlib import Path

import numpy as np

from lumigraph.core import checks
from lumigraph.core.arrays import to_numpy
from lumigraph.core.lightfield import LightField
from lumigraph.core.raw import RawImage
from lumigraph.errors import FormatError
from lumigraph.io import png, source
from lumigraph.io.cameras import from_cameras, to_cameras

ILLUM = 14
"""Views of the Illum along each side."""

_SIDES = range(3, 31)  # what a guess may be
_SHARE = 0.8  # of the best score that the smallest side must have: its multiples score as well


def load(
    path: Path, *, views: int | tuple[int, int] | None = None, max_pixels: int = source.MAX_PIXELS
) -> LightField:
    """The light field of a mosaic.

    Parameters
    ----------
    path
        A PNG.
    views
        Pixels of a block (v, u); guessed if left out, with a warning that names the guess.
    max_pixels
        Larger pictures are refused.

    Raises
    ------
    FormatError
        A picture whose sides are no multiples of the views, or in which no guess is possible.
    """
    raw = png.load(path, max_pixels=max_pixels)
    if views is None:
        side = guess(raw.data)
        told = f"{path} is read as {side} x {side} views, a guess. Give views= to be sure."
        warnings.warn(told, stacklevel=4)
        views = side
    rows, columns = checks.shape("views", views)
    if raw.shape[0] % rows or raw.shape[1] % columns:
        size = f"{raw.shape[0]} x {raw.shape[1]}"
        raise FormatError(f"{path} has {size} pixels, no multiple of {rows} x {columns} views.")
    height, width = raw.shape[0] // rows, raw.shape[1] // columns
    blocks = raw.data.reshape(height, rows, width, columns, *raw.data.shape[2:])
    return from_cameras(np.ascontiguousarray(np.moveaxis(blocks, (1, 3), (0, 1))))


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
        No side divides the picture, or nothing repeats.
    """
    height, width = mosaic.shape[:2]
    if (height, width) == (376 * ILLUM, 541 * ILLUM):
        return ILLUM
    grey = (mosaic.mean(axis=2) if mosaic.ndim == 3 else mosaic).astype(np.float32)
    scores = {n: _score(grey, n) for n in _SIDES if height % n == 0 and width % n == 0}
    best = max(scores.values(), default=0.0)
    if best <= 0.02:
        raise FormatError(f"nothing repeats in {height} x {width} pixels. Give views= yourself.")
    return min(n for n, score in scores.items() if score >= _SHARE * best)


def _score(grey: np.ndarray, n: int) -> float:
    """Share of the variance within blocks that the mean block explains, less what chance would."""
    blocks = grey.reshape(grey.shape[0] // n, n, grey.shape[1] // n, n)
    mean = blocks.mean(axis=(1, 3), keepdims=True)
    within = float(((blocks - mean) ** 2).mean())
    explained = float(((blocks - mean).mean(axis=(0, 2)) ** 2).mean())
    return explained / within - 1 / (blocks.shape[0] * blocks.shape[2]) if within > 0 else 0.0
