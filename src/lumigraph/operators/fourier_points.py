r"""Points before a Fourier light-field microscope, wherever they stand, with derivatives by their place.

A point's place changes the phase of its light alone: with U = W_y P W_x behind a lenslet,

.. math:: \partial_y U = W_y' P W_x, \quad \partial_z U = W_y (i k n (\cos\theta - 1) P) W_x, \quad
          \partial |U|^2 = 2 \mathrm{Re}(U^* \partial U).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lumigraph.elements.objective import Objective
from lumigraph.operators.fourier_microscope import Mosaic, View, half_window, lit_lenslets


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

    def lit(self, y: float, x: float, dz: float) -> np.ndarray:
        """Raw image and its derivatives by y, x and dz [1/m], (4, ny, nx)."""
        found = np.zeros((4, *self.mosaic.shape))
        for objective in self.objectives:
            lit = lit_lenslets(objective, self.mosaic)
            half = half_window(objective, lit, (dz,))
            for j, center in enumerate(lit.centers):
                view = View.of(objective, lit, j, half)
                self._add(found, center, view, objective, (y, x, dz))
        return found / len(self.objectives)

    def _add(
        self, found: np.ndarray, center: np.ndarray, view: View, objective: Objective,
        position: Sequence[float],
    ) -> None:  # fmt: skip
        """Add what a lenslet shows."""
        mosaic, half, count = self.mosaic, view.half, 2 * view.half + 1
        at = (center + mosaic.total_magnification * np.array(position[:2])) / mosaic.pixel_pitch
        nearest = np.round(at).astype(int)
        corner = nearest - half + np.array(mosaic.shape) // 2
        raw, own = [], []
        for first, n in zip(corner.tolist(), mosaic.shape, strict=True):
            start, stop = min(max(0, first), n), min(max(0, first + count), n)
            raw.append(slice(start, stop))
            own.append(slice(start - first, stop - first))
        image = _images(view, objective, at - nearest, position[2])
        image[1:3] *= mosaic.total_magnification / mosaic.pixel_pitch
        found[:, raw[0], raw[1]] += image[:, own[0], own[1]]


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
