"""Lenslets and pixels of a raw image whose lattice is known."""

from typing import NamedTuple

import numpy as np

from lumigraph.core.calibration import Calibration
from lumigraph.elements.objective import Objective
from lumigraph.operators.microscope_bench import DEGREE
from lumigraph.operators.microscope_building import Layout
from lumigraph.operators.microscope_cell import CellSampling, Lenslet
from lumigraph.operators.microscope_pixels import placement, whole_pixels
from lumigraph.operators.microscope_samples import samples_needed

PIXELS = 0.6
"""Of the accuracy, what the interpolation of pixels may take."""


class Behind(NamedTuple):
    """Sensor behind the lenslets: places of the micro-images, and the pixels' fill factor."""

    calibration: Calibration
    fill: float


def cell_sampling(
    objective: Objective, lenslet: Lenslet, behind: Behind, points: int, depths: tuple[float, ...],
    accuracy: float,
) -> CellSampling:  # fmt: skip
    """Sampling of a cell: so many points of the object along a lenslet, and its pixels, or samples
    between which they are interpolated.
    """
    calibration, fill = behind
    if N := whole_pixels(calibration, accuracy):
        return CellSampling(points, N, fill / N, 0, fill**2)
    return interpolated(objective, lenslet, behind, points, depths, accuracy)


def interpolated(
    objective: Objective, lenslet: Lenslet, behind: Behind, points: int, depths: tuple[float, ...],
    accuracy: float, samples: int | None = None,
) -> CellSampling:  # fmt: skip
    """Sampling of pixels wherever they stand: so many samples along a lenslet, or as many as are needed."""
    width = behind.fill / behind.calibration.lattice.pitch
    N = samples or samples_needed(objective, lenslet, width, depths, PIXELS * accuracy)
    return CellSampling(points, N, width, DEGREE, behind.fill**2)


def laid_out(
    sampling: CellSampling, calibration: Calibration, size: float, dtype: type = np.float32
) -> Layout:
    """Lenslets that are seen, each so large in the object [m], with their pixels."""
    placed, cells, middle = placement(calibration, sampling.pixels, sampling.degree, dtype)
    step = size / calibration.lattice.pitch
    y, x = ((middle[k] - calibration.shape[k] // 2) * step for k in (0, 1))
    return Layout(cells, sampling, placed, (float(y), float(x)))
