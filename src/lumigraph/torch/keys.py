"""Keys of a camera file as parameters: parts of their ranges, and the cameras a little to either side."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, cast

import numpy as np

from lumigraph.errors import FormatError, GeometryError
from lumigraph.instruments.camera import Camera
from lumigraph.instruments.varied import NUMBER, changed, value
from lumigraph.operators.lenslets.paraxial_error import resolved
from lumigraph.operators.lenslets.point_images import PointImages
from lumigraph.operators.sampling.camera import CameraOptics
from lumigraph.studies.optimisation.space import Range, Space

APART = 1e-4
"""Part of a range to either side, where a camera differs by a little."""

AROUND = 0.05
"""Half of the range of a key that has none, over its value."""

MASKS = {"main_lens.mask.phase": "phase", "main_lens.mask.open": "open"}
"""Tables of control points that are parameters as a whole."""

Pair = tuple[CameraOptics, CameraOptics]


@dataclass(frozen=True, eq=False)
class Keys:
    """Keys of a camera file, each within its range.

    Parameters
    ----------
    camera
        The camera.
    ranges
        By key.
    masks
        Keys of `MASKS` that are parameters, too.
    """

    camera: Camera
    ranges: Mapping[str, Range]
    masks: Sequence[str] = ()
    _known: dict[bytes, tuple[Camera, list[Pair]]] = field(default_factory=dict)

    @classmethod
    def of(cls, camera: Camera, parameters: Sequence[str] | Mapping[str, str]) -> "Keys":
        """Keys with ranges such as "5 mm:5.4 mm"; of a key alone, 5 % to either side of its value.

        Raises
        ------
        FormatError
            An unknown key, no range, or a value that lies out of it; a key without a value to begin with.
        """
        words = parameters if isinstance(parameters, Mapping) else dict.fromkeys(parameters, "")
        ranges = {name: _range(camera, name, text) for name, text in words.items() if name not in MASKS}
        found = cls(camera, ranges, [name for name in words if name in MASKS])
        for name in found.masks:
            if value(camera, name) is None:
                raise FormatError(
                    f"{name} has no control points in the camera file. Give some to begin with: "
                    'camera.replace(main_lens={"mask": {"phase": np.zeros((8, 8)).tolist()}}).'
                )
        changed(camera, found.item(found.own))  # refuses unknown keys
        return found

    @property
    def own(self) -> np.ndarray:
        """(n,), parts of the ranges at which the camera's own values are.

        Raises
        ------
        FormatError
            One beyond its range.
        """
        parts = []
        for name, one in self.ranges.items():
            low, high = (one.in_units(end) for end in (one.low, one.high))
            part = (_number(self.camera, name) - low) / (high - low)
            if not -1e-9 <= part <= 1 + 1e-9:
                raise FormatError(
                    f"{name} is {value(self.camera, name)} but its range goes from {one.at(0)} to "
                    f"{one.at(1)}. Give a range that holds the camera's own value."
                )
            parts.append(min(max(part, 0.0), 1.0))
        return np.array(parts)

    def item(self, parts: np.ndarray) -> dict[str, Any]:
        """Values by key, as a camera file has them, to the last digit."""
        numbers = {
            name: one.low + (one.high - one.low) * part
            for part, (name, one) in zip(parts.tolist(), self.ranges.items(), strict=True)
        }
        return {
            name: f"{number!r} {self.ranges[name].unit}" if self.ranges[name].unit else number
            for name, number in numbers.items()
        }

    def points(self) -> dict[str, np.ndarray]:
        """Control points of the camera's own masks, by their names in `MASKS`."""
        return {MASKS[name]: np.array(value(self.camera, name), np.float64) for name in self.masks}

    def at(
        self, parts: np.ndarray, masks: Mapping[str, np.ndarray], *, pairs: bool
    ) -> tuple[Camera, list[Pair]]:
        """The camera at parts of the ranges, and pairs a little to either side, 1 apart by `widths`."""
        tables = {name: masks[MASKS[name]] for name in self.masks}
        key = b"".join(one.tobytes() for one in (parts, *tables.values())) + bytes([pairs])
        if key not in self._known:
            self._known.clear()
            more = {name: table.tolist() for name, table in tables.items()}
            camera = cast(Camera, changed(self.camera, more)) if more else self.camera
            camera = cast(Camera, changed(camera, self.item(parts))) if self.ranges else camera
            ends = [self._ends(camera, parts, k) for k in range(len(parts))] if pairs else []
            self._known[key] = camera, ends
        return self._known[key]

    def images(
        self, parts: np.ndarray, masks: Mapping[str, np.ndarray], accuracy: float, *, pairs: bool
    ) -> PointImages:
        """Images of points by the camera there, and by the pairs."""
        camera, ends = self.at(parts, masks, pairs=pairs)
        own = resolved(camera.optics(), accuracy)
        both = tuple((replace(a, model=own.model), replace(b, model=own.model)) for a, b in ends)
        if own.lean is not None:
            raise GeometryError(
                "the array or the sensor is tilted, which torch.Camera does not follow. Leave array_tilt, "
                "array_bow and sensor_tilt out of [built], or use camera.part_images."
            )
        return PointImages(own, both, accuracy)

    @staticmethod
    def widths(parts: np.ndarray) -> np.ndarray:
        """(n,), how far apart the cameras of the pairs are, in parts of the ranges."""
        return np.minimum(parts + APART, 1) - np.maximum(parts - APART, 0)

    def _ends(self, camera: Camera, parts: np.ndarray, number: int) -> Pair:
        ends = []
        for side in (-APART, APART):
            there = parts.copy()
            there[number] = min(max(there[number] + side, 0.0), 1.0)
            one = cast(Camera, changed(camera, self.item(there)))
            if one.sensor.shape != camera.sensor.shape:  # it follows from the lengths where it is left out
                one = one.replace(sensor={"shape": camera.sensor.shape})
            ends.append(one.optics())
        return ends[0], ends[1]


def _number(camera: Camera, name: str) -> float:
    """Value under a key, in SI; 0 of a key that the file leaves out, if it counts from there."""
    here = value(camera, name)
    if here is None:
        if not any(part in name for part in ("aberrations", "single", "built", "offset", "rotation")):
            raise FormatError(f"{name} has no value in the camera file. Give it one to begin with.")
        return 0.0
    return Range.si(here)


def _range(camera: Camera, name: str, text: str) -> Range:
    if text:
        return Space.of([f"{name}={text}:x1"]).ranges[name]
    number, unit = NUMBER.fullmatch(str(value(camera, name))), ""
    if number is None or not (here := float(number[1])):
        raise FormatError(
            f"{name} is {value(camera, name)} in the camera file, of which no range follows. Give one: "
            f'parameters={{"{name}": "LOW:HIGH"}}.'
        )
    unit = number[2].strip()
    low, high = sorted((here * (1 - AROUND), here * (1 + AROUND)))
    return Range(low, high, unit)
