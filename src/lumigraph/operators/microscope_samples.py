"""How many samples along a lenslet of a microscope pixels are interpolated from."""

import math
from dataclasses import replace
from functools import lru_cache

from lumigraph.core import arrays
from lumigraph.elements.objective import Objective
from lumigraph.operators.microscope_bench import DEGREE, Bench, sampled
from lumigraph.operators.microscope_cell import CellSampling, Lenslet
from lumigraph.operators.microscope_kernels import Demand, margin_of
from lumigraph.operators.microscope_waves import Crossed

WIDEST = 8
"""Cells to each side of the window by which the number of samples is chosen."""


@lru_cache(maxsize=64)
def samples_needed(objective: Objective, lenslet: Lenslet, width: float, dz: float, accuracy: float) -> int:
    """Samples N along a lenslet from which pixels of a width [lenslets] are interpolated to an accuracy.

    By the spectra of two points, in the focused plane and at a depth.
    """
    cutoff = 2 * lenslet.pitch**2 / (objective.wavelength * abs(lenslet.distance))
    lit = abs(dz) * objective.aperture / math.sqrt(objective.medium**2 - objective.aperture**2)
    reach = min(2 + math.ceil(lit * lenslet.magnification / lenslet.pitch), WIDEST)
    margin = max(3.0, margin_of(objective, lenslet, dz, Demand(accuracy, reach)))
    sampling = CellSampling(1, 1, width, DEGREE)
    bench = (Bench if lenslet.is_round else Crossed)(objective, lenslet, sampling, reach, margin)
    places = ((0.03, -0.46), 0.0), ((0.21, 0.37), dz)
    spectra = [arrays.fft2(light) for point, at in places for light in bench.lights(at, [point])]
    N = max(2, math.floor(cutoff))
    while max(sampled(one, bench.fine, replace(sampling, pixels=N))[1] for one in spectra) > accuracy:
        N = math.ceil(1.06 * N)
    return N
