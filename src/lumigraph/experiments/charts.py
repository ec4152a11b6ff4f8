"""Reading of a USAF-1951 target's picture: the contrast of its elements, and the finest resolved."""

import numpy as np
from scipy.ndimage import map_coordinates

from lumigraph.core.grid import Grid
from lumigraph.scene import targets


def elements(groups: tuple[int, int]) -> list[tuple[float, tuple[float, float], float]]:
    """Frequency [1/m], corner (y, x) and bar width [m], coarse to fine."""
    return [(1 / (2 * width), corner, width) for _, _, corner, width in targets.usaf_elements(groups)]


def contrast(picture: np.ndarray, grid: Grid, corner: tuple[float, float], width: float) -> float:
    """Contrast of an element's bars and gaps, mean of its upright and its lying ones."""
    at, along = (np.arange(5) + 0.5) * width, np.linspace(1, 4, 7) * width
    values = []
    for axis, left in ((1, corner[1]), (0, corner[1] + 7 * width)):
        across, beside = np.meshgrid(at, along, indexing="ij")
        y, x = (beside, across) if axis == 1 else (across, beside)
        places = ((corner[0] + y - grid.y[0]) / grid.pitch[0], (left + x - grid.x[0]) / grid.pitch[1])
        profile = map_coordinates(picture, places, order=1).mean(1)
        bright, dark = profile[::2].mean(), profile[1::2].mean()
        values.append((bright - dark) / max(bright + dark, 1e-30))
    return float(np.mean(values))


def finest_resolved(contrasts: dict[float, float], least: float) -> float:
    """The highest frequency up to which all elements have a contrast [1/m]; 0 if the coarsest has not."""
    finest = 0.0
    for frequency, value in sorted(contrasts.items()):
        if value < least:
            break
        finest = frequency
    return finest
