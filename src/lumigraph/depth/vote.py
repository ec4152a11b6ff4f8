"""Choice between two maps, place by place, by the views' agreement."""

from dataclasses import replace

import numpy as np
from scipy.ndimage import map_coordinates

from lumigraph.depth.pictures import Pictures
from lumigraph.depth.shading import Shading
from lumigraph.depth.visible import visible
from lumigraph.depth.volume import box

_WINDOW = 10  # px to each side that decide together; of 1, 3, 6, 10 on *antinous* and *cotton*
_MOST = 0.1  # of a picture from 0 to 1: more says only that a place is wrong


def agreed(pictures: Pictures, maps: tuple[np.ndarray, np.ndarray], shading: Shading) -> np.ndarray:
    """Mask (y, x) of places where the second of two maps of movements [px in the outermost view] fits better.

    Fits: the views of the cross that see the place, each moved by the map, differ less from the middle view
    and its shading, over a window.
    """
    first, second = (box(_left(pictures, one, shading), _WINDOW) for one in maps)
    return second < first


def _left(pictures: Pictures, moves: np.ndarray, shading: Shading) -> np.ndarray:
    """Mean difference (y, x) of the views of the cross that see a place."""
    (v, u), center = pictures.middle, pictures.center.mean(0)
    cross = np.zeros_like(pictures.lit)
    cross[v], cross[:, u] = pictures.lit[v], pictures.lit[:, u]
    places = np.meshgrid(*(np.arange(n, dtype=np.float32) for n in moves.shape), indexing="ij")
    total, count = np.zeros_like(moves), np.zeros_like(moves)
    for k, m, on_top in visible(replace(pictures, lit=cross), moves):
        y, x = float(pictures.down[k]), float(pictures.right[m])
        at = [place + moves * np.float32(w) for place, w in zip(places, (y, x), strict=True)]
        seen = on_top & pictures.sees((k, m), at)
        view = map_coordinates(pictures.data[k, m].mean(0), at, order=1, mode="nearest")
        total += seen * np.minimum(np.abs(view - center - shading.at(y, x)), _MOST)
        count += seen
    return total / np.maximum(count, 1)
