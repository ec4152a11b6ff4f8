"""A lenslet of the thesis' camera, measured: the wave behind it, and rays through it."""

import numpy as np

from lumigraph import analysis
from lumigraph.core.field import Field
from lumigraph.core.grid import Grid
from lumigraph.elements import ThinLens
from lumigraph.propagation import propagate

FOCAL, PITCH, IMAGE = 5.2e-3, 150e-6, 0.12
"""Values of Tables 5.1, 5.2 and 6.1: f_µ, p and z2 [m]."""

_HALF_CONTRAST = 0.40397  # of the cut-off, where the MTF of a round lens is 1/2: Goodman, equation 6-31


def measured(a: float, b: float, wavelength: float, samples: int = 300) -> tuple[float, float]:
    """Lobe [m] and incoherent cut-off [1/m] of a round lenslet, both on the main-lens image.

    A spherical wave from the point at a, a lens, and the way b to the sensor; nothing of the closed forms but
    the distances [m]. The lobe is twice the first zero, the cut-off follows from where the MTF is one half.
    """
    pupil = Grid.square(samples, 1.02 * PITCH / samples)
    radius2 = pupil.y[:, None] ** 2 + pupil.x**2
    wave = Field(np.exp(1j * np.pi * radius2 / (wavelength * a)), pupil, wavelength)
    airy = wavelength * b / PITCH
    sensor = Grid.square(1201, airy / 10)  # far out, where the last of an Airy pattern's light is
    image = propagate(ThinLens(FOCAL, PITCH)(wave), b, "fresnel", grid=sensor).intensity
    lobe = 2 * analysis.first_zero(sensor.x, image[600])
    frequencies, mtf = analysis.mtf(image, sensor.pitch[1])
    return lobe * a / b, analysis.cutoff(frequencies, mtf, 0.5) / _HALF_CONTRAST * b / a


def traced(a: float, b: float, diameter: float) -> dict[str, float]:
    """Paraxial values: blur and magnification on the sensor, lenslets that a point lights, filling.

    From the rim of the main lens through a point of its image to the lenslets and the sensor.
    """
    rays = np.array([[0.0, 0.0], [-0.01, 0.01]])  # heights and angles of two rays from a point of the image
    through = _free(b) @ _lens(FOCAL) @ _free(a)
    heights = (through @ rays)[0]
    up = (through @ np.array([[1e-5], [0.0]]))[0, 0]
    rim = np.array([diameter / 2, -diameter / 2])
    lit = np.ptp(-rim / IMAGE * a) / PITCH
    filled = np.ptp(rim / (IMAGE + a) * b) / PITCH
    return {"blur": float(np.ptp(heights)), "magnification": -up / 1e-5, "lenslets": lit, "filled": filled}


def _free(distance: float) -> np.ndarray:
    return np.array([[1.0, distance], [0.0, 1.0]])


def _lens(focal_length: float) -> np.ndarray:
    return np.array([[1.0, 0.0], [-1 / focal_length, 1.0]])
