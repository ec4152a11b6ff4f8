"""Description of a bench's motors: which device moves what, its sign, step, limits and backlash."""

import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, fields
from os import PathLike
from pathlib import Path
from typing import Any

from lumigraph.core import checks
from lumigraph.core.printable import printable
from lumigraph.errors import FormatError
from lumigraph.metrology.twin import CAUSES, UNITS
from lumigraph.units import parse

STATES = (*CAUSES, "sensor", "separation", "pitch")
"""Quantities that may be out of place: `twin.CAUSES`, then

- sensor: distance of the sensor from the array beyond its place [m]
- separation: distance of the main lens from the array beyond its place [m]
- pitch: of the lenslets over the pixels' over that of the file, less 1
"""

STATE_UNITS = (*UNITS, "m", "m", "1")

MOVABLE = STATES[:-1]
"""Quantities that a motor may move."""

_DIMENSION = {"m": "length", "rad": "angle"}


@dataclass(frozen=True, slots=True)
class Motor:
    """One motorised axis.

    Parameters
    ----------
    moves
        What it moves, one of `MOVABLE`.
    device
        Label of the device in Micro-Manager.
    coordinate
        "x" or "y" of an XY stage; empty for others.
    setting
        Property of the device that holds the position; empty for stages.
    unit
        What one of the device's units (µm for stages) is [m, rad or 1].
    sign
        1 if larger positions make more of what it moves, -1 if less, 0 if that is to be learned.
    step, backlash
        Smallest move, and the largest backlash that it may have [m, rad or 1].
    limits
        Lowest and highest position [m, rad or 1].
    """

    moves: str
    device: str
    coordinate: str = ""
    setting: str = ""
    unit: float = 1e-6
    sign: int = 0
    step: float = 0.0
    backlash: float = 0.0
    limits: tuple[float, float] = (-math.inf, math.inf)

    @property
    def name(self) -> str:
        """Name for messages."""
        place = self.setting or self.coordinate
        return f"{self.device}{'.' if place else ''}{place} ({self.moves})"

    def rounded(self, position: float) -> float:
        """The nearest position that is a whole number of steps [m, rad or 1]."""
        return round(position / self.step) * self.step if self.step else position

    def shown(self, value: float, *, signed: bool = True) -> str:
        """A value of what it moves, for people."""
        return shown(self.moves, value, signed=signed)


def shown(state: str, value: float, *, signed: bool = True) -> str:
    """A value of one of `STATES` in µm, ° or %."""
    unit = STATE_UNITS[STATES.index(state)]
    scale, name, digits = {"m": (1e6, " µm", 1), "rad": (180 / math.pi, "°", 4), "1": (100, " %", 3)}[unit]
    return f"{value * scale:{'+' if signed else ''}.{digits}f}{name}"


@dataclass(frozen=True, slots=True)
class BenchSetup:
    """The motors and the camera of a bench.

    Parameters
    ----------
    camera
        Label of the camera in Micro-Manager.
    motors
        The motors, one for each thing that is moved.
    config
        Micro-Manager configuration file with the devices; None where they are simulated.
    known
        Standard deviations of `STATES` before the first exposure [m, rad or 1], by name; others are left
        as `belief.BEFORE` has them.
    drift
        How far anything may drift in an hour [m]; angles and parts as this over 0.1 m.
    simulated
        Options of a simulated bench; None for a real one.
    """

    camera: str
    motors: tuple[Motor, ...]
    config: Path | None = None
    known: Mapping[str, float] | None = None
    drift: float = 0.0
    simulated: Mapping[str, Any] | None = None

    def __post_init__(self) -> None:
        if not self.motors:
            raise FormatError("the bench file has no [[motor]]: give one for each thing that can be moved.")
        for k, motor in enumerate(self.motors):
            if motor.moves in [one.moves for one in self.motors[:k]]:
                raise FormatError(f"two motors of the bench file move {motor.moves}. Leave one out.")

    def motor(self, moves: str) -> Motor | None:
        """The motor that moves something; None where there is none."""
        return next((one for one in self.motors if one.moves == moves), None)


def read_setup(path: str | PathLike[str]) -> BenchSetup:
    """Description of a bench from its TOML file.

    Raises
    ------
    FormatError
        No such file, not TOML, or a key or value that no bench has; the message names it.
    """
    file = Path(path)
    try:
        table = tomllib.loads(file.read_text("utf-8"))
    except OSError as error:
        raise FormatError(f"{file} cannot be read: {error.strerror or error}. Check the path.") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise FormatError(f"{file} is not TOML: {error}. Correct it.") from None
    return setup_of(table, file.parent)


