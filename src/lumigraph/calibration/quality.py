"""Quality beyond the lattice: how much of each micro-image is lit, and which kind is sharp."""

import numpy as np
from scipy import ndimage

from lumigraph.core.calibration import Calibration

_SPOT = 0.03  # of the pitch: radius in which the middle of the smallest spots is bright


def fill_of(cell: np.ndarray) -> float | None:
    """Width of the mean micro-image at half its brightness over the pitch; 1 where micro-images touch.

    The lit part of a micro-image is the main lens' stop seen through a lenslet: it fills the pitch where the
    f-numbers match. None where the mean micro-image (m, m), its centre first, has no contrast.
    """
    size = len(cell)
    dark, small = float(cell.min()), max(_SPOT, 1.5 / size)
    bright = max(float(np.median(cell[near_centre(size, part)])) for part in (0.12, small))
    if bright - dark <= 0.05 * max(abs(bright), 1e-30):
        return None
    level = dark + (bright - dark) / 2
    widths = [_width(line, level) for line in (cell[0], cell[:, 0])]
    return float(np.mean(widths))


def near_centre(size: int, part: float) -> np.ndarray:
    """True for samples of a cell within a part of the pitch of its centre, which is its first sample."""
    k = np.minimum(np.arange(size), size - np.arange(size)) / size
    return k[:, None] ** 2 + k**2 <= part**2


def _width(line: np.ndarray, level: float) -> float:
    size = len(line)
    total = 0.0
    for way in (line, np.roll(line[::-1], 1)):
        below = np.flatnonzero(way[: size // 2 + 1] < level)
        if not len(below) or below[0] == 0:
            total += 0.5
            continue
        k = int(below[0])
        total += (k - 1 + (way[k - 1] - level) / (way[k - 1] - way[k])) / size
    return total


def sharpness_of(picture: np.ndarray, model: Calibration) -> tuple[float, ...]:
    """Contrast of the details in the three kinds of micro-images over their mean; empty for one kind."""
    if model.lattice.kinds != 3:
        return ()
    energies = lens_energies(picture, model)
    means = [float(np.median(energies[k])) for k in range(3)]
    return tuple(m / max(float(np.mean(means)), 1e-30) for m in means)


def lens_energies(picture: np.ndarray, model: Calibration) -> list[np.ndarray]:
    """Mean squared detail inside each micro-image over its squared brightness, for each of three kinds."""
    smooth = ndimage.gaussian_filter(np.asarray(picture, np.float32), 0.8)
    detail = ndimage.gaussian_filter(np.square(ndimage.laplace(smooth)), model.lattice.pitch * 0.12)
    light = ndimage.gaussian_filter(smooth, model.lattice.pitch * 0.12)
    pitch, (ny, nx) = model.lattice.pitch, model.shape
    indices = model.indices_within((pitch / 2, ny - 1 - pitch / 2), (pitch / 2, nx - 1 - pitch / 2))
    rows, columns = np.rint(model.position(indices)).astype(int).T
    energy = detail[rows, columns] / np.maximum(light[rows, columns] ** 2, 1e-12)
    kinds = np.mod(indices[:, 1] - indices[:, 0], 3)
    return [energy[kinds == k] for k in range(3)]
