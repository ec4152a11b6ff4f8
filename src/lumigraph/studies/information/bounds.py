r"""`bounds`: the least errors of a point's place, depth and light by any estimate from one raw image.

With mean electrons μ of each pixel and unknowns θ (y, x, dz, brightness, background) Fisher's information is

.. math:: F_{ij} = \sum_{pixels} \phi(\mu, \sigma)\, \partial_i \mu\, \partial_j \mu

with φ of Poisson electrons and Gaussian read noise; the variance of an unbiased estimate of θᵢ is at least
(F⁻¹)ᵢᵢ, the others unknown too. R. J. Ober, S. Ram & E. S. Ward, Biophys. J. 86, 1185 (2004).
"""

import math
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from os import PathLike
from typing import Any

import numpy as np

from lumigraph.core import checks, memory, upper_floors
from lumigraph.core.progress import Progress
from lumigraph.core.result import Quantity
from lumigraph.core.short_repr import brief
from lumigraph.errors import GeometryError, SamplingError, SamplingWarning
from lumigraph.instruments.instrument import Instrument
from lumigraph.sensor import Sensor
from lumigraph.studies.information.noise import pixel_information
from lumigraph.studies.information.points import PointSource, source, spread

MOST_PLACES, MOST_DEPTHS = 1000, 1000

PARTS = {"lateral": slice(0, 2), "depth": slice(2, 3), "brightness": slice(3, 4)}
"""Unknowns of a point, by name."""

DOUBTFUL = 0.05
"""Relative error of a derivative that is warned of."""


@dataclass(frozen=True, slots=True)
class Light:
    """Light of a point, and background around it.

    Parameters
    ----------
    photons
        Of the point that enter the main lens or the objective, in one exposure.
    background
        Photons of even light that reach each pixel; where there are some, their number is unknown too.

    Raises
    ------
    GeometryError
        No photons, or less than no background.
    """

    photons: float = 10_000.0
    background: float = 0.0

    def __post_init__(self) -> None:
        checks.positive("photons", self.photons, "1")
        if checks.finite("background", self.background, "photons") < 0:
            raise GeometryError(f"background is {self.background:g} photons but must be at least 0.")


@dataclass(frozen=True, slots=True, eq=False)
class Bounds:
    """Least standard deviations of unbiased estimates of a point's place and light, place by place.

    Parameters
    ----------
    depths
        (nz,), from the focused plane [m].
    places
        (nz, k, 2), (y, x) in the cell over which places repeat [m].
    deviations
        (nz, k, n): y, x, dz [m], brightness over its value, and the background over its value where there is
        one. Infinite where the raw image does not determine it.
    caught
        (nz,), part of the point's light that falls on the pixels, in the mean.
    light
        Photons.
    errors
        (3,), relative, rms: largest of the derivatives by y, x and dz, by a second step; 0 of exact ones, NaN
        where they were not checked.
    """

    depths: np.ndarray
    places: np.ndarray
    deviations: np.ndarray
    caught: np.ndarray
    light: Light
    errors: np.ndarray

    __repr__ = brief

    @property
    def over_depths(self) -> np.ndarray:
        """(nz, n): roots of the mean variances over the places of each depth."""
        return np.sqrt(np.mean(self.deviations**2, axis=1))

    def of(self, name: str) -> np.ndarray:
        """Rms deviation of "lateral", "depth" or "brightness" at each depth (nz,); the first two in m."""
        return np.sqrt(np.mean(self.deviations[..., PARTS[name]] ** 2, axis=(1, 2)))

    @property
    def lateral(self) -> float:
        """Rms deviation of y and x over the volume [m]."""
        return float(np.sqrt(np.mean(self.deviations[..., :2] ** 2)))

    @property
    def depth(self) -> float:
        """Rms deviation of dz over the volume [m]."""
        return float(np.sqrt(np.mean(self.deviations[..., 2] ** 2)))

    @property
    def brightness(self) -> float:
        """Rms deviation of the brightness over its value."""
        return float(np.sqrt(np.mean(self.deviations[..., 3] ** 2)))

    def uneven(self, name: str) -> float:
        """Relative sampling error of "lateral", "depth" or "brightness", as places are few.

        Half of what variances differ by from place to place, over the number of places: they fill the cell
        evenly, so that errors fall faster than those of places drawn by chance. NaN for one place, and for
        what cannot be determined.
        """
        variances = np.mean(self.deviations[..., PARTS[name]] ** 2, axis=(0, 2))
        count = len(variances)
        if count < 2 or not np.isfinite(variances).all():
            return math.nan
        return float(variances.std(ddof=1) / variances.mean()) / 2 / count

    def beside(self, other: "Bounds") -> "Bounds":
        """Bounds at these places and at others of the same depths, before the same light."""
        own, more = self.places.shape[1], other.places.shape[1]
        return Bounds(
            self.depths, np.concatenate([self.places, other.places], 1),
            np.concatenate([self.deviations, other.deviations], 1),
            (own * self.caught + more * other.caught) / (own + more), self.light,
            np.maximum(self.errors, other.errors),
        )  # fmt: skip

    def quantities(self) -> tuple[Quantity, ...]:
        """Values over the volume, with units and equations."""
        return (
            Quantity("lateral_bound", self.lateral, "m"), Quantity("depth_bound", self.depth, "m"),
            Quantity("brightness_bound", self.brightness, "1"),
            Quantity("light_caught", float(self.caught.mean()), "1"),
        )  # fmt: skip

    def rows(self) -> list[dict[str, Any]]:
        """Row for each depth, in metres; None for what cannot be determined."""
        found = []
        for dz, some, caught in zip(self.depths, self.over_depths, self.caught, strict=True):
            values = [float(v) if math.isfinite(v) else None for v in some]
            row: dict[str, Any] = {"depth [m]": float(dz), "light caught": float(caught)}
            names = ("y [m]", "x [m]", "dz [m]", "brightness", "background")
            found.append(row | dict(zip(names, values, strict=False)))
        return found


