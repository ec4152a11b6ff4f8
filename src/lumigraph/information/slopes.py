"""`slopes`: derivatives of a bound by an instrument's parts, for gradient searches.

One run backwards through the images gives what a bound changes by as the waves on the lenslets, and what
these do to light, change; how these change with a key of the camera file is cheap.
"""

import math
from collections.abc import Sequence
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
from lumigraph.information.followed import Pair, followed
from lumigraph.information.noise import pixel_information
from lumigraph.instruments.instrument import Instrument
from lumigraph.sensor import Sensor

APART, TINY = 1e-5, 1e-300
"""Relative step of electrons, whose differences are central; and what is above 0."""

Bound = Literal["depth", "lateral", "brightness"]


class Sloping(NamedTuple):
    """A bound and how it changes.

    Parameters
    ----------
    bound
        As `Bounds` has it [m, or 1 of the brightness].
    changes
        (n,), from the first to the last of each pair of instruments.
    """

    bound: float
    changes: np.ndarray


def slopes(
    scope: Instrument,
    pairs: Sequence[Pair],
    depths: Sequence[float],
    light: Light | None = None,
    *,
    name: Bound = "depth",
    places: int | range = 4,
    accuracy: float = 1e-2,
) -> Sloping:
    """A bound of `bounds`, and how it changes with an instrument's parts.

    Images and information are differentiated exactly, backwards to the waves on the lenslets, and to what
    these do to light; that is compared between instruments that differ by a little. Places are parts of a
    cell, whose size in the object may change; the point shines alike for all.

    Parameters
    ----------
    scope
        A camera that has `part_images`, or a microscope: a Fourier one, or one that has `pupil_images`.
    pairs
        (n,), instruments a little to either side of it: by a focal length, a lenslet's place, a term of the
        pupil's phase.
    depths, light, places
        As of `bounds`.
    name
        Of the bound.
    accuracy
        Of images of points, relative, rms; not of Fourier microscopes.

    Raises
    ------
    GeometryError
        Another instrument, another number of lenslets or of those before the pixels, a sensor that differs by
        more than its pixels' optics, or a bound that raw images do not determine.

    Examples
    --------
    >>> import lumigraph as lg
    >>> scope = lg.load_camera("lfm-fourier")
    >>> pair = scope.replace(fourier_lens="74.99 mm"), scope.replace(fourier_lens="75.01 mm")
    >>> bound, changes = slopes(scope, [pair], [-10e-6, 10e-6], places=1)
    >>> float(changes[0]) < 0  # a longer lens would be better
    True
    """
    light = Light() if light is None else light
    planes, numbers = checked_depths(depths), checked_places(places)
    variance, total = 0.0, np.zeros(len(pairs))
    for some in followed(scope, pairs, planes, numbers, accuracy):
        for number, dz in enumerate(some.depths):
            seen, back = some.lit(number)
            found, by = _variance(seen, scope.sensor, light, PARTS[name])
            if not math.isfinite(found):
                raise GeometryError(f"raw images do not determine {name} at {dz:g} m. Leave that depth out.")
            back(by)
            variance += found
        total += some.along()
    count = len(planes) * len(numbers)
    bound = math.sqrt(variance / count)
    return Sloping(bound, total / (2 * bound * count))


def _variance(seen: np.ndarray, sensor: Sensor, light: Light, part: slice) -> tuple[float, np.ndarray]:
    """Mean variance of the bound, and its slopes (4, ny, nx) by a point's parts of the light."""
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
