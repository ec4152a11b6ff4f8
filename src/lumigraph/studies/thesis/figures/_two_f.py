"""The 2f system of the thesis' chapter 3: f = 158 mm, unit magnification, 633 nm, a field of 1 cm."""

import time
import warnings
from collections.abc import Sequence

import numpy as np
from scipy.special import j1

from lumigraph.core.cache import remembered
from lumigraph.core.field import Field
from lumigraph.core.grid import Grid
from lumigraph.elements import CircularAperture, ThinLens, Train
from lumigraph.errors import SamplingWarning
from lumigraph.propagation import Propagate
from lumigraph.units import mm, nm, um

CAMERA = "thesis-2f"
WAVELENGTH, FOCAL_LENGTH, DISTANCE = 633 * nm, 158 * mm, 316 * mm
DIAMETER, DIAMETER_OF_TABLE_4_1 = 5 * mm, 3.6 * mm
GRID = Grid.square(2000, 5 * um)

METHODS: dict[str, tuple[str, float]] = {
    "multi-step Fresnel": ("multi_step_fresnel", 0.0),
    "angular spectrum": ("angular_spectrum", 0.0),
    "band limited (circle)": ("band_limited_circular", 0.0),
    "corrected band limited": ("corrected_band_limited", 0.0),
    "band limited": ("band_limited", 0.0),
    "band limited, padded": ("band_limited", 1.0),
}
"""(method, padding) by name; the first four are those of the thesis."""


def train(name: str, diameter: float) -> Train:
    """Object to sensor by one of `METHODS`."""
    method, pad = METHODS[name]
    way = Propagate(DISTANCE, method, pad)
    return Train((way, ThinLens(FOCAL_LENGTH, diameter), way))


@remembered
def point_image(name: str, diameter: float = DIAMETER, pinhole: float = 0.0) -> tuple[np.ndarray, float]:
    """Image (2000, 2000) of a point, 1 in its middle, and the time [s] that it took with warm caches.

    Parameters
    ----------
    name
        One of `METHODS`.
    diameter
        Diameter of the lens [m].
    pinhole
        Diameter of the source [m]; 0 for one sample.
    """
    data = np.zeros(GRID.shape, np.complex64)
    data[GRID.shape[0] // 2, GRID.shape[1] // 2] = 1
    if pinhole:
        data = CircularAperture(pinhole).transmission(GRID, WAVELENGTH).astype(np.complex64)
    source, elements = Field(data, GRID, WAVELENGTH), train(name, diameter)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SamplingWarning)  # aliasing is what is looked at
        elements(source)
        start = time.perf_counter()
        image = elements(source).intensity
        seconds = time.perf_counter() - start
    return image / image[GRID.shape[0] // 2, GRID.shape[1] // 2], seconds


def profile(image: np.ndarray) -> np.ndarray:
    """Row through the middle of an image."""
    return image[image.shape[0] // 2]


def airy(r: np.ndarray, diameter: float = DIAMETER) -> np.ndarray:
    """Airy pattern (2 J1(v)/v)², v = π D r/(λ z), at distances r [m] from the axis."""
    v = np.pi * diameter * np.abs(r) / (WAVELENGTH * DISTANCE)
    return np.square(np.divide(2 * j1(v), v, out=np.ones_like(v), where=v > 0))


PINHOLE = 10 * um
"""Diameter of the thesis' source in Tables 3.1 and 3.2 and figure 3.6."""


def pinhole_image(diameter: float = DIAMETER) -> np.ndarray:
    """Intensity (2000,) of the row through the middle that a pinhole's samples have, by Airy amplitudes.

    Each sample, in phase with the wave that spreads over the object, has the amplitude 2 J1(v)/v: no
    propagation method is used.
    """
    stop = CircularAperture(PINHOLE).transmission(GRID, WAVELENGTH)
    total = np.zeros(GRID.shape[1], complex)
    for i, j in zip(*np.nonzero(stop), strict=True):
        y, x = GRID.y[i], GRID.x[j]
        v = np.pi * diameter * np.hypot(y, GRID.x - x) / (WAVELENGTH * DISTANCE)
        turn = np.exp(1j * np.pi * (y**2 + x**2) / (WAVELENGTH * DISTANCE))
        total += stop[i, j] * turn * np.divide(2 * j1(v), v, out=np.ones_like(v), where=v > 0)
    light = np.square(np.abs(total))
    return light / light[GRID.shape[1] // 2]


def middle(half: float) -> slice:
    """Samples of `GRID` within `half` [m] of the axis."""
    n, samples = GRID.shape[1] // 2, round(half / GRID.pitch[1])
    return slice(n - samples, n + samples + 1)


def clipped(values: Sequence[float] | np.ndarray, lowest: float) -> np.ndarray:
    """Values for a logarithmic axis: nothing below `lowest`."""
    return np.maximum(values, lowest)
