"""Beads of a volume: where the light of an object stands that consists of points."""

import numpy as np
from scipy.ndimage import gaussian_filter

from lumigraph.scene import Points

SMOOTH = 0.7
"""Standard deviation by which a volume is smoothed before its highest sample is looked for [samples]."""


def brightest(
    volume: np.ndarray,
    axes: tuple[np.ndarray, np.ndarray, np.ndarray],
    apart: tuple[float, float],
    faint: float,
) -> Points:
    """Beads of a volume (z, y, x): the highest sample with what is around it, then the next.

    Parameters
    ----------
    volume
        At least 0.
    axes
        Places (z, y, x) of the samples [m].
    apart
        Half axes of the spheroid around a bead, across and along the axis, whose light is its own [m].
    faint
        Light of a bead, over the brightest's, below which there is none.
    """
    left = gaussian_filter(np.asarray(volume, np.float64), SMOOTH)
    z, y, x = axes[0][:, None, None], axes[1][:, None], axes[2]
    found: list[tuple[float, float, float, float]] = []
    while (highest := left.max()) > 0:
        k, i, j = np.unravel_index(int(left.argmax()), left.shape)
        away = ((y - axes[1][i]) ** 2 + (x - axes[2][j]) ** 2) / apart[0] ** 2
        own = np.where(away + ((z - axes[0][k]) / apart[1]) ** 2 <= 1, left, 0)
        light = float(own.sum())
        if found and light < faint * max(bead[3] for bead in found):
            break
        near = np.where(own > highest / 3, own, 0)
        place = [float((near * at).sum() / near.sum()) for at in (y, x, z)]
        found.append((place[0], place[1], place[2], light))
        left = left - own
    table = np.array(found).reshape(-1, 4)
    return Points(table[:, :3], table[:, 3])
