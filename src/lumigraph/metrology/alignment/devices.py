"""Bench of Micro-Manager devices: positions, moves and pictures, each checked."""

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from lumigraph.metrology.alignment.moves import BenchError
from lumigraph.metrology.alignment.setup import BenchSetup, Motor

_LEFT = 2.0  # steps, or µm of stages without any, by which a motor may miss where it was sent


@dataclass(slots=True)
class Bench:
    """Motors and camera of a bench.

    Parameters
    ----------
    core
        `CMMCorePlus`, `UniMMCore` or whatever has their methods, with the devices loaded.
    setup
        What they move.
    now, wait
        Clock [s], and a function that waits.

    Raises
    ------
    BenchError
        No device of a name.
    """

    core: Any
    setup: BenchSetup
    now: Callable[[], float] = time.time
    wait: Callable[[float], None] = time.sleep
    _last: np.ndarray | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        known = tuple(self.core.getLoadedDevices())
        for label in (self.setup.camera, *(one.device for one in self.setup.motors)):
            if label not in known:
                others = ", ".join(one for one in known if one != "Core") or "none"
                raise BenchError(
                    f"there is no device {label!r}: Micro-Manager has {others}. "
                    "Correct the bench file, or load it."
                )

    @property
    def top(self) -> float:
        """Value of a saturated pixel."""
        return float(2 ** int(self.core.getImageBitDepth()) - 1)

    def positions(self) -> list[float]:
        """Positions of all motors [m, rad or 1]."""
        return [self.position(one) for one in self.setup.motors]

    def position(self, motor: Motor) -> float:
        """Position of a motor [m, rad or 1]."""
        return self._asked(motor, "read", lambda: self._read(motor)) * motor.unit

    def go(self, motor: Motor, position: float) -> None:
        """Send a motor to a position [m, rad or 1], and wait for it.

        Raises
        ------
        BenchError
            Beyond its limits; it is not moved. Or it does not arrive.
        """
        low, high = motor.limits
        if not low <= position <= high:
            raise BenchError(
                f"{motor.name} was to go to {motor.shown(position)}, beyond its limits {motor.shown(low)} "
                f"and {motor.shown(high)}: it was not moved. Check the bench file."
            )
        self._asked(motor, "moved", lambda: self._send(motor, position / motor.unit))
        reached = self.position(motor)
        if abs(reached - position) > _LEFT * max(motor.step, motor.unit / 2):
            raise BenchError(
                f"{motor.name} does not move: it was sent to {motor.shown(position)} but stands at "
                f"{motor.shown(reached)}. Check its power, cable and brake, and start again."
            )

    def expose(self) -> np.ndarray:
        """Picture (y, x).

        Raises
        ------
        BenchError
            The camera fails, or gives the picture before once more.
        """
        label = self.setup.camera
        try:
            self.core.setCameraDevice(label)
            self.core.snapImage()
            image = np.array(self.core.getImage())
        except Exception as error:
            raise BenchError(f"{label} takes no picture: {_words(error)}. Check the camera.") from error
        if image.ndim != 2:
            raise BenchError(f"{label} gives pictures of shape {image.shape} but must give grey ones (y, x).")
        if self._last is not None and np.array_equal(image, self._last):
            raise BenchError(
                f"{label} gives the same picture twice, to the last bit: its frame is frozen. "
                "Restart the camera."
            )
        self._last = image
        return image

    def _read(self, motor: Motor) -> float:
        core, label = self.core, motor.device
        if motor.setting:
            return float(core.getProperty(label, motor.setting))
        if motor.coordinate:
            return float(core.getXYPosition(label)["xy".index(motor.coordinate)])
        return float(core.getPosition(label))

    def _send(self, motor: Motor, value: float) -> None:
        core, label = self.core, motor.device
        if motor.setting:
            core.setProperty(label, motor.setting, value)
        elif motor.coordinate:
            place = list(core.getXYPosition(label))
            place["xy".index(motor.coordinate)] = value
            core.setXYPosition(label, *place)
        else:
            core.setPosition(label, value)
        core.waitForDevice(label)

    @staticmethod
    def _asked(motor: Motor, what: str, call: Callable[[], Any]) -> Any:
        try:
            return call()
        except BenchError:
            raise
        except Exception as error:
            raise BenchError(
                f"{motor.name} cannot be {what}: {_words(error)}. "
                "Check the device and its name in the bench file."
            ) from error


def _words(error: Exception) -> str:
    return (" ".join(str(error).split()) or type(error).__name__)[:160].rstrip(".")
