"""Cameras with manufacturing errors, given or random."""

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any
from zlib import crc32

import numpy as np

from lumigraph.core import checks
from lumigraph.errors import FormatError, GeometryError
from lumigraph.instruments import Instrument, LensletCamera, Tolerance
from lumigraph.instruments.tolerances import EACH, MISSING, TILT, check_name

if TYPE_CHECKING:
    from lumigraph.instruments.loading import AnyCamera

SEED = "built.seed"
"""Error that says which lenslet is how."""

LEANS = ("array_tilt_y", "array_tilt_x", "sensor_tilt_y", "sensor_tilt_x")
"""Tilts, one along each axis."""

_SCATTERS = {
    "focal_length": "focal_length_scatter", "decentre": "decentre_scatter", "missing": "missing",
    "tilt": "tilt_scatter", "form": "form_scatter",
}  # fmt: skip
"""Keys of ``[built]`` by the error that differs from lenslet to lenslet."""


def check_camera(camera: "AnyCamera | LensletCamera | Instrument") -> LensletCamera:
    """The camera, if its manufacturing errors are known.

    Raises
    ------
    GeometryError
        Another kind of instrument.
    """
    if not isinstance(camera, LensletCamera):
        told = f"a {camera.noun} has no tolerances here yet. Give a plenoptic camera 1.0 or 2.0."
        raise GeometryError(told)
    return camera


def _path(name: str) -> tuple[str | int, ...]:
    """Path of a value in the table of a camera as built."""
    check_name(name)
    if name in ("separation", "lenslet_distance", "array_bow"):
        return "built", name
    if name in LEANS:
        return "built", name[:-2], "yx".index(name[-1])
    if name.startswith("lenslets.offset_"):
        return "lenslets", "offset", "yx".index(name[-1])
    return tuple(int(part) if part.isdecimal() else part for part in name.split("."))


def _meant(camera: LensletCamera) -> dict[str, Any]:
    """The camera's table with all distances, so that one may change alone."""
    table = camera.model_dump(by_alias=True)
    table["built"] |= {"separation": camera.separation, "lenslet_distance": camera.lenslet_distance}
    table["main_lens"]["diameter"] = camera.pupil_diameter
    table["sensor"]["shape"] = camera.sensor.shape
    for name in ("array_tilt", "sensor_tilt"):
        table["built"][name] = list(table["built"][name])
    table["lenslets"]["offset"] = list(camera.lenslets.offset)
    return table


def _holder(table: Any, path: Sequence[str | int]) -> Any:
    """Table that holds the last part of a path; an aberration that is not there is 0."""
    for part in path[:-1]:
        table = table[part]
    if path[-1] not in table and isinstance(table, dict):
        table[path[-1]] = 0.0
    return table


def value_of(camera: LensletCamera, name: str) -> float:
    """A value that may be off, in SI; of several lenslet focal lengths the first; no lenslet is decentred.

    Raises
    ------
    FormatError
        A name without tolerance.
    """
    if name.startswith(EACH):
        check_name(name)
        return camera.lenslets.focal_length[0] if name.endswith("focal_length") else 0.0
    path = _path(name)
    value = _holder(_meant(camera), path)[path[-1]]
    return value[0] if isinstance(value, tuple) else value


def built(camera: LensletCamera, errors: Mapping[str, float]) -> LensletCamera:
    """Camera with manufacturing errors: whatever has none stays where the description puts it.

    A lenslet that is too strong moves no sensor, as it would if the camera were described with it: distances,
    stop and sensor are those of the camera that was meant. A plane that is not in focus is seen blurred.

    Parameters
    ----------
    camera
        The camera as described.
    errors
        What is added to its values, in SI, by the names of `Tolerance`; of several lenslet focal lengths to
        each. Names below "lenslets.each" have a standard deviation, or the part that is missing, of lenslets
        that differ by the error "built.seed".

    Raises
    ------
    FormatError
        An unknown name.
    GeometryError
        Another kind of instrument, or values that no camera can have.

    Examples
    --------
    >>> import lumigraph as lg
    >>> camera = lg.FocusedPlenopticCamera.from_catalogue("thesis-plenoptic-2-m050")
    >>> off = built(camera, {"lenslets.focal_length": 0.05e-3})
    >>> float(round(off.lenslets.focal_length[0], 6)), off.lenslet_distance == camera.lenslet_distance
    (0.00525, True)
    """
    table = _meant(check_camera(camera))
    for name, error in errors.items():
        added = checks.finite(name, error)
        if name.startswith(EACH):
            part = added / value_of(camera, name) if name.endswith("focal_length") else added
            table["built"][_SCATTERS[name.removeprefix(EACH)]] += part
            continue
        if name == SEED:
            table["built"]["seed"] = int(added)
            continue
        path = _path(name)
        holder = _holder(table, path)
        old = holder[path[-1]]
        holder[path[-1]] = tuple(f + added for f in old) if isinstance(old, tuple) else old + added
    return type(camera)(**table)