def bounds(
    instrument: Instrument | str | PathLike[str],
    depths: Sequence[float],
    light: Light | None = None,
    *,
    places: int | range = 4,
    accuracy: float = 1e-2,
    checked: bool = True,
    progress: Progress | None = None,
) -> Bounds:
    """Least errors of a point's place, depth and light from one raw image, over depths and a cell.

    Its place, depth and brightness are unknown, and the background where there is some. Noise is that of
    photons, dark current, reading and rounding; fixed patterns are taken as known. The points stand around
    the axis, alone.

    Parameters
    ----------
    instrument
        A camera or microscope of any kind, its file, or a name of the catalogue.
    depths
        From the focused plane [m], positive farther.
    light
        10,000 photons without background if left out.
    places
        At each depth; they fill the cell over which images repeat: a lenslet's, or a pixel's where
        there is none or it stands in the pupil. A range takes others of the same sequence: `range(4, 8)`
        are four that 4 leaves out.
    accuracy
        Of the points' images, relative, rms.
    checked
        Whether derivatives that are central differences are compared with those of twice the step, and
        improved by them. Takes nearly twice the time; exact derivatives need none.
    progress
        Called as ``progress(fraction)``.

    Raises
    ------
    GeometryError
        No depths, one that is not imaged, no places, light below zero.
    SamplingError
        Images that do not fit in memory.

    Warns
    -----
    SamplingWarning
        Pixels would be full; derivatives that two steps do not agree on.

    Examples
    --------
    >>> import lumigraph as lg
    >>> scope = lg.load_camera("lfm-fourier")
    >>> found = lg.information.bounds(scope, [-10e-6, 10e-6], lg.information.Light(5000))
    >>> 3e-8 < found.depth < 3e-7
    True
    """
    light = Light() if light is None else light
    instrument = upper_floors.camera(instrument)
    checks.instance("light", light, Light)
    checks.instance("instrument", instrument, Instrument)
    planes = checked_depths(depths)
    numbers = checked_places(places)
    points = source(instrument, planes, accuracy)
    memory.require(8.0 * 12 * points.pixels, "images of a point", "Use fewer pixels.", SamplingError)
    where = np.stack([spread(points.cell(float(dz)), numbers) for dz in planes])
    each = _each(where, planes, progress)
    spots = [_KnownPoint.of(points, instrument.sensor, light, place, checked) for place in each]
    _warn(spots, instrument.sensor)
    shape = (len(planes), len(numbers), -1)
    return Bounds(
        planes, where, np.stack([one.deviations for one in spots]).reshape(shape),
        np.array([one.caught for one in spots]).reshape(shape[:2]).mean(1), light,
        np.max([one.errors for one in spots], axis=0),
    )  # fmt: skip


def checked_places(places: int | range) -> range:
    """Numbers of places in their sequence.

    Raises
    ------
    GeometryError
        None, too many, or a range that does not go up from 0 or more.
    """
    numbers = places if isinstance(places, range) else range(checks.whole("places", places))
    if not (numbers and 0 <= numbers[0] <= numbers[-1]):
        raise GeometryError(f"places are {places} but a range of them must go up from 0 or more.")
    if len(numbers) > MOST_PLACES:
        raise GeometryError(f"places are {len(numbers)} but must be at most {MOST_PLACES}.")
    return numbers


def checked_depths(depths: Sequence[float]) -> np.ndarray:
    """Depths as an array (nz,) [m].

    Raises
    ------
    GeometryError
        None, too many, or one that is no number.
    """
    planes = np.array([checks.finite("a depth", float(dz)) for dz in depths], np.float64)
    if not 1 <= len(planes) <= MOST_DEPTHS:
        raise GeometryError(f"there are {len(planes)} depths but must be 1 to {MOST_DEPTHS}.")
    return planes


