r"""Gaussian belief about a bench after some exposures, with the motors' play.

A motor's carriage stands at :math:`u + s`, u its position and s its slack, :math:`-B/2` after it has gone up
by the backlash B or more, :math:`B/2` after it has gone down. Both are states, so that moves in two
directions tell B. Exposures are taken in as by an iterated extended Kalman filter (B. M. Bell and F. W.
Cathey, *IEEE Trans. Autom. Control* **38**, 294 (1993)).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from lumigraph.metrology.alignment.rays import BenchRays
from lumigraph.metrology.alignment.reading import WhiteReading
from lumigraph.metrology.alignment.setup import STATE_UNITS, STATES, BenchSetup, Motor
from lumigraph.metrology.twin import PITCH_ERROR

BEFORE = (1e-3, 0.05, 0.05, 1e-3, 1e-3, 0.05, 0.2, 0.0, 0.0, PITCH_ERROR)
"""Standard deviations of `STATES` before the first exposure, unless the bench file has others."""

SCALE = 2e-3
"""Standard deviation of how far a motor goes, over how far it should."""

_MOVED = 0.5e-3  # of sensor and main lens that have motors, unless the bench file says [m]
_ROUNDS = 4
_FAR = (*4 * (3e-4,), *2 * (1e-4,), *2 * (0.06,), 0.02, *2 * (0.06,))
"""Errors of `BenchRays.measures`, over how far they are from those of the camera file."""

_ASIDE = 0.15, 2e-3
"""Distance [px] of an origin from the camera file's from which on pixels change the slope by the second."""

_LEVER = 0.03  # m: angles drift by as much as lengths, over this