def tolerances_of(
    camera: LensletCamera, given: Mapping[str, str | Tolerance] | None = None
) -> tuple[Tolerance, ...]:
    """Tolerances of the camera file, and those given beside or instead of them.

    Raises
    ------
    FormatError
        There are none, or one that cannot be read.
    GeometryError
        A part of a value that is zero.
    """
    texts = {**camera.tolerances, **(given or {})}
    found = tuple(
        text if isinstance(text, Tolerance) else Tolerance.parse(name, text) for name, text in texts.items()
    )
    if not found:
        raise FormatError(
            "there are no tolerances. Add a table [tolerances] to the camera file, or give some, "
            "such as separation = '±0.05 mm'."
        )
    if any(one.name == TILT for one in found):
        built(camera, {TILT: 1e-6})  # their index must be known
    for one in found:
        one.deviation_of(value_of(camera, one.name))
    if camera.errors is not None and (each := [one.name for one in found if one.is_of_each]):
        raise FormatError(
            f"{each[0]} would be drawn but the lenslets of [built] differ already. Leave out the tolerance, "
            "or focal_length_scatter, decentre_scatter, tilt_scatter, form_scatter and missing."
        )
    return found


def drawn(
    tolerances: Sequence[Tolerance], deviations: Sequence[float], number: int, *, seed: int = 0
) -> dict[str, float]:
    """Errors [SI] by name of one camera of many, by chance.

    Each tolerance has separate random numbers: one more or less leaves those of the others. Where
    lenslets have errors of their own, these are standard deviations, and "built.seed" draws them.

    Parameters
    ----------
    tolerances
        How far values may be off.
    deviations
        Standard deviation of each, in SI.
    number
        Of the camera that is drawn.
    seed
        Of all draws.
    """
    errors = {}

    def numbers(name: str) -> np.random.Generator:
        return np.random.default_rng([checks.whole("seed", seed, 0), number, crc32(name.encode())])

    for one, size in zip(tolerances, deviations, strict=True):
        if one.is_of_each:
            errors[SEED] = float(numbers(EACH).integers(2**32))
            errors[one.name] = one.half if one.name == MISSING else size
            continue
        rng = numbers(one.name)
        unit = math.sqrt(3) * rng.uniform(-1, 1) if one.shape == "uniform" else rng.normal()
        errors[one.name] = float(size * unit)
    return errors


def cameras(
    camera: LensletCamera,
    tolerances: Mapping[str, str | Tolerance] | None = None,
    count: int = 1,
    *,
    seed: int = 0,
) -> tuple[LensletCamera, ...]:
    """Cameras as built with errors by chance, the same ones for the same seed.

    Parameters
    ----------
    camera
        The camera as described.
    tolerances
        Beside those of the camera file, or instead of them.
    count
        Of the cameras.
    seed
        Of all draws.

    Raises
    ------
    FormatError
        No tolerances, or one that cannot be read.
    GeometryError
        Another kind of instrument, or one of the draws is no camera.
    """
    found = tolerances_of(check_camera(camera), tolerances)
    sizes = [one.deviation_of(value_of(camera, one.name)) for one in found]
    return tuple(
        built(camera, drawn(found, sizes, number, seed=seed))
        for number in range(checks.whole("count", count))
    )