def setup_of(table: Mapping[str, Any], folder: Path = Path()) -> BenchSetup:
    """Description of a bench from the table of its file; `config` is relative to `folder`."""
    _only(table, ("camera", "config", "drift", "motor", "known", "simulated"), "the bench file")
    camera, config = table.get("camera", "Camera"), table.get("config")
    simulated, known = table.get("simulated"), table.get("known", {})
    kinds = (
        ("camera", camera, str), ("config", config or "", str), ("known", known, dict),
        ("motor", table.get("motor", []), list), ("simulated", simulated or {}, dict),
    )  # fmt: skip
    for name, value, kind in kinds:
        if not isinstance(value, kind):
            raise FormatError(
                f"{name} of the bench file is {checks.shown(value)} but must be a {_KINDS[kind]}."
            )
    if (simulated is None) == (config is None):
        raise FormatError(
            "the bench file needs either config, a file of Micro-Manager, or a table [simulated]."
        )
    _only(known, STATES, "[known]")
    return BenchSetup(
        camera,
        tuple(_motor(one, number) for number, one in enumerate(table.get("motor", []), 1)),
        None if config is None else folder / config,
        {name: number(f"[known] {name}", value, name) for name, value in known.items()},
        number("drift", table.get("drift", 0), "height"),
        simulated,
    )


_KINDS = {str: "text", dict: "table", list: "list of tables"}


def number(name: str, value: Any, state: str) -> float:
    """A value of one of `STATES` with its unit, such as "5 um", "0.02 deg" or "0.1 %", in SI units."""
    unit = STATE_UNITS[STATES.index(state)]
    if unit == "1":
        text = str(value).strip()
        try:
            found = float(text.removesuffix("%")) * (0.01 if text.endswith("%") else 1.0)
        except ValueError:
            raise FormatError(
                f"{name} is {checks.shown(value)} but must be a part, as 0.001 or '0.1 %'."
            ) from None
        return checks.finite(name, found, "1", FormatError)
    try:
        return parse(value, _DIMENSION[unit])
    except FormatError as error:
        raise FormatError(f"{name}: {error}") from None


def _motor(table: Any, place: int) -> Motor:
    where = f"[[motor]] {place}"
    if not isinstance(table, dict):
        raise FormatError(f"{where} of the bench file must be a table.")
    _only(table, ("property", *(one.name for one in fields(Motor) if one.name != "setting")), where)
    moves, device = table.get("moves"), table.get("device")
    if moves not in MOVABLE:
        raise FormatError(f"{where} moves {checks.shown(moves)} but must move one of {', '.join(MOVABLE)}.")
    if not isinstance(device, str) or not device:
        raise FormatError(f"{where} has no device: give its label in Micro-Manager.")
    coordinate, prop, sign = table.get("coordinate", ""), table.get("property", ""), table.get("sign", 0)
    if coordinate not in ("", "x", "y"):
        raise FormatError(f"{where} has coordinate {checks.shown(coordinate)} but must have 'x' or 'y'.")
    if not isinstance(prop, str) or (prop and coordinate):
        raise FormatError(f"{where} must have a coordinate or a property, not both.")
    if sign not in (-1, 0, 1):
        raise FormatError(f"{where} has sign {checks.shown(sign)} but must have 1, -1, or 0 to learn it.")
    values = {
        name: number(f"{where} {name}", table[name], moves)
        for name in ("unit", "step", "backlash") if name in table
    }  # fmt: skip
    if "unit" not in values and (prop or STATE_UNITS[STATES.index(moves)] != "m"):
        raise FormatError(f"{where} has no unit: say what 1 of the device is, such as unit = '0.001 deg'.")
    for name, value in values.items():
        if value < 0 or (name == "unit" and value == 0):
            raise FormatError(f"{where} {name} is {printable(str(table[name]))} but must not be below 0.")
    limits = table.get("limits")
    if not isinstance(limits, list) or len(limits) != 2:
        raise FormatError(f"{where} needs limits, two positions, such as limits = ['-0.5 mm', '0.5 mm'].")
    low, high = (number(f"{where} limits", one, moves) for one in limits)
    if low >= high:
        raise FormatError(f"{where} has limits {limits} but the first must be below the second.")
    return Motor(moves, device, coordinate, prop, sign=sign, limits=(low, high), **values)


def _only(table: Mapping[str, Any], names: tuple[str, ...], where: str) -> None:
    for name in table:
        if name not in names:
            raise FormatError(f"{where} has no key {printable(name)!r}; its keys are {', '.join(names)}.")
