r"""Waves of a point that lenslets spread over their own micro-image and their neighbours'.

Main lens and lenslets act on the same waves. Lengths are in pitches, and `width` is λ b/d². The integral over
the main lens' stop is derived in docs/theory/metric.md.
"""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from scipy.fft import fft2
from scipy.interpolate import CubicSpline

from lumigraph.analysis.pupil_edge import fitted, strip

FAR = 2
"""Neighbours to each side."""

_ACROSS = 6  # lenslets over which the light of all points is added up
_PROFILE = 24  # steps from the middle of a micro-image to the next
_FINE, _SPAN = 96, 1.2  # steps over a lenslet and a bit, and how far they reach [pitches]


@dataclass(frozen=True, slots=True)
class Waves:
    """Light of points before neighbouring lenslets that fill a lattice; all lengths in pitches.

    Parameters
    ----------
    width
        λ b/d².
    fill
        Width of a micro-image.
    basis
        Of the lattice of lenslets.
    sharp
        How far micro-images of a point that is in focus move, over the way from lenslet to lenslet: 0 behind
        lenslets that are in focus at infinity.
    """

    width: float
    fill: float
    basis: tuple[tuple[float, ...], ...]
    sharp: float = 0.0

    def directions(self, across: int) -> np.ndarray:
        """Directions (y, x, 2), close enough to cover so many lenslets with light."""
        step = self.width / across
        half = int(self.fill / 2 / step) + 1
        line = np.arange(-half, half + 1) * step
        return np.stack(np.meshgrid(line, line, indexing="ij"), -1)

    def light(self, u: np.ndarray, field: np.ndarray, slope: float) -> tuple[np.ndarray, np.ndarray]:
        """Light of points (..., y, x) by fields in directions u, and their places along either axis."""
        step, count = float(u[1, 0, 0] - u[0, 0, 0]), 2 * len(u)
        bent = self.stop(u) * np.exp(-1j * np.pi * slope / self.width * (u**2).sum(-1))
        found: Any = fft2(field * bent.astype(field.dtype), (count, count))
        light = np.fft.fftshift(found.real**2 + found.imag**2, (-2, -1))
        return light, (np.arange(count) - count // 2) * self.width / step / count

    def opened(self, u: np.ndarray, way: np.ndarray, far: int = FAR) -> np.ndarray:
        """Transform of all lenslets' fields at one way, at directions (y, x, 2)."""
        (t, field), line, steps = _opening(self), u[:, 0, 0], np.arange(-far, far + 1)
        lenslets = np.stack(np.meshgrid(steps, steps), -1).reshape(-1, 2) @ np.array(self.basis)
        turn = 1j * np.pi / self.width
        own = [np.exp(-2 * turn * np.outer(line - w, t)) for w in way]

        def seen(axis: int, k: np.ndarray) -> np.ndarray:
            bent = np.exp(turn * ((way[axis] - k) ** 2 + 2 * np.outer(line, k)))
            return own[axis] * (bent @ np.exp(-2 * turn * np.outer(k, t)))

        total: np.ndarray = np.zeros(u.shape[:2], complex)
        for k in np.unique(lenslets[:, 0]):  # a row of them
            total += seen(0, k[None]) @ field @ seen(1, lenslets[lenslets[:, 0] == k, 1]).T
        return total

    def stop(self, u: np.ndarray) -> np.ndarray:
        """The part of each cell about directions (y, x, 2) that is open."""
        step, distance = float(u[1, 0, 0] - u[0, 0, 0]), np.hypot(u[..., 0], u[..., 1])
        return np.clip((self.fill / 2 - distance) / step + 0.5, 0, 1)

    def white(self, way: np.ndarray) -> float:
        """Light at a way of all points alike."""
        u = self.directions(_ACROSS)
        return float((self.stop(u) * np.abs(self.opened(u, way, 1)) ** 2).mean())

    def edge(self, pitch: float) -> tuple[float, float]:
        """Width and blur of white micro-images so many pixels apart, over their pitch; see `pupil_edge`.

        Raises
        ------
        CalibrationError
            Micro-images that run into each other.
        """
        aside, row = strip(pitch) / pitch / math.sqrt(3), np.array(self.basis[0]) / math.hypot(*self.basis[0])
        line = row * (np.arange(_PROFILE // 2 + 1) / _PROFILE)[:, None] + aside * np.array([row[1], -row[0]])
        half = np.array([self.white(way) for way in line])
        total = CubicSpline(np.arange(-1, _PROFILE + 2) / _PROFILE, _mirrored(half)).antiderivative()
        at = (np.arange(round(pitch) * 4) + 0.5) / (round(pitch) * 4)
        light = (total(at + 0.5 / pitch) - total(at - 0.5 / pitch)) * pitch  # as pixels see it
        width, blur = fitted(at * pitch, light / light[at < 0.2].mean(), pitch)
        return width / pitch, blur / pitch

    def seen_fill(self) -> float:
        """Width where white micro-images are half as bright as between the darkest and the middle.

        That is what a white image's `Calibration.fill` is measured by; 1 where they touch.
        """
        rim, basis = self.fill / 2 + np.linspace(-0.08, 0.08, 9), np.array(self.basis)
        darkest = basis.sum(0) / (2 if abs(basis[0] @ basis[1]) < 0.1 else 3)
        half = (self.white(np.zeros(2)) + self.white(darkest)) / 2
        across = np.array([(-basis[0, 1], basis[0, 0]), basis[0]]) / math.hypot(*basis[0])
        seen = [[self.white(way * axis) for way in rim] for axis in across]
        found = [min(0.5, float(np.interp(-half, -np.array(line), rim))) for line in seen]
        return 2 * float(np.mean(found))


def _mirrored(half: np.ndarray) -> np.ndarray:
    """Light from just before a middle to just after the next, by that up to halfway between them."""
    return np.concatenate([half[1:2], half, half[-2::-1], half[1:2]])


@lru_cache(maxsize=4)
def _opening(waves: Waves) -> tuple[np.ndarray, np.ndarray]:
    """Steps along either axis over a lenslet (n,), and its field (n, n), curved by what is sharp."""
    t = ((np.arange(_FINE) + 0.5) / _FINE - 0.5) * _SPAN
    at = np.stack(np.meshgrid(t, t, indexing="ij"), -1)
    field = np.exp(-1j * np.pi * waves.sharp / waves.width * (at**2).sum(-1)) * (t[1] - t[0]) ** 2
    for k in _around(waves.basis):  # no part of it is nearer to another lenslet's middle
        short = math.hypot(*k) / 2 - at @ k / math.hypot(*k)
        field *= np.clip(short / (t[1] - t[0]) + 0.5, 0, 1)
    return t, field


def _around(basis: tuple[tuple[float, ...], ...]) -> np.ndarray:
    """Ways (8, 2) to neighbours, of which the nearest bound a lenslet."""
    steps = np.stack(np.meshgrid([-1, 0, 1], [-1, 0, 1]), -1).reshape(-1, 2)
    return steps[steps.any(1)] @ np.array(basis)
