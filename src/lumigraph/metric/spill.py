r"""Light that lenslets spill into their neighbours' micro-images, and what it does to views.

Behind each lenslet of a camera 1.0 stands a picture of the main lens' stop S, spread by diffraction at the
lenslet's opening, h. At a way w from the middle of a micro-image is light from lenslet k beside it and from
direction u, as much as :math:`S(u)\, h(w - k - u)`. A view takes it all for its own lenslet's, from direction
w. So a part of each corner that it shows stands aside by :math:`k - \sigma (u - w)`, where corners move by σ
of the way from view to view, and the corner is found aside by the mean; what is farther than a lenslet aside
is a ghost beside it, and pulls at it as one does there. It grows as λ b/d². Where that is 0.12, corners in
the plane in focus move by 0.065 of the way from view to view, and b comes out some percent too long.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.interpolate import RegularGridInterpolator
from scipy.signal import fftconvolve
from scipy.special import j1

from lumigraph.core import checks
from lumigraph.core.lattice import Lattice

GREEN = 550e-9
"""Wavelength where none is said [m]."""

FAR, FINE = 3, (64, 160)
"""Neighbours to each side; and samples across a lenslet, of which four go into the light's width: narrower
than 0.025 pitches it moves views by less than 0.01 of their way."""

UNSURE = 0.15
"""Of what is taken out, over itself: by wave optics, up to 0.011 of 0.088 is left from view to view."""


@dataclass(frozen=True, slots=True)
class Spill:
    """What it depends on, but for the lenslets' distance from the sensor.

    Parameters
    ----------
    lattice
        Of the micro-images [px].
    fill
        Width of a micro-image over their pitch.
    wavelength
        Of the light [m].

    Raises
    ------
    GeometryError
        A wavelength or a fill that is not above 0.
    """

    lattice: Lattice
    fill: float
    wavelength: float

    def __post_init__(self) -> None:
        checks.positive("wavelength", self.wavelength)
        checks.positive("fill", self.fill, "1")

    def aside(self, way: np.ndarray, slope: np.ndarray, width: float) -> np.ndarray:
        """How far (n, 2) [px] views at ways (n, 2) [px] show corners aside.

        Parameters
        ----------
        way
            Of the views.
        slope
            (n,), how far corners move from view to view, over the way.
        width
            λ b/d over the micro-images' pitch: that of the light behind a lenslet d wide.
        """
        light = _light(self.fill, width, self.lattice.layout == "square")
        steps, way = np.arange(-FAR, FAR + 1), np.asarray(way)[:, None]
        away = np.stack(np.meshgrid(steps, steps), -1).reshape(-1, 2) @ np.array(self.lattice.basis)
        down, right = self.lattice.basis[0]
        axes = np.array([(down, right), (right, -down)])  # along the lattice's rows, and across them
        found = light((way - away) @ axes.T / self.lattice.pitch**2)
        part, directions = found[..., :1], found[..., 1:] @ axes / np.maximum(found[..., :1], 1e-12)
        ghosts = away - np.asarray(slope)[:, None, None] * (directions - way)
        far = np.linalg.norm(ghosts, axis=-1, keepdims=True) / self.lattice.pitch
        return -(part * ghosts / np.maximum(far, 1)).sum(1) / part.sum(1)


def _light(fill: float, width: float, square: bool) -> Any:
    """At places (..., 2) from a lenslet's own middle, its light, and that times its direction [pitches]."""
    fine = int(np.clip(math.ceil(4 / width), *FINE))
    at = np.arange(-2 * FAR * fine, 2 * FAR * fine + 1) / fine
    distance = np.hypot(at[:, None], at)
    stop = np.clip((fill / 2 - distance) * fine + 0.5, 0, 1)
    if square:
        line = np.sinc(at / width) ** 2
        spread = line[:, None] * line
    else:
        u = np.pi * np.maximum(distance, 1e-9) / width * math.sqrt(4 / np.pi)  # an opening of the same area
        spread = (2 * j1(u) / u) ** 2
    parts = [fftconvolve(one, spread, mode="same") for one in (stop, at[:, None] * stop, at * stop)]
    return RegularGridInterpolator((at, at), np.stack(parts, -1), bounds_error=False, fill_value=0.0)
