"""Descent by gradients, within ranges and around impossible cameras."""

import math
from collections.abc import Callable

import numpy as np

SPREAD = 0.15
"""Longest first step of a search, as a part of each range."""

SHORT = 1e-3
"""Part of a step to which it is shortened at most, where cameras on its way are impossible or worse."""

ENOUGH = 1e-4
"""Relative gain of two steps, below which they lead no farther."""

SLIGHT, LEAST = 1e-3, 1e-6
"""Part of a gradient's promise that a step must keep, and the least slope."""


def downhill(
    cost: Callable[[np.ndarray], float], slopes: Callable[[np.ndarray], np.ndarray], start: np.ndarray
) -> None:
    """Quasi-Newton descent by gradients, within the ranges and around impossible cameras."""
    at, here, slope, last = start, cost(start), slopes(start), math.inf
    curve = np.eye(len(at)) * SPREAD / max(float(np.abs(slope).max()), LEAST)
    while True:
        moved = _step(cost, at, (here, slope, curve))
        if moved is None or last - moved[1] < ENOUGH * here:
            return
        last, steeper = here, slopes(moved[0])
        curve = _bent(curve, moved[0] - at, steeper - slope)
        (at, here), slope = moved, steeper


def _step(
    cost: Callable[[np.ndarray], float], at: np.ndarray, known: tuple[float, np.ndarray, np.ndarray]
) -> tuple[np.ndarray, float] | None:
    """Point that a step downhill leads to, and the cost there; None where no step does."""
    here, slope, curve = known
    free = ~(((at <= 0) & (slope > 0)) | ((at >= 1) & (slope < 0)))
    for by in (curve, np.diag(np.diag(curve))):  # what steps before told may mislead
        way = np.where(free, -(np.where(free, by, 0) @ np.where(free, slope, 0)), 0)
        part = min(1.0, SPREAD / max(float(np.abs(way).max()), LEAST))
        shortest = part * SHORT
        while part > shortest:
            there = np.clip(at + part * way, 0, 1)
            found = cost(there)
            if found < here and found <= here + SLIGHT * (slope @ (there - at)):
                return there, found
            part /= 3
    return None


def _bent(curve: np.ndarray, moved: np.ndarray, steeper: np.ndarray) -> np.ndarray:
    """The inverse of the curvature after a step (Broyden, Fletcher, Goldfarb and Shanno)."""
    both = float(moved @ steeper)
    if both <= SLIGHT * float(np.linalg.norm(moved) * np.linalg.norm(steeper)):
        return curve
    turn = np.eye(len(moved)) - np.outer(moved, steeper) / both
    return turn @ curve @ turn.T + np.outer(moved, moved) / both
