"""`slopes`: how a bound changes with the instrument, for searches that go downhill.

One run backwards through the images gives what a bound changes by as the waves on the lenslets do; what these
change by as a key of the camera file does is cheap.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Literal, NamedTuple

import numpy as np

from lumigraph.errors import GeometryError
from lumigraph.information.bounds import (
    PARTS,
    Light,
    Seen,
    checked_depths,
    checked_places,
    deviations,
    reading,
)
from lumigraph.information.noise import pixel_information
from lumigraph.information.points import collected, source, spread
from lumigraph.instruments import LightFieldMicroscope
from lumigraph.instruments.capabilities import WithObjective
from lumigraph.instruments.instrument import Instrument
from lumigraph.operators.fourier_changes import Behind, Pupil, Slopes, pupils
from lumigraph.operators.fourier_microscope import Window, lit_ones, overlap
from lumigraph.sensor import Sensor

APART, TINY = 1e-5, 1e-300
"""Relative step of electrons, whose differences are central; and what is above 0."""

Bound = Literal["depth", "lateral", "brightness"]

Pair = tuple[LightFieldMicroscope, LightFieldMicroscope]
"""Microscopes a little to either side."""


class Sloping(NamedTuple):
    """A bound and how it changes.

    Parameters
    ----------
    bound
        As `Bounds` has it [m, or 1 of the brightness].
    changes
        (n,), from the first to the last of each pair of microscopes.
    """

    bound: float
    changes: np.ndarray


def require_slopes(instrument: Instrument) -> None:
    """Refuse an instrument whose bounds have no derivatives by its parts.

    Raises
    ------
    GeometryError
        Another one than a Fourier microscope.
    """
    if not (isinstance(instrument, WithObjective) and instrument.in_pupil):
        raise GeometryError(
            "derivatives of bounds by an instrument's parts are of Fourier microscopes. For others, use "
            "search 'local'."
        )


def slopes(
    scope: LightFieldMicroscope,
    pairs: Sequence[Pair],
    depths: Sequence[float],
    light: Light | None = None,
    *,
    name: Bound = "depth",
    places: int | range = 4,
) -> Sloping:
    """A bound of `bounds`, and how it changes with the parts of a Fourier microscope.

    Images and information are differentiated exactly, backwards to the waves on the lenslets; these are
    compared between microscopes that differ by a little. Places are parts of a pixel, whose size in the
    object may change; the point shines alike for all.

    Parameters
    ----------
    scope
        A Fourier microscope.
    pairs
        (n,), microscopes a little to either side of it: by a focal length, a lenslet's place, a term of the
        pupil's phase.
    depths, light, places
        As of `bounds`.
    name
        Of the bound.

    Raises
    ------
    GeometryError
        Another instrument, another number of lenslets, a sensor that differs by more than its pixels' pitch,
        or a bound that raw images do not tell.

    Examples
    --------
    >>> import lumigraph as lg
    >>> scope = lg.load_camera("lfm-fourier")
    >>> pair = scope.replace(fourier_lens="74.99 mm"), scope.replace(fourier_lens="75.01 mm")
    >>> bound, changes = slopes(scope, [pair], [-10e-6, 10e-6], places=1)
    >>> float(changes[0]) < 0  # a longer lens would be better
    True
    """
    require_slopes(scope)
    for one in (end for pair in pairs for end in pair):
        _require_alike(scope, one)
    light = Light() if light is None else light
    planes, numbers = checked_depths(depths), checked_places(places)
    points, cell = scope.fourier_points(), source(scope, planes, 1e-2).cell
    lit = lit_ones(points.objectives[0], points.mosaic)
    variance, total = 0.0, np.zeros(len(pairs))
    for far in np.unique(np.abs(planes)):  # windows are as wide as in `bounds`
        group = planes[np.abs(planes) == far]
        own = pupils(points, group, lit)
        by, what = [Slopes.none(one) for one in own], (scope.sensor, light, PARTS[name])
        for k, dz in enumerate(group):
            for place in spread(cell(float(dz)), numbers):
                found, by = _by_pupils([Behind.of(one, k, place) for one in own], what, by)
                if not math.isfinite(found):
                    raise GeometryError(f"raw images do not tell {name} at {dz:g} m. Leave that depth out.")
                variance += found
        total += [_between(pair, scope, group, (lit, own, by)) for pair in pairs]
    count = len(planes) * len(numbers)
    bound = math.sqrt(variance / count)
    return Sloping(bound, total / (2 * bound * count))


def _require_alike(scope: LightFieldMicroscope, other: LightFieldMicroscope) -> None:
    require_slopes(other)
    same = replace(other.sensor, pixel_pitch=scope.sensor.pixel_pitch, shape=scope.sensor.shape)
    if same != scope.sensor or other.lenslets.count != scope.lenslets.count:
        raise GeometryError(
            "derivatives of bounds are by optics and by the pixels' pitch; two microscopes have other "
            "numbers of lenslets, or other sensors. Use search 'local' for these."
        )


def _between(
    pair: Pair,
    scope: LightFieldMicroscope,
    depths: np.ndarray,
    known: tuple[np.ndarray, list[Pupil], list[Slopes]],
) -> float:
    """Change of the sum of variances from one microscope to another."""
    lit, own, by = known
    ends = [pupils(one.fourier_points(), depths, lit, collected(one) / collected(scope), own) for one in pair]
    return sum(one.along(low, high) for one, low, high in zip(by, *ends, strict=True))


def _by_pupils(
    behind: list[Behind], what: tuple[Sensor, Light, slice], slopes: list[Slopes]
) -> tuple[float, list[Slopes]]:
    """Variance of a point, and its slopes by each pupil, beside those of other points."""
    sensor, light, part = what
    windows = [_window(one, sensor.shape) for one in behind]
    seen = np.zeros((4, *sensor.shape))
    for one, (raw, inside) in zip(behind, windows, strict=True):
        seen[(slice(None), *raw)] += one.lit()[(slice(None), *inside)]
    variance, by = _variance(seen, sensor, light, part)
    found = []
    for one, (raw, inside), before in zip(behind, windows, slopes, strict=True):
        size = 2 * one.pupil.half + 1
        given = np.zeros((4, size, size))
        given[(slice(None), *inside)] = by[(slice(None), *raw)]
        found.append(one.back(given, before))
    return variance, found


def _window(one: Behind, shape: tuple[int, int]) -> tuple[Window, Window]:
    corner = one.nearest - one.pupil.half + np.array(shape) // 2
    size = 2 * one.pupil.half + 1
    return overlap(corner.tolist(), (size, size), shape)


def _variance(seen: np.ndarray, sensor: Sensor, light: Light, part: slice) -> tuple[float, np.ndarray]:
    """Mean variance of what is asked, and its slopes (4, ny, nx) by a point's parts of the light."""
    known, noise = Seen.of(sensor, light, seen), reading(sensor)
    if not np.isfinite(deviations(known.fisher)[part]).all():
        return math.inf, np.zeros_like(seen)
    mean, changes, inverse = known.mean, known.changes, np.linalg.inv(known.fisher)
    some = inverse[:, part]
    weighed = some @ (some.T @ changes) / some.shape[1]
    sides = (pixel_information(mean * (1 + step), noise) for step in (-APART, APART))
    low, high = sides
    bend = (high - low) / (2 * APART * np.maximum(mean, TINY))
    by_mean = -bend * (weighed * changes).sum(0)
    by_changes = -2 * pixel_information(mean, noise) * weighed
    by = np.zeros_like(seen)
    by[:, known.lit] = np.stack([by_mean + by_changes[3], *by_changes[:3]])
    point = sensor.quantum_efficiency * light.photons
    return float(np.trace(inverse[part, part])) / some.shape[1], by * point
