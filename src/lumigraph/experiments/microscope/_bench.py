"""The microscope of these experiments, its noise, and the deconvolution of its raw images."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from lumigraph.deconvolution import Exposure, LowPass, RichardsonLucy, deconvolve
from lumigraph.deconvolution.filters import widths_of
from lumigraph.instruments import LightFieldMicroscope

HAZE = 1.0
"""Photons of the background on every pixel."""

PIXELS = 15
"""Pixels of a lenslet, along each side."""


def scope(count: int) -> LightFieldMicroscope:
    """20x/0.5 with lenslets of 125 µm and f/20, the microscope of M. Broxton et al. (2013)."""
    tables: dict[str, Any] = {  # as in a camera file: the model makes its own types of them
        "objective": {"magnification": 20.0, "numerical_aperture": 0.5},
        "lenslets": {"pitch": "125 um", "focal_length": "2.5 mm", "count": (count, count)},
        "sensor": {"pixel_pitch": "8.33 um"},
    }
    return LightFieldMicroscope(wavelength=525e-9, **tables)


def exposed(truth: np.ndarray, operator: Any, rng: np.random.Generator) -> np.ndarray:
    """Photons on each pixel (ny, nx), counted."""
    return rng.poisson(operator.forward(truth) + HAZE).astype(np.float32)


def found_by(
    distances: Sequence[float], operator: Any, raw: np.ndarray, iterations: int, *, accelerated: bool = False
) -> np.ndarray:
    """Volume (z, y, x) by Richardson-Lucy, with a low-pass of these widths [m]."""
    widths = widths_of(distances, operator.object_grid.pitch[0])
    method = RichardsonLucy(filter=LowPass(widths), accelerated=accelerated)
    return deconvolve(raw, operator, iterations, method=method, exposure=Exposure(background=HAZE))
