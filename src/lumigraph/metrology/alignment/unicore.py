"""Devices of Micro-Manager by pymmcore-plus: simulated ones, and those of a configuration file."""

import logging
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from pymmcore_plus.experimental.unicore import (
    GenericDevice,
    SimpleCameraDevice,
    StageDevice,
    UniMMCore,
    XYStageDevice,
)

from lumigraph.metrology.alignment.devices import Bench
from lumigraph.metrology.alignment.moves import BenchError
from lumigraph.metrology.alignment.setup import BenchSetup
from lumigraph.metrology.alignment.simulated import SimulatedBench, SimulatedMotor


def loaded(setup: BenchSetup) -> Bench:
    """Bench of the devices in Micro-Manager's configuration file.

    Raises
    ------
    BenchError
        The file cannot be loaded.
    """
    path = Path(setup.config or "")
    if not path.is_file():
        raise BenchError(f"there is no configuration file {path}. Correct config in the bench file.")
    core = _quiet_core()
    try:
        core.loadSystemConfiguration(path)
    except Exception as error:
        raise BenchError(
            f"Micro-Manager cannot load {path}: {' '.join(str(error).split())[:240]}. Correct that line, "
            "or install its device adapters: mmcore install."
        ) from error
    return Bench(core, setup)


def _quiet_core() -> UniMMCore:
    """Core for devices in Python and, where Micro-Manager is installed, its own; silent where it is not."""
    logger = logging.getLogger("pymmcore-plus")
    level = logger.level
    logger.setLevel(logging.CRITICAL)
    try:
        return UniMMCore()
    finally:
        logger.setLevel(level)


def simulated_devices(setup: BenchSetup, bench: SimulatedBench) -> Bench:
    """Bench whose devices are simulated, each behind Micro-Manager's interface."""
    core = _quiet_core()
    core.loadPyDevice(setup.camera, _Camera(bench))
    for label in dict.fromkeys(one.device for one in setup.motors):
        core.loadPyDevice(label, _device([one for one in bench.motors if one.motor.device == label]))
    core.initializeAllDevices()
    return Bench(core, setup, bench.now, bench.wait)


def _device(motors: list[SimulatedMotor]) -> Any:
    first = motors[0]
    if first.motor.setting:
        return _Properties(motors)
    return _XYStage(motors) if first.motor.coordinate else _Stage(first)


class _Camera(SimpleCameraDevice):
    """Camera of a simulated bench."""

    def __init__(self, bench: SimulatedBench):
        super().__init__()
        self._bench, self._exposure = bench, 10.0

    def sensor_shape(self) -> tuple[int, int]:
        return self._bench.camera.sensor.shape

    def dtype(self) -> Any:
        return np.uint16

    def get_exposure(self) -> float:
        return self._exposure

    def set_exposure(self, exposure: float) -> None:
        self._exposure = exposure

    def snap(self, buffer: np.ndarray) -> Mapping:
        buffer[:] = self._bench.expose()
        return {}


class _Still:
    """Stages of a simulated bench, less what they do not do."""

    def home(self) -> None:
        raise BenchError("simulated stages have no home")

    def stop(self) -> None:
        """Stop; simulated stages arrive at once."""

    def set_origin(self) -> None:
        raise BenchError("simulated stages keep their origin")

    set_origin_x = set_origin_y = set_origin


class _Stage(_Still, StageDevice):
    """Stage of a simulated bench."""

    def __init__(self, motor: SimulatedMotor):
        super().__init__()
        self._motor = motor

    def set_position_um(self, val: float) -> None:
        self._motor.go(val * self._motor.motor.unit)

    def get_position_um(self) -> float:
        return self._motor.position / self._motor.motor.unit


class _XYStage(_Still, XYStageDevice):
    """XY stage of a simulated bench."""

    def __init__(self, motors: list[SimulatedMotor]):
        super().__init__()
        self._motors = {one.motor.coordinate: one for one in motors}

    def set_position_um(self, x: float, y: float) -> None:
        for name, value in (("x", x), ("y", y)):
            if (one := self._motors.get(name)) is not None:
                one.go(value * one.motor.unit)

    def get_position_um(self) -> tuple[float, float]:
        found = [self._motors.get(name) for name in "xy"]
        x, y = (0.0 if one is None else one.position / one.motor.unit for one in found)
        return x, y


class _Properties(GenericDevice):
    """Device of a simulated bench that is moved by properties."""

    def __init__(self, motors: list[SimulatedMotor]):
        super().__init__()
        for one in motors:
            get, go = _accessors(one)
            self.register_property(
                one.motor.setting, default_value=0.0, getter=get, setter=go, property_type=float
            )


def _accessors(one: SimulatedMotor) -> tuple[Callable[[Any], float], Callable[[Any, float], None]]:
    unit = one.motor.unit
    return lambda _: one.position / unit, lambda _, value: one.go(float(value) * unit)
