"""What can be changed of each kind of camera: sliders with units and ranges, and cameras from values."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from lumigraph.core import checks
from lumigraph.errors import FormatError
from lumigraph.instruments.loading import AnyCamera

MOST_LENSLETS = 301
"""Along each side, so that every answer comes at once."""

_SPAN = 8.0  # a slider reaches from the value over this to the value times this


@dataclass(frozen=True, slots=True)
class Parameter:
    """One control.

    Parameters
    ----------
    key
        As in the camera file, such as "lenslets.pitch".
    label
        For people.
    unit, scale
        As it is written, and its size in SI.
    value
        In that unit; text for a choice, None where it is computed.
    low, high
        Ends of the slider, in that unit.
    kind
        "log" or "linear" slider, "whole" numbers, or a "choice".
    choices
        Of a choice.
    optional
        Whether it may be left out, and is then computed.
    """

    key: str
    label: str
    unit: str
    scale: float
    value: Any
    low: float = 0.0
    high: float = 1.0
    kind: str = "log"
    choices: tuple[str, ...] = ()
    optional: bool = False


def parameters(camera: AnyCamera) -> tuple[Parameter, ...]:
    """The controls of a camera, at its values."""
    return _microscope(camera) if camera.KIND == "light-field-microscope" else _camera(camera)


def _camera(camera: Any) -> tuple[Parameter, ...]:
    found = [
        _length("wavelength", "Wavelength", camera.wavelength, "nm", (350.0, 1000.0)),
        _length("object_distance", "Object distance z1", camera.object_distance, "mm"),
        _length("main_lens.focal_length", "Main lens focal length f", camera.main_lens.focal_length, "mm"),
    ]
    diameter = _length("main_lens.diameter", "Main lens diameter D", camera.pupil_diameter, "mm")
    if camera.KIND == "single-lens":
        return (*found, diameter, _pixel(camera))
    found.append(_optional(diameter, given=camera.main_lens.diameter is not None))
    if camera.KIND == "focused-plenoptic":
        m = camera.lenslets.magnification
        ends = (0.05, 2.0) if m > 0 else (-0.95, -0.05)
        kind = "log" if m > 0 else "linear"
        found.append(Parameter("lenslets.magnification", "Lenslet magnification m", "", 1.0, m, *ends, kind))
        found.append(_choice("matching", "Diameter matched for", camera.matching, ("views", "full")))
    return (*found, *_lenslets(camera), _pixel(camera))


def _microscope(camera: Any) -> tuple[Parameter, ...]:
    part = camera.objective
    found = [
        _length("wavelength", "Wavelength", camera.wavelength, "nm", (350.0, 1000.0)),
        Parameter("objective.magnification", "Magnification", "×", 1.0, part.magnification, 2.0, 150.0),
        Parameter("objective.numerical_aperture", "Numerical aperture NA", "", 1.0, part.numerical_aperture,
                  0.05, 1.49, "linear"),
        Parameter("objective.immersion_index", "Immersion index n", "", 1.0, part.immersion_index, 1.0, 1.6,
                  "linear"),
    ]  # fmt: skip
    if camera.fourier_lens is not None:
        found.append(_length("fourier_lens", "Fourier lens", camera.fourier_lens, "mm"))
    if camera.sensor_distance is not None:
        found.append(_length("sensor_distance", "Lenslets to sensor b", camera.sensor_distance, "mm"))
    relay = Parameter("relay_magnification", "Relay magnification", "×", 1.0, camera.relay_magnification,
                      0.1, 10.0)  # fmt: skip
    return (*found, *_lenslets(camera), relay, _pixel(camera))


def _lenslets(camera: Any) -> list[Parameter]:
    parts = camera.lenslets
    found = [_length("lenslets.pitch", "Lenslet pitch p", parts.pitch, "µm")]
    if len(parts.focal_length) == 1:
        found.append(_length("lenslets.focal_length", "Lenslet focal length", parts.focal_length[0], "mm"))
    for k, side in enumerate(("rows", "columns")):
        count = min(parts.count[k], MOST_LENSLETS)
        found.append(
            Parameter(f"lenslets.count.{k}", f"Lenslets, {side}", "", 1.0, count, 1, MOST_LENSLETS, "whole")
        )
    fill = Parameter("lenslets.fill_factor", "Fill factor", "", 1.0, parts.fill_factor, 0.3, 1.0, "linear")
    if camera.KIND == "plenoptic" or (camera.KIND == "focused-plenoptic" and len(parts.focal_length) == 1):
        found.append(_choice("lenslets.layout", "Layout", parts.layout, ("square", "hex")))
    return [*found, fill]


def _pixel(camera: Any) -> Parameter:
    return _length("sensor.pixel_pitch", "Pixel pitch", camera.pixels.pixel_pitch, "µm")


_UNITS = {"nm": 1e-9, "µm": 1e-6, "mm": 1e-3}


def _length(
    key: str, label: str, value: float, unit: str, ends: tuple[float, float] | None = None
) -> Parameter:
    shown = float(f"{value / _UNITS[unit]:.10g}")
    low, high = ends or (shown / _SPAN, shown * _SPAN)
    return Parameter(key, label, unit, _UNITS[unit], shown, min(low, shown), max(high, shown))


def _optional(parameter: Parameter, *, given: bool) -> Parameter:
    return replace(parameter, optional=True, value=parameter.value if given else None)


def _choice(key: str, label: str, value: str, choices: tuple[str, ...]) -> Parameter:
    return Parameter(key, label, "", 1.0, value, kind="choice", choices=choices)


def changed(camera: AnyCamera, values: Any) -> AnyCamera:
    """The camera with the values of a page: only what differs from its own, so that its text stays short.

    Parameters
    ----------
    camera
        As it was opened.
    values
        By the parameters' keys, in their units; what is missing stays.

    Raises
    ------
    FormatError
        An unknown key, or a value of another type.
    GeometryError
        Values that no camera can have.
    """
    if not isinstance(values, Mapping):
        raise FormatError("values must be numbers by their keys.")
    known = {each.key: each for each in parameters(camera)}
    changes: dict[str, Any] = {}
    count: list[int] = []
    for key, value in values.items():
        if key not in known:
            raise FormatError(f"{str(key)[:60]!r} is not a parameter of this camera.")
        each = known[key]
        value = _checked(each, value)
        if value == each.value:
            continue
        if key.startswith("lenslets.count."):
            count = count or list(camera.lenslets.count)  # type: ignore[union-attr]
            count[int(key[-1])] = value
            continue
        table, _, name = key.rpartition(".")
        inside = changes.setdefault(table, {}) if table else changes
        inside[name] = value if value is None or each.kind == "choice" else value * each.scale
    if count:
        changes.setdefault("lenslets", {})["count"] = tuple(count)
    return camera.replace(**changes) if changes else camera


def _checked(parameter: Parameter, value: Any) -> Any:
    name = parameter.key
    if value is None:
        if parameter.optional:
            return None
        raise FormatError(f"{name} is None but must be a finite number.")
    if parameter.kind == "choice":
        if value not in parameter.choices:
            raise FormatError(f"{name} is {str(value)[:60]!r} but must be {' or '.join(parameter.choices)}.")
        return value
    number = checks.finite(name, value, "1", FormatError)
    if parameter.kind != "whole":
        return number
    if number != int(number) or not 1 <= number <= MOST_LENSLETS:
        raise FormatError(f"{name} is {number:g} but must be a whole number from 1 to {MOST_LENSLETS}.")
    return int(number)
