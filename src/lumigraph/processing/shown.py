"""Pictures and films, as people look at them."""

from pathlib import Path

import numpy as np

from lumigraph import io
from lumigraph.core.arrays import Array, to_numpy
from lumigraph.core.depth_map import DepthMap
from lumigraph.core.stack import Stack

_WHITE = 0.999  # part of the pixels that are not brighter than white
_TRUSTED, _ENOUGH = 0.5, 0.05  # confidence; part of the places
_ENDS = 0.02, 0.98
_LONGEST = 640  # pixels of a film
FRAMES = 15
"""Pictures from one end of a film to the other."""


def ends(found: DepthMap) -> tuple[float, float]:
    """Range of a map but for a few of its values: of those that are trusted, where there are enough."""
    values, trusted = to_numpy(found.values).astype(float), to_numpy(found.trusted(_TRUSTED)).astype(float)
    known = trusted if np.isfinite(trusted).mean() > _ENOUGH else values
    low, high = np.nanquantile(known, _ENDS)
    return float(low), float(high)


def save_picture(picture: Array, path: Path) -> None:
    """Write a picture (y, x[, c]) as PNG: black is 0, white what one pixel in a thousand exceeds."""
    data = to_numpy(picture)
    io.save(data.astype(np.float32), path, white=_white(data))


def save_film(pictures: Array, path: Path) -> None:
    """Write pictures (n, y, x[, c]) as a GIF that goes there and back, one white for all."""
    data = to_numpy(pictures)
    step = -(-max(data.shape[1:3]) // _LONGEST)
    data = data[:, ::step, ::step].astype(np.float32)
    there_and_back = np.concatenate([data, data[-2:0:-1]])
    io.save(Stack(there_and_back), path, white=_white(data))


def _white(data: np.ndarray) -> float:
    return float(np.quantile(data, _WHITE)) or float(data.max()) or 1.0
