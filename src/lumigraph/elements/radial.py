"""Radial integrals of azimuthal harmonics, tabulated as cubic pieces and interpolated."""

from threading import Lock

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.special import j0, j1, jv

_WEAK = 1e-5
"""Harmonics below this part of the strongest are left out."""


def at(places: np.ndarray, pieces: np.ndarray) -> np.ndarray:
    """Cubic polynomials (2, 4, n), real and imaginary, highest power first, at places in steps."""
    index = places.astype(np.intp)
    rest, found = places - index, np.empty(places.shape, np.complex128)
    for part, (first, *others) in zip((found.real, found.imag), pieces, strict=True):
        value = first[index]
        for coefficient in others:
            value *= rest
            value += coefficient[index]
        part[...] = value
    return found


def power(turn: np.ndarray | float, order: int) -> np.ndarray | float:
    """exp(i order φ) from exp(i φ)."""
    return turn**order if order > 0 else np.conj(turn) ** -order


def harmonics_of(
    spectrum: np.ndarray, amplitude: np.ndarray, q: np.ndarray, steps: np.ndarray
) -> list[tuple[int, np.ndarray]]:
    """Order and radial integral, in cubic pieces (2, 4, radii), of each azimuthal harmonic that counts."""
    strength = np.abs(spectrum).max(1)
    found = []
    for row in np.flatnonzero(strength > _WEAK * strength.max()):
        order = int(row) if row < len(spectrum) // 2 else int(row) - len(spectrum)
        bessel = _bessel(abs(order), q, float(steps[1]), len(steps))
        wave = amplitude * spectrum[row]
        parts = bessel @ np.stack([wave.real, wave.imag], axis=1)
        values = CubicSpline(np.arange(len(steps)), 1j ** abs(order) * (parts[:, 0] + 1j * parts[:, 1]))
        found.append((order, np.stack([values.c.real, values.c.imag])))
    return found


_BESSEL: dict[tuple, np.ndarray] = {}
_LOCK = Lock()


def _bessel(order: int, q: np.ndarray, step: float, count: int) -> np.ndarray:
    """J of this order at (radii, nodes); the last few are kept, for depths share them."""
    key = order, len(q), float(q[-1]), float(q[0]), step, count
    with _LOCK:
        if key not in _BESSEL:
            argument = np.arange(count)[:, None] * (step * q)
            while len(_BESSEL) > 5:
                _BESSEL.pop(next(iter(_BESSEL)))
            if order == 2:  # by recurrence, three times as fast as jv
                near = np.where(argument > 0, argument, 1)
                _BESSEL[key] = 2 * j1(argument) / near - np.where(argument > 0, j0(argument), 0)
            else:
                _BESSEL[key] = {0: j0, 1: j1}.get(order, lambda x: jv(order, x))(argument)
        return _BESSEL[key]
