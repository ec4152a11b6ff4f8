r"""Points before a Fourier light-field microscope, wherever they stand, with derivatives by their place.

A point's place changes the phase of its light alone: with U = W_y P W_x behind a lenslet,

.. math:: \partial_y U = W_y' P W_x, \quad \partial_z U = W_y (i k n (\cos\theta - 1) P) W_x, \quad
          \partial |U|^2 = 2 \mathrm{Re}(U^* \partial U).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from lumigraph.elements.objective import Objective
from lumigraph.operators.fourier_microscope import (
    Mosaic,
    View,
    half_window,
    image_behind,
    lit_lenslets,
    overlap,
)

Behind = Callable[[View, Objective, np.ndarray, float], np.ndarray]
"""What is found behind a lenslet of a point `rest` [px] from a pixel, at a depth."""


@dataclass(frozen=True, slots=True, eq=False)
class FourierPoints:
    """Images of points that send 1 through a whole lenslet on the axis.

    Parameters
    ----------
    objectives
        One for each wavelength.
    mosaic
        Lenslets and pixels.
    """

    objectives: tuple[Objective, ...]
    mosaic: Mosaic

    @property
    def whole(self) -> float:
        """Light of a point that goes through the objective, lenslets or not."""
        shares = []
        for one in self.objectives:
            cosine = math.sqrt(1 - (one.aperture / one.medium) ** 2)
            area = 2 * math.pi * one.medium**2 * (1 - cosine)
            shares.append(area * (self.mosaic.fourier_lens / self.mosaic.magnification) ** 2)
        return float(np.mean(shares)) / self.mosaic.width**2

    def image(self, y: float, x: float, dz: float) -> np.ndarray:
        """Raw image (ny, nx) of a point [m]."""
        return self._seen((y, x, dz), 1, image_behind)[0]

    def lit(self, y: float, x: float, dz: float) -> np.ndarray:
        """Raw image and its derivatives by y, x and dz [1/m], (4, ny, nx)."""
        found = self._seen((y, x, dz), 4, _images)
        found[1:3] *= self.mosaic.total_magnification / self.mosaic.pixel_pitch
        return found

    def _seen(self, position: tuple[float, float, float], count: int, behind: Behind) -> np.ndarray:
        """Raw image of all lenslets (count, ny, nx), by what is found behind each."""
        found, mosaic = np.zeros((count, *self.mosaic.shape)), self.mosaic
        moved = mosaic.total_magnification * np.array(position[:2])
        for objective in self.objectives:
            lit = lit_lenslets(objective, mosaic)
            half = half_window(objective, lit, position[2:])
            for j, center in enumerate(lit.centers):
                at = (center + moved) / mosaic.pixel_pitch
                nearest = np.round(at).astype(int)
                image = behind(View.of(objective, lit, j, half), objective, at - nearest, position[2])
                corner = nearest - half + np.array(mosaic.shape) // 2
                raw, own = overlap(corner.tolist(), (2 * half + 1, 2 * half + 1), mosaic.shape)
                found[(slice(None), *raw)] += image[(..., *own)]
        return found / len(self.objectives)


def _images(view: View, objective: Objective, rest: np.ndarray, dz: float) -> np.ndarray:
    """Image behind a lenslet, and its derivatives by pixels along y and x and by depth (4, w, w)."""
    down, across = (view.waves(float(r)) for r in rest)
    pupil = view.amplitude * np.exp(1j * objective.phase(*view.q, dz))
    slope = 1j * view.turn * view.u
    deeper = 2j * np.pi / objective.wavelength * objective.depth_path(*view.q) * pupil
    rows = pupil @ across.T
    field = down @ rows
    changes = (
        down @ (slope[:, None] * rows),
        down @ ((pupil * slope) @ across.T),
        down @ (deeper @ across.T),
    )
    light = [np.square(np.abs(field)), *(2 * (field.conj() * change).real for change in changes)]
    return np.stack([view.pixels(one) for one in light])
