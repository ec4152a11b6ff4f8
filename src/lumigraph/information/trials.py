"""`trials`: errors of the most likely places of points in drawn noise, to check the bounds."""

from dataclasses import dataclass

import numpy as np

from lumigraph.core import checks, memory
from lumigraph.errors import GeometryError, SamplingError
from lumigraph.information.bounds import Light, Seen, deviations, expected, reading
from lumigraph.information.noise import pixel_information
from lumigraph.information.points import Source, source
from lumigraph.instruments.instrument import Instrument
from lumigraph.sensor import Sensor

REACH = 5.0
"""Distance from the truth within which places are searched, in bounds."""

NODES = 5
"""Places along each axis at which images are known; between, polynomials of this many terms."""

STEPS, SMALL = 25, 1e-3
"""Steps of Fisher's scoring, at most, and the length, in bounds, at which they end."""

DARK = 1e-7
"""Pixels that get less light than this, of the brightest, are left out."""


@dataclass(frozen=True, slots=True, eq=False)
class Trials:
    """Errors of most likely places, beside their bounds.

    Parameters
    ----------
    bounds
        (n,): least deviations of y, x, dz [m] and brightness, and the background where there is some.
    errors
        (draws, n), found less true.
    """

    bounds: np.ndarray
    errors: np.ndarray

    @property
    def rms(self) -> np.ndarray:
        """(n,), of the errors."""
        return np.sqrt(np.mean(self.errors**2, axis=0))

    @property
    def rms_error(self) -> np.ndarray:
        """(n,), standard error of `rms` by the number of draws."""
        return self.rms / np.sqrt(2 * len(self.errors))


def trials(
    instrument: Instrument,
    place: tuple[float, float, float],
    light: Light | None = None,
    *,
    draws: int = 200,
    accuracy: float = 1e-2,
    rng: np.random.Generator,
) -> Trials:
    """Draw raw images of a point with noise, and find its place, depth and light by the likeliest in each.

    The noise is Poisson's and the reading's. What is found is where the scores vanish that weigh pixels by
    their information: the maximum of the likelihood without read noise, and as good with it. Images between
    places are polynomials through 5 × 5 × 5 images around the true place.

    Parameters
    ----------
    instrument
        A camera or microscope.
    place
        (y, x, dz) of the point [m].
    light
        As of `bounds`.
    draws
        Raw images.
    accuracy
        Of the points' images.
    rng
        Random numbers.

    Raises
    ------
    GeometryError
        If the raw image does not determine the place.
    """
    light = Light() if light is None else light
    at = np.array([checks.finite("place", v) for v in place])
    if checks.whole("draws", draws) > 1_000_000 or len(at) != 3:
        raise GeometryError(f"place is {place} and draws {draws}; give (y, x, dz) and at most 1000000 draws.")
    points, sensor = source(instrument, at[2:], accuracy), instrument.sensor
    first = points.lit(at, checked=True)[0]
    told = deviations(Seen.of(sensor, light, first).fisher)
    if not np.isfinite(told).all():
        raise GeometryError(
            f"a raw image does not determine the place of a point at {place}. Use more photons."
        )
    between = _Between.of(points, at, told[:3])
    mean = expected(sensor, light, between.at(np.zeros(3)))[0]
    errors = []
    for _ in range(draws):
        drawn = rng.poisson(mean) + rng.normal(0, reading(sensor), mean.shape)
        errors.append(_found(between, (sensor, light), drawn, told) * told)
    return Trials(told, np.array(errors))


@dataclass(frozen=True, slots=True, eq=False)
class _Between:
    """Images around a place, as polynomials.

    Parameters
    ----------
    images
        (k, k, k, pixels) that get light.
    nodes
        Where they are, in bounds from the place.
    """

    images: np.ndarray
    nodes: np.ndarray

    @classmethod
    def of(cls, points: Source, at: np.ndarray, steps: np.ndarray) -> "_Between":
        """Polynomials through a point's images at steps from a place."""
        nodes = np.cos(np.pi * (np.arange(NODES) + 0.5) / NODES) * REACH
        memory.require(
            8.0 * points.pixels * NODES**3, "images around the place", "Use fewer pixels.", SamplingError
        )
        images = [points.image(at + steps * nodes[list(k)]).ravel() for k in np.ndindex(NODES, NODES, NODES)]
        lit = np.max(images, axis=0) > DARK * np.max(images)
        return cls(np.stack([one[lit] for one in images]).reshape(NODES, NODES, NODES, -1), nodes)

    def at(self, place: np.ndarray) -> np.ndarray:
        """(4, pixels): the image and its derivatives by y, x and dz, in bounds."""
        lines = [_lagrange(self.nodes, float(v)) for v in place]
        found = []
        for axis in (None, 0, 1, 2):
            weights = [line[1 if k == axis else 0] for k, line in enumerate(lines)]
            found.append(np.einsum("i,j,k,ijkp->p", *weights, self.images, optimize=True))
        return np.stack(found)


def _lagrange(nodes: np.ndarray, at: float) -> tuple[np.ndarray, np.ndarray]:
    """Weights of nodes for a value and for a slope."""
    powers = np.vander(nodes / REACH, increasing=True)
    order = np.arange(len(nodes))
    value = (at / REACH) ** order
    slope = order * (at / REACH) ** np.maximum(order - 1, 0) / REACH
    return np.linalg.solve(powers.T, value), np.linalg.solve(powers.T, slope)


def _found(between: _Between, by: tuple[Sensor, Light], drawn: np.ndarray, told: np.ndarray) -> np.ndarray:
    """Most likely unknowns, less the true ones, in bounds."""
    off, noise = np.zeros(len(told)), reading(by[0])
    scales = np.concatenate([np.ones(3), told[3:]])
    for _ in range(STEPS):
        ratios = 1 + off[3:] * told[3:]
        mean, changes = expected(*by, between.at(off[:3]), ratios)
        changes *= scales[:, None]
        weights = pixel_information(mean, noise)
        step = np.linalg.solve((changes * weights) @ changes.T, changes @ (weights * (drawn - mean)))
        off = np.clip(off + step, -REACH, REACH)
        if np.abs(step).max() < SMALL:
            break
    return off
