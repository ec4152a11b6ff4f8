"""Simulated bench: its true state, its motors with play, and the white images that it makes."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from lumigraph.errors import FormatError
from lumigraph.instruments import Instrument, LensletCamera
from lumigraph.instruments.telecentric import white_camera
from lumigraph.metrology.alignment.moves import BenchError
from lumigraph.metrology.alignment.setup import STATE_UNITS, STATES, BenchSetup, Motor, number
from lumigraph.metrology.alignment.stood import white_of

DRAWN = {"m": 0.3e-3, "rad": math.radians(1), "1": 0.05}
"""How far things are out of place at most that are drawn, by unit."""

_AROUND = 0.6e-3  # m of sensor around the camera's, so that what comes into its picture is there
_FULL = 60000.0  # brightest value of 16 bits


@dataclass(slots=True)
class SimulatedMotor:
    """One motor with play.

    Parameters
    ----------
    motor
        Description.
    sign
        The true one.
    backlash
        The true one [m, rad or 1].
    position, carriage
        Where it was sent, and where what it moves stands [m, rad or 1].
    stuck
        Whether it reports a position but moves nothing.
    """

    motor: Motor
    sign: int
    backlash: float
    position: float = 0.0
    carriage: float = 0.0
    stuck: bool = False

    def go(self, position: float) -> None:
        """Move to a position; one beyond the limits is refused, as hardware does."""
        low, high = self.motor.limits
        if not low - 1e-12 <= position <= high + 1e-12:
            raise BenchError(f"{self.motor.name}: limit switch at {self.motor.shown(position)}")
        self.position = position
        if not self.stuck:
            half = self.backlash / 2
            self.carriage = min(max(self.carriage, position - half), position + half)


@dataclass(slots=True)
class SimulatedBench:
    """A bench whose true state is known.

    Parameters
    ----------
    camera
        What it is meant to be.
    state
        What is out of place where all carriages are at 0, by `STATES`.
    motors
        The motors.
    rng
        Random numbers.
    noise
        Standard deviation of a pixel over the brightest one's value.
    fading
        How much the light changes at most, as a part of it.
    drift
        How much each of `STATES` grows in an hour.
    vibration
        Rms shift of the array from one exposure to the next [m].
    frozen
        Exposures from which on the camera repeats its picture; None if it never does.
    """

    camera: LensletCamera
    state: dict[str, float]
    motors: tuple[SimulatedMotor, ...]
    rng: np.random.Generator
    noise: float = 0.01
    fading: float = 0.02
    drift: Mapping[str, float] = field(default_factory=dict)
    vibration: float = 0.0
    frozen: int | None = None
    exposures: int = 0
    seconds: float = 0.0
    _last: np.ndarray | None = None

    def now(self) -> float:
        """Time since the start [s]."""
        return self.seconds

    def wait(self, seconds: float) -> None:
        """Let time pass."""
        self.seconds += seconds

    def truth(self) -> dict[str, float]:
        """True misalignment now, by `STATES`."""
        hours = self.seconds / 3600
        found = {name: self.state.get(name, 0.0) + hours * self.drift.get(name, 0.0) for name in STATES}
        for one in self.motors:
            found[one.motor.moves] += one.sign * one.carriage
        return found

    def expose(self) -> np.ndarray:
        """White image (y, x), 16 bits, with noise."""
        self.exposures += 1
        self.wait(1.0)
        if self._last is not None and self.frozen is not None and self.exposures > self.frozen:
            return self._last
        light = self.light(self.truth())
        bright = _FULL * (1 + self.fading * self.rng.uniform(-1, 1)) / 1.1
        noisy = bright * (light / light.max() + self.noise * self.rng.standard_normal(light.shape))
        black = self.camera.sensor.black_level
        self._last = image = np.clip(np.rint(noisy + black), 0, 65535).astype(np.uint16)
        return image

    def light(self, truth: Mapping[str, float]) -> np.ndarray:
        """White image (y, x) without noise, by wave optics."""
        shaken = dict(truth)
        for name in ("shift_y", "shift_x"):
            shaken[name] += self.vibration * self.rng.standard_normal()
        return white_of(self.camera, np.array([shaken[one] for one in STATES]), around=_AROUND)


def simulated(setup: BenchSetup, camera: Instrument) -> SimulatedBench:
    """Bench of the table ``[simulated]`` of a bench file.

    `seed` draws what is out of place, each motor's sign and its backlash; `out` sets what is out of place;
    `signs` sets signs; `noise`, `fading`, `vibration`, `drift`, `stuck` and `frozen` are as in
    `SimulatedBench`.

    Raises
    ------
    FormatError
        A key that no simulated bench has.
    """
    table = dict(setup.simulated or {})
    for name in table:
        if name not in _KEYS:
            raise FormatError(f"[simulated] has no key {name!r}; its keys are {', '.join(_KEYS)}.")
    rng = np.random.default_rng(table.get("seed", 0))
    state, motors = {}, []
    stuck, signs = table.get("stuck", ""), table.get("signs", {})
    for motor in setup.motors:
        unit = STATE_UNITS[STATES.index(motor.moves)]
        state[motor.moves] = float(rng.uniform(-1, 1)) * DRAWN[unit]
        sign = signs.get(motor.moves, int(rng.choice([-1, 1])))
        backlash = float(rng.uniform(0, 1)) * motor.backlash
        carriage = float(rng.uniform(-0.5, 0.5)) * backlash
        motors.append(SimulatedMotor(motor, sign, backlash, 0.0, carriage, motor.moves == stuck))
    for name, value in table.get("out", {}).items():
        state[name] = number(f"[simulated] out.{name}", value, name)
    drift = {
        name: number(f"[simulated] drift.{name}", value, name)
        for name, value in table.get("drift", {}).items()
    }
    options: dict[str, Any] = {name: table[name] for name in ("noise", "fading", "frozen") if name in table}
    shaken = number("[simulated] vibration", table.get("vibration", 0), "shift_x")
    return SimulatedBench(
        white_camera(camera), state, tuple(motors), rng, drift=drift, vibration=shaken, **options
    )


_KEYS = ("seed", "out", "signs", "noise", "fading", "vibration", "drift", "stuck", "frozen")