def _each(where: np.ndarray, planes: np.ndarray, progress: Progress | None) -> Iterator[np.ndarray]:
    """Places (y, x, dz), depth by depth."""
    total = where.shape[0] * where.shape[1]
    for number, (k, j) in enumerate(np.ndindex(where.shape[:2])):
        yield np.array([*where[k, j], planes[k]])
        if progress is not None:
            progress((number + 1) / total)


def expected(
    sensor: Sensor, light: Light, lit: np.ndarray, ratios: Sequence[float] | np.ndarray = (1.0, 1.0)
) -> tuple[np.ndarray, np.ndarray]:
    """Mean electrons of pixels, and their derivatives (n, ...) by the unknowns.

    Parameters
    ----------
    sensor, light
        What turns parts of a point's light into electrons.
    lit
        (4, ...): those parts, and their derivatives by y, x and dz.
    ratios
        Brightness and background over those of `light`.
    """
    image, eta = np.maximum(lit[0], 0), sensor.quantum_efficiency
    point = eta * light.photons * ratios[0]
    mean = point * image + sensor.dark_signal
    changes = [*(point * one for one in lit[1:]), eta * light.photons * image]
    if light.background:
        mean += eta * light.background * ratios[1]
        changes.append(np.full_like(mean, eta * light.background))
    return mean, np.stack(changes)


def reading(sensor: Sensor) -> float:
    """Standard deviation of reading and rounding [electrons]."""
    return math.sqrt(sensor.read_noise**2 + sensor.gain**2 / 12)


@dataclass(frozen=True, slots=True, eq=False)
class _KnownPoint:
    """Deviations of a point at one place."""

    deviations: np.ndarray
    caught: float
    errors: np.ndarray
    brightest: float

    @classmethod
    def of(
        cls, points: PointSource, sensor: Sensor, light: Light, place: np.ndarray, checked: bool
    ) -> "_KnownPoint":
        lit, errors = points.lit(place, checked=checked)
        seen = PointInformation.of(sensor, light, lit)
        return cls(deviations(seen.fisher), float(lit[0].sum()), errors, float(seen.mean.max()))


@dataclass(frozen=True, slots=True, eq=False)
class PointInformation:
    """Information of pixels about a point.

    Parameters
    ----------
    lit
        (ny, nx), those that its light reaches.
    mean, changes
        (k,), (n, k): electrons of these, as `expected`.
    fisher
        (n, n), information of all pixels.
    """

    lit: np.ndarray
    mean: np.ndarray
    changes: np.ndarray
    fisher: np.ndarray

    @classmethod
    def of(cls, sensor: Sensor, light: Light, lit: np.ndarray) -> "PointInformation":
        """Information of parts of a point's light and their derivatives (4, ny, nx)."""
        some, noise = np.any(lit, axis=0), reading(sensor)
        mean, changes = expected(sensor, light, lit[:, some])
        found = fisher(mean, changes, noise)
        if light.background:  # it is all that the other pixels tell
            even = expected(sensor, light, np.zeros((4, 1)))
            found += fisher(*even, noise) * (some.size - np.count_nonzero(some))
        return cls(some, mean, changes, found)


def fisher(mean: np.ndarray, changes: np.ndarray, read_noise: float) -> np.ndarray:
    """Information (n, n) of pixels, by their mean electrons and its derivatives (n, ...)."""
    flat = changes.reshape(len(changes), -1)
    return (flat * pixel_information(mean.ravel(), read_noise)) @ flat.T


def deviations(information: np.ndarray) -> np.ndarray:
    """Square roots of the inverse's diagonal; infinite where the information is singular."""
    found, scale = np.full(len(information), np.inf), np.sqrt(np.diag(information))
    some = np.flatnonzero(scale > 0)
    if not len(some) or not np.isfinite(scale).all():
        return found
    plain = information[np.ix_(some, some)] / np.outer(scale[some], scale[some])
    values, vectors = np.linalg.eigh(plain)
    told = values > len(values) * np.finfo(np.float32).eps  # images are of single precision
    parts = np.square(vectors)
    variances = parts[:, told] @ (1 / values[told])
    lost = parts[:, ~told].sum(1) > np.finfo(np.float32).eps
    found[some] = np.where(lost, np.inf, np.sqrt(variances) / scale[some])
    return found


def _warn(spots: list[_KnownPoint], sensor: Sensor) -> None:
    brightest = max(one.brightest for one in spots)
    if brightest > sensor.full_well:
        warnings.warn(
            f"the brightest pixel gets {brightest:.4g} electrons but is full with {sensor.full_well:g}: real "
            "errors are larger. Use fewer photons.",
            SamplingWarning,
            stacklevel=3,
        )
    worst = max(float(np.max(one.errors)) for one in spots)
    if worst > DOUBTFUL:
        warnings.warn(
            f"derivatives by two steps differ by {worst:.1%}: the bounds may be off by as much. Use a finer "
            "accuracy.",
            SamplingWarning,
            stacklevel=3,
        )
