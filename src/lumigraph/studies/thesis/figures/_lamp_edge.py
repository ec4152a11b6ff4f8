"""Image of an edge in a lamp's light, which is coherent in part: simulated, and by Hopkins' integral."""

import numpy as np
from scipy.special import sici

from lumigraph.core.grid import Grid
from lumigraph.instruments import load_camera
from lumigraph.scene import ExtendedSource, Scene, Slice
from lumigraph.simulation import PartiallyCoherent, simulate
from lumigraph.studies.thesis.figures import _two_f as two_f
from lumigraph.units import um

GRID = Grid((120, 640), (20 * um, 5 * um))
"""Object: 2.4 mm by 3.2 mm, the half at x > 0 bright. Fringes are 80 µm apart."""

PIXEL, PIXELS = 8 * um, 80
PLATEAU = slice(55, PIXELS)
"""Pixels from 120 to 312 µm beside the edge, over whose mean an image is taken."""

HIGHEST = two_f.DIAMETER / (2 * two_f.WAVELENGTH * two_f.DISTANCE)


def places() -> np.ndarray:
    """Distances of the pixels from the edge [m]."""
    edge = GRID.x[GRID.shape[1] // 2 - 1 : GRID.shape[1] // 2 + 1].mean()
    return (np.arange(PIXELS) - PIXELS // 2) * PIXEL - edge


def lamp_edge(width: float) -> np.ndarray:
    """A row of the simulated image, over its plateau, for a lamp so wide in apertures of the lens."""
    camera = load_camera(two_f.CAMERA).replace(sensor={"pixel_pitch": PIXEL, "shape": (1, PIXELS)})
    lit = np.broadcast_to((np.arange(GRID.shape[1]) >= GRID.shape[1] // 2).astype(float), GRID.shape)
    lamp = ExtendedSource.disc(width * two_f.DIAMETER / 2 / two_f.DISTANCE, -two_f.DISTANCE)
    row = simulate(camera, Scene([Slice(lit, GRID)]), PartiallyCoherent(lamp, 4e-3)).data[0]
    return row / row[PLATEAU].mean()


def lamp_edge_theory(width: float) -> np.ndarray:
    """The same from the mean over the lamp of an edge's image in closed form; nothing is propagated.

    A point s of the lamp, in apertures of the lens, makes a tilted wave, and the round pupil passes the
    edge's frequencies from -(c + s_x) to c - s_x, c² = 1 - s_y², in units of D/(2λz). The edge's spectrum
    δ(f)/2 + 1/(2πif) over that band gives sines' and cosines' integrals.
    """
    within = (np.arange(9) - 4) / 9 * PIXEL  # a pixel is a mean
    x = 2 * np.pi * HIGHEST * (places()[:, None] + within)
    radii, weights = np.polynomial.legendre.leggauss(12)
    radii, weights = (radii + 1) / 2, weights * (radii + 1)
    light = np.zeros_like(x)
    for radius, weight in zip(radii, weights / weights.sum(), strict=True):
        for angle in (np.arange(32) + 0.5) * np.pi / 16:
            s_y, s_x = width * radius * np.sin(angle), width * radius * np.cos(angle)
            half = np.sqrt(1 - s_y**2)
            (sine_a, cosine_a), (sine_b, cosine_b) = (
                sici(np.abs(x) * end) for end in (half + s_x, half - s_x)
            )
            real = 0.5 + np.sign(x) * (sine_a + sine_b) / (2 * np.pi)
            light += weight / 32 * (real**2 + ((cosine_b - cosine_a) / (2 * np.pi)) ** 2)
    row = light.mean(1)
    return row / row[PLATEAU].mean()
