"""Axes of a cell and of the window of light around it."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from lumigraph.sensor.angular import AngularResponse

SLACK = 1.04
"""How much wider than D/(λL) the band is taken: grey pixels at the stop's edge reach beyond it."""

STEP = 2
"""Points between those of the window: an amplitude has half the band of its intensity."""

Pair = tuple[float, float]

Limits = Pair

Box = tuple[Pair, Pair]
"""Middle (y, x) and half the size of where some cells' centres are on the array [m]."""

MIDDLE: Box = ((0.0, 0.0), (0.0, 0.0))

INFINITE: Limits = (-math.inf, math.inf)

Accepted = tuple[AngularResponse, float]
"""How pixels respond to angles, and the distance from the lenslets that these are seen over [m]."""


@dataclass(frozen=True, slots=True)
class CellAxis:
    """One axis of a cell and of the window of light around it, both centred on the cell.

    Parameters
    ----------
    size
        Of the cell [m].
    points, samples
        Of the light and of the image, along the cell.
    neighbourhood
        How far beyond the cell light is followed [m].
    band
        Highest spatial frequency of the light [1/m].
    """

    size: float
    points: int
    samples: int
    neighbourhood: float
    band: float

    @property
    def margin(self) -> int:
        """Points of the window beyond the cell, on each side."""
        return math.ceil(self.neighbourhood * self.points / self.size)

    @property
    def window(self) -> np.ndarray:
        """Positions of every second point of the window [m]: enough for an amplitude."""
        k = np.arange(-self.margin, self.points + self.margin, STEP)
        return ((k + 0.5) / self.points - 0.5) * self.size

    @property
    def image(self) -> np.ndarray:
        """Positions of the image's samples [m]."""
        return ((np.arange(self.samples) + 0.5) / self.samples - 0.5) * self.size

    def basis(self) -> tuple[np.ndarray, Any]:
        """Coefficients (m, window) of band-limited light, and the function that gives their values (x, m).

        They are the discrete prolate sequences of the window: most of a band-limited signal in the fewest
        numbers, and between the samples too.
        """
        return held(self.window, self.band)

    def fade(self, at: np.ndarray, pitch: float) -> np.ndarray:
        """Weight of light at positions [m]: 1, and 0 at the end of the neighbourhood."""
        left = np.clip((np.abs(at) - self.size / 2 - self.neighbourhood + pitch) / pitch, 0, 1)
        return np.cos(np.pi / 2 * left) ** 2


def held(x: np.ndarray, band: float) -> tuple[np.ndarray, Any]:
    """`CellAxis.basis` of samples at places x [m] of light with a band [1/m]."""
    strength, vectors = np.linalg.eigh(np.sinc(2 * band * (x[:, None] - x)))
    kept = strength > 1e-10 * strength[-1]
    scaled = vectors[:, kept] / strength[kept]
    return vectors[:, kept].T, lambda at: np.sinc(2 * band * (at[:, None] - x)) @ scaled
