"""Radial integrals of azimuthal harmonics, tabulated as cubic pieces and interpolated."""

from collections.abc import Iterator, Sequence
from itertools import count
from threading import Lock

import numpy as np
import scipy

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


Table = list[tuple[int, np.ndarray]]
"""Order and radial integral, in cubic pieces (2, 4, radii), of each azimuthal harmonic that counts."""


def tables_of(
    modes: Sequence[tuple[np.ndarray, np.ndarray]], q: np.ndarray, steps: np.ndarray
) -> list[Table]:
    """Tables of modes, given by spectra (orders, nodes) over the azimuth and amplitudes (nodes,)."""
    counted = [_counted(spectrum) for spectrum, _ in modes]
    found: list[Table] = [[] for _ in modes]
    highest = max(abs(order) for orders in counted for order in orders)
    for order, bessel in zip(range(highest + 1), _bessels(q, steps), strict=False):
        for table, orders, (spectrum, amplitude) in zip(found, counted, modes, strict=True):
            for signed in sorted({order, -order} & orders):
                wave = amplitude * spectrum[signed]
                real, imaginary = (bessel @ np.stack([wave.real, wave.imag], axis=1)).T
                values = scipy.interpolate.CubicSpline(
                    np.arange(len(steps)), 1j**order * (real + 1j * imaginary)
                )
                table.append((signed, np.stack([values.c.real, values.c.imag])))
    return found


def _counted(spectrum: np.ndarray) -> set[int]:
    strength, half = np.abs(spectrum).max(1), len(spectrum) // 2
    strong = strength > _WEAK * strength.max()
    return {order for order in range(-half, len(spectrum) - half) if strong[order]}


def _bessels(q: np.ndarray, steps: np.ndarray) -> Iterator[np.ndarray]:
    """J of the orders 0, 1, 2 and so on at (radii, nodes): each from both before it.

    Where the argument is below the order, the recurrence is not stable, and far below it J is 0.
    """
    yield from (_first(order, q, steps) for order in range(3))
    before, now = _first(1, q, steps), _first(2, q, steps)
    argument = np.arange(len(steps))[:, None] * (float(steps[1]) * q)
    double = 2 / np.where(argument > 0, argument, 1)
    for order in count(3):
        before, now = now, (order - 1) * double * now - before
        lower = argument < order
        near = lower & (argument > order - 12 * order ** (1 / 3))
        now[lower] = 0
        now[near] = scipy.special.jv(order, argument[near])
        yield now


_FIRST: dict[tuple, np.ndarray] = {}
_LOCK = Lock()


def _first(order: int, q: np.ndarray, steps: np.ndarray) -> np.ndarray:
    """J of the orders 0 to 2 at (radii, nodes); the last few are kept, for depths share them."""
    key = order, len(q), float(q[-1]), float(q[0]), float(steps[1]), len(steps)
    with _LOCK:
        if key not in _FIRST:
            while len(_FIRST) > 5:
                _FIRST.pop(next(iter(_FIRST)))
            _FIRST[key] = (scipy.special.j0, scipy.special.j1, _j2)[order](
                np.arange(len(steps))[:, None] * (float(steps[1]) * q)
            )
        return _FIRST[key]


def _j2(argument: np.ndarray) -> np.ndarray:
    """Bessel function J_2 by recurrence, three times as fast as jv."""
    near = np.where(argument > 0, argument, 1)
    return 2 * scipy.special.j1(argument) / near - np.where(argument > 0, scipy.special.j0(argument), 0)