@dataclass(frozen=True, slots=True, eq=False)
class Belief:
    """Gaussian belief about a bench.

    Parameters
    ----------
    motors
        Its motors.
    mean, covariance
        Of `STATES` now, then of each motor's slack and backlash (10 + 2 n).
    sides
        From where each motor came last: 1 from below, -1 from above, 0 where nobody knows.
    """

    motors: tuple[Motor, ...]
    mean: np.ndarray
    covariance: np.ndarray
    sides: tuple[int, ...]

    @classmethod
    def before(cls, setup: BenchSetup, pitch_error: float | None = None) -> "Belief":
        """Belief before the first exposure."""
        deviation = dict(zip(STATES, BEFORE, strict=True))
        deviation |= {one: _MOVED for one in ("sensor", "separation") if setup.motor(one)}
        deviation |= dict(setup.known or {})
        deviation |= {} if pitch_error is None else {"pitch": pitch_error}
        play = np.array([one.backlash for one in setup.motors])
        mean = np.concatenate([np.zeros(len(STATES)), np.stack([0 * play, play / 2], 1).ravel()])
        spread = np.stack([play / 6, play / np.sqrt(12)], 1).ravel()
        variance = np.concatenate([[deviation[one] for one in STATES], spread]) ** 2
        return cls(setup.motors, mean, np.diag(variance), (0,) * len(setup.motors))

    @property
    def errors(self) -> np.ndarray:
        """Standard deviations (10,) of `STATES`."""
        return np.sqrt(np.maximum(np.diag(self.covariance)[: len(STATES)], 0))

    def __getitem__(self, state: str) -> float:
        return float(self.mean[STATES.index(state)])

    def error(self, state: str) -> float:
        """Standard deviation of one of `STATES`."""
        return float(self.errors[STATES.index(state)])

    def backlash(self, number: int) -> tuple[float, float]:
        """Backlash of a motor and its standard deviation."""
        place = len(STATES) + 2 * number + 1
        return float(self.mean[place]), float(np.sqrt(max(self.covariance[place, place], 0)))

    def moved(self, number: int, way: float, side: int) -> "Belief":
        """Belief after a motor has gone by `way`, and came to its end from `side`."""
        motor, n = self.motors[number], len(self.mean)
        state, slack = STATES.index(motor.moves), len(STATES) + 2 * number
        change = np.eye(n)
        if side != self.sides[number]:
            change[slack, slack], change[slack, slack + 1] = 0.0, -side / 2
            change[state] += motor.sign * (change[slack] - np.eye(n)[slack])
        mean = change @ self.mean
        mean[state] += motor.sign * way
        covariance = change @ self.covariance @ change.T
        covariance[state, state] += (SCALE * way) ** 2
        sides = (*self.sides[:number], side, *self.sides[number + 1 :])
        return replace(self, mean=mean, covariance=covariance, sides=sides)

    def widened(self, state: str, deviation: float) -> "Belief":
        """Belief with one state less sure."""
        covariance, place = self.covariance.copy(), STATES.index(state)
        covariance[place, place] += deviation**2
        return replace(self, covariance=covariance)

    def drifted(self, metres: float) -> "Belief":
        """Belief after everything may have drifted by so much."""
        far = [metres if unit == "m" else metres / _LEVER for unit in STATE_UNITS]
        free = np.array([one not in ("pitch",) and self.error(one) > 0 for one in STATES])
        added = np.zeros(len(self.mean))
        added[: len(STATES)] = np.where(free, far, 0.0)
        return replace(self, covariance=self.covariance + np.diag(added**2))

    def seen(self, rays: BenchRays, reading: WhiteReading) -> "Belief":
        """Belief after an exposure."""
        noise = _noise(rays, reading)
        mean, slopes = self.mean, self._slopes(rays, self.mean)
        for _ in range(_ROUNDS):
            slopes = self._slopes(rays, mean)
            rest = _rest(rays, reading, mean) + slopes @ (mean - self.mean)
            spread = slopes @ self.covariance @ slopes.T + noise
            gain = np.linalg.solve(spread, slopes @ self.covariance).T
            mean = self.mean + gain @ rest
        left = _rest(rays, reading, mean)
        excess = max(1.0, float(left @ np.linalg.solve(noise, left)) / len(left))
        covariance = self._after(slopes, noise * excess)
        return replace(self, mean=mean, covariance=covariance)

    def expected(self, rays: BenchRays) -> "Belief":
        """Belief after an exposure that shows what is expected, with the bench where it is thought to be."""
        noise = np.diag(np.array([*4 * [1e-4], *2 * [1.5e-3], *2 * [1e-3], 5e-3, *2 * [1e-3]]) ** 2)
        noise = noise[: len(rays.start), : len(rays.start)]
        return replace(self, covariance=self._after(self._slopes(rays, self.mean), noise))

    def _after(self, slopes: np.ndarray, noise: np.ndarray) -> np.ndarray:
        spread = slopes @ self.covariance @ slopes.T + noise
        gain = np.linalg.solve(spread, slopes @ self.covariance).T
        left = np.eye(len(self.mean)) - gain @ slopes
        return left @ self.covariance @ left.T + gain @ noise @ gain.T

    def _slopes(self, rays: BenchRays, mean: np.ndarray) -> np.ndarray:
        shown = rays.slopes(mean[: len(STATES)])
        return np.concatenate([shown, np.zeros((len(shown), len(mean) - len(STATES)))], 1)

    def values(self) -> dict[str, Any]:
        """Numbers that JSON can hold; `Belief.of` reads them."""
        return {"mean": self.mean.tolist(), "covariance": self.covariance.tolist(), "sides": list(self.sides)}

    @classmethod
    def of(cls, motors: Sequence[Motor], values: dict[str, Any]) -> "Belief":
        """Belief from `values`."""
        return cls(
            tuple(motors), np.array(values["mean"]), np.array(values["covariance"]), tuple(values["sides"])
        )


def _rest(rays: BenchRays, reading: WhiteReading, mean: np.ndarray) -> np.ndarray:
    """Measures less expected ones; the origin to the nearest lenslet where whole ones are not known."""
    rest = reading.values - rays.measures(mean[: len(STATES)])
    if reading.lenslets is None:
        basis = reading.values[:4].reshape(2, 2)
        rest[4:6] -= np.rint(rest[4:6] @ np.linalg.inv(basis)) @ basis
    return rest


def _noise(rays: BenchRays, reading: WhiteReading) -> np.ndarray:
    away = np.abs(reading.values - rays.start)
    away[:4], away[4:6], away[6:8] = away[:4].max(), away[4:6].max(), away[6:8].max()
    variance = reading.errors**2 + (np.array(_FAR)[: len(away)] * away) ** 2
    variance[6:8] += _ASIDE[1] ** 2 if away[4] > _ASIDE[0] and not reading.matched else 0.0
    return np.diag(variance)
